"""Single against double precision on the default surface: results, residuals, transforms, seconds.

Prints a table in Markdown. Differences are those of single from double, both solved to the same
tolerance; CPU seconds are of one thread, the least of REPEATS.
"""

import sys
import time

from gfmd_cli.physics.contact import build_scene
from gfmd_cli.physics.elastomer import Power
from gfmd_cli.physics.observables import observe
from gfmd_cli.physics.surface import SelfAffine
from gfmd_cli.solvers.cascade import SolverChoice, solve_contact

EXPONENTS = (0.5, 1.0, 2.0, 3.0)
PRESSURES = (0.01, 0.1, 1.0)
REPEATS = 3


def solved(contact, precision, tolerance):
    """Solution, what is measured on it, CPU seconds."""
    choice = SolverChoice(tolerance=tolerance, precision=precision)
    least = float("inf")
    for _ in range(REPEATS):
        begun = time.process_time()
        solution = solve_contact(contact, choice, lambda contact, state: None)
        least = min(least, time.process_time() - begun)
    return solution, observe(contact, solution.u, solution.sigma), least


def main(points: int = 512, tolerance: float = 1e-4) -> None:
    print("| n | p* | u_g | a_r | σ_p | residual | status | transforms | CPU s |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for n in EXPONENTS:
        scene = build_scene(SelfAffine(), Power(n=n), points)
        for p_star in PRESSURES:
            contact = scene.contact(p_star)
            found = [solved(contact, kind, tolerance) for kind in ("double", "single")]
            (double, exact, seconds), (single, rough, faster) = found
            changes = [
                f"{getattr(rough, name) / getattr(exact, name) - 1:.0e}"
                for name in ("u_g", "a_r", "sigma_p")
            ]
            status = " / ".join(dict.fromkeys((double.status, single.status)))
            cells = [
                f"{n:g}",
                f"{p_star:g}",
                *changes,
                f"{double.residual:.1e} / {single.residual:.1e}",
                status,
                f"{double.transforms:.0f} / {single.transforms:.0f}",
                f"{seconds:.2f} / {faster:.2f}",
            ]
            print("| " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]), *map(float, sys.argv[2:3]))
