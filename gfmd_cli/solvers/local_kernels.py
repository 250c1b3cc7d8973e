"""Compiled kernels of the start on tiles; see `local_start` and `grid.rows`."""

from gfmd_cli.grid.compilation import kernel
from gfmd_cli.solvers.tiles import SIDE


@kernel
def lay(w, level, h, used, u, entered, out, a, b):  # type: ignore[no-untyped-def]
    """u <- max(w - level, h); sums of the squares of h - u where that lifts u, outside the tiles.

    Marks the tiles outside in which u was lifted.
    """
    for i in range(a, b):
        total = 0.0
        tile = i // SIDE
        for block in range(used.shape[1]):
            outside = 0.0
            for j in range(SIDE * block, SIDE * block + SIDE):
                below = max(h[i, j] - (w[i, j] - level), 0.0)
                u[i, j] = w[i, j] - level if below == 0.0 else h[i, j]
                outside += below * below
            if outside > 0.0 and not used[tile, block]:
                entered[tile, block] = True
                total += outside
        out[i, 0] = total
