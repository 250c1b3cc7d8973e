"""Measure `forecast.PAIRS`: the time of a solve by n and p*, in units of `SECONDS_PER_PAIR`.

    python scripts/forecast_pairs.py --points 1024 2048
    python scripts/forecast_pairs.py --solver fire --points 512 --exponents 1 --p-star 0.01 0.1 1

With another solver than `auto`, each entry is the ratio of its time to that of `auto`.
Default surface, natural residual 1e-6, one thread, processor seconds, the least of some repeats.
Each entry is the geometric mean over the grids; the last line shows its largest ratio to one grid.
"""

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from pydantic import TypeAdapter
from timing import least

from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.auto import AnySolver
from gfmd_cli.solvers.nested_grids import solve_contact
from gfmd_cli.study.forecast import DECADES, PAIRS, SECONDS_PER_PAIR

TOLERANCE = 1e-6


def pairs(
    kind: str, surface: SelfAffine, n: float, points: int, p_star: list[float], repeats: int
) -> np.ndarray:
    """The time of a solve at each pressure, in units of `SECONDS_PER_PAIR` times grid points."""
    scene = build_scene(surface, Power(n=n), points)
    solver = TypeAdapter(AnySolver).validate_python({"kind": kind, "tolerance": TOLERANCE})
    contacts = [scene.contact(p) for p in p_star]
    times = [least(lambda: solve_contact(c, solver), repeats) for c in contacts]  # noqa: B023
    return np.array(times) / (SECONDS_PER_PAIR * points**2)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--points", type=int, nargs="+", default=[1024, 2048])
    parser.add_argument("--exponents", type=float, nargs="+", default=list(PAIRS))
    parser.add_argument("--p-star", type=float, nargs="+", default=[10.0**d for d in DECADES])
    parser.add_argument("--solver", default="auto")
    parser.add_argument("--cutoff", type=float, default=SelfAffine().cutoff)
    parser.add_argument("--repeats", type=int, default=2)
    arguments = parser.parse_args()
    surface, largest, ratios = SelfAffine(cutoff=arguments.cutoff), 1.0, []
    for n in arguments.exponents:
        common = arguments.p_star, arguments.repeats
        cases = [(surface, n, points, *common) for points in arguments.points]
        grids = np.array([pairs(arguments.solver, *case) for case in cases])
        if arguments.solver != "auto":
            grids /= np.array([pairs("auto", *case) for case in cases])
            ratios.append(grids)
        mean = np.exp(np.log(grids).mean(axis=0))
        largest = max(largest, float(np.exp(np.abs(np.log(grids / mean)).max())))
        print(f"{n:g}: ({', '.join(f'{value:.2g}' for value in mean)}),", flush=True)
    print(f"largest ratio of an entry to one of its grids: {largest:.2f}")
    if ratios:
        print(f"geometric mean of all: {np.exp(np.log(ratios).mean()):.2g}")


if __name__ == "__main__":
    main()
