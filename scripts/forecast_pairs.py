"""Measure `forecast.PAIRS`: the time of a solve by n and p*, in units of `SECONDS_PER_PAIR`.

    python scripts/forecast_pairs.py --points 1024 2048

Default surface, natural residual 1e-6, one thread, processor seconds, the least of some repeats.
Each entry is the geometric mean over the grids; the last line shows its largest ratio to one grid.
"""

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from timing import least

from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import solve_contact
from gfmd_cli.study.forecast import DECADES, PAIRS, SECONDS_PER_PAIR


def pairs(surface: SelfAffine, n: float, points: int, repeats: int) -> list[float]:
    """The time of a solve at each pressure, in units of `SECONDS_PER_PAIR` times grid points."""
    scene, solver = build_scene(surface, Power(n=n), points), Auto(tolerance=1e-6)
    contacts = [scene.contact(10.0**decade) for decade in DECADES]
    times = [least(lambda: solve_contact(c, solver), repeats) for c in contacts]  # noqa: B023
    return [seconds / (SECONDS_PER_PAIR * points**2) for seconds in times]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--points", type=int, nargs="+", default=[1024, 2048])
    parser.add_argument("--exponents", type=float, nargs="+", default=list(PAIRS))
    parser.add_argument("--cutoff", type=float, default=SelfAffine().cutoff)
    parser.add_argument("--repeats", type=int, default=2)
    arguments = parser.parse_args()
    surface, largest = SelfAffine(cutoff=arguments.cutoff), 1.0
    for n in arguments.exponents:
        grids = np.array([pairs(surface, n, N, arguments.repeats) for N in arguments.points])
        mean = np.exp(np.log(grids).mean(axis=0))
        largest = max(largest, float(np.exp(np.abs(np.log(grids / mean)).max())))
        print(f"{n:g}: ({', '.join(f'{value:.2g}' for value in mean)}),", flush=True)
    print(f"largest ratio of an entry to one of its grids: {largest:.2f}")


if __name__ == "__main__":
    main()
