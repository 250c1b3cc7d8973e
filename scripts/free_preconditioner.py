"""Steps and transforms of `dual` by the number of V-cycles of its preconditioner, as a table.

    python scripts/free_preconditioner.py
    python scripts/free_preconditioner.py --padding 1 1.125 1.25 1.5

Default surface with lambda_s / L = 0.02, whole maps, natural residual 1e-6, means over the seeds.
Without a V-cycle, the preconditioner is the stiffness K restricted to the contact.
"""

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from typing import Any
from unittest.mock import patch

import numpy as np
from markdown_tables import print_head, print_row
from small_contacts import WholeMaps

from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.free_contact import build_free_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers import dual, stress_preconditioner
from gfmd_cli.solvers.nested_grids import solve_contact


def preconditioner_with(cycles: int) -> type[stress_preconditioner.StressPreconditioner]:
    """The preconditioner with this number of V-cycles."""

    class WithCycles(stress_preconditioner.StressPreconditioner):
        def __init__(self, contact: Any) -> None:
            super().__init__(contact)
            self.transforms *= (1 + cycles) / (1 + self.cycles)
            self.cycles = cycles

    return WithCycles


def cell(contacts: list[Any]) -> str:
    """Mean numbers of steps on the finest grid and of transforms."""
    solutions = [solve_contact(contact, WholeMaps(max_steps=2000)) for contact in contacts]
    if not all(solution.status.is_converged for solution in solutions):
        return "-"
    means = np.mean([(solution.steps, solution.transforms) for solution in solutions], axis=0)
    return f"{means[0]:.0f}, {means[1]:.0f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--points", type=int, default=512)
    parser.add_argument("--exponents", type=float, nargs="+", default=[0.5, 1, 1.25, 1.5, 1.75])
    parser.add_argument("--p-star", type=float, nargs="+", default=[0.01, 0.1, 1])
    parser.add_argument("--seeds", type=int, nargs="+", default=[2, 3])
    parser.add_argument("--cycles", type=int, nargs="+", default=[0, 1, 2, 3])
    parser.add_argument("--padding", type=float, nargs="+", help="of the cell, instead of cycles")
    options = parser.parse_args()
    print_head("n", "p*", *(options.padding or options.cycles))
    for n in options.exponents:
        scenes = [
            build_free_scene(SelfAffine(seed=seed, cutoff=0.02), Power(n=n), options.points)
            for seed in options.seeds
        ]
        for p_star in options.p_star:
            contacts = [scene.contact(p_star) for scene in scenes]
            cells = []
            for padding in options.padding or []:
                with patch.object(stress_preconditioner, "PADDING", padding):
                    cells.append(cell(contacts))
            for cycles in [] if options.padding else options.cycles:
                with patch.object(dual, "StressPreconditioner", preconditioner_with(cycles)):
                    cells.append(cell(contacts))
            print_row(f"{n:g}", f"{p_star:g}", *cells)


if __name__ == "__main__":
    main()
