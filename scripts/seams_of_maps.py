"""Stitched scans and displaced lines: how many sound and damaged maps give a warning.

    python scripts/seams_of_maps.py [--points 64 128 256] [--seeds 20]

The table of docs/map_evidence.md. The surfaces are self-affine, plateau-honed, worn, turned, ground
and noisy. Maps are stitched of two tiles with an offset (without one only the warning of seams
counts, with one also the others about lines), or every second line is displaced by some points
(only the warning of this counts).
"""

import argparse
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from noise_of_maps import random_profile, scan, warned, white

from gfmd_cli.grid.arrays import Field

OFFSETS = (0.5, 1.0, 2.0, 3.0, 4.0)  # over the rms difference of neighbours
SEAM, ANY = ("as between tiles",), ("the lines along",)
"""Words of the warning that sound maps must not have, and of those about lines of stitched maps."""
DISPLACED = ("every second line along",)


def sound(points: int, random: np.random.Generator) -> Iterator[tuple[str, Field]]:
    """Surfaces as they are machined or worn."""
    y, x = np.mgrid[:points, :points]

    def rough(hurst: float, rolloffs: tuple[float, ...], cutoffs: tuple[float, ...]) -> Field:
        lengths = random.choice(rolloffs), random.choice(cutoffs)
        return scan(points, hurst, *lengths, int(random.integers(10**6)))

    for hurst in (0.2, 0.4, 0.6, 0.8, 1.0):
        yield "self-affine", rough(hurst, (1, 0.5, 0.2), (2, 4, 8, 16))
    for hurst in (0.5, 0.8):
        grooves = np.zeros((points, points))
        for slope in (0.5, -0.5):
            for _ in range(random.integers(6, 25)):
                place, width = random.uniform(-1, 2) * points, random.uniform(1.5, 6)
                distance = (y - slope * x - place) / width
                grooves -= random.exponential(3) * np.exp(-(distance**2) / 2)
        yield "plateau-honed", grooves + 0.2 * rough(hurst, (0.2,), (2, 4))
        heights = rough(hurst, (0.3,), (2, 4))
        plateaus = np.where(heights > 0, 0.1 * heights, heights)
        yield "worn", plateaus + 0.01 * rough(hurst, (0.2,), (2,))
        feed = random.uniform(8, 50)
        arcs = 3 * ((y / feed + random.random()) % 1 - 0.5) ** 2
        yield "turned", arcs + random.choice([0.03, 0.1, 0.3]) * heights
        lengths = random.choice([0.2, 1]), random.choice([2, 4, 8])
        profile = random_profile(points, hurst, *lengths, random)
        yield "ground", profile[:, None] + random.choice([0.1, 0.3]) * heights
        yield "noisy", white(rough(hurst, (0.5,), (8,)), random.choice([0.5, 1, 3]), random)


def stitched(heights: Field, random: np.random.Generator, offset: float) -> Field:
    """A map of two tiles."""
    seam = random.integers(len(heights) // 4, 3 * len(heights) // 4)
    shifted = heights.copy()
    shifted[seam:] += offset * np.diff(heights, axis=0).std()
    return shifted


def displaced(heights: Field, random: np.random.Generator, by: int) -> Field:
    """A map of which every second line is displaced along itself."""
    shifted = heights.copy()
    shifted[1::2] = np.roll(heights[1::2], by, axis=1)
    return shifted


DAMAGES = [
    (f"offset {offset}", partial(stitched, offset=offset), ANY if offset else SEAM)
    for offset in (0.0, *OFFSETS)
] + [(f"displaced by {by}", partial(displaced, by=by), DISPLACED) for by in (0, 1, 2)]
"""Name, what makes a damaged map of a sound one, and the words of the warnings that count."""


def main() -> None:
    """Print the fractions of maps with a warning, of all and of each kind."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--points", type=int, nargs="+", default=[64, 128, 256])
    parser.add_argument("--seeds", type=int, default=20)
    arguments = parser.parse_args()
    with TemporaryDirectory() as folder:
        for points in arguments.points:
            for damage, damaged, words in DAMAGES:
                answers: dict[str, list[bool]] = {}
                for seed in range(arguments.seeds):
                    random = np.random.default_rng([points, seed])
                    for name, heights in sound(points, random):
                        is_warned = warned(damaged(heights, random=random), Path(folder), words)
                        answers.setdefault(name, []).append(is_warned)
                kinds = ", ".join(f"{name} {np.mean(each):.1%}" for name, each in answers.items())
                every = np.concatenate(list(answers.values()))
                print(f"{points}^2, {damage}: {np.mean(every):.1%} of {len(every)}; {kinds}")


if __name__ == "__main__":
    main()
