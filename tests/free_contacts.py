"""Contacts with a free boundary that several tests share."""

import numpy as np

from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.elastomers import HalfSpace, Layer, Power
from gfmd_cli.physics.free_contact import FreeCompliance, FreeContact

ELASTOMERS = [
    Power(n=0),
    Power(n=0.5),
    HalfSpace(),
    Power(n=1.5),
    Layer(thickness=0.2, poisson=0.4),
]
SPEC = """\
[surface]
kind = "self-affine"
cutoff = 0.1
[elastomer]
kind = "half-space"
[grid]
points = 32
boundary = "free"
[load]
p_star = 0.1
"""


def oblong_contact(elastomer, pressure=0.1, *, void=False):
    """A random map of 17 x 20 points and pixels of 0.2 x 0.3 m, rough on all scales."""
    grid = Grid(20, 2, 20 * 0.3, points_y=17, length_y=17 * 0.2)
    height = np.random.default_rng(4).standard_normal(grid.shape)
    may_touch = np.random.default_rng(8).random(grid.shape) < 0.7 if void else None
    compliance = FreeCompliance(elastomer, grid, 1.0)
    return FreeContact(
        grid, height, np.empty(0), pressure, may_touch=may_touch, compliance=compliance
    )


def compliance_matrix(elastomer, grid):
    """Displacement of each pixel by a unit pressure on each, shape (pixels, pixels)."""
    kernel = elastomer.free_compliance(grid.shape, grid.spacings)
    y, x = (i.ravel() for i in np.indices(grid.shape))
    return kernel[np.abs(y[:, None] - y), np.abs(x[:, None] - x)]
