"""Contact of maps that do not resolve their roughness: the tables of docs/map_evidence.md.

    python scripts/unresolved_roughness.py [--points 1024] [--seeds 4] [--n 1] [--maps MAPS]

Self-affine surfaces on an elastomer k = q^n, whose shortest waves have half the shortest wavelength
that the map resolves (one halving) or a quarter of it (two). The map has the waves of two points
and more ("sharp"), the means over its pixels, or the heights at its points ("sampled"). Others have
four points in this wavelength, of which a microscope shows half the amplitude: by a Gaussian filter
("gaussian"), or as a lens in incoherent light without aberrations does ("diffraction"); they are
solved with this `surface.lateral_period_limit`. All contacts are solved on the same grid, the map
interpolated as the program chooses, at the pressure that is a given p* for the true surface.
Printed are the mean over seeds of `short_wave_factor`, of the ratio of Delta_sigma and, for each
p*, of the ratios of contact area and mean gap, of the map to the true surface; in brackets the
standard deviation in the last digits.

    python scripts/unresolved_roughness.py --leakage

The largest factors by which waves below the lateral period limit increase the rms gradient of
blurred maps without noise.

    python scripts/unresolved_roughness.py --scans FOLDER

The same for parts of scans of 256 x 256 points with a free boundary: the map has the means of 2 x 2
points. Scans with missing heights or with warnings are left out.
"""

import argparse
from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np

from gfmd_cli.api import Result, Tables, solve
from gfmd_cli.errors import InputError
from gfmd_cli.grid.arrays import Field
from gfmd_cli.maps.gaussian_filter import gaussian_filter
from gfmd_cli.maps.noise import _Gradient
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.spec.parse import read_scan

HURST = (0.3, 0.5, 0.8, 1.0)
P_STARS = (0.003, 0.03, 0.3)
ROLLOFF, SHORTEST = 1 / 4, 1 / 256  # of the side
HALVINGS = (1, 2)
SCANNED = 256  # points per side of the part of a scan
BLURRED = 4  # points of a blurred map in the shortest wavelength that it resolves
HALF_RESPONSE = 0.404  # frequency at which the response of a lens is 1/2, over that where it ends


def sharp(heights: Field, points: int) -> Field:
    """The waves of two points of a map and more."""
    whole = len(heights)
    modes = np.fft.rfft2(heights)
    q = np.hypot(np.fft.fftfreq(whole, 1 / whole)[:, None], np.arange(whole // 2 + 1))
    modes[q > points / 2] = 0
    return sampled(np.fft.irfft2(modes, s=heights.shape), points)


def means(heights: Field, points: int) -> Field:
    """The means over the pixels of a map."""
    step = len(heights) // points
    return np.ascontiguousarray(heights.reshape(points, step, points, step).mean(axis=(1, 3)))


def sampled(heights: Field, points: int) -> Field:
    """The heights at the points of a map."""
    step = len(heights) // points
    return np.ascontiguousarray(heights[::step, ::step])


def gaussian(heights: Field, points: int, in_wave: int = BLURRED) -> Field:
    """The map of a microscope that shows half the amplitude of some waves, by a Gaussian filter.

    They are 2 / points of the side long, and have `in_wave` points in the map.
    """
    spacing = (1 / len(heights),) * 2
    filtered = gaussian_filter(heights, spacing, 2 / points, periodic=True)
    return sampled(filtered, points * in_wave // 2)


def diffraction(heights: Field, points: int, in_wave: int = BLURRED) -> Field:
    """Such a map, by a lens in incoherent light (Goodman, Introduction to Fourier Optics).

    The response to a wave of the frequency f is 2 / pi (acos f - f sqrt(1 - f^2)), f < 1.
    """
    whole = len(heights)
    frequency = np.hypot(np.fft.fftfreq(whole, 1 / whole)[:, None], np.arange(whole // 2 + 1))
    f = np.minimum(HALF_RESPONSE * frequency * 2 / points, 1.0)
    response = 2 / np.pi * (np.arccos(f) - f * np.sqrt(1 - f**2))
    blurred = np.fft.irfft2(response * np.fft.rfft2(heights), s=heights.shape)
    return sampled(blurred, points * in_wave // 2)


MAPS = {each.__name__: each for each in (sharp, means, sampled, gaussian, diffraction)}


def contacts(heights: Field, spec: Tables, pressures: Sequence[float]) -> list[Result]:
    """The contacts of a map at some pressures [Pa]."""
    loads = ({"load": {"pressure": pressure}} for pressure in pressures)
    return [solve({**spec, **load}, heights=heights) for load in loads]


def pressures(heights: Field, spec: Tables, p_stars: Sequence[float]) -> list[float]:
    """Reduced pressures on a map in Pa."""
    (contact,) = contacts(heights, spec, [1.0])
    return [p_star * contact.columns["delta_sigma"] for p_star in p_stars]


def ratios(of_map: Sequence[Result], true: Sequence[Result]) -> list[float]:
    """Factor of the map, and its Delta_sigma, contact areas and mean gaps over the true ones."""
    names = ("a_r", "mean_gap")
    pairs = [(a.columns, b.columns) for a, b in zip(of_map, true, strict=True)]
    first, exact = pairs[0]
    return [
        first["short_wave_factor"],
        first["delta_sigma"] / exact["delta_sigma"],
        *(a[name] / b[name] for a, b in pairs for name in names),
    ]


def leakage() -> None:
    """Print the factors of blurred maps of 256 points a side, whole and cut, over four seeds."""
    print("H, map, points in the lateral period limit: largest factor")
    for hurst, blur, in_wave in product(HURST, (gaussian, diffraction), (4, 8, 16)):
        factors = []
        for seed in range(4):
            surface = SelfAffine(cutoff=SHORTEST, rolloff=ROLLOFF, hurst=hurst, seed=seed)
            seen = blur(surface.heights(1024), 512 // in_wave, in_wave)
            for part in (seen, seen[:200, :220]):
                share = _Gradient(part, (1.0, 1.0)).beyond(in_wave, 0.0)
                factors.append(1 / np.sqrt(1 - share))
        print(f"{hurst:3g} {blur.__name__:11} {in_wave:2} {max(factors):.2f}", flush=True)


def random_surfaces(n: float, points: int, hurst: float, seeds: int, maps: Sequence[str]) -> None:
    """Print the ratios for random surfaces, all waves of which are known."""
    rows: dict[tuple[str, int], list[list[float]]] = {}
    spec: dict[str, dict[str, object]] = {
        "elastomer": {"kind": "power", "n": n},
        "surface": {"length": 1.0},
        "grid": {"points": points},
    }
    for seed in range(seeds):
        surface = SelfAffine(cutoff=SHORTEST, rolloff=ROLLOFF, hurst=hurst, h_std=1e-3, seed=seed)
        heights = surface.heights(points)
        loads = pressures(heights, spec, P_STARS)
        true = contacts(heights, spec, loads)
        for name, halvings in product(maps, HALVINGS):
            seen = MAPS[name](heights, round(2 / SHORTEST) >> halvings)
            keys = {"length": 1.0, "lateral_period_limit": SHORTEST * 2**halvings}
            row = ratios(contacts(seen, spec | {"surface": keys}, loads), true)
            rows.setdefault((name, halvings), []).append(row)
    for (name, halvings), values in rows.items():
        mean, deviation = np.mean(values, axis=0), np.std(values, axis=0, ddof=1)
        texts = (f"{m:.2f} ({100 * d:.0f})" for m, d in zip(mean, deviation, strict=True))
        print(f"{hurst:3g} {name:11} {halvings}", *texts, flush=True)


def scan(path: Path) -> str:
    """The ratios for the middle of a scan without warnings, from the means of 2 x 2 pixels."""
    surface = read_scan(path, ())
    measured, spacing = surface.measured_map() or (np.ma.zeros(0), (0.0,))
    about = [each for each in surface.warnings("free") if "length" not in each]
    if measured.ndim != 2 or min(measured.shape) < SCANNED or measured.mask.any() or about:
        return "left out"
    middle = tuple(slice((n - SCANNED) // 2, (n + SCANNED) // 2) for n in measured.shape)
    heights = np.array(measured[middle])
    length = SCANNED * spacing[-1]
    spec: dict[str, dict[str, object]] = {
        "elastomer": {"kind": "half-space"},
        "surface": {"length": length, "periodic": False, "level": "plane"},
        "grid": {"points": SCANNED},
    }
    loads = pressures(heights, spec, P_STARS)
    halved = contacts(means(heights, SCANNED // 2), spec, loads)
    return " ".join(f"{ratio:.2f}" for ratio in ratios(halved, contacts(heights, spec, loads)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--points", type=int, nargs="+", default=[1024])
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--hurst", type=float, nargs="+", default=HURST)
    parser.add_argument("--n", type=float, nargs="+", default=[1.0])
    parser.add_argument("--maps", nargs="+", choices=MAPS, default=list(MAPS))
    parser.add_argument("--leakage", action="store_true", help="print the factors of blurred maps")
    parser.add_argument("--scans", type=Path, help="a folder of microscope files instead")
    arguments = parser.parse_args()
    if arguments.leakage:
        leakage()
        return
    if arguments.scans is not None:
        for path in sorted(arguments.scans.iterdir()):
            try:
                print(path.name, scan(path), flush=True)
            except InputError as error:
                print(path.name, error)
        return
    for n, points in product(arguments.n, arguments.points):
        print(
            f"n = {n:g}, {points}^2: H, map, halvings: factor, ratios of Delta_sigma, a_r and gap"
        )
        print("p* =".rjust(33), *(f"{p_star:15g}" for p_star in P_STARS), flush=True)
        for hurst in arguments.hurst:
            random_surfaces(n, points, hurst, arguments.seeds, arguments.maps)


if __name__ == "__main__":
    main()
