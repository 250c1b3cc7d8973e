"""Measure `forecast.PAIRS`: the time of a solve by n and p*, in units of `SECONDS_PER_PAIR`.

    python scripts/forecast_pairs.py
    python scripts/forecast_pairs.py --boundary free --points 512 1024 --cutoff 0.01
    python scripts/forecast_pairs.py --solver fire --points 512 --exponents 0.5 1 3 \\
        --p-star 0.01 0.1 1

With another solver than `auto`, each entry is the ratio of its time to that of `auto`, and their
geometric mean is its `relative_time`.
Default surface, natural residual 1e-6, one thread, processor seconds, the least of some repeats.
Each entry is the geometric mean over the grids; the last line shows its largest ratio to one grid.
"""

import argparse
import os
from functools import partial

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from pydantic import TypeAdapter
from timing import least

from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.free_contact import SCENES
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.auto import AnySolver
from gfmd_cli.solvers.nested_grids import solve_contact
from gfmd_cli.study.forecast import DECADES, PAIRS, SECONDS_PER_PAIR

TOLERANCE = 1e-6


def pairs(kind: str, options: argparse.Namespace, n: float, points: int) -> np.ndarray:
    """The time of a solve at each pressure, in units of `SECONDS_PER_PAIR` times grid points."""
    scene = SCENES[options.boundary](SelfAffine(cutoff=options.cutoff), Power(n=n), points)
    solver = TypeAdapter(AnySolver).validate_python({"kind": kind, "tolerance": TOLERANCE})
    times = []
    for p_star in options.p_star:
        solve = partial(solve_contact, scene.contact(p_star), solver)
        times.append(least(solve, options.repeats))
    return np.array(times) / (SECONDS_PER_PAIR * points**2)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--points", type=int, nargs="+", default=[1024, 2048])
    parser.add_argument("--exponents", type=float, nargs="+", help="default: those of the table")
    parser.add_argument("--p-star", type=float, nargs="+", default=[10.0**d for d in DECADES])
    parser.add_argument("--boundary", choices=list(SCENES), default="periodic")
    parser.add_argument("--solver", default="auto")
    parser.add_argument("--cutoff", type=float, default=SelfAffine().cutoff)
    parser.add_argument("--repeats", type=int, default=2)
    arguments = parser.parse_args()
    kind, largest, ratios = arguments.solver, 1.0, []
    for n in arguments.exponents or PAIRS[arguments.boundary]:
        grids = np.array([pairs(kind, arguments, n, points) for points in arguments.points])
        if kind != "auto":
            grids /= [pairs("auto", arguments, n, points) for points in arguments.points]
            ratios.append(grids)
        mean = np.exp(np.log(grids).mean(axis=0))
        largest = max(largest, float(np.exp(np.abs(np.log(grids / mean)).max())))
        print(f"{n:g}: ({', '.join(f'{value:.2g}' for value in mean)}),", flush=True)
    print(f"largest ratio of an entry to one of its grids: {largest:.2f}")
    if ratios:
        print(f"geometric mean of all: {np.exp(np.log(ratios).mean()):.2g}")


if __name__ == "__main__":
    main()
