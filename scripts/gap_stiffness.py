"""Contact stiffness over mean gap, and percolation of the gap: docs/contact_stiffness.md.

Reads the studies `stiffness`, `surfaces`, `percolation` and `thresholds` of
scripts/theory_studies.py, prints tables and draws two figures.

python scripts/gap_stiffness.py --folder results/theory --figures docs/figures
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from gamma_fit import GAMMA, mean_gap, smooth, spread
from markdown_tables import print_table
from theory_studies import EXPONENTS, LADDER, SHOWN, TRAINING, run_with_studies

from gfmd_cli.analysis.compare import Curve, compare
from gfmd_cli.analysis.curve_styles import MARKERS, CurveStyle, colours
from gfmd_cli.analysis.plotting import ColumnFigure, styled
from gfmd_cli.analysis.selection import grouped
from gfmd_cli.physics import einstein_solid
from gfmd_cli.physics.discretisation_error import AREA_EXCESS, MAX_AREA_EXPONENT
from gfmd_cli.physics.persson import Shells, gamma_n

GRIDS = (256, 512, 1024)
GRID = 512
P_STAR = np.array(LADDER)
DIFFERENCES = (0.2, 0.6)
"""p* from and to which differences of u_g are compared with the stiffness."""
ALL_EXPONENTS = [0.0, *EXPONENTS]
Curves = dict[tuple[float, int, int], Curve]
"""By n, points a side and seed."""


def by_grid(curves: Sequence[Curve]) -> Curves:
    return {(c.n, int(c.rows[0]["points"]), int(c.rows[0]["seed"])): c for c in curves}


def surface_of(curve: Curve) -> tuple[str, float]:
    return curve.rows[0]["spectrum"], curve.rows[0]["hurst"]


def column(curves: Curves, n: float, name: str, points: int = GRID) -> np.ndarray:
    """Of all seeds of one grid: seeds, pressures."""
    seeds = {seed: curve for (m, side, seed), curve in curves.items() if (m, side) == (n, points)}
    return np.array([seeds[seed].column(name) for seed in sorted(seeds)])


def compliance(curves: Curves, n: float, points: int = GRID) -> np.ndarray:
    """-d u_g / d ln p = p / kappa in units of h_std."""
    return P_STAR / column(curves, n, "stiffness", points)


def theory_compliance(shells: Shells, gamma: float, p_star: np.ndarray = P_STAR) -> np.ndarray:
    step = 1e-3
    ends = [mean_gap(shells, gamma, p_star * np.exp(sign * step)) for sign in (1, -1)]
    return (ends[1] - ends[0]) / (2 * step)


def exact_springs_compliance(p_star: np.ndarray) -> np.ndarray:
    """p (1 - a_r) / (k a_r), of springs k (1 - mean) under Gaussian heights, Eqs. (34)-(38)."""
    a_r = einstein_solid.contact_area(einstein_solid.non_contact_height(p_star))
    return np.asarray(p_star * (1 - a_r) / a_r)


def print_stiffness(curves: Curves) -> None:
    places = [int(np.argmin(np.abs(P_STAR - p))) for p in SHOWN]
    rows = []
    for n in ALL_EXPONENTS:
        u_g, u_0 = column(curves, n, "u_g"), compliance(curves, n)
        shells = curves[n, GRID, TRAINING[0]].persson.shells
        theories = [
            theory_compliance(shells, float(np.squeeze(gamma(n))))
            for gamma in (gamma_n, lambda n: smooth(n, *GAMMA))
        ]
        if n == 0:
            theories.append(exact_springs_compliance(P_STAR))
        coarse, fine = compliance(curves, n, 256), compliance(curves, n, 1024)
        for i in places:
            changes = [
                np.log(coarse[:, i] / u_0[: len(coarse), i]),
                np.log(fine[:, i] / u_0[: len(fine), i]),
            ]
            rows.append(
                [
                    f"{n:g}",
                    f"{P_STAR[i]:g}",
                    "{:.4f} ± {:.4f}".format(*spread(u_g[:, i])),
                    "{:.4f} ± {:.4f}".format(*spread(u_0[:, i])),
                    f"{P_STAR[i] / u_0[:, i].mean():.3f}",
                    " / ".join(f"{100 * change.mean():+.1f} %" for change in changes),
                    *(f"{theory[i]:.3f}" for theory in theories),
                ]
            )
    heads = [
        "n",
        "p*",
        "u_g",
        "u_0",
        "kappa",
        "256, 1024 against 512",
        "Eq. (39)",
        "fitted",
        "exact",
    ]
    print_table("Mean gap [h_std] and u_0 = p / kappa [h_std]", heads, rows)


def print_surfaces(path: Path) -> None:
    """u_0 of two more surfaces, and the error of Eq. (39) in brackets."""
    groups = grouped(compare(path).curves, lambda c: (*surface_of(c), c.n))
    rows = []
    for key, group in sorted(groups.items()):
        p_star, shells = group[0].column("p_star"), group[0].persson.shells
        u_0 = np.array([p_star / curve.column("stiffness") for curve in group])
        theory = theory_compliance(shells, float(np.squeeze(gamma_n(key[2]))), p_star)
        cells = [
            "{:.3f} ± {:.3f}".format(*spread(u_0[:, i])) + f" ({100 * (ratio - 1):+.0f} %)"
            for i, ratio in enumerate(theory / u_0.mean(axis=0))
        ]
        rows.append([*(f"{one}" for one in key), *cells])
    heads = ["spectrum", "H", "n", *(f"p* = {p:g}" for p in SHOWN)]
    print_table("u_0 [h_std] of other surfaces (error of Eq. (39))", heads, rows)


def print_differences(curves: Curves) -> None:
    """-dp/du_g against differences of u_g between neighbouring pressures."""
    low, high = DIFFERENCES
    title = f"u_g(p_i) - u_g(p_i+1) over the integral of 1/kappa dp, p* = {low:g} to {high:g}"
    print(f"\n{title}, all seeds")
    for n in ALL_EXPONENTS:
        u_g, kappa = column(curves, n, "u_g"), column(curves, n, "stiffness")
        pairs = [i for i in range(P_STAR.size - 1) if low <= P_STAR[i] and P_STAR[i + 1] <= high]
        ratios = []
        for i in pairs:
            step = np.log(P_STAR[i + 1] / P_STAR[i])
            ends = [P_STAR[j] / kappa[:, j] for j in (i, i + 1)]
            ratios.append((u_g[:, i] - u_g[:, i + 1]) / (step * (ends[0] + ends[1]) / 2))
        print(
            f"n = {n:g}: {np.mean(ratios):.4f}, from {np.min(ratios):.4f} to {np.max(ratios):.4f}"
        )


def areas(curves: Curves, n: float, points: int) -> np.ndarray:
    """Contact areas without the excess of the grid (docs/error_estimates.md), where it is known."""
    counted = column(curves, n, "a_r", points)
    if n > MAX_AREA_EXPONENT:
        return counted
    return np.asarray(counted - AREA_EXCESS * n * column(curves, n, "perimeter", points) / points)


def thresholds(curves: Curves, n: float, points: int, values: np.ndarray) -> np.ndarray:
    """Values at which the gap stops percolating: seeds, directions.

    The middle of the two pressures between which the last change occurs.
    """
    ends = np.empty((len(values), 2))
    for place, name in enumerate(("percolates_x", "percolates_y")):
        for seed, percolates in enumerate(column(curves, n, name, points)):
            last = np.flatnonzero(percolates == 1)[-1]
            ends[seed, place] = (values[seed, last] + values[seed, last + 1]) / 2
    return ends


def print_percolation(curves: Curves) -> None:
    rows = []
    for n in ALL_EXPONENTS:
        cells = [f"{n:g}"]
        for points in GRIDS:
            counted, corrected = column(curves, n, "a_r", points), areas(curves, n, points)
            common = slice(0, len(column(curves, n, "a_r", GRIDS[-1])))  # seeds of all grids
            ends = [thresholds(curves, n, points, a)[common].mean() for a in (counted, corrected)]
            cells.append("{:.3f} ({:.3f})".format(*ends))
        values = areas(curves, n, GRID), *(column(curves, n, name) for name in ("u_g", "p_star"))
        for each in values:
            ends = thresholds(curves, n, GRID, each)
            cells.append("{:.3f} ± {:.3f}".format(*spread(ends.mean(axis=1))))
        rows.append(cells)
    heads = ["n", *(f"{points}^2" for points in GRIDS), "a_r, 512^2, 16 seeds", "u_g", "p*"]
    print_table("Where the gap stops percolating: a_r counted (corrected)", heads, rows)


def print_on_four_grids(curves: Curves) -> None:
    """Where the gap stops percolating on finer and finer grids, mean over seeds and directions."""
    grids = sorted({points for _, points, _ in curves})
    rows = []
    for n in sorted({n for n, _, _ in curves}):
        for name in ("p_star", "a_r", "a_r_continuum", "a_r_continuum_error", "u_g"):
            cells = []
            for points in grids:
                ends = thresholds(curves, n, points, column(curves, n, name, points))
                cells.append("{:.3f} ± {:.3f}".format(*spread(ends.mean(axis=1))))
            rows.append([f"{n:g}", name, *cells])
    heads = ["n", "", *(f"{points}^2" for points in grids)]
    print_table("Where the gap stops percolating, 4 seeds", heads, rows)


def print_on_surfaces(path: Path) -> None:
    """Where the gap stops percolating on several surfaces, mean over seeds and directions."""
    rows = []
    for key, group in grouped(compare(path).curves, surface_of).items():
        curves = by_grid(group)
        for n in sorted({c.n for c in group}):
            cells = [f"{one}" for one in (*key, n, sum(c.n == n for c in group))]
            for values in (areas(curves, n, GRID), column(curves, n, "p_star")):
                ends = thresholds(curves, n, GRID, values).mean(axis=1)
                cells.append("{:.3f} ± {:.3f}".format(*spread(ends)))
            rows.append(cells)
    heads = ["spectrum", "H", "n", "seeds", "a_r", "p*"]
    print_table("Where the gap stops percolating, other surfaces and seeds, 512^2", heads, rows)


def draw(curves: Curves, folder: Path) -> None:
    with styled():
        plot = ColumnFigure(
            "mean gap  $u_g/h_{std}$", "stiffness  $\\kappa h_{std}/\\Delta\\sigma$"
        )
        for place, n in enumerate(ALL_EXPONENTS):
            style = CurveStyle(colours(6)[place], MARKERS[place], f"n = {n:g}")
            u_g, kappa = (column(curves, n, name).mean(axis=0) for name in ("u_g", "stiffness"))
            plot.points(style, u_g, kappa)
            plot.axes.plot(u_g, kappa, color=style.colour, lw=0.8)
        plot.axes.set(yscale="log", xlim=(0, None))
        plot.write(folder / "gap_stiffness")[0].unlink()  # docs show the PNG
        plot = ColumnFigure("relative contact area  $a_r$", "share with open gap")
        for place, n in enumerate(n for n in ALL_EXPONENTS if n <= MAX_AREA_EXPONENT):
            style = CurveStyle(colours(6)[place], MARKERS[place], f"n = {n:g}")
            share = np.mean([column(curves, n, f"percolates_{axis}") for axis in "xy"], axis=(0, 1))
            a_r = areas(curves, n, GRID).mean(axis=0)
            plot.points(style, a_r, share)
            plot.axes.plot(a_r, share, color=style.colour, lw=0.8)
        plot.axes.set(xlim=(0.15, 0.7), ylim=(-0.05, 1.05))
        plot.write(folder / "gap_percolation")[0].unlink()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--folder", type=Path, default=Path("results/theory"))
    parser.add_argument("--figures", type=Path, default=Path("docs/figures"))
    arguments = parser.parse_args()
    curves = by_grid(compare(arguments.folder / "stiffness.h5").curves)
    print_stiffness(curves)
    print_surfaces(arguments.folder / "surfaces.h5")
    print_differences(curves)
    print_percolation(curves)
    print_on_four_grids(by_grid(compare(arguments.folder / "percolation.h5").curves))
    print_on_surfaces(arguments.folder / "thresholds.h5")
    draw(curves, arguments.figures)


if __name__ == "__main__":
    run_with_studies(main, "python scripts/theory_studies.py")
