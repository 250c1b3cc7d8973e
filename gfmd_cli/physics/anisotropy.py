"""How much the slopes of a surface depend on the direction."""

from math import inf, sqrt

import numpy as np

from gfmd_cli.grid.arrays import BLOCK, Field, row_blocks
from gfmd_cli.grid.fft_grid import Grid


def anisotropy(grid: Grid, height: Field) -> float:
    """Ratio of the rms slopes along the principal axes: 1 if isotropic, infinite for a line.

    From the eigenvalues of the tensor <grad h grad h>, summed over the waves of the surface. The
    cost is one transform.
    """
    if grid.dimension == 1:
        return inf
    modes = grid.forward_into_work(height)
    x = np.arange(*grid.span, dtype=np.float64)
    weight = grid.multiplicity()
    sums = np.zeros(3)
    for rows in row_blocks(modes, max(modes.size // 16, BLOCK)):
        y = grid.mode_number_y(rows)[:, None]
        power = weight * np.abs(modes[rows]) ** 2
        # the waves with the highest q_y of an even number of points have both signs of q_y
        mixed = np.where(np.abs(y) * grid.length_y < 0.5 * grid.points_y * grid.length, x * y, 0.0)
        sums += [float(np.sum(power * term)) for term in (x * x, y * y, mixed)]
    xx, yy, xy = grid.total(sums)
    middle, half = 0.5 * (xx + yy), sqrt((0.5 * (xx - yy)) ** 2 + xy**2)
    return sqrt((middle + half) / (middle - half)) if middle - half > 1e-12 * middle else inf
