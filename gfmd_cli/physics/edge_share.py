"""The share of a contact that lies where a window has changed the heights of a map."""

import numpy as np

from gfmd_cli.grid.arrays import Field
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.indenters import RigidSurface
from gfmd_cli.physics.observables import contact_pressure


def edge_shares(
    surface: RigidSurface, grid: Grid, height: Field, u: Field, sigma: Field
) -> dict[str, float]:
    """Shares of the contact area and of the load in the tapered zone at the edges.

    Columns `edge_contact` and `edge_load`; none where the surface has no such zone.
    """
    edge = surface.tapered(grid)
    if edge is None:
        return {}
    load = contact_pressure(height, u, sigma)
    touching = load > 0
    inside = grid.total(float(np.count_nonzero(touching & edge)))
    area, carried = grid.total(float(np.count_nonzero(touching))), grid.total(float(load.sum()))
    return {
        "edge_contact": inside / area if area else np.nan,
        "edge_load": grid.total(float(load[edge].sum())) / carried if carried else np.nan,
    }
