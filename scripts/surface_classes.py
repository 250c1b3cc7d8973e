"""Error bars on maps of many kinds of surface, also those that the calibration does not contain.

Each map has 64^2 points and Fourier interpolation; n = 0.5, 1, 2 and p* = 0.02, 0.1, 0.4. Contacts
on 64^2 (one grid) and 128^2 points (two grids) are compared with 1024^2. A line for each kind says
how many bars hold, of those that are given: docs/calibration.md.

python scripts/surface_classes.py --count 8
python scripts/surface_classes.py --count 8 --laws      # the laws of random surfaces for all kinds
"""

import argparse
import tempfile
import warnings
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import numpy as np
from markdown_tables import print_head, print_row

from gfmd_cli import rows, run
from gfmd_cli.analysis.selection import grouped
from gfmd_cli.physics import discretisation_error
from gfmd_cli.physics.observables import MAIN_OBSERVABLES

POINTS = 64
EXPONENTS = [0.5, 1.0, 2.0]
PRESSURES = [0.02, 0.1, 0.4]

Draw = np.random.Generator
M_Y = np.fft.fftfreq(POINTS, 1 / POINTS)[:, None]
M_X = np.fft.rfftfreq(POINTS, 1 / POINTS)


def standard(h: np.ndarray) -> np.ndarray:
    return (h - h.mean()) / h.std()


def limited(h: np.ndarray, highest: float = 24) -> np.ndarray:
    """Heights without the waves beyond the highest number of waves per side."""
    modes = np.fft.rfft2(h) * (np.hypot(M_Y, M_X) <= highest)
    return standard(np.fft.irfft2(modes, h.shape))


def gaussian(
    draw: Draw, highest: float = 14, lowest: float = 0, hurst: float = 0.8, stretch: float = 1.0
) -> np.ndarray:
    """Self-affine Gaussian heights with a roll-off at four waves per side."""
    amplitude = (1 + (np.hypot(stretch * M_Y, M_X) / 4) ** 2) ** (-(1 + hurst) / 2)
    m = np.hypot(M_Y, M_X)
    amplitude *= (lowest < m) & (m <= highest)
    noise = draw.normal(size=(POINTS, POINTS))
    return standard(np.fft.irfft2(amplitude * np.fft.rfft2(noise), noise.shape))


def bumps(draw: Draw, scatter: float = 0.0, jitter: float = 0.0) -> np.ndarray:
    """4 x 4 Gaussian bumps: scatter of their heights, jitter of their places over the pitch."""
    y, x = ((np.arange(POINTS) + draw.random()) * 4 / POINTS for _ in range(2))
    h = np.zeros((POINTS, POINTS))
    for place in np.ndindex(4, 4):
        dy, dx = (
            (axis - at - jitter * draw.normal() + 2) % 4 - 2
            for axis, at in zip((y, x), place, strict=True)
        )
        h += (1 + scatter * draw.normal()) * np.exp(-50 * np.add.outer(dy**2, dx**2))
    return standard(h)


def cut_off(draw: Draw, level: float) -> np.ndarray:
    """Heights whose peaks are cut off at a level, with some short roughness."""
    plateau = np.minimum(gaussian(draw, 10), level)
    return limited(plateau + 0.05 * gaussian(draw, 20, hurst=0))


def copies(draw: Draw) -> np.ndarray:
    """2 x 2 copies of a random map."""
    return np.tile(gaussian(draw)[::2, ::2], (2, 2))


def mirrored(draw: Draw) -> np.ndarray:
    """A random map beside, above and diagonal to its mirror images."""
    h = gaussian(draw, 12)
    h = h + h[::-1]
    return standard(h + h[:, ::-1])


KINDS: dict[str, Callable[[Draw], np.ndarray]] = {
    "random": gaussian,
    "white noise": lambda draw: gaussian(draw, 31, hurst=-1),
    "ring of waves": lambda draw: gaussian(draw, 11, 9, hurst=-1),
    "anisotropic": lambda draw: gaussian(draw, 16, stretch=1.8),
    "two scales": lambda draw: limited(gaussian(draw, 2) + 0.1 * gaussian(draw, 24, 12, -1)),
    "peaks": lambda draw: limited(np.exp(gaussian(draw, 8)), 20),
    "low peaks": lambda draw: limited(np.exp(0.5 * gaussian(draw, 8)), 20),
    "pits": lambda draw: limited(-np.exp(gaussian(draw, 8)), 20),
    "low pits": lambda draw: limited(-np.exp(0.5 * gaussian(draw, 8)), 20),
    "cut off at 0.3": lambda draw: cut_off(draw, 0.3),
    "cut off at 0.8": lambda draw: cut_off(draw, 0.8),
    "cut off at 1.3": lambda draw: cut_off(draw, 1.3),
    "bumps": bumps,
    "bumps of scattered heights": lambda draw: bumps(draw, scatter=0.2),
    "jittered bumps": lambda draw: bumps(draw, 0.05, 0.15),
    "rough bumps": lambda draw: limited(bumps(draw) + 0.05 * gaussian(draw, 24, hurst=0)),
    "rough stripes": lambda draw: limited(
        np.cos(8 * np.pi * np.arange(POINTS) / POINTS) + 0.4 * gaussian(draw, 20, hurst=0.3)
    ),
    "2 x 2 copies": copies,
    "mirrored": mirrored,
}


def errors(heights: np.ndarray, finest: int, folder: Path) -> list[tuple[int, str, float]]:
    """Errors over bars: number of grids, quantity, ratio; NaN where no bar is given."""
    np.save(folder / "map.npy", 0.01 * heights)
    surface = {"kind": "file", "path": str(folder / "map.npy"), "length": 1.0, "periodic": True}
    spec = {
        "surface": surface | {"interpolation": "fourier"},
        "elastomer": {"kind": "power", "n": EXPONENTS},
        "grid": {"points": [POINTS, 2 * POINTS, finest * POINTS]},
        "load": {"p_star": PRESSURES},
        "accuracy": {"mean_gap": 0.01},
    }
    (folder / "study.h5").unlink(missing_ok=True)
    run(spec, folder / "study.h5")
    contacts = grouped(rows(folder / "study.h5"), lambda row: (row["n"], row["load_value"]))
    ratios = []
    for contact in contacts.values():
        *coarse, fine = sorted(contact, key=lambda row: row["points"])
        for grids, row in enumerate(coarse, 1):
            for name in MAIN_OBSERVABLES:
                error = row[f"{name}_continuum"] - fine[f"{name}_continuum"]
                ratios.append((grids, name, abs(error) / row[f"{name}_continuum_error"]))
    return ratios


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("kinds", nargs="*", choices=[[], *KINDS], default=[], metavar="KIND")
    parser.add_argument("--count", type=int, default=4, help="maps of each kind")
    parser.add_argument("--finest", type=int, default=16, help="points over those of the maps")
    parser.add_argument("--laws", action="store_true", help="as if all surfaces were calibrated")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    if arguments.laws:
        for limit in ("MAX_REPETITIONS", "MAX_PLATEAU", "MAX_HIGHEST"):
            setattr(discretisation_error, limit, np.inf)
    heads = [f"{grids}: {name}" for grids in (1, 2) for name in MAIN_OBSERVABLES]
    print("bars that hold of those given, largest error over its bar")
    print_head("kind", *heads)
    for kind in arguments.kinds or KINDS:
        draw = np.random.default_rng([arguments.seed, list(KINDS).index(kind)])
        ratios = defaultdict(list)
        with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(action="ignore"):
            for _ in range(arguments.count):
                of_map = errors(KINDS[kind](draw), arguments.finest, Path(folder))
                for grids, name, ratio in of_map:
                    if np.isfinite(ratio):
                        ratios[f"{grids}: {name}"].append(ratio)
        cells = [
            f"{sum(x <= 1 for x in ratios[head])}/{len(ratios[head])}, {max(ratios[head]):.1f}"
            if ratios[head]
            else "-"
            for head in heads
        ]
        print_row(kind, *cells)


if __name__ == "__main__":
    main()
