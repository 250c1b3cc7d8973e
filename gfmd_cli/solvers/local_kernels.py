"""Compiled kernels of the start on tiles; see `local_start` and `grid.rows`."""

import numpy as np

from gfmd_cli.grid.compilation import kernel
from gfmd_cli.solvers.tiles import SIDE

BATCH_SIZE = 8  # tiles that are convolved at once: the 8 numbers of a point lie next to each other
WINDOW_WIDTH = 3 * SIDE * BATCH_SIZE  # numbers of a row of points in the 3 x 3 tiles around each
TILE_WIDTH = SIDE * BATCH_SIZE  # numbers between points of neighbouring tiles


@kernel
def mark_entered(w, level, h, used, entered, sums, a, b):
    """Mark the tiles that are not used in which w - level is below h somewhere.

    `sums` receives the sum of w^2 of each row.
    """
    below = np.empty(h.shape[1], np.bool_)
    for i in range(a, b):
        squares = 0.0
        for j in range(h.shape[1]):
            below[j] = w[i, j] - level < h[i, j]
            squares += w[i, j] * w[i, j]
        sums[i, 0] = squares
        for block in range(used.shape[1]):
            somewhere = False
            for j in range(SIDE * block, SIDE * block + SIDE):
                somewhere |= below[j]
            if somewhere and not used[i // SIDE, block]:
                entered[i // SIDE, block] = True


@kernel
def convolve(values, neighbours, quadrant, out, a, b):
    """Convolve values on the tiles [a, b) with a kernel that is even along both axes.

    `values` has the shape (tiles + 1, 64), zero in the last row; `neighbours` and `out` are as in
    `Tiles`. `quadrant` holds the kernel at distances from 0 to 8, shape (9, 9), halved for each
    distance of 0: values at opposite distances are added before they are multiplied.
    """
    window = np.empty((3 * SIDE, WINDOW_WIDTH), np.float32)
    pairs = np.empty(WINDOW_WIDTH, np.float32)
    row = np.empty(TILE_WIDTH, np.float32)
    for first in range(a, b, BATCH_SIZE):
        count = min(BATCH_SIZE, b - first)
        for t in range(count):
            for n in range(9):
                tile = values[neighbours[first + t, n]]
                for i in range(SIDE):
                    for j in range(SIDE):
                        column = SIDE * (n % 3) + j
                        window[SIDE * (n // 3) + i, BATCH_SIZE * column + t] = tile[SIDE * i + j]
        for i in range(SIDE):
            row[:] = 0.0
            for y in range(SIDE + 1):
                above, below = window[SIDE + i - y], window[SIDE + i + y]
                for j in range(WINDOW_WIDTH):
                    pairs[j] = above[j] + below[j]
                for x in range(0, SIDE + 1, 3):  # three at a time, which saves loads and stores
                    k0, k1, k2 = quadrant[y, x], quadrant[y, x + 1], quadrant[y, x + 2]
                    left = pairs[TILE_WIDTH - BATCH_SIZE * (x + 2) :]
                    right = pairs[TILE_WIDTH + BATCH_SIZE * x :]
                    for j in range(TILE_WIDTH):
                        row[j] += (
                            k0 * (left[j + 2 * BATCH_SIZE] + right[j])
                            + k1 * (left[j + BATCH_SIZE] + right[j + BATCH_SIZE])
                            + k2 * (left[j] + right[j + 2 * BATCH_SIZE])
                        )
            for j in range(SIDE):
                for t in range(count):
                    out[first + t, SIDE * i + j] = row[BATCH_SIZE * j + t]
