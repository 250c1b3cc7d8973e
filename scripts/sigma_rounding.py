"""The rounding of an updated stress, over its estimate, at the end of solves.

    python scripts/sigma_rounding.py
    python scripts/sigma_rounding.py --on-tiles --points 512 1024 --exponents 0.5 1 1.5 2 \
        --p-star 1e-5 1e-4 1e-3 0.01 --tolerance 0.1 0.01 1e-3 1e-4 --seeds 301 302

Default surface with lambda_s = L/50. A solve that ends without a last recomputation of sigma keeps
the rounding of its updates, and that of a start on tiles (`--on-tiles`). The true error is the rms
difference to sigma = K u + p; the estimate is that by which the solve ends
(`gfmd_cli/solvers/loop.py`). The increase is that of the residual when sigma is computed from u.
One row for each n; docs/solver_measurements.md has the ranges.
"""

import argparse
from itertools import product
from math import hypot
from typing import ClassVar

import numpy as np
from markdown_tables import print_head, print_row

from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.loop import Start, State, solve
from gfmd_cli.solvers.nested_grids import solve_contact
from gfmd_cli.solvers.pcg import PCGState, ProjectedCG


class Recorded(ProjectedCG):
    """Keeps the state in which the last solve from a start on tiles ended."""

    last: ClassVar[State | None]

    def begin_from(self, start: Start) -> PCGState:
        """See `Solver`."""
        Recorded.last = state = super().begin_from(start)
        return state


def final_state(contact: Contact, tolerance: float, *, on_tiles: bool) -> State | None:
    """The state in which a solve ends: on one grid, or from a start on tiles if there is one."""
    solver, Recorded.last = Recorded(tolerance=tolerance), None
    if on_tiles:
        solve_contact(contact, solver)
        return Recorded.last
    u = contact.grid.empty()
    u[...] = contact.height.max()
    state = solver.begin(contact, u)
    solve(contact, solver, state)
    return state


def compared(contact: Contact, state: State | None) -> tuple[float, float] | None:
    """Error and increase over the estimate; None for a solve that ends with sigma from u."""
    if state is None or state.exact:
        return None
    estimate = hypot(state.rounding, contact.rounding(state.u))
    exact = contact.stress(state.u, out=contact.grid.empty())
    error = contact.as_residual(float(np.square(exact - state.sigma).sum()))
    return error / estimate, (contact.residual(state.u, exact) - state.residual) / estimate


def main() -> None:
    """Solve all contacts and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, nargs="+", default=[256, 512, 1024], help="per side")
    parser.add_argument("--exponents", type=float, nargs="+", default=[1.0, 2.0, 3.0, 4.0])
    parser.add_argument("--p-star", type=float, nargs="+", default=[0.01, 0.1, 1.0])
    parser.add_argument("--tolerance", type=float, nargs="+", default=[1e-4, 1e-6])
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--on-tiles", action="store_true")
    options = parser.parse_args()
    print_head("n", "solves", "ended without recomputation", "error over estimate", "increase")
    for n in options.exponents:
        ratios = []
        for points, seed in product(options.points, options.seeds):
            scene = build_scene(SelfAffine(cutoff=0.02, seed=seed), Power(n=n), points)
            for p_star, tolerance in product(options.p_star, options.tolerance):
                contact = scene.contact(p_star)
                state = final_state(contact, tolerance, on_tiles=options.on_tiles)
                ratios.append(compared(contact, state))
        known = [values for values in ratios if values is not None]
        errors, increases = zip(*known, strict=True) if known else ([np.nan], [np.nan])
        span = f"{min(errors):.2g} to {max(errors):.2g}"
        print_row(f"{n:g}", len(ratios), len(known), span, f"{max(increases):.2g}")


if __name__ == "__main__":
    main()
