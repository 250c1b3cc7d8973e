"""Compiled kernels of the start on tiles; see `local_start` and `grid.rows`."""

import numpy as np

from gfmd_cli.grid.compilation import kernel
from gfmd_cli.solvers.tiles import SIDE


@kernel
def lay(w, level, h, used, u, entered, out, a, b):  # type: ignore[no-untyped-def]
    """u <- max(w - level, h); sums of the squares of h - u where that lifts u, outside the tiles.

    Marks the tiles outside in which u was lifted.
    """
    below = np.empty(h.shape[1])
    for i in range(a, b):
        total, tile = 0.0, i // SIDE
        for j in range(h.shape[1]):
            here = w[i, j] - level
            u[i, j] = max(here, h[i, j])
            below[j] = max(h[i, j] - here, 0.0) ** 2
        for block in range(used.shape[1]):
            outside = 0.0
            for j in range(SIDE * block, SIDE * block + SIDE):
                outside += below[j]
            if outside > 0.0 and not used[tile, block]:
                entered[tile, block] = True
                total += outside
        out[i, 0] = total
