"""How often the error bars of `physics.discretisation_error` hold: contacts on nested grids.

    python scripts/calibration.py --seed 47 --cache results/calibration_47.json

Each case is one continuous contact at one pressure, solved on grids N0, 2 N0, 4 N0, ... The finest
of them give the value of the continuum, one to three of the coarse ones an estimate of it; the
table counts how often the estimate's bar holds. The constants of the estimates were fitted to the
cases of the half "fit" only. docs/calibration.md names the sets of its tables by their options.
"""

import argparse
import json
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from gfmd_cli.physics import discretisation_error
from gfmd_cli.physics.contact import Scene
from gfmd_cli.physics.discretisation_error import (
    MAX_AREA_EXPONENT,
    ExcessExponent,
    RoughnessScales,
    estimate,
    excess_exponent,
    local_exponent,
)
from gfmd_cli.physics.elastomers import Elastomer, Layer, Power, Slab
from gfmd_cli.physics.error_estimates import GridValues
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.free_contact import SCENES
from gfmd_cli.physics.indenters import Parabola, Wave
from gfmd_cli.physics.observables import MAIN_OBSERVABLES, observe
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.physics.surfaces import Surface
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import solve_contact
from gfmd_cli.study.refinement import border_share, scales_of

EXPONENTS = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0)
THICKNESSES = (0.01, 0.03, 0.1)
PRESSURES = np.geomspace(0.003, 3.0, 9)
WIDE = (0.0, 0.5, 1.0, 1.0, 1.5, 2.0, 2.5, 3.0)
MAP_EXPONENTS = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
IRREGULAR = ("clipped", "worn", "steps", "stripes", "stretched", "turned")
"""Kinds of maps; in docs/calibration.md worn ones are "polished", stripes "two levels", turned ones
"stretched at an angle"."""
FREE_EXPONENTS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75)
"""Exponents of an elastomer with a free boundary."""
FREE = ("part", "clipped", "steps", "stretched", "turned")
"""Kinds of maps with a free boundary; parts are those of random roughness."""
BETWEEN = (0.25, 1.25, 1.75, 2.25, 2.75, 3.25, 3.75)
FINER = 4  # the grid that truth comes from is at least so much finer than those of an estimate
KEYS = ("points", "a_r", "sigma_p", "u_g", "perimeter")
FULL = 1e-9  # mean gap [h_std]: below, the contact is full on all grids and there is no error


@dataclass(frozen=True)
class Case:
    """One contact, on `base` points and `doublings` finer grids."""

    number: int
    name: str
    surface: Surface
    elastomer: Elastomer
    p_star: float
    base: int
    doublings: int
    fit: bool
    """Whether the constants of the estimates were fitted to it, among others."""
    boundary: str = "periodic"
    """The boundary of the map."""
    aspect: int = 1
    """Spacing along y over that along x; `base` counts the points along y."""

    @property
    def is_single(self) -> bool:
        """Whether the indenter is a single one."""
        return isinstance(self.surface, Parabola | Wave)


def map_cases(folder: Path, seed: int, scans: Path | None) -> list[Case]:
    """Maps that are no isotropic random surfaces: clipped, stepped, anisotropic, measured.

    `scans` is a folder of levelled square maps of 64 points in .npy files.
    """
    draw, out = np.random.default_rng(seed + 2), []

    def add(kind: str, heights: np.ndarray, n: float, fit: bool, **keys: object) -> None:
        path = folder / f"{kind}-{seed}-{len(out)}.npy"
        np.save(path, heights)
        p, surface = float(draw.choice(PRESSURES[1:7])), FileSurface(path=path, **keys)
        points = surface.smallest_grid()
        doublings = {32: 4, 64: 3}.get(points, 2)
        name = f"n={n:g} {kind} {surface.applied_interpolation()}"
        out.append(Case(len(out), name, surface, Power(n=n), p, points, doublings, fit))

    for fit in (True, False):
        for kind in IRREGULAR:
            for n in MAP_EXPONENTS:
                for points in (32, 64):
                    add(kind, irregular_map(kind, draw, points), n, fit)
    for i, path in enumerate(sorted(scans.glob("*.npy")) if scans else []):
        for n in draw.choice(MAP_EXPONENTS, 3, replace=False):
            edges = str(draw.choice(["window", "mirror", "none"]))
            add("scan", np.load(path), float(n), i % 2 == 0, edges=edges)
    return out


def free_cases(folder: Path, seed: int) -> list[Case]:
    """Parts of random maps and profiles, and paraboloids, with a free boundary."""
    draw, out = np.random.default_rng(seed + 3), []

    def add(kind: str, elastomer: Elastomer, surface: Surface | np.ndarray, doublings: int) -> None:
        path = folder / f"{kind}-{seed}-{len(out)}.npy"
        base = 32
        if isinstance(surface, np.ndarray):
            np.save(path, surface)
            base = surface.shape[-1]
            surface = FileSurface(path=path, periodic=False).within("free")
        p, name = float(draw.choice(PRESSURES[1:8])), f"{_name(elastomer)} {kind}"
        case = Case(len(out), name, surface, elastomer, p, base, doublings, False, "free")
        out.append(case)

    for _ in range(2):
        for elastomer in [
            *(Power(n=n) for n in FREE_EXPONENTS),
            Layer(thickness=0.1, base="sliding"),
        ]:
            for kind in FREE:
                is_fast = (elastomer.exponent or 0.0) <= 1  # else 1024^2 is slow
                sizes = [32, 64, 128] if is_fast else [32, 64]
                points = int(draw.choice(sizes))
                whole = irregular_map(kind.replace("part", "random"), draw, 2 * points)
                add(kind, elastomer, whole[: points - 5, :points], 4 if points == 32 else 3)
            if isinstance(elastomer, Power):
                add("parabola", elastomer, Parabola(), 4)
            if elastomer.decays(1):
                add("line", elastomer, irregular_map("random", draw, 128)[0, :64], 5)
    return out


def shape_cases(folder: Path, seed: int) -> list[Case]:
    """Random surfaces on oblong pixels, and random maps with holes, filled in or void."""
    draw, out = np.random.default_rng(seed + 4), []
    for n in MAP_EXPONENTS:
        for aspect in (2, 4):
            for base in (32, 32, 48):
                surface = SelfAffine(
                    hurst=float(draw.choice([0.3, 0.8])),
                    rolloff=float(draw.choice([0.25, 0.5])),
                    cutoff=1 / int(draw.choice([10, 12, 16])),
                    seed=int(draw.integers(1, 10**6)),
                )
                p, name = float(draw.choice(PRESSURES[1:7])), f"n={n:g} pixels {aspect}:1"
                elastomer = Power(n=n)
                out.append(
                    Case(len(out), name, surface, elastomer, p, base, 3, False, aspect=aspect)
                )
        for missing in ("fill", "void"):
            for points in (32, 32, 48):
                path = folder / f"{missing}-{seed}-{len(out)}.npy"
                np.save(path, with_holes(irregular_map("random", draw, points), draw))
                p, name = float(draw.choice(PRESSURES[1:7])), f"n={n:g} {missing}"
                holed = FileSurface(path=path, missing=missing)
                out.append(Case(len(out), name, holed, Power(n=n), p, points, 3, False))
    return out


def layered_cases(seed: int) -> list[Case]:
    """Slabs and layers whose local exponent changes within the waves of the surface or beyond."""
    draw, out = np.random.default_rng(seed), []
    for number in range(200):
        thickness = float(np.exp(draw.uniform(np.log(0.004), np.log(0.2))))
        elastomer: Elastomer = (
            Slab(thickness=thickness)
            if number % 4 < 2
            else Layer(thickness=thickness, base="sliding")
            if number % 8 > 3
            else Layer(thickness=thickness, base="bonded", poisson=0.45)
        )
        modes = int(draw.choice([10, 12, 16, 20, 24]))
        surface = SelfAffine(
            hurst=float(draw.choice([0.1, 0.3, 0.5, 0.8, 1.0])),
            rolloff=float(draw.choice([0.25, 0.5, 1.0])),
            cutoff=1 / modes,
            spectrum=str(draw.choice(["rolloff", "cutoff"])),
            seed=int(draw.integers(1, 10**6)),
        )
        base = 2 * round(modes * float(draw.choice([1.0, 1.25, 1.5])))
        p = float(np.exp(draw.uniform(np.log(0.005), np.log(1.5))))
        doublings = 4 if base > 32 else 5
        out.append(Case(number, _name(elastomer), surface, elastomer, p, base, doublings, False))
    return out


def with_holes(heights: np.ndarray, draw: np.random.Generator) -> np.ndarray:
    """Three round holes with radii of a fiftieth to a tenth of the side."""
    points = len(heights)
    y, x = np.mgrid[:points, :points]
    for _ in range(3):
        centre, radius = draw.uniform(0, points, 2), points * draw.uniform(0.02, 0.1)
        heights[np.hypot(y - centre[0], x - centre[1]) <= max(radius, 0.8)] = np.nan
    return heights


def irregular_map(kind: str, draw: np.random.Generator, points: int) -> np.ndarray:
    """A periodic map: random roughness, clipped, in steps, or stretched along one direction."""
    m_y, m_x = np.meshgrid(*[np.fft.fftfreq(points, 1 / points)] * 2, indexing="ij")
    if kind in ("stretched", "turned"):
        stretch, angle = draw.choice([3.0, 8.0]), draw.uniform(0.3, 1.2) * (kind == "turned")
        m_y, m_x = (
            m_y * np.cos(angle) + m_x * np.sin(angle),
            m_x * np.cos(angle) - m_y * np.sin(angle),
        )
        m_y = m_y * stretch
    radius = np.hypot(m_y, m_x)
    amplitude = (1 + (radius / 3) ** 2) ** (-0.5 - 0.5 * draw.choice([0.3, 0.8]))
    amplitude[(radius == 0) | (radius > points / draw.choice([2.0, 3.0, 4.0]))] = 0.0
    h = np.fft.ifft2(np.fft.fft2(draw.normal(size=(points, points))) * amplitude).real
    h = (h - h.mean()) / h.std()
    level = draw.uniform(0.0, 1.2)
    if kind == "clipped":
        return np.minimum(h, level)
    if kind == "worn":  # peaks polished, not cut off
        return np.where(h > level, level + 0.05 * (h - level), h)
    if kind == "steps":
        return np.rint(h * draw.choice([0.4, 1.0]))
    if kind == "stripes":
        return np.where(h > level - 0.6, 1.0, 0.0) + 0.02 * h
    return h


def cases(folder: Path, seed: int = 20) -> list[Case]:
    """A calibration set; height maps are written to `folder`. Seed 20 is that of the constants."""
    draw = np.random.default_rng(seed)
    out: list[Case] = []

    def add(name: str, surface: Surface, elastomer: Elastomer, p: float, base: int) -> None:
        steep = isinstance(elastomer, Power) and elastomer.n > 3
        doublings = 3 if base > 72 else 4 if steep or base > 32 else 5
        fit = replicate == 0
        out.append(Case(len(out), name, surface, elastomer, float(p), base, doublings, fit))

    for replicate in range(2):
        for elastomer in [Power(n=n) for n in EXPONENTS] + [Slab(thickness=t) for t in THICKNESSES]:
            pressures = PRESSURES if isinstance(elastomer, Power) else PRESSURES[1:6]
            for p in pressures:
                modes = int(draw.choice([10, 12, 16, 20, 24]))
                spectrum = str(draw.choice(["rolloff", "cutoff"]))
                surface = SelfAffine(
                    hurst=float(draw.choice([0.1, 0.3, 0.5, 0.8, 1.0])),
                    rolloff=float(draw.choice([0.25, 0.5, 1.0])),
                    cutoff=1 / modes,
                    spectrum=spectrum,
                    seed=int(draw.integers(1, 10**6)),
                )
                base = 2 * round(modes * float(draw.choice([1.0, 1.25, 1.5])))
                add(
                    _name(elastomer) + f" H={surface.hurst:g} {spectrum}",
                    surface,
                    elastomer,
                    p,
                    base,
                )
        for kind in ("peaks", "pits", "ridges", "white"):
            for n in (0.5, 1.0, 2.0, 3.0):
                path = folder / f"{kind}-{replicate}-{n:g}.npy"
                np.save(path, height_map(kind, draw))
                p = draw.choice(PRESSURES[1:7])
                add(f"n={n:g} file {kind}", FileSurface(path=path), Power(n=n), p, 32)
        for n in (0.5, 1.0, 1.5, 2.0):
            p = draw.choice(PRESSURES[2:6])
            add(f"n={n:g} wave", Wave(), Power(n=n), 0.5 * p, 32)
            add(f"n={n:g} parabola", Parabola(), Power(n=n), p / 3, 32)
    draw = np.random.default_rng(seed + 1)
    for replicate in range(2):  # noqa: B007, `add` reads it; many waves between roll-off and cut-off
        for n in WIDE:
            surface = SelfAffine(cutoff=1 / 64, seed=int(draw.integers(1, 10**6)))
            add(f"n={n:g} wide", surface, Power(n=n), draw.choice(PRESSURES[1:8]), 128)
    for n in BETWEEN:  # exponents that nothing was fitted to; replicate is still 1
        for p in draw.choice(PRESSURES[1:8], 3, replace=False):
            seed, hurst = int(draw.integers(1, 10**6)), float(draw.choice([0.3, 0.8]))
            surface = SelfAffine(cutoff=1 / 16, hurst=hurst, seed=seed)
            add(f"n={n:g} between", surface, Power(n=n), p, 32)
    return out


def _name(elastomer: Elastomer) -> str:
    return (
        f"n={elastomer.n:g}"
        if isinstance(elastomer, Power)
        else f"{elastomer.kind} t={elastomer.thickness:g}"
    )


def height_map(kind: str, draw: np.random.Generator, points: int = 32) -> np.ndarray:
    """A periodic map whose heights are not Gaussian, with no wave shorter than the grid's."""
    m = np.fft.fftfreq(points, 1 / points)
    radius = np.hypot(m[:, None], m)
    if kind == "white":  # every wave of the grid alike
        return draw.normal(size=(points, points))
    amplitude = (1 + (radius / 3) ** 2) ** -0.9
    h = np.fft.ifft2(np.fft.fft2(draw.normal(size=(points, points))) * amplitude).real
    h = (h - h.mean()) / h.std()
    h = {"peaks": np.exp(h), "pits": -np.exp(h), "ridges": -np.abs(h)}[kind]
    return np.fft.ifft2(np.fft.fft2(h) * (radius < 15)).real


def scene_of(case: Case, points: int) -> Scene:
    shape = {"points_y": points} if case.aspect > 1 else {}
    return SCENES[case.boundary](case.surface, case.elastomer, case.aspect * points, **shape)


def measure(case: Case, tolerance: float = 1e-6) -> dict:
    """Solve one case on all its grids, at one pressure in Pa, in the units of the first grid."""
    levels = []
    first = None
    for step in range(case.doublings + 1):
        points = case.base * 2**step
        scene = scene_of(case, points)
        first = first or scene
        # Delta_sigma of a kink, or of a map interpolated by monotone cubics, is one of the grid
        changes = case.is_single or not case.surface.band_limited
        stress = scene.delta_sigma / first.delta_sigma if changes else 1.0
        height = scene.h_std / first.h_std if changes else 1.0
        contact, length = scene.contact(case.p_star / stress), scene.grid.length
        begun = time.perf_counter()
        solution = solve_contact(contact, Auto(tolerance=tolerance))
        observables = observe(contact, solution.u, solution.sigma)
        band_limited = case.surface.band_limited
        texture = None if case.is_single else asdict(scales_of(scene, band_limited))
        levels.append(
            {
                "points": points,
                "exponent": local_exponent(case.elastomer, points, length),
                "area_exponent": excess_exponent(case.elastomer, points, length),
                "a_r": observables.a_r,
                "sigma_p": observables.sigma_p * stress,
                "u_g": observables.u_g * height,
                "perimeter": observables.perimeter,
                "energy": observables.energy * stress * height,
                "border": None if contact.is_periodic else border_share(contact, solution),
                "texture": texture,
                "status": solution.status,
                "seconds": round(time.perf_counter() - begun, 3),
            }
        )
    has_copies = case.boundary == "periodic" and not case.is_single
    return {
        "name": case.name,
        "fit": case.fit,
        "p_star": case.p_star,
        "single": case.is_single,
        "band_limited": case.surface.band_limited,
        "area": 1 / (first.texture.copies if has_copies else 1),
        "stepped": case.surface.stepped,
        "levels": levels,
    }


def truth(levels: list[dict]) -> dict[str, float]:
    """The continuum values, from the finest grids alone; no constant of discretisation_error.py."""
    third, second, first = levels[-3:]
    n = first["exponent"]
    x_second, x_first = (level["perimeter"] / level["points"] for level in (second, first))
    area = first["a_r"]
    if n > MAX_AREA_EXPONENT:  # geometric, where it is; half a line's width less where not
        steps = (second["a_r"] - third["a_r"], area - second["a_r"])
        ratio = steps[1] / steps[0] if steps[0] else 1.0
        area += steps[1] * ratio / (1 - ratio) if 0 < ratio < 0.8 else -0.5 * x_first
    elif n >= 0.25 and x_second > x_first:  # first order in the contact line
        area -= (second["a_r"] - area) * x_first / (x_second - x_first)
    stress = first["sigma_p"]
    if first.get("border"):  # the variance converges as the spacing to the power 1 - n
        if 0 < n < 1:
            change = stress**2 - second["sigma_p"] ** 2
            stress = (stress**2 + change / (2 ** (1 - n) - 1)) ** 0.5
    elif 0.75 <= n < 2.8:
        stress += (stress - second["sigma_p"]) / (2 ** min(2.0, 3 - n) - 1)
    return {"a_r": min(1.0, max(0.0, area)), "sigma_p": stress, "u_g": first["u_g"]}


@dataclass(frozen=True)
class Score:
    """One estimate of one number beside the truth."""

    name: str
    fit: bool
    exponent: float
    grids: int
    quantity: str
    error: float
    bar: float
    continuum_error: float
    continuum_bar: float

    @property
    def holds(self) -> bool:
        return self.error <= self.bar * (1 + 1e-9) + 1e-12

    @property
    def continuum_holds(self) -> bool:
        return self.continuum_error <= self.continuum_bar * (1 + 1e-9) + 1e-12


def scores(records: list[dict]) -> Iterator[Score]:
    """Every estimate from one, two or three neighbouring grids, FINER times coarser than truth."""
    for record in records:
        exact = truth(record["levels"])
        levels = [
            GridValues(
                *(level[key] for key in KEYS),
                area=record.get("area", 1.0),
                border=level.get("border"),
            )
            for level in record["levels"]
        ]
        for last in range(len(levels) - int(np.log2(FINER))):
            fine, at_last = levels[last], record["levels"][last]
            rough = None if record["single"] else RoughnessScales(**at_last["texture"])
            if fine.u_g < FULL:
                continue
            for grids in range(1, min(last + 1, 3) + 1):
                used = levels[last + 1 - grids : last + 1]
                by_name = estimate(
                    used,
                    at_last["exponent"],
                    rough,
                    ExcessExponent(*at_last["area_exponent"]),
                    same_waves=record["band_limited"],
                    stepped=record["stepped"],
                )
                for quantity, value in by_name.items():
                    if np.isnan(value.error):
                        continue
                    error = abs(getattr(fine, quantity) - exact[quantity])
                    yield Score(
                        record["name"],
                        record["fit"],
                        at_last["exponent"],
                        grids,
                        quantity,
                        error,
                        value.error,
                        abs(value.continuum - exact[quantity]),
                        value.continuum_error,
                    )


def summary(chosen: list[Score]) -> tuple[int, float, float, int, float, float]:
    """Number, coverage, median of bar over error; the same of the continuum value."""
    second = [score for score in chosen if not np.isnan(score.continuum_bar)]
    return (
        len(chosen),
        float(np.mean([score.holds for score in chosen])),
        float(np.median([score.bar / max(score.error, 1e-12) for score in chosen])),
        len(second),
        float(np.mean([s.continuum_holds for s in second])) if second else np.nan,
        float(np.median([s.continuum_bar / max(s.continuum_error, 1e-12) for s in second]))
        if second
        else np.nan,
    )


def table(scored: list[Score]) -> None:
    """Print coverage and medians."""

    def line(label: str, which: Callable[[Score], bool]) -> None:
        chosen = [score for score in scored if which(score)]
        if chosen:
            n, held, ratio, m, held_too, ratio_too = summary(chosen)
            print(
                f"{label:28s} {n:5d} {100 * held:6.1f} % {ratio:6.2f}"
                f"   {m:5d} {100 * held_too:6.1f} % {ratio_too:6.2f}"
            )

    print("                                 value +- error            continuum +- its error")
    print("                             cases coverage bar/error  cases coverage bar/error")
    for half in (True, False):
        for quantity in MAIN_OBSERVABLES:
            for grids in (1, 2, 3):
                label = f"{'fit' if half else 'verify'} {quantity} {grids} grid{'s'[: grids - 1]}"
                line(label, lambda s: (s.fit, s.quantity, s.grids) == (half, quantity, grids))  # noqa: B023
    for quantity in MAIN_OBSERVABLES:
        for n in sorted({*EXPONENTS, *FREE_EXPONENTS}):
            line(
                f"verify {quantity} n={n:g}",
                lambda s: (
                    not s.fit and s.quantity == quantity and s.name.startswith(f"n={n:g} ")  # noqa: B023
                ),
            )
        for kind in (
            "slab",
            "file",
            "wide",
            "between",
            *IRREGULAR,
            "scan",
            "layer",
            "part",
            "line",
            "pixels 2:1",
            "pixels 4:1",
            "fill",
            "void",
        ):
            line(
                f"verify {quantity} {kind}",
                lambda s: not s.fit and s.quantity == quantity and kind in s.name,  # noqa: B023
            )
        line(
            f"verify {quantity} single indenter",
            lambda s: (
                not s.fit
                and s.quantity == quantity  # noqa: B023
                and s.name.endswith(("wave", "parabola"))
            ),
        )


def figure(scored: list[Score], path: Path) -> None:
    """Error bar over true error of the cases that nothing was fitted to."""
    from gfmd_cli.analysis.plotting import ColumnFigure, Line2D, styled

    with styled():
        plot = ColumnFigure("true error", "error bar")
        span = (1e-6, 1.0)
        styles = {
            "a_r": ("o", "tab:blue"),
            "sigma_p": ("s", "tab:orange"),
            "u_g": ("^", "tab:green"),
        }
        labels = {"a_r": "$a_r$", "sigma_p": "$\\sigma_p/\\Delta\\sigma$", "u_g": "$u_g/h_{std}$"}
        for quantity, (marker, colour) in styles.items():
            chosen = [s for s in scored if not s.fit and s.quantity == quantity]
            x, y = ([getattr(s, name) for s in chosen] for name in ("error", "bar"))
            style = {"marker": marker, "ls": "none", "mfc": "none", "color": colour}
            plot.axes.plot(*np.clip((x, y), *span), ms=2.2, mew=0.4, **style)
            plot.legend[labels[quantity]] = Line2D([], [], **style)
        plot.line("error bar = true error", np.array(span), np.array(span), color="black")
        for axis in "xy":
            plot.scale(axis, "log", span)
        plot.write(path)


def collect(chosen: list[Case], cache: Path | None = None) -> list[dict]:
    """Measure the cases that the cache does not hold yet, and keep them there."""
    if cache:
        cache.parent.mkdir(parents=True, exist_ok=True)
    records = json.loads(cache.read_text()) if cache and cache.exists() else []
    pairs = zip(records, chosen, strict=False)
    if any(
        (record["name"], record["p_star"]) != (case.name, case.p_star) for record, case in pairs
    ):
        raise SystemExit(f"{cache} has the cases of other options")
    begun = time.perf_counter()
    for case in chosen[len(records) :]:
        records.append(measure(case))
        print(f"{time.perf_counter() - begun:6.0f} s  {case.name}, p* = {case.p_star:.3g}")
        if cache:
            cache.write_text(json.dumps(records))
    return records


def quick(chosen: list[Case]) -> list[Case]:
    """Every second case, a grid less where that leaves truth fine enough."""
    return [replace(case, doublings=min(case.doublings, 4)) for case in chosen[::2]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cache", type=Path, help="JSON file of what is measured already")
    parser.add_argument("--quick", action="store_true", help="half the cases, smaller grids")
    parser.add_argument("--seed", type=int, default=20, help="20 is the set of the constants")
    parser.add_argument("--shift", type=float, default=1.0, help="factor of the pressures")
    parser.add_argument("--figure", type=Path, help="path of a figure, without suffix")
    parser.add_argument("--maps", action="store_true", help="irregular maps instead")
    parser.add_argument("--free", action="store_true", help="maps with a free boundary instead")
    parser.add_argument("--shapes", action="store_true", help="oblong pixels and holes instead")
    parser.add_argument("--layers", action="store_true", help="slabs and layers alone instead")
    parser.add_argument("--beyond", action="store_true", help="the excess of a_r beyond its limits")
    parser.add_argument("--scans", type=Path, help="with --maps: folder of maps of 64 x 64 points")
    options = parser.parse_args()
    if options.beyond:
        discretisation_error.MAX_EXCESS_ANISOTROPY = np.inf
        discretisation_error.MAX_KINKED_EXPONENT = np.inf
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.free:
            wanted = free_cases(folder, options.seed)
        elif options.shapes:
            wanted = shape_cases(folder, options.seed)
        elif options.layers:
            wanted = layered_cases(options.seed)
        elif options.maps:
            wanted = map_cases(folder, options.seed, options.scans)
        else:
            wanted = cases(folder, options.seed)
        wanted = [replace(case, p_star=options.shift * case.p_star) for case in wanted]
        records = collect(quick(wanted) if options.quick else wanted, options.cache)
    scored = list(scores(records))
    table(scored)
    if options.figure:
        figure(scored, options.figure)


if __name__ == "__main__":
    main()
