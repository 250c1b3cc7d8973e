"""Compiled kernels of the start on tiles; see `local_start` and `grid.rows`."""

import numpy as np

from gfmd_cli.grid.compilation import kernel
from gfmd_cli.solvers.tiles import SIDE


@kernel
def penetration(w, level, h, used, entered, out, a, b):
    """Sums of the squares of h - (w - level) where that is positive, outside the tiles.

    Marks the tiles outside in which it is positive somewhere.
    """
    below = np.empty(h.shape[1])
    for i in range(a, b):
        total, tile = 0.0, i // SIDE
        for j in range(h.shape[1]):
            below[j] = max(h[i, j] - (w[i, j] - level), 0.0) ** 2
        for block in range(used.shape[1]):
            outside = 0.0
            for j in range(SIDE * block, SIDE * block + SIDE):
                outside += below[j]
            if outside > 0.0 and not used[tile, block]:
                entered[tile, block] = True
                total += outside
        out[i, 0] = total
