"""Cost of a solve in pairs of transforms of its grid, by pressure and by grid: table and figures.

    python scripts/cost.py                  # the table and both figures of docs/performance.md
    python scripts/cost.py --table-only --points 1024

One thread, processor seconds; the least of some repeats counts, of a pair of transforms as of a
solve. Default surface with lambda_s / L = 0.02, natural residual 1e-4. The lower limit of the
figures is one pair of transforms, which shows the residual of a solution that is known, and the
preparation of the surface.
"""

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from markdown_tables import print_head, print_row
from matplotlib.ticker import NullLocator
from timing import least

from gfmd_cli.analysis.curve_styles import MARKERS, CurveStyle, colours
from gfmd_cli.analysis.figures import P_STAR
from gfmd_cli.analysis.plotting import ColumnFigure, styled
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.contact import Scene
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import solve_contact

SURFACE = SelfAffine(cutoff=0.02)
EXPONENTS = (0.5, 1.0, 2.0, 3.0)
PRESSURES = (1e-3, 1e-2, 0.1)
Curves = dict[str, tuple[np.ndarray, np.ndarray]]
COSTS = "processor time [pairs of transforms]"


@dataclass
class Cost:
    """What a solve takes."""

    counted: float
    """Pairs of transforms of the grid, those in single precision as half a pair."""
    time: float
    """Processor time of the whole solve over that of a pair of transforms in double precision."""


def pair_of(grid: Grid) -> float:
    """Processor seconds of a pair of transforms of a grid."""
    grid.padded[...] = 0.0
    return least(lambda: (grid.transform(), grid.transform_back()), 9)


def cost(scene: Scene, p_star: float, pair: float, repeats: int) -> Cost:
    """The cost of one contact."""
    contact, solver = scene.contact(p_star), Auto(tolerance=1e-4)
    transforms = solve_contact(contact, solver).transforms
    return Cost(transforms / 2, least(lambda: solve_contact(contact, solver), repeats) / pair)


def preparation(points: int, pair: float, repeats: int) -> float:
    """Processor time to draw the surface and reduce the problem, in pairs of transforms."""
    return least(lambda: build_scene(SURFACE, Power(n=1), points), repeats) / pair


def table(points: int, repeats: int) -> None:
    """Print the pairs counted, the time taken and their ratio."""
    pair = pair_of(Grid(points))
    print(f"{points}^2: a pair of transforms takes {1e3 * pair:.1f} ms; the preparation of the")
    print(f"surface takes {preparation(points, pair, repeats):.1f} pairs\n")
    print_head("n", *(f"$p^\\ast$ = {p:g}" for p in PRESSURES))
    for n in EXPONENTS:
        scene = build_scene(SURFACE, Power(n=n), points)
        costs = [cost(scene, p, pair, repeats) for p in PRESSURES]
        cells = (f"{c.counted:.1f} → {c.time:.0f} ({c.time / c.counted:.1f})" for c in costs)
        print_row(f"{n:g}", *cells)


def by_pressure(points: int, path: Path, repeats: int) -> None:
    """Draw the cost over the pressure, one curve for each exponent."""
    pair, pressures = pair_of(Grid(points)), np.geomspace(1e-4, 1.0, 9)
    curves = {}
    for n in EXPONENTS:
        scene = build_scene(SURFACE, Power(n=n), points)
        costs = [cost(scene, p, pair, repeats).time for p in pressures]
        curves[f"n = {n:g}"] = (pressures, np.array(costs))
    limit = np.full(pressures.size, 1 + preparation(points, pair, repeats))
    draw(P_STAR, curves, pressures, limit, path)


def by_grid(sizes: list[int], path: Path, repeats: int) -> None:
    """Draw the cost at n = 1 over the grid, one curve for each pressure."""
    scenes = {points: build_scene(SURFACE, Power(n=1), points) for points in sizes}
    pairs = {points: pair_of(Grid(points)) for points in sizes}
    curves = {}
    for p in PRESSURES:
        costs = [cost(scene, p, pairs[points], repeats).time for points, scene in scenes.items()]
        curves[f"$p^*$ = {p:g}"] = (np.array(sizes), np.array(costs))
    limit = np.array([1 + preparation(points, pairs[points], repeats) for points in sizes])
    draw("points along a side", curves, np.array(sizes), limit, path)


def draw(label: str, curves: Curves, x: np.ndarray, limit: np.ndarray, path: Path) -> None:
    """Write a PNG, and print its values."""
    with styled():
        plot = ColumnFigure(label, COSTS)
        for place, (name, (at, values)) in enumerate(curves.items()):
            style = CurveStyle(colours(len(curves))[place], MARKERS[place], name)
            plot.axes.plot(at, values, color=style.colour, lw=0.7)
            plot.points(style, at, values)
            print(f"{name}: " + ", ".join(f"{value:.1f}" for value in values), flush=True)
        name = "preparation and one pair"
        plot.line(name, x, limit, color="0.4", ls=(0, (4, 2)), lw=0.9)
        print(f"{name}: " + ", ".join(f"{value:.1f}" for value in limit), flush=True)
        plot.axes.set(xscale="log", yscale="log")
        if path.name.endswith("grid"):
            plot.axes.set_xticks(x, [str(points) for points in x], minor=False)
            plot.axes.minorticks_off()
        ticks = (3, 5, 10, 20, 50, 100)
        plot.axes.set_yticks(ticks, [str(tick) for tick in ticks])
        plot.axes.yaxis.set_minor_locator(NullLocator())
        plot.write_file(path.with_suffix(".png"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--points", type=int, default=2048)
    parser.add_argument("--sizes", type=int, nargs="+", default=[256, 512, 1024, 2048, 4096])
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--figures", type=Path, default=Path("docs/figures"))
    parser.add_argument("--table-only", action="store_true")
    arguments = parser.parse_args()
    table(arguments.points, arguments.repeats)
    if not arguments.table_only:
        by_pressure(arguments.points, arguments.figures / "cost_by_pressure", arguments.repeats)
        by_grid(arguments.sizes, arguments.figures / "cost_by_grid", arguments.repeats)


if __name__ == "__main__":
    main()
