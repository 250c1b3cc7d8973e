"""Transforms and processor time on other grids: odd numbers of points, oblong pixels.

    python scripts/grid_shapes.py
    python scripts/grid_shapes.py --without-v-cycle

Self-affine surface with a short-wavelength cut-off of L/50, one thread. Prints the table of
docs/solver_measurements.md; each entry has the numbers of transforms for the pressures, and the
processor seconds of the faster of two further solves.
"""

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from functools import partial

from markdown_tables import print_head, print_row
from timing import least

from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers import preconditioners
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import solve_contact

SHAPES = {  # points along x and y, length_y / L
    "512 × 512": (512, 512, 1.0),
    "512 × 256, pixels 1 : 2": (512, 256, 1.0),
    "512 × 128, pixels 1 : 4": (512, 128, 1.0),
    "500 × 375": (500, 375, 0.75),
    "333 × 333": (333, 333, 1.0),
    "750 × 750": (750, 750, 1.0),
    "1000 × 1000": (1000, 1000, 1.0),
}
REPEATS = 2


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--exponents", type=float, nargs="+", default=[0.5, 1, 2, 3, 4])
    parser.add_argument("--p-star", type=float, nargs="+", default=[0.01, 0.1, 1.0])
    parser.add_argument("--tolerance", type=float, default=1e-4)
    parser.add_argument("--without-v-cycle", action="store_true")
    arguments = parser.parse_args()
    if arguments.without_v_cycle:
        preconditioners.has_coarser_level = lambda grid: False
    solver = Auto(tolerance=arguments.tolerance)
    print_head("grid", *(f"n = {n:g}" for n in arguments.exponents))
    for name, (points, points_y, length_y) in SHAPES.items():
        surface, cells = SelfAffine(cutoff=0.02, length_y=length_y), []
        for n in arguments.exponents:
            scene = build_scene(surface, Power(n=n), points, points_y=points_y)
            numbers, seconds = [], []
            for p_star in arguments.p_star:
                solve = partial(solve_contact, scene.contact(p_star), solver)
                numbers.append(f"{solve().transforms:.0f}")
                seconds.append(f"{least(solve, REPEATS):.2f}")
            cells.append(f"{', '.join(numbers)}; {', '.join(seconds)}")
        print_row(name, *cells)


if __name__ == "__main__":
    main()
