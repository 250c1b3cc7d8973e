"""How well the exact identities of the contact problem hold on the default surface.

    python scripts/identities.py        # the table of docs/verification.md

2 v = <sigma h> - p <u>;  -dv/du_g = p;  integral of u_g dp = v + p u_g between two pressures, which
becomes v_full over all pressures. Prints one line for each elastomer.
"""

import argparse

import numpy as np

from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.observables import observe
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import solve_contact

EXPONENTS = (0.0, 0.5, 1.0, 2.0, 3.0, 4.0)
TOLERANCE = 1e-8
PANELS = 12  # in ln p, four Gauss points each
STEP = 0.002  # relative, of the central difference in p


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--points", type=int, default=512)
    parser.add_argument("--cutoff", type=float, default=SelfAffine().cutoff, help="lambda_s / L")
    parser.add_argument("--exponents", type=float, nargs="+", default=EXPONENTS)
    options = parser.parse_args()
    surface, solver = SelfAffine(cutoff=options.cutoff), Auto(tolerance=TOLERANCE)
    print(f"{options.points}^2, tolerance {TOLERANCE:g}, p* from 0.01 to 3")
    print("   n  |2v/(<sigma h> - p<u>) - 1|  |-dv/du_g / p - 1|  |int u_g dp / [v + p u_g] - 1|")
    for n in options.exponents:
        scene = build_scene(surface, Power(n=n), options.points)

        def observables_at(p, scene=scene):
            contact = scene.contact(float(p))
            solution = solve_contact(contact, solver)
            assert solution.status == "converged"
            return observe(contact, solution.u, solution.sigma)

        work, slope = 0.0, 0.0
        for p in (0.01, 0.1, 0.5, 1.0, 3.0):
            middle, low, high = (
                observables_at(p),
                observables_at(p * (1 - STEP)),
                observables_at(p * (1 + STEP)),
            )
            work = max(work, abs(2 * middle.energy / middle.work - 1))
            slope = max(slope, abs((low.energy - high.energy) / (high.u_g - low.u_g) / p - 1))
        nodes, weights = np.polynomial.legendre.leggauss(4)
        edges = np.linspace(np.log(0.01), np.log(3.0), PANELS + 1)
        half = 0.5 * (edges[1] - edges[0])
        integral = 0.0
        for left in edges[:-1]:
            for node, weight in zip(nodes, weights, strict=True):
                p = np.exp(left + half * (1 + node))
                integral += half * weight * p * observables_at(p).u_g
        first, last = observables_at(0.01), observables_at(3.0)
        exact = last.energy + 3.0 * last.u_g - first.energy - 0.01 * first.u_g
        print(f"{n:4g} {work:28.1e} {slope:19.1e} {abs(integral / exact - 1):30.1e}", flush=True)


if __name__ == "__main__":
    main()
