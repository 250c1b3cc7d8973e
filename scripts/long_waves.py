"""Long waves solved with K itself in the V-cycle of `pcg`, and without: steps, mean gap, time.

    python scripts/long_waves.py --points 1024 2048

Default surface, whole grids (no tiles, no direct solves), one thread. Prints a Markdown table:
steps on the finest grid, those until the mean gap stays within 1e-4 of its value, its error after
two of them, and the processor time with over that without. Means over the seeds, geometric ones of
errors and times. Each solve is repeated `--repeats` times, the two ways in turn; the least counts.
Table of docs/solver_measurements.md.
"""

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from unittest.mock import patch

import numpy as np
from markdown_tables import print_head, print_row
from small_contacts import WholeGrids
from timing import least

from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers import multigrid
from gfmd_cli.solvers.nested_grids import solve_contact

WITHIN = 1e-4  # of the mean gap


def errors_of_mean_gap(contact: Contact, tolerance: float, mean_gap: float) -> list[float]:
    """Its relative errors after each step on the finest grid, from the start on."""
    errors = []

    def watch(current, state):
        if current is contact:
            errors.append(abs(float(np.mean(state.u - contact.height)) / mean_gap - 1))

    solution = solve_contact(contact, WholeGrids(tolerance=tolerance), watch)
    errors.append(abs(float(np.mean(solution.u - contact.height)) / mean_gap - 1))
    return errors[: solution.steps + 1]


def compare(contact: Contact, tolerance: float, repeats: int) -> list[float]:
    """Steps, steps to the mean gap and its error after two, without and with; ratio of times."""
    exact = solve_contact(contact, WholeGrids(tolerance=1e-8))
    mean_gap = float(np.mean(exact.u - contact.height))
    results, seconds = [], np.full(2, np.inf)
    growths = 0.0, multigrid.MAX_LONG_WAVE_GROWTH
    for growth in growths:
        with patch.object(multigrid, "MAX_LONG_WAVE_GROWTH", growth):
            errors = errors_of_mean_gap(contact, tolerance, mean_gap)
        above = np.flatnonzero(np.array(errors) > WITHIN)
        results.append((len(errors) - 1, above[-1] + 1 if above.size else 0, errors[2]))
    for _ in range(repeats):
        for way, growth in enumerate(growths):
            with patch.object(multigrid, "MAX_LONG_WAVE_GROWTH", growth):
                solver = WholeGrids(tolerance=tolerance)
                time = least(lambda solver=solver: solve_contact(contact, solver), 1)
            seconds[way] = min(seconds[way], time)
    return [*np.ravel(results), seconds[1] / seconds[0]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, nargs="+", default=[1024, 2048])
    parser.add_argument("--exponents", type=float, nargs="+", default=[0.5, 1])
    parser.add_argument("--p-star", type=float, nargs="+", default=[0.003, 0.03, 0.1, 0.5])
    parser.add_argument("--seeds", type=int, nargs="+", default=[20, 21])
    parser.add_argument("--tolerance", type=float, default=1e-4)
    parser.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()
    print_head("grid", "n", "p*", "steps", f"to {WITHIN:g}", "error after two", "time")
    for points in arguments.points:
        for n in arguments.exponents:
            surfaces = [SelfAffine(seed=seed) for seed in arguments.seeds]
            scenes = [build_scene(surface, Power(n=n), points) for surface in surfaces]
            for p_star in arguments.p_star:
                options = arguments.tolerance, arguments.repeats
                results = [compare(scene.contact(p_star), *options) for scene in scenes]
                columns = np.transpose(results)
                steps, reached, other_steps, other_reached = columns[[0, 1, 3, 4]].mean(axis=1)
                error, other_error, time = np.exp(np.log(columns[[2, 5, 6]]).mean(axis=1))
                cells = f"{steps:.1f}, {other_steps:.1f}", f"{reached:.1f}, {other_reached:.1f}"
                errors = f"{error:.0e}, {other_error:.0e}"
                print_row(f"{points}²", f"{n:g}", f"{p_star:g}", *cells, errors, f"{time:.2f}")


if __name__ == "__main__":
    main()
