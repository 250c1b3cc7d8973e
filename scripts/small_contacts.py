"""Small contacts: transforms and processor time with a start on tiles or a direct one, and without.

    python scripts/small_contacts.py --points 512 1024 2048 --p-star 0.001 0.01
    python scripts/small_contacts.py --exponents 2 3 4 --cutoff 0.02
    python scripts/small_contacts.py --boundary free --points 256 512 1024 --cutoff 0.02

Default surface, one thread. After a first solve, which loads the kernels, both ways are timed side
by side, `--repeats` times; the minimum counts. The numbers of transforms are means over the seeds,
and the ratio of times is their median. Tables of docs/solver_measurements.md and
docs/performance.md, with the options named there.
"""

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from functools import partial
from typing import ClassVar

import numpy as np
from timing import least

from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.free_contact import SCENES
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.dual import Dual
from gfmd_cli.solvers.loop import Solver
from gfmd_cli.solvers.nested_grids import solve_contact
from gfmd_cli.solvers.pcg import ProjectedCG


class WholeGrids(ProjectedCG):
    """The solver without a start for small contacts."""

    starts_locally: ClassVar[bool] = False


class WholeMaps(Dual):
    """The same for a free boundary."""

    starts_locally: ClassVar[bool] = False


WAYS: dict[str, tuple[type[Solver], type[Solver]]] = {
    "periodic": (ProjectedCG, WholeGrids),
    "free": (Dual, WholeMaps),
}


def compare(contact: Contact, tolerance: float, repeats: int) -> tuple[float, ...]:
    """Transforms with and without the start, ratio of times, relative difference of gaps."""
    solvers = [kind(tolerance=tolerance) for kind in WAYS[contact.boundary]]
    small, whole = (solve_contact(contact, solver) for solver in solvers)
    solves = [partial(solve_contact, contact, solver) for solver in solvers]
    seconds = np.min([[least(solve, 1) for solve in solves] for _ in range(repeats)], axis=0)
    gaps = [float(np.mean(solution.u - contact.height)) for solution in (small, whole)]
    difference = abs(gaps[0] / gaps[1] - 1)
    return small.transforms, whole.transforms, seconds[1] / seconds[0], difference


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, nargs="+", default=[512, 1024, 2048])
    parser.add_argument("--boundary", choices=list(SCENES), default="periodic")
    parser.add_argument("--exponents", type=float, nargs="+", default=[1.0])
    parser.add_argument("--cutoff", type=float, default=0.005, help="lambda_s / L")
    parser.add_argument("--p-star", type=float, nargs="+", default=[0.001, 0.01, 0.1])
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--tolerance", type=float, default=1e-4)
    parser.add_argument("--repeats", type=int, default=2)
    arguments = parser.parse_args()
    print("points     n     p*  with (transforms)      without  time ratio  difference of u_g")
    for points in arguments.points:
        for n in arguments.exponents:
            surfaces = [SelfAffine(seed=seed, cutoff=arguments.cutoff) for seed in arguments.seeds]
            build = SCENES[arguments.boundary]
            scenes = [build(surface, Power(n=n), points) for surface in surfaces]
            for p_star in arguments.p_star:
                results = [
                    compare(scene.contact(p_star), arguments.tolerance, arguments.repeats)
                    for scene in scenes
                ]
                small, whole, ratio, difference = np.transpose(results)
                print(
                    f"{points:6} {n:5g} {p_star:6g} {small.mean():18.1f} {whole.mean():12.1f} "
                    f"{np.median(ratio):11.1f} {difference.max():18.1e}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
