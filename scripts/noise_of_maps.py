"""Noise in measured maps: its effect on a contact, and which maps the program warns of.

    python scripts/noise_of_maps.py [contacts | filters | sound | noisy | profiles]

"contacts": errors of contacts on the half-space, as `rounded_heights.py`. "filters": contact areas
of noisy maps with the S-filter that the warning names. "sound": random and structured surfaces
without noise. "noisy": random surfaces with noise. "profiles": line profiles without and with
noise. The tables of docs/map_evidence.md.
"""

import argparse
import re
import warnings
from collections.abc import Iterator
from functools import partial
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from rounded_heights import POINTS_PER_WAVE, results
from scipy.ndimage import gaussian_filter1d, grey_dilation, uniform_filter

from gfmd_cli.api import Result, solve
from gfmd_cli.grid.arrays import Field
from gfmd_cli.maps.gaussian_filter import gaussian_filter
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
CUTOFF = 5  # points: cut-off wavelength of the S-filter
FACTORS = (1.0, 1.5)  # of the cut-off wavelength that the warning names
P_STAR = 0.03  # of the map without noise
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


def warnings_about(heights: Field, folder: Path) -> str:
    """The warnings about a map with a spacing of 1 m, one after the other."""
    path = folder / f"{abs(hash(heights.tobytes()))}.npy"
    np.save(path, heights)
    surface = FileSurface(path=path, length=float(heights.shape[-1]), periodic=False)
    text = " ".join(surface.warnings())
    path.unlink()
    return text


def warned(heights: Field, folder: Path, words: tuple[str, ...]) -> bool:
    """Whether a warning about a map has one of these words."""
    text = warnings_about(heights, folder)
    return any(each in text for each in words)


def contacts(seeds: int, sizes: list[int], _: Path) -> None:
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
                filtered = gaussian_filter(noisy, (1.0, 1.0), CUTOFF, periodic=True)
                rows.append([results(scene, each) / exact for each in (noisy, filtered)])
        means = np.mean(np.reshape(rows, (seeds, 1 + len(LEVELS), 8)), axis=0) - 1
        for level, mean in zip((0.0, *LEVELS), means, strict=True):
            print(f"{level:5.1f}" + "".join(f"{value:8.1%}" for value in mean))


def pressed(heights: Field, load: dict[str, float], s_filter: float | None = None) -> Result:
    """The contact of a scan with a spacing of 1 m."""
    tables = {
        "surface": {"length": float(heights.shape[-1]), "periodic": False, "s_filter": s_filter},
        "elastomer": {"kind": "half-space"},
        "solver": {"kind": "dual", "tolerance": 1e-4},
        "load": load,
    }
    with warnings.catch_warnings(action="ignore"):
        return solve(tables, heights=heights)


def filters(seeds: int, sizes: list[int], folder: Path) -> None:
    """Errors of the contact area with and without the filter that the warning names."""
    for points in sizes:
        print(
            f"{points}^2: H, lambda_s in points, level, noticed, cut-off in points; errors of a_r"
        )
        print(f"without a filter, and with {FACTORS} of the cut-off: mean, and largest; between")
        for hurst, cutoff, level in product((0.3, 0.5, 0.8), (2, 4, 8), (1.0, 2.0, 3.0)):
            rows = []
            for seed in range(seeds):
                sound = 1e-3 * scan(points, hurst, 0.5, cutoff, seed)
                noisy = white(sound, level, np.random.default_rng(seed))
                stated = re.search(r"s_filter = (\S+) or more", warnings_about(noisy, folder))
                if not stated:
                    continue
                s_filter = float(stated[1])
                exact = pressed(sound, {"p_star": P_STAR})
                load = {"pressure": exact.nominal_pressure}
                used = (None, *(factor * s_filter for factor in FACTORS))
                areas = [pressed(noisy, load, each).a_r for each in used]
                rows.append([s_filter, *(np.array(areas) / exact.a_r - 1)])
            text = f"{hurst:5}{cutoff:4}{level:5}{len(rows):4}"
            if rows:
                stated, *errors = np.array(rows).T
                between = np.mean((errors[1] < 0) & (errors[2] > 0))
                text += f"{stated.mean():6.1f}" + "".join(
                    f"{each.mean():8.0%}{each[np.abs(each).argmax()]:6.0%}" for each in errors
                )
                text += f"{between:7.0%}"
            print(text, flush=True)


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
    for name, (number, with_warning) in counts.items():
        print(f"{name:36}{number:6}{with_warning:6}")


def random_profile(
    points: int, hurst: float, rolloff: float, cutoff: float, random: np.random.Generator
) -> Field:
    """Half of a periodic random profile, with wavelengths as in `scan`."""
    q = np.fft.rfftfreq(2 * points)
    amplitude = np.maximum(q, 1 / (rolloff * points)) ** (-0.5 - hurst) * (q <= 1 / cutoff)
    modes = amplitude * (random.normal(size=q.size) + 1j * random.normal(size=q.size))
    heights: Field = np.fft.irfft(modes, 2 * points)[:points]
    return (heights - heights.mean()) / heights.std()


def profiles(points: int, random: np.random.Generator) -> Iterator[tuple[str, Field]]:
    """Line profiles without noise."""
    x, tip = np.arange(points) / points, -0.02 * np.arange(-3, 4) ** 2
    for hurst in HURST:
        rolloff, cutoff = random.choice([1, 0.5, 0.2]), random.choice([2, 3, 4, 8, 16])
        rough = random_profile(points, hurst, rolloff, cutoff, random)
        grooves = ((np.arange(points) / random.choice([6, 10, 25, 60]) + 0.3) % 1 - 0.5) ** 2
        yield "random", rough
        yield "points of a finer profile", random_profile(8 * points, hurst, 2, 2, random)[::8]
        yield "mean of 2 points", uniform_filter(rough, 2)
        yield "seen with a round tip", grey_dilation(rough, structure=tip)
        yield "on a bow", rough - 20 * (x - 0.5) ** 2
        yield "on waves", rough + random.choice([3, 10, 50]) * np.sin(20 * x)
        yield "on steps", rough + random.choice([3, 30]) * np.floor(random.choice([3, 7]) * x)
        yield "worn", rough.clip(max=random.choice([0, 0.5, 1]))
        yield "turned", 3 * grooves + random.choice([0.05, 0.3]) * rough
        yield "plateau-honed", np.where(rough < -1, 3 * rough, 0.1 * rough)


def of_profiles(seeds: int, sizes: list[int], folder: Path) -> None:
    """Numbers of sound profiles, and of those with a warning; fraction of noisy ones with one."""
    for points in sizes:
        random, counts = np.random.default_rng(points), dict[str, list[bool]]()
        for _ in range(seeds):
            for name, heights in profiles(points, random):
                counts.setdefault(name, []).append(warned(heights, folder, NOISE))
        print(f"{points} points without noise")
        for name, each in counts.items():
            print(f"{name:36}{len(each):6}{sum(each):6}")
        for level in LEVELS:
            answers = []
            for _, hurst in product(range(seeds), HURST[1:]):
                sound = random_profile(points, hurst, 0.5, 8, random)
                noise = noise_like(sound[None], level) * random.normal(size=points)
                answers.append(warned(sound + noise, folder, NOISE))
            print(f"noise {level:5}: {np.mean(answers):.0%}", flush=True)


def with_noise(seeds: int, sizes: list[int], folder: Path) -> None:
    """Fraction of noisy maps with a warning."""
    for (name, add), points in product(NOISES.items(), sizes):
        print(f"{name}, {points}^2: H, lambda_s in points; level " + " ".join(map(str, LEVELS)))
        for hurst, cutoff in product((0.3, 0.5, 0.8, 1.0), (2, 8)):
            fractions = [
                np.mean(
                    [
                        warned(add(surface(seed), level, np.random.default_rng(seed)), folder, ALL)
                        for seed in range(seeds)
                    ]
                )
                for surface in [partial(scan, points, hurst, 0.5, cutoff)]
                for level in LEVELS
            ]
            cells = "".join(f"{value:6.0%}" for value in fractions)
            print(f"{hurst:4}{cutoff:4}{cells}", flush=True)


TABLES = {
    "contacts": contacts,
    "filters": filters,
    "sound": sound,
    "noisy": with_noise,
    "profiles": of_profiles,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("tables", nargs="*", choices=[[], *TABLES], default=[])
    parser.add_argument("--points", type=int, nargs="+", default=[128, 256])
    parser.add_argument("--seeds", type=int, default=8)
    arguments = parser.parse_args()
    with TemporaryDirectory() as folder:
        for table in arguments.tables or TABLES:
            TABLES[table](arguments.seeds, arguments.points, Path(folder))


if __name__ == "__main__":
    main()
