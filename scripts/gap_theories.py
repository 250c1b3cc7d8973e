"""Theories of the mean gap on surfaces that no constant was fitted to.

Compares Eq. (39), the fitted gamma(n), weights W of two contact areas, and coarse-graining: the
tables of docs/mean_gap.md and docs/energy_weights.md. Prints the constants of
gfmd_cli/physics/gap_theories.py. Reads the studies `gamma`, `further`, `between`, `stiffness`,
`surfaces`, `depth` and `slab` of scripts/theory_studies.py, and the weights by shell of
scripts/energy_weights.py.

python scripts/gap_theories.py --folder results/theory --weights results/energy_weights.jsonl
"""

import argparse
import json
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
from energy_weights import GROUPS, KINDS, PRESSURES, Record, groups, scene_of
from gamma_fit import (
    FINER,
    FITTED,
    GAMMA,
    GRID,
    HELD_OUT,
    P_STAR,
    Key,
    Surface,
    read,
    rms,
    spectrum_of,
    spread,
)
from gamma_fit import smooth as gamma
from markdown_tables import print_table
from scipy.optimize import least_squares
from scipy.special import erf
from theory_studies import EXPONENTS, HURST, SHOWN, SPECTRA, run_with_studies

from gfmd_cli.analysis.compare import Curve, Theory, compare, einstein_prediction, theory_of
from gfmd_cli.analysis.selection import grouped
from gfmd_cli.physics.persson import Shells, gamma_n

NODES = np.geomspace(3e-4, 8, 300)
"""Pressures [Delta_sigma] of the integral of Eq. (28)."""
THEORIES: dict[Theory, str] = {
    "paper": "Eqs. (39), (42)",
    "fitted": "fitted W",
    "coarse-grained": "coarse-graining",
}
OTHER = (0.001, 0.003, 0.01, 0.1, 0.3, 0.6, 1.0)
Weight = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""W of the areas a at the scale q and s at q_s, and of constants."""
FORMS: dict[str, tuple[Weight, list[float]]] = {
    "a [c + (1 - c) a²]": (lambda a, s, c: a * (c[0] + (1 - c[0]) * a * a), [0.3]),
    "a^α s^(1-α) [c + (1 - c) a²]": (
        lambda a, s, c: a ** c[0] * s ** (1 - c[0]) * (c[1] + (1 - c[1]) * a * a),
        [0.7, 0.4],
    ),
    "a^α s^β [c + (1 - c) a²]": (
        lambda a, s, c: a ** c[0] * s ** c[1] * (c[2] + (1 - c[2]) * a * a),
        [1.2, 0.1, 0.4],
    ),
}
"""Weights that are 1 in full contact, and first guesses of their constants."""
GENERAL = list(FORMS)[-1]
SMOOTH = [0.4, 0.6, 0.6, 0.9, 0.9, -0.3, 0.1]
"""First guess of the constants of `of_n`."""
FREE = list(FORMS)[1:]
WEIGHT = "fitted W"


def of_n(n: float, t: np.ndarray) -> np.ndarray:
    """alpha, beta and c of the last form as functions of n."""
    c = t[4] + t[5] * n + t[6] * n * n
    return np.array([t[0] + t[1] * n, t[2] * np.exp(-n / t[3]), c])


class Areas:
    """Contact areas of a spectrum at all scales, and the mean gap of a weight of them."""

    def __init__(self, shells: Shells):
        total = shells.variance.sum()
        middle = np.cumsum(shells.variance) - 0.5 * shells.variance
        self.energy = 0.5 * shells.energy
        self.scale = erf(NODES[:, None] * np.sqrt(0.5 * total / middle))
        self.all = erf(NODES[:, None] / np.sqrt(2))
        self.unit = float(np.sqrt(shells.height.sum() * total))

    def log_gap(self, weight: Weight, constants: np.ndarray, p_star: np.ndarray) -> np.ndarray:
        """ln u_g / h_std of Eqs. (28) and (29); 0 < p* < 2."""
        v = weight(self.scale, self.all, constants) @ self.energy
        lost = np.diff(v) / np.sqrt(NODES[1:] * NODES[:-1])
        gap = np.maximum(np.cumsum(lost[::-1])[::-1], 1e-300) / self.unit
        return np.asarray(np.interp(np.log(p_star), np.log(NODES[:-1]), np.log(gap)))


def log_gap(theory: Theory, shells: Shells, n: float, p_star: np.ndarray) -> np.ndarray:
    """ln u_g / h_std of a theory of `gfmd analyze`."""
    persson = theory_of(theory, shells, n)
    gap = persson.mean_gap(p_star * persson.delta_sigma)
    return np.asarray(np.log(gap / np.sqrt(shells.height.sum())))


def springs(shells: Shells) -> Shells:
    """The same heights on springs, n = 0."""
    return replace(shells, energy=shells.height, variance=shells.height)


class Fits:
    """The constants of the forms, fitted to the mean ln u_g of the training seeds."""

    def __init__(self, surfaces: dict[Key, Surface]):
        self.surfaces = surfaces
        self.areas = {key: Areas(surface.shells) for key, surface in surfaces.items()}
        self.known: dict[tuple[str, float, str], np.ndarray] = {}
        self.springs = {
            (name, hurst): Areas(springs(surfaces[name, hurst, EXPONENTS[0]].shells))
            for name, hurst in product(SPECTRA, HURST)
        }

    def errors(self, form: str, c: np.ndarray, key: Key, seeds: slice) -> np.ndarray:
        """ln u_g less that of the seeds: seeds, pressures."""
        theory = self.areas[key].log_gap(FORMS[form][0], c, P_STAR)
        return np.asarray(theory - self.surfaces[key].log_gap[seeds])

    def constants(self, form: str, n: float, without: str = "") -> np.ndarray:
        """Of all spectra but those of one kind."""
        if (form, n, without) not in self.known:
            keys = [(name, h, n) for name, h in product(SPECTRA, HURST) if name != without]

            def residuals(c: np.ndarray) -> np.ndarray:
                errors = [self.errors(form, c, key, FITTED).mean(axis=0) for key in keys]
                return np.concatenate(errors)

            start = FORMS[form][1]
            self.known[form, n, without] = least_squares(residuals, start, method="lm").x
        return self.known[form, n, without]

    def smooth(self, without: str = "") -> np.ndarray:
        """Constants of `of_n` of all spectra but those of one kind; n = 0 is its closed form."""
        if (WEIGHT, 0.0, without) not in self.known:
            exact = np.log(einstein_prediction(P_STAR).u_g)
            weight = FORMS[GENERAL][0]

            def residuals(t: np.ndarray) -> np.ndarray:
                errors = [
                    areas.log_gap(weight, of_n(0.0, t), P_STAR) - exact
                    for key, areas in self.springs.items()
                    if key[0] != without
                ]
                errors += [
                    self.errors(GENERAL, of_n(key[2], t), key, FITTED).mean(axis=0)
                    for key in self.surfaces
                    if key[0] != without
                ]
                return np.concatenate(errors)

            self.known[WEIGHT, 0.0, without] = least_squares(residuals, SMOOTH, method="lm").x
        return self.known[WEIGHT, 0.0, without]


def cell(errors: list[np.ndarray]) -> str:
    """Of single seeds / of the mean over the seeds, in per cent."""
    return f"{100 * rms(errors):.1f} / {100 * rms([one.mean(axis=0) for one in errors]):.1f}"


def signed(errors: np.ndarray) -> list[str]:
    return [f"{100 * error:+.1f}" for error in errors]


def print_errors(fits: Fits) -> None:
    """Test seeds; of the forms also spectra that were left out."""
    rows = []
    for n in EXPONENTS:
        keys = [(name, hurst, n) for name, hurst in product(SPECTRA, HURST)]
        simulated = {key: fits.surfaces[key].log_gap[HELD_OUT] for key in keys}
        weights = float(gamma_n(n)), float(gamma(n, *GAMMA))
        cells = [
            cell([fits.surfaces[key].theory(one) - simulated[key] for key in keys])
            for one in weights
        ]
        cells += [
            cell(
                [fits.errors(form, fits.constants(form, n, key[0]), key, HELD_OUT) for key in keys]
            )
            for form in FREE
        ]
        smooth = {key: of_n(n, fits.smooth(key[0])) for key in keys}
        cells.append(cell([fits.errors(GENERAL, smooth[key], key, HELD_OUT) for key in keys]))
        theory = {
            key: log_gap("coarse-grained", fits.surfaces[key].shells, n, P_STAR) for key in keys
        }
        cells.append(cell([theory[key] - simulated[key] for key in keys]))
        rows.append([f"{n:g}", *cells])
    heads = ["n", "Eq. (39)", "fitted γ", *FREE, WEIGHT, "coarse-graining"]
    print_table("ln u_g on the test seeds, per cent; forms on spectra left out", heads, rows)
    rows = [
        [f"{n:g}", *(" ".join(f"{x:.3f}" for x in fits.constants(form, n)) for form in FORMS)]
        for n in EXPONENTS
    ]
    print_table("Constants, all spectra", ["n", *FORMS], rows)
    print("\nConstants of physics/gap_theories.py:", *(f"{x:.3f}" for x in fits.smooth()))


def print_spectra(fits: Fits) -> None:
    """Error of coarse-graining of the mean over all seeds: least and largest of the spectra."""
    rows = []
    for n in EXPONENTS:
        errors = [
            log_gap("coarse-grained", surface.shells, n, P_STAR) - surface.log_gap.mean(axis=0)
            for key, surface in fits.surfaces.items()
            if key[2] == n
        ]
        low, high = np.min(errors, axis=0), np.max(errors, axis=0)
        ends = zip(signed(low), signed(high), strict=True)
        rows.append([f"{n:g}", *(f"{a} to {b}" for a, b in ends)])
    heads = ["n", *(f"p* = {p:g}" for p in P_STAR)]
    print_table("Coarse-graining, all seeds, range over the spectra, per cent", heads, rows)


def print_further(path: Path) -> None:
    """Coarse-graining on seeds of their own: errors and standard errors over the spectra."""
    by_key = defaultdict(list)
    for curve in compare(path).curves:
        key = curve.n, spectrum_of(curve.rows[0]), curve.rows[0]["hurst"]
        theory = log_gap("coarse-grained", curve.persson.shells, curve.n, P_STAR)
        by_key[key].append(theory - np.log(curve.column("u_g")))
    rows = []
    for n in sorted({key[0] for key in by_key}):
        held = [np.array(errors) for key, errors in by_key.items() if key[0] == n]
        means = np.array([errors.mean(axis=0) for errors in held])
        bars = np.array([errors.std(axis=0, ddof=1) / len(errors) ** 0.5 for errors in held])
        ends = [signed(one) for one in (means.min(axis=0), means.max(axis=0))]
        ends += [[f"{100 * x:.1f}" for x in one] for one in (bars.min(axis=0), bars.max(axis=0))]
        ends += [[f"{x:.1f}" for x in np.max(np.abs(means) / bars, axis=0)]]
        cells = zip(*ends, strict=True)
        rows.append([f"{n:g}", *("{} to {} (± {} to {}; {})".format(*cell) for cell in cells)])
    heads = ["n", *(f"p* = {p:g}" for p in P_STAR)]
    title = "Coarse-graining, further seeds on 512^2, per cent (standard errors; largest ratio)"
    print_table(title, heads, rows)


def means(path: Path, points: int | None = None) -> Iterator[tuple[list[Curve], np.ndarray]]:
    """Curves of one surface and elastomer, and the mean of their ln u_g over the seeds."""

    def key(curve: Curve) -> tuple:
        row = curve.rows[0]
        return curve.n, -row["cutoff"], row["spectrum"], row["hurst"]

    on_grid = (c for c in compare(path).curves if points in (None, c.rows[0]["points"]))
    for _, curves in sorted(grouped(on_grid, key).items()):
        yield curves, np.mean([np.log(curve.column("u_g")) for curve in curves], axis=0)


def print_between(path: Path) -> None:
    """Exponents that no constant was fitted to; mean of the seeds, in the continuum."""
    rows = []
    by_key: dict[tuple, dict[int, list[np.ndarray]]] = defaultdict(lambda: defaultdict(list))
    shells = {}
    for curve in sorted(compare(path).curves, key=lambda one: one.rows[0]["seed"]):
        key = curve.n, spectrum_of(curve.rows[0]), curve.rows[0]["hurst"]
        by_key[key][curve.rows[0]["points"]].append(np.log(curve.column("u_g")))
        shells[key] = curve.persson.shells
    for key, grids in sorted(by_key.items()):
        finer = 4 / 3 * (grids[FINER][0] - grids[GRID][0])
        simulated = np.mean(grids[GRID], axis=0) + finer
        errors = {name: log_gap(name, shells[key], key[0], P_STAR) - simulated for name in THEORIES}
        for name, error in errors.items():
            rows.append([f"{key[0]:g}", f"{key[1]}, H = {key[2]}", THEORIES[name], *signed(error)])
    heads = ["n", "surface", "", *(f"p* = {p:g}" for p in P_STAR)]
    print_table("Exponents between those of the fit, test seeds, per cent", heads, rows)


def print_other(path: Path, pressures: Sequence[float]) -> None:
    """Other pressures, on the grid of 512^2; the last line is the standard error of the mean."""
    rows = []
    for curves, simulated in means(path, GRID):
        n, p, row = curves[0].n, curves[0].column("p_star"), curves[0].rows[0]
        at = np.array([np.argmin(np.abs(p - one)) for one in pressures])
        first = f"{n:g}", f"{row['spectrum']}, H = {row['hurst']}"
        for name, head in THEORIES.items():
            theory = log_gap(name, curves[0].persson.shells, n, p[at])
            rows.append([*first, head, *signed(theory - simulated[at])])
        bars = np.transpose([np.log(curve.column("u_g")) for curve in curves])[at]
        rows.append([*first, "±", *(f"{100 * spread(list(one))[1]:.1f}" for one in bars)])
    heads = ["n", "surface", "", *(f"p* = {p:g}" for p in pressures)]
    print_table("Other pressures, per cent", heads, rows)


def print_depth(path: Path) -> None:
    """The range of the spectrum at p* = 0.01 and 0.1."""
    rows = []
    for curves, simulated in means(path):
        n, p, row = curves[0].n, curves[0].column("p_star"), curves[0].rows[0]
        errors = [log_gap(name, curves[0].persson.shells, n, p) - simulated for name in THEORIES]
        cells = [" / ".join(signed(error[[0, 2]])) for error in errors]
        rows.append([f"{n:g}", f"{row['rolloff'] / row['cutoff']:.0f}", *cells])
    heads = ["n", "λr/λs", *THEORIES.values()]
    print_table("Range of the spectrum, p* = 0.01 / 0.1, per cent", heads, rows)


def print_slabs(path: Path) -> None:
    """Slabs, in the continuum, with the constants at the local exponent."""
    by_thickness = defaultdict(list)
    for curve in compare(path).curves:
        row, shells = curve.rows[0], curve.persson.shells
        p = curve.column("p_star") * row["delta_sigma"] / curve.persson.delta_sigma
        simulated = np.log(curve.column("u_g_continuum"))
        differences = [log_gap(name, shells, np.nan, p) - simulated for name in THEORIES]
        by_thickness[row["thickness"]].append(differences)
    rows = []
    for t, errors in by_thickness.items():
        for i, name in enumerate(THEORIES.values()):
            rows.append([f"{t:g}", name, *signed(np.mean(errors, axis=0)[i])])
        bars = np.transpose([one[0] for one in errors])
        rows.append([f"{t:g}", "±", *(f"{100 * spread(list(one))[1]:.1f}" for one in bars)])
    print_table(
        "Slabs, per cent (standard errors in the last lines)",
        ["t/L", "", *(f"p* = {p:g}" for p in P_STAR)],
        rows,
    )
    every = np.array([one for errors in by_thickness.values() for one in errors])
    ends = zip(THEORIES.values(), np.moveaxis(every, 1, 0), strict=True)
    print("\nrms:", *(f"{name} {100 * rms(list(errors)):.1f}" for name, errors in ends))


def print_weights(records: list[Record], fits: Fits) -> None:
    """rms of ln W of the theory less that measured, over pressures up to 0.3 and groups."""
    rows = []
    for n in sorted({record["n"] for record in records}):
        forms = {form: (FORMS[form][0], fits.constants(form, n)) for form in FORMS}
        forms[WEIGHT] = FORMS[GENERAL][0], of_n(n, fits.smooth())
        errors: dict[str, list[np.ndarray]] = {form: [] for form in forms}
        for kind in KINDS:
            mean = np.mean([r["weight"] for r in records if (r["kind"], r["n"]) == (kind, n)], 0)
            shells = scene_of(kind, n, 0).shells
            areas = Areas(shells)
            group = np.digitize(shells.q / (2 * np.pi), groups()) - 1
            for form, (weight, c) in forms.items():
                w = weight(areas.scale, areas.all, c)
                for p, measured in zip(PRESSURES, mean, strict=True):
                    at = w[np.argmin(np.abs(np.log(NODES / p)))] * shells.energy
                    full = np.bincount(group, shells.energy, GROUPS)
                    with np.errstate(invalid="ignore"):
                        theory = np.bincount(group, at, GROUPS) / full
                    if p <= P_STAR[-1]:
                        errors[form].append(np.log(theory / measured)[full > 0])
        rows.append([f"{n:g}", *(f"{rms([np.concatenate(e)]):.2f}" for e in errors.values())])
    print_table("W by shell: rms of ln W - ln W measured", ["n", *FORMS, WEIGHT], rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--folder", type=Path, default=Path("results/theory"))
    parser.add_argument("--weights", type=Path, default=Path("results/energy_weights.jsonl"))
    arguments = parser.parse_args()
    fits = Fits(read(arguments.folder / "gamma.h5"))
    print_errors(fits)
    print_spectra(fits)
    print_further(arguments.folder / "further.h5")
    print_between(arguments.folder / "between.h5")
    print_other(arguments.folder / "stiffness.h5", OTHER)
    print_other(arguments.folder / "surfaces.h5", SHOWN)
    print_depth(arguments.folder / "depth.h5")
    print_slabs(arguments.folder / "slab.h5")
    lines = arguments.weights.read_text().splitlines()
    print_weights([json.loads(line) for line in lines], fits)


if __name__ == "__main__":
    run_with_studies(main, "python scripts/theory_studies.py")
