"""Rounding error of the gap with a free boundary over its estimate, after each step of `dual`.

    python scripts/free_rounding.py

Self-affine surfaces and paraboloids; k ~ q^n and layers. The gap that the solver updates in single
precision is compared, in contact, with that of the stress in double precision. Estimates of less
than 1e-11, as natural residuals, are left out: there the rounding of double precision counts.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from typing import Any

import numpy as np
from small_contacts import WholeMaps

from gfmd_cli.physics.elastomers import Layer, Power
from gfmd_cli.physics.free_contact import build_free_scene
from gfmd_cli.physics.indenters import Parabola
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.nested_grids import solve_contact

ELASTOMERS = [
    *(Power(n=n) for n in (0.1, 0.5, 1.0, 1.5, 1.75)),
    Layer(thickness=0.1, poisson=0.4),
    Layer(thickness=0.3, poisson=0.49),
]
SURFACES = [SelfAffine(seed=1, cutoff=0.05), Parabola(radius=1.0)]
SMALLEST_ESTIMATE = 1e-11


def main() -> None:
    ratios: list[float] = []

    def watch(contact: Any, state: Any) -> None:
        if state.exact or state.rounding < SMALLEST_ESTIMATE:
            return
        gap = contact.compliance.displacement(state.sigma, out=contact.grid.empty())
        difference = (gap - contact.height - state.gap)[state.sigma > 0]
        difference -= difference.mean()
        error = contact.as_residual(float(difference @ difference))
        ratios.append(error / state.rounding)

    for elastomer in ELASTOMERS:
        for surface in SURFACES:
            for points in (64, 128, 300, 512):
                scene = build_free_scene(surface, elastomer, points)
                for p_star in (1e-4, 0.3, 15.0):
                    solve_contact(
                        scene.contact(p_star), WholeMaps(max_steps=80, tolerance=1e-7), watch
                    )
    percentiles = np.percentile(ratios, [5, 50, 95, 100])
    print(f"{len(ratios)} steps; 5, 50, 95, 100 %:", *(f"{value:.2f}" for value in percentiles))


if __name__ == "__main__":
    main()
