"""Contact of maps that do not resolve their roughness: the table of docs/map_evidence.md.

    python scripts/unresolved_roughness.py [--points 1024 2048 4096] [--seeds 4] [--n 0.5 1 2]

Self-affine surfaces on an elastomer k = q^n, whose shortest waves have one point of the map (a
halving of the shortest waves of the map, two points) or half a point (two halvings). The map has
the waves of two points and more ("sharp"), the means over its pixels, or the heights at its points
("sampled"). All contacts are solved on the same grid, the map interpolated as the program chooses,
at the pressure that is a given p* for the true surface. Printed are the mean over seeds of
`short_wave_factor`, of the ratio of Delta_sigma and, for each p*, of the ratios of contact area and
mean gap, of the map to the true surface; in brackets the standard deviation in the last digits.
"""

import argparse
from itertools import product

import numpy as np

from gfmd_cli.api import Result, solve
from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.self_affine import SelfAffine

HURST = (0.3, 0.5, 0.8, 1.0)
P_STARS = (0.003, 0.03, 0.3)
ROLLOFF, SHORTEST = 1 / 4, 1 / 256  # of the side
HALVINGS = (1, 2)


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


def contacts(heights: Field, n: float, pressures: list[float], points: int) -> list[Result]:
    """The contacts of a map of unit side on a grid."""
    spec = {
        "elastomer": {"kind": "power", "n": n},
        "surface": {"length": 1.0},
        "grid": {"points": points},
    }
    loads = ({"load": {"pressure": pressure}} for pressure in pressures)
    return [solve(spec | load, heights=heights) for load in loads]


def ratios(of_map: Result, true: Result) -> list[float]:
    """Ratios of contact areas and mean gaps."""
    return [of_map.a_r / true.a_r, of_map.columns["mean_gap"] / true.columns["mean_gap"]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--points", type=int, nargs="+", default=[2048])
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--hurst", type=float, nargs="+", default=HURST)
    parser.add_argument("--n", type=float, nargs="+", default=[1.0])
    arguments = parser.parse_args()
    for n, points in product(arguments.n, arguments.points):
        print(
            f"n = {n:g}, {points}^2: H, map, halvings: factor, ratios of Delta_sigma, a_r and gap"
        )
        print("p* =".rjust(30), *(f"{p_star:15g}" for p_star in P_STARS), flush=True)
        for hurst in arguments.hurst:
            rows: dict[tuple[str, int], list[list[float]]] = {}
            for seed in range(arguments.seeds):
                surface = SelfAffine(
                    cutoff=SHORTEST, rolloff=ROLLOFF, hurst=hurst, h_std=1e-3, seed=seed
                )
                heights = surface.heights(points)
                unit = contacts(heights, n, [1.0], points)[0].columns["delta_sigma"]
                pressures = [p_star * unit for p_star in P_STARS]
                true = contacts(heights, n, pressures, points)
                for instrument, halvings in product((sharp, means, sampled), HALVINGS):
                    seen = instrument(heights, round(2 / SHORTEST) >> halvings)
                    of_map = contacts(seen, n, pressures, points)
                    columns = of_map[0].columns
                    row = [columns["short_wave_factor"], columns["delta_sigma"] / unit]
                    for pair in zip(of_map, true, strict=True):
                        row += ratios(*pair)
                    rows.setdefault((instrument.__name__, halvings), []).append(row)
            for (name, halvings), values in rows.items():
                mean, deviation = np.mean(values, axis=0), np.std(values, axis=0)
                texts = (f"{m:.2f} ({100 * d:.0f})" for m, d in zip(mean, deviation, strict=True))
                print(f"{hurst:3g} {name:8} {halvings}", *texts, flush=True)


if __name__ == "__main__":
    main()
