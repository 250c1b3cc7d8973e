"""The rounding of an updated stress, over its estimate, at the end of solves.

    python scripts/sigma_rounding.py

Default surface with lambda_s = L/50. A solve that ends without a last recomputation of sigma keeps
the rounding of its updates. The true error is the rms difference to sigma = K u + p; the estimate
is that by which the solve ends (`gfmd_cli/solvers/loop.py`). One row for each n.
"""

import argparse
from math import hypot, sqrt

import numpy as np

from gfmd_cli.physics.contact import Contact, build_scene
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.loop import solve
from gfmd_cli.solvers.pcg import ProjectedCG

SURFACE = SelfAffine(cutoff=0.02)
TOLERANCES = (1e-4, 1e-6)


def ratio(contact: Contact, tolerance: float) -> float | None:
    """True error over its estimate; None for a solve that ends with sigma computed from u."""
    solver = ProjectedCG(tolerance=tolerance)
    u = contact.grid.empty()
    u[...] = contact.height.max()
    state = solver.begin(contact, u)
    solve(contact, solver, state)
    if state.exact:
        return None
    estimate = hypot(state.rounding, contact.rounding(state.u))
    exact = contact.stress(state.u, out=contact.grid.empty())
    squares = float(np.square(exact - state.sigma).sum())
    return sqrt(squares / contact.grid.size) / min(contact.pressure, 1.0) / estimate


def main() -> None:
    """Solve all contacts and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, nargs="+", default=[256, 512, 1024], help="per side")
    parser.add_argument("--exponents", type=float, nargs="+", default=[1.0, 2.0, 3.0, 4.0])
    parser.add_argument("--p-star", type=float, nargs="+", default=[0.01, 0.1, 1.0])
    options = parser.parse_args()
    print("| n | solves | ended without recomputation | error over estimate |")
    print("| --- | --- | --- | --- |")
    for n in options.exponents:
        scenes = [build_scene(SURFACE, Power(n=n), points) for points in options.points]
        contacts = [scene.contact(p) for scene in scenes for p in options.p_star]
        found = [ratio(contact, tolerance) for contact in contacts for tolerance in TOLERANCES]
        known = [value for value in found if value is not None]
        span = f"{min(known):.2g} to {max(known):.2g}" if known else ""
        print(f"| {n:g} | {len(found)} | {len(known)} | {span} |", flush=True)


if __name__ == "__main__":
    main()
