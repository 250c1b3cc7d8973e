"""Transforms for tabulated k(q) that are steep or have a step: what the limit of the levels saves.

    python scripts/steep_stiffness.py

The numbers of docs/solver_measurements.md and docs/hard_cases.md.

Self-affine surface, seed 0, natural residual 1e-6, no direct solves. Prints a Markdown table of
transforms: with the limit on the growth of k(q) between levels, without it, and with the Green's
function alone. A dash stands for a solve that does not converge in `--steps` steps.
"""

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from contextlib import AbstractContextManager
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np
from markdown_tables import print_head, print_row

from gfmd_cli.physics.elastomers import Tabulated
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers import direct_start, multigrid, preconditioners
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import solve_contact

NO_LIMIT = 99.0  # exponent that no table here reaches between two levels
CASES = [  # k(q), points, lambda_s / L, p*
    ("q^2, step", 256, 0.02, 0.05),
    ("q^3, step", 256, 0.02, 0.05),
    ("q^4", 512, 0.02, 0.05),
    ("q^5", 512, 0.02, 0.05),
    ("q^6", 512, 0.02, 0.05),
    ("q^6.5", 256, 0.02, 0.05),
    ("q^6.5", 512, 0.02, 0.05),
    ("q^4", 512, 0.005, 0.01),
    ("q^5", 512, 0.005, 0.01),
    ("q^6", 512, 0.005, 0.01),
]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, help="of all grids; default: those of the cases")
    parser.add_argument("--steps", type=int, default=4000)
    arguments = parser.parse_args()
    without_cycle = patch.object(preconditioners, "has_coarser_level", lambda grid: False)
    heads = ("k(q)", "points", "lambda_s / L", "p*")
    print_head(*heads, "with the limit", "without", "Green's function")
    for law, usual, cutoff, p_star in CASES:
        points = arguments.points or usual
        case = law, points, max(cutoff, 2 / points), p_star, arguments.steps
        numbers = [transforms(*case)]
        for change in (without_limit(), without_cycle):
            with change:
                numbers.append(transforms(*case))
        print_row(law, f"{points}²", f"{case[2]:g}", f"{p_star:g}", *numbers)


def without_limit() -> AbstractContextManager[object]:
    """No limit on the growth of k(q); weights and damping keep their values at the limit."""
    largest, at_growth = 2**multigrid.STEEPEST, multigrid._at_growth
    changes = {
        "STEEPEST": NO_LIMIT,
        "_at_growth": lambda lines, growth: at_growth(lines, min(growth, largest)),
    }
    return patch.multiple(multigrid, **changes)


def transforms(law: str, points: int, cutoff: float, p_star: float, steps: int) -> str:
    """Number of transforms of a solve by iteration, or a dash."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "k.txt"
        write_table(path, law, points)
        scene = build_scene(SelfAffine(cutoff=cutoff), Tabulated(path=path), points)
    with patch.object(direct_start, "MAX_COST", 0):
        solution = solve_contact(scene.contact(p_star), Auto(max_steps=steps))
    return f"{solution.transforms:.0f}" if solution.status.is_converged else "-"


def write_table(path: Path, law: str, points: int) -> None:
    """k = m^n over the mode m, with a step by a factor of 100 at points / 16 where the law says."""
    power, _, step = law.removeprefix("q^").partition(", ")
    m = np.geomspace(1, points / np.sqrt(2), 4000)
    k = m ** float(power) * np.where(m > points / 16, 100.0 if step else 1.0, 1.0)
    np.savetxt(path, np.column_stack([2 * np.pi * m, k]), fmt="%.17g")


if __name__ == "__main__":
    main()
