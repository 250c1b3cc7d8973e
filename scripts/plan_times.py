"""Processor seconds to plan the transforms of a first contact, and to solve it with these plans.

    python scripts/plan_times.py
    python scripts/plan_times.py --points 256 400 --measured-from 0 65536 131072 262144 --repeats 25

Default surface with lambda_s / L = 0.02 (seed 0), n = 1, p* = 0.1, residual 1e-4. Plans are
measured on grids from a number of points on that make many transforms: 131072 in a run; 0 stands
for all grids, and inf for none. No plans are known before.
"""

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
from math import inf
from tempfile import TemporaryDirectory
from typing import Any

import pyfftw
from markdown_tables import print_head, print_row
from timing import least

from gfmd_cli.grid import plans
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.free_contact import SCENES
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import solve_contact

SURFACE = SelfAffine(cutoff=0.02)
MEASURED_FROM = 0, plans.MIN_MEASURED_POINTS, inf


class Planning:
    """Makes plans, and adds up the time that this takes."""

    def __init__(self) -> None:
        self.seconds, self.make = 0.0, pyfftw.FFTW

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        begun = time.process_time()
        try:
            return self.make(*arguments, **options)
        finally:
            self.seconds += time.process_time() - begun


def times(points: int, boundary: str, measured_from: float, repeats: int) -> tuple[float, float]:
    """Seconds of planning, and of a solve with the plans; measured plans are measured anew."""
    planning, plans.MIN_MEASURED_POINTS = Planning(), measured_from
    with TemporaryDirectory() as cache:
        os.environ["XDG_CACHE_HOME"] = cache
        plans.plan_with(None)
        pyfftw.FFTW = planning
        try:
            scene = SCENES[boundary](SURFACE, Power(n=1), points)
            contact = scene.contact(0.1)
            solve_contact(contact, Auto(tolerance=1e-4))
        finally:
            pyfftw.FFTW = planning.make
        solve = least(lambda: solve_contact(contact, Auto(tolerance=1e-4)), repeats)
        return planning.seconds, solve


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, nargs="+", default=[128, 256, 512, 1024, 2048])
    parser.add_argument("--boundaries", nargs="+", default=list(SCENES))
    parser.add_argument("--measured-from", type=float, nargs="+", default=MEASURED_FROM)
    parser.add_argument("--repeats", type=int, default=9)
    options = parser.parse_args()
    heads = (f"measured from {start:g} points" for start in options.measured_from)
    print_head("boundary", "points a side", *heads)
    for boundary in options.boundaries:
        for points in options.points:
            starts, repeats = options.measured_from, options.repeats
            pairs = [times(points, boundary, start, repeats) for start in starts]
            cells = (f"{plan:.1f} + {solve:.4f}" for plan, solve in pairs)
            print_row(boundary, points, *cells)


if __name__ == "__main__":
    main()
