"""Noise in measured maps: its effect on a contact, and which maps the program warns of.

    python scripts/noise_of_maps.py [contacts | sound | noisy]

"contacts": errors of contacts on the half-space, as `rounded_heights.py`. "sound": random and
structured surfaces without noise. "noisy": random surfaces with noise. The tables of
docs/map_evidence.md.
"""

import argparse
from collections.abc import Iterator
from functools import partial
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rounded_heights import POINTS_PER_WAVE, results
from scipy.ndimage import gaussian_filter, gaussian_filter1d, grey_dilation, uniform_filter

from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.elastomers import HalfSpace
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine

LEVELS = (0.3, 0.5, 0.7, 1.0, 2.0, 3.0, 10.0)
"""Difference of neighbours due to noise, over that of the surface, both rms along x."""
HURST = (0.1, 0.3, 0.5, 0.8, 1.0)
NOISE = ("white noise of", "random offsets of")
ALL = (*NOISE, "as much as distant ones", "lines along x are shifted")
"""Words of the warnings about noise; the last two are those of noise that is stronger still."""
NESTING = 5  # points: nesting index of the filter
ALPHA = np.sqrt(np.log(2) / np.pi)  # of ISO 16610-61
CORRELATED = 20  # points along a line: noise of low frequency


def scan(points: int, hurst: float, rolloff: float, cutoff: float, seed: int) -> Field:
    """A quarter of a random surface; wavelengths are in units of its side, and in points."""
    cell = SelfAffine(
        hurst=hurst, rolloff=rolloff / 2, cutoff=cutoff / (2 * points), seed=seed
    ).heights(2 * points)
    heights: Field = np.array(cell[:points, :points])
    return (heights - heights.mean()) / heights.std()


def white(heights: Field, level: float, random: np.random.Generator) -> Field:
    """Heights with white noise."""
    return heights + noise_like(heights, level) * random.normal(size=heights.shape)


def of_lines(heights: Field, level: float, random: np.random.Generator) -> Field:
    """Heights with an offset of each line."""
    return heights + noise_like(heights, level) * random.normal(size=(len(heights), 1))


def slow(heights: Field, level: float, random: np.random.Generator) -> Field:
    """Heights with noise that is correlated along a line, but not between lines."""
    noise = gaussian_filter1d(random.normal(size=heights.shape), CORRELATED, axis=1)
    return heights + noise_like(heights, level) * noise / noise.std()


def noise_like(heights: Field, level: float) -> float:
    """Standard deviation of noise of this level."""
    return level * float(np.diff(heights, axis=1).std()) / np.sqrt(2)


NOISES = {"white": white, "offsets of lines": of_lines, f"over {CORRELATED} points": slow}


def warned(heights: Field, folder: Path, words: tuple[str, ...]) -> bool:
    """Whether a warning about a map has one of these words."""
    path = folder / f"{abs(hash(heights.tobytes()))}.npy"
    np.save(path, heights)
    found = " ".join(FileSurface(path=path, length=1.0, periodic=False).warnings())
    path.unlink()
    return any(each in found for each in words)


def filtered(heights: Field) -> Field:
    """Periodic heights without the shortest waves, by the Gaussian filter of ISO 16610-61."""
    return np.array(gaussian_filter(heights, ALPHA / np.sqrt(2 * np.pi) * NESTING, mode="wrap"))


def contacts(seeds: int, sizes: list[int]) -> None:
    """Errors of gradient, contact area, mean gap and sigma_p due to white noise."""
    for points in sizes:
        print(f"{points}^2: level, errors of gradient, a_r, mean gap, sigma_p; those with a filter")
        rows = []
        for seed in range(seeds):
            surface = SelfAffine(cutoff=POINTS_PER_WAVE / points, seed=seed)
            scene = build_scene(surface, HalfSpace(), points)
            exact, random = results(scene, scene.height), np.random.default_rng(seed)
            for level in (0.0, *LEVELS):
                noisy = white(scene.height, level, random)
                rows.append([results(scene, each) / exact for each in (noisy, filtered(noisy))])
        means = np.mean(np.reshape(rows, (seeds, 1 + len(LEVELS), 8)), axis=0) - 1
        for level, mean in zip((0.0, *LEVELS), means, strict=True):
            print(f"{level:5.1f}" + "".join(f"{value:8.1%}" for value in mean))


def surfaces(points: int, seed: int) -> Iterator[tuple[str, Field]]:
    """Surfaces without noise."""
    random = np.random.default_rng([points, seed])
    y, x = np.mgrid[:points, :points] / points
    tip = -0.02 * (np.mgrid[-3:4, -3:4] ** 2).sum(axis=0)
    for hurst in HURST:
        rolloff, cutoff = random.choice([1, 0.5, 0.2]), random.choice([2, 3, 4, 8, 16])
        rough = scan(points, hurst, rolloff, cutoff, seed)
        waves = np.sin(2 * np.pi * random.integers(1, 11) * x + 1)
        steps = np.floor(random.choice([3, 7]) * x + random.choice([0, 2]) * y)
        pillars = (np.floor(8 * x) % 2) * (np.floor(8 * y) % 2)
        yield "random", rough
        yield "points of a finer surface", scan(4 * points, hurst, 2, 2, seed)[::4, ::4]
        yield "mean of 2 x 2 points", uniform_filter(rough, 2)
        yield "seen with a round tip", grey_dilation(rough, structure=tip)
        yield "on a sphere", rough - 20 * ((x - 0.5) ** 2 + (y - 0.5) ** 2)
        yield "on waves", rough + random.choice([3, 10, 50]) * waves
        yield "on steps", rough + random.choice([3, 30]) * steps
        yield "on pillars", rough + random.choice([3, 30]) * pillars
        yield "grooves", np.tile(rough[0], (points, 1)) + 0.1 * rough
        yield "worn", rough.clip(max=random.choice([0, 0.5, 1]))
        yield "exponential", np.exp(rough)
        yield "rounded", np.round(40 * rough)


def sound(seeds: int, sizes: list[int], folder: Path) -> None:
    """Numbers of sound maps, and of those with a warning, of each kind."""
    counts: dict[str, list[int]] = {}
    for points, seed in product(sizes, range(seeds)):
        for name, heights in surfaces(points, seed):
            number = counts.setdefault(name, [0, 0])
            number[0] += 1
            number[1] += warned(heights, folder, NOISE)
    for name, (number, found) in counts.items():
        print(f"{name:36}{number:6}{found:6}")


def with_noise(seeds: int, sizes: list[int], folder: Path) -> None:
    """Fraction of noisy maps with a warning."""
    for (name, add), points in product(NOISES.items(), sizes):
        print(f"{name}, {points}^2: H, lambda_s in points; level " + " ".join(map(str, LEVELS)))
        for hurst, cutoff in product((0.3, 0.5, 0.8, 1.0), (2, 8)):
            found = [
                np.mean(
                    [
                        warned(add(surface(seed), level, np.random.default_rng(seed)), folder, ALL)
                        for seed in range(seeds)
                    ]
                )
                for surface in [partial(scan, points, hurst, 0.5, cutoff)]
                for level in LEVELS
            ]
            print(f"{hurst:4}{cutoff:4}" + "".join(f"{value:6.0%}" for value in found), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("tables", nargs="*", default=["contacts", "sound", "noisy"])
    parser.add_argument("--points", type=int, nargs="+", default=[128, 256])
    parser.add_argument("--seeds", type=int, default=8)
    arguments = parser.parse_args()
    with TemporaryDirectory() as folder:
        for table in arguments.tables:
            if table == "contacts":
                contacts(arguments.seeds, arguments.points)
            else:
                {"sound": sound, "noisy": with_noise}[table](
                    arguments.seeds, arguments.points, Path(folder)
                )


if __name__ == "__main__":
    main()
