"""Transforms with other values of a constant of the solvers, over those with the present value.

    python scripts/solver_constants.py multigrid.COARSEST_STEP_PAIRS 1 2 8
    python scripts/solver_constants.py projected_move.LENGTH_CHANGE "(0.25, 4)" "(0.67, 1.5)"

Self-affine surfaces with lambda_s four times the larger spacing, whole grids (no tiles, no direct
solves), natural residual 1e-6. Prints a Markdown table: for each grid and exponent n, the geometric
mean of the ratios over the pressures and seeds. A dash stands for a solve that has not converged.
"""

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from ast import literal_eval
from importlib import import_module
from math import inf, isfinite
from unittest.mock import patch

import numpy as np
from markdown_tables import print_head, print_row
from small_contacts import WholeGrids

from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.nested_grids import solve_contact


def transforms(shape: tuple[int, int], n: float, p_star: float, seed: int) -> float:
    """Number of transforms of a solve; infinite if it does not converge."""
    points, points_y = shape
    surface = SelfAffine(cutoff=4 / points_y, seed=seed)
    contact = build_scene(surface, Power(n=n), points, points_y=points_y).contact(p_star)
    solution = solve_contact(contact, WholeGrids(max_steps=3000))
    return solution.transforms if solution.status.is_converged else inf


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("constant", help="module of gfmd_cli.solvers and name in it")
    parser.add_argument("values", nargs="+", type=literal_eval)
    parser.add_argument("--points", type=int, nargs="+", default=[64, 128, 256])
    parser.add_argument("--exponents", type=float, nargs="+", default=[0.5, 1, 2, 3, 4])
    parser.add_argument("--p-star", type=float, nargs="+", default=[0.01, 0.1, 1.0])
    parser.add_argument("--seeds", type=int, nargs="+", default=[3, 4, 5])
    parser.add_argument("--aspect", type=float, default=1, help="of the pixels, of a square cell")
    arguments = parser.parse_args()
    module_name, name = arguments.constant.split(".")
    module = import_module(f"gfmd_cli.solvers.{module_name}")
    present = getattr(module, name)
    print_head("points", "n", *arguments.values, f"present: {present}")
    for points in arguments.points:
        shape = points, round(points / arguments.aspect)
        for n in arguments.exponents:
            cases = [(shape, n, p, seed) for p in arguments.p_star for seed in arguments.seeds]
            counts = []
            for value in (present, *arguments.values):
                with patch.object(module, name, value):
                    counts.append(np.array([transforms(*case) for case in cases]))
            ratios = [float(np.exp(np.mean(np.log(count / counts[0])))) for count in counts[1:]]
            cells = [f"{ratio:.2f}" if isfinite(ratio) else "-" for ratio in ratios]
            print_row(f"{points} × {shape[1]}", f"{n:g}", *cells, f"{counts[0].mean():.0f}")


if __name__ == "__main__":
    main()
