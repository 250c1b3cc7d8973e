"""Maps that were interpolated to more points than were measured: which the program warns of.

    python scripts/interpolated_maps.py [--points 64 128 256] [--seeds 12] [--contacts]

The tables of docs/map_evidence.md: the fraction that `gfmd_cli.maps.misread` compares with
MIN_EXTREMA, of sound maps and of interpolated self-affine ones. "--contacts": contacts on the
half-space, too, of maps of which every second height was interpolated, and of blurred ones.
"""

import argparse
from collections.abc import Iterator
from itertools import product

import numpy as np
from markdown_tables import print_head, print_row
from noise_of_maps import scan, surfaces, white
from scipy.ndimage import gaussian_filter, map_coordinates, median_filter, uniform_filter, zoom
from seams_of_maps import sound as machined

from gfmd_cli.api import solve
from gfmd_cli.grid.arrays import Field
from gfmd_cli.maps.misread import MIN_EXTREMA, extrema
from gfmd_cli.physics.self_affine import SelfAffine

FIRST_SEED = 1000  # MIN_EXTREMA was chosen with smaller ones
HURST = (0.1, 0.3, 0.5, 0.7, 0.9)
ORDERS = {"nearest": 0, "bilinear": 1, "bicubic": 3}
FACTORS = (1.5, 2, 3)
BLURS = (1, 2, 4)  # points: standard deviation
NOISE = (0.1, 0.3, 1)  # as in `noise_of_maps.py`
POINTS, P_STAR = 256, 0.03  # of the contacts


def fraction(heights: Field) -> float:
    """The largest fraction along x or along y, the smaller one: both must be above the limit."""
    return min(max(each for _, each in extrema(lines)) for lines in (heights, heights.T))


def sound(points: int, seed: int) -> Iterator[tuple[str, Field]]:
    """Classes of maps on their own points, and their heights."""
    random = np.random.default_rng([points, seed])
    known = {"noise": surfaces(points, seed), "seams": machined(points, random)}
    for name, (_, heights) in ((name, each) for name, maps in known.items() for each in maps):
        yield f"surfaces of `scripts/{name}_of_maps.py`", heights
        levels = np.round(255 * (heights - heights.min()) / np.ptp(heights))
        yield f"surfaces of `scripts/{name}_of_maps.py`, 256 levels", levels
    for hurst in HURST:
        rough, smooth = (scan(points, hurst, 0.5, cutoff, seed) for cutoff in (2, 8))
        for width in BLURS:
            yield "self-affine, Gaussian blur of 1, 2 or 4 points", gaussian_filter(rough, width)
        for size in (3, 5):
            yield "self-affine, mean of 3² or 5² points", uniform_filter(rough, size)
            yield "self-affine, median of 3² or 5² points", median_filter(rough, size)
        for each, level in product((rough, smooth), NOISE):
            yield "self-affine, white noise of 0.1, 0.3 or 1", white(each, level, random)


def print_sound(sizes: list[int], seeds: range) -> None:
    fractions: dict[str, list[float]] = {}
    for points, seed in product(sizes, seeds):
        for name, heights in sound(points, seed):
            fractions.setdefault(name, []).append(fraction(heights))
    print_head("sound maps", "number", "warnings", "largest fraction")
    for name, each in fractions.items():
        warnings = np.count_nonzero(np.array(each) > MIN_EXTREMA)
        print_row(name, len(each), warnings, f"{max(each):.2f}")


def print_interpolated(sizes: list[int], seeds: range) -> None:
    number = len(sizes) * len(seeds) * len(HURST)
    print(f"\nSmallest fraction of {number} maps each, and part of them with a warning\n")
    print_head("interpolation", *(f"{factor} times the points" for factor in FACTORS))
    for (name, order), centred in product(ORDERS.items(), (True, False)):
        options, cells = {"order": order, "mode": "nearest", "grid_mode": centred}, []
        for factor in FACTORS:
            measured = (
                scan(int(np.ceil(points / factor)), hurst, 0.5, 2, seed)
                for points, seed, hurst in product(sizes, seeds, HURST)
            )
            fractions = np.array([fraction(zoom(each, factor, **options)) for each in measured])
            cells.append(f"{fractions.min():.2f}, {100 * np.mean(fractions > MIN_EXTREMA):.0f} %")
        print_row(f"{name}, {'sides' if centred else 'outer points'} kept", *cells)


def print_contacts(seeds: range) -> None:
    tables = {
        "surface": {"length": 1.0, "periodic": True, "interpolation": "fourier"},
        "elastomer": {"kind": "half-space"},
        "grid": {"points": 2 * POINTS},
    }
    halves, ratios = np.mgrid[:POINTS, :POINTS] / 2, dict[str, list[list[float]]]()
    for hurst, seed in product((0.5, 0.8), seeds):
        surface = SelfAffine(hurst=hurst, rolloff=0.5, cutoff=2 / POINTS, seed=seed)
        heights = 0.01 * np.array(surface.heights(POINTS))
        exact = solve(tables | {"load": {"p_star": P_STAR}}, heights=heights)
        load = {"pressure": exact.nominal_pressure}
        changed = {}
        for name in ("bilinear", "bicubic"):
            options = {"order": ORDERS[name], "mode": "grid-wrap"}
            changed[name] = map_coordinates(heights[::2, ::2], halves, **options)
        for width in BLURS:
            changed[f"blur of {width}"] = gaussian_filter(heights, width, mode="wrap")
        for name, each in changed.items():
            result = solve(tables | {"load": load}, heights=each)
            gap = result.u_g * result.h_std / (exact.u_g * exact.h_std)
            ratios.setdefault(name, []).append([result.a_r / exact.a_r, gap])
    print("\nContacts of changed maps over those of the maps\n")
    print_head("change", "contact area", "mean gap")
    for name, pairs in ratios.items():
        areas, gaps = np.transpose(pairs)
        print_row(name, *(f"{each.min():.2f} to {each.max():.2f}" for each in (areas, gaps)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--points", type=int, nargs="+", default=[64, 128, 256])
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--contacts", action="store_true", help="contacts, too, of three seeds")
    arguments = parser.parse_args()
    seeds = range(FIRST_SEED, FIRST_SEED + arguments.seeds)
    print_sound(arguments.points, seeds)
    print_interpolated(arguments.points, seeds)
    if arguments.contacts:
        print_contacts(seeds[:3])


if __name__ == "__main__":
    main()
