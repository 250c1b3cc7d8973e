"""Solves on tiles at any fraction of tiles and any n: fraction, steps, prediction, time.

    python scripts/tile_solves.py --points 1024 2048 --exponents 0.25 0.5 1 1.25 \\
        --p-star 0.01 0.02 0.05 0.1 --tolerance 1e-3 --seeds 0 1 2
    python scripts/tile_solves.py --exponents 1 1.5 2 --p-star 0.001 --max-steps 2000

Periodic cell, default surface, one thread. The columns: share of the tiles that are kept on the
finest grid; evaluations of the displacement at all points, and steps on the tiles, both on the
finest grid; natural residual of the start, measured at all points over the prediction on the
tiles; processor time of a solve on whole grids over that of the solve with tiles, each the smallest
of `--repeats` times; microseconds that the convolution with the stiffness takes per tile. Results,
and the options for them, are in docs/solver_measurements.md.
"""

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from itertools import product
from typing import ClassVar
from unittest.mock import patch

from small_contacts import WholeGrids
from timing import least

from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers import local_solve, local_start
from gfmd_cli.solvers.local_solve import Evaluation
from gfmd_cli.solvers.loop import State
from gfmd_cli.solvers.nested_grids import solve_contact
from gfmd_cli.solvers.pcg import ProjectedCG

CONVOLUTIONS = 3  # whose fastest is printed


class RecordedSolve(local_start.PeriodicSolve):
    """The solve on tiles, which counts its evaluations and steps on the finest grid."""

    max_exponent: ClassVar[float] = 9.0
    latest: ClassVar["RecordedSolve | None"] = None
    """The last solve on a finest grid."""

    @staticmethod
    def max_fraction(exponent: float) -> float:
        """No limit."""
        return 1.0

    def solve(self, tolerance: float) -> tuple[Evaluation, Field]:
        """See `LocalSolve`."""
        RecordedSolve.latest = self
        self.fraction = self.tiles.count / self.tiles.used.size
        self.evaluations = self.steps = 0
        self.pause = self.count_step
        return super().solve(tolerance)

    def count_step(self) -> None:
        """Count a step; the test that ends a solve counts as one, too."""
        self.steps += 1

    def evaluate(self, displacement: Field, tolerance: float) -> Evaluation:
        """See `LocalSolve`."""
        result = super().evaluate(displacement, tolerance)
        self.evaluations += 1
        self.predicted = result.start_residual
        return result


def row(contact: Contact, tolerance: float, repeats: int) -> str:
    """The columns of one contact."""
    RecordedSolve.latest, residuals = None, list[float]()

    def watch(current: Contact, state: State) -> None:
        if current is contact and state.step == 0:
            residuals.append(state.residual)

    def with_tiles() -> None:
        solution = solve_contact(contact, ProjectedCG(tolerance=tolerance), watch)
        residuals.append(solution.residual)  # the first one where the start is the solution

    seconds = least(with_tiles, repeats)
    whole = least(lambda: solve_contact(contact, WholeGrids(tolerance=tolerance)), repeats)
    solve = RecordedSolve.latest
    if solve is None:
        return "not solved on tiles"
    convolution = least(lambda: solve.map_displacement(solve.s), CONVOLUTIONS) / solve.tiles.count
    return (
        f"{solve.fraction:7.3f} {solve.evaluations:11} {solve.steps:6} {solve.predicted:10.1e} "
        f"{residuals[0] / solve.predicted:8.2f} {whole / seconds:11.2f} {1e6 * convolution:6.2f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, nargs="+", default=[1024])
    parser.add_argument("--exponents", type=float, nargs="+", default=[1.0])
    parser.add_argument("--cutoff", type=float, default=0.005, help="lambda_s / L")
    parser.add_argument("--p-star", type=float, nargs="+", default=[0.001, 0.01, 0.1])
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--tolerance", type=float, nargs="+", default=[1e-4])
    parser.add_argument("--max-steps", type=int, default=local_solve.MAX_STEPS, help="on tiles")
    parser.add_argument("--repeats", type=int, default=2)
    arguments = parser.parse_args()
    with (
        patch.dict(local_start.LOCAL_SOLVES, periodic=RecordedSolve),
        patch.object(local_start, "SMALLEST_EXPONENT", 0.0),
        patch.object(local_solve, "MAX_STEPS", arguments.max_steps),
    ):
        print_table(arguments)


def print_table(arguments: argparse.Namespace) -> None:
    """A line for each contact."""
    print(
        "points     n     p* tolerance seed   share evaluations  steps  predicted measured "
        "time ratio us/tile"
    )
    chosen = (arguments.points, arguments.exponents, arguments.seeds)
    for points, n, seed in product(*chosen):
        surface = SelfAffine(seed=seed, cutoff=arguments.cutoff)
        scene = build_scene(surface, Power(n=n), points)
        for p_star, tolerance in product(arguments.p_star, arguments.tolerance):
            columns = row(scene.contact(p_star), tolerance, arguments.repeats)
            print(f"{points:6} {n:5g} {p_star:6g} {tolerance:9g} {seed:4} {columns}", flush=True)


if __name__ == "__main__":
    main()
