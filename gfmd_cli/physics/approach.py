"""The approach of the indenter: its displacement [m] from first touch without load.

Where the undeformed surface of the elastomer has a level c, far from all loads or above its base,
the highest point of the indenter has moved by d = max h - c since it touched. For a free boundary
u = C sigma + c. For a periodic one the mean displacement under the mean pressure p is
<u> - c = p / k(0), with the stiffness k(0) against a uniform displacement.
"""

from collections.abc import Callable

import numpy as np

from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.contact import Contact, Scene
from gfmd_cli.physics.linear_elastomer import LinearElastomer
from gfmd_cli.physics.persson import Persson

ESTIMATE_PRESSURES = (1e-8, 1e4, 121)  # reduced pressures of the estimate: from, to, how many


def approach(
    scene: Scene,
    peak: Callable[[], float | None],
    elastomer: LinearElastomer,
    contact: Contact,
    u: Field,
    sigma: Field,
) -> float:
    """Displacement of the indenter from first touch [m] at a solution; NaN where c is undefined.

    `peak` gives max h [m], or None for the largest height on the grid. `u` and `sigma` are in
    reduced units, of shape `grid.shape`.
    """
    if not elastomer.has_level(contact.boundary, scene.grid.dimension):
        return np.nan
    level = contact.reference_level(u, sigma)
    if contact.is_periodic:
        assert elastomer.uniform_stiffness is not None
        uniform = elastomer.uniform_stiffness * scene.h_std / scene.delta_sigma
        level -= contact.pressure / uniform
    return _highest(scene, peak()) - level * scene.h_std


def _highest(scene: Scene, peak: float | None) -> float:
    """max h above <h> [m]."""
    on_grid = scene.highest * scene.h_std
    return on_grid if peak is None else max(on_grid, peak - scene.mean_height)


def touching_displacement(scene: Scene, peak: float | None) -> float:
    """Displacement [m] at which the highest grid point touches, if max h lies between points."""
    return _highest(scene, peak) - scene.highest * scene.h_std


def estimated_pressures(
    scene: Scene, peak: float | None, elastomer: LinearElastomer, displacements: Field
) -> Field:
    """Pressures [Pa] of some displacements [m], from the mean gap of Persson theory.

    d = max h - <u> + p / k(0). Without k(0), the stiffness at q = 2 / side takes its place: for a
    half-space p / k is then within 6 % the mean displacement of a square under uniform pressure.
    """
    low, high, count = ESTIMATE_PRESSURES
    pressure = scene.delta_sigma * np.geomspace(low, high, count)
    softest = np.array([2.0 / min(scene.grid.sides)])
    uniform = elastomer.uniform_stiffness or float(
        elastomer.stiffness(softest, scene.grid.length)[0]
    )
    gap = Persson(scene.shells).mean_gap(pressure)
    depth = _highest(scene, peak) - gap + pressure / uniform
    return np.exp(np.interp(displacements, depth, np.log(pressure)))
