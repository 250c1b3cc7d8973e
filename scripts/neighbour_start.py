"""Ten pressures on one surface: starts from the neighbouring pressure against new starts.

A start from the neighbour begins on the tiles around its contact, with its pressure; see
gfmd_cli/solvers/local_start.py. Prints transforms, and processor seconds of the faster of two
solves: a table of docs/solver_measurements.md.

    python scripts/neighbour_start.py --points 1024 --p-star 0.001 0.01
"""

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections.abc import Sequence

import numpy as np
from timing import least

from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.contact import Contact, Scene
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.observables import contact_pressure
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.local_start import start_from
from gfmd_cli.solvers.loop import solve
from gfmd_cli.solvers.nested_grids import Solution, solve_contact
from gfmd_cli.solvers.pcg import ProjectedCG

COUNT = 10  # pressures
REPEATS = 2  # the faster counts


def from_neighbour(contact: Contact, solver: ProjectedCG, pressure: Field) -> float:
    """Transforms of a solve that starts from the contact pressure at another load."""
    half = tuple(n // 2 for n in contact.grid.shape)
    coarse = contact.coarsen(half)
    averaged = contact.grid.average(pressure, coarse.grid)
    start = start_from(coarse, averaged, [contact], solver.tolerance)
    if start is None:
        raise SystemExit("the contact is too large for a solve on tiles")
    state = solver.begin_from(start)
    solve(contact, solver, state)
    return start.transforms + state.transforms


def ladder(scene: Scene, solver: ProjectedCG, pressures: Sequence[float]) -> None:
    """Print the cost at each pressure but the first, and the ratios of the sums."""
    costs, last = [], None
    for p_star in pressures:
        contact = scene.contact(p_star)
        solution: Solution = solve_contact(contact, solver)
        if last is not None:
            pressure = last
            transforms = from_neighbour(contact, solver, pressure)
            seconds = (
                least(lambda: solve_contact(contact, solver), REPEATS),  # noqa: B023
                least(lambda: from_neighbour(contact, solver, pressure), REPEATS),  # noqa: B023
            )
            costs.append((solution.transforms, transforms, *seconds))
            print(f"{p_star:8.5f}" + "{:7.1f}{:7.1f}{:7.2f}{:7.2f}".format(*costs[-1]))
        last = contact_pressure(contact.obstacle, solution.u, solution.sigma)
    new, near, seconds_new, seconds_near = np.sum(costs, axis=0)
    print(f"ratios: transforms {near / new:.2f}, time {seconds_near / seconds_new:.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=1024)
    parser.add_argument("--tolerance", type=float, default=1e-4)
    parser.add_argument("--p-star", type=float, nargs=2, default=[1e-3, 1e-2])
    arguments = parser.parse_args()
    scene = build_scene(SelfAffine(), Power(n=1), arguments.points)
    pressures = np.geomspace(*arguments.p_star, COUNT).tolist()
    for name, order in (("loading", pressures), ("unloading", pressures[::-1])):
        print(f"{name}; transforms and seconds, of a new start and from the neighbour")
        ladder(scene, ProjectedCG(tolerance=arguments.tolerance), order)


if __name__ == "__main__":
    main()
