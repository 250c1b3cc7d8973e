"""The work between two transforms, each a single sweep over the arrays, compiled.

All kernels run over rows [a, b) and release the interpreter lock, so that `Rows` can share them
out over threads. Sums are taken row by row into `out` and added up in a fixed order: results do not
depend on the number of threads. `padded` arrays are those of `Grid.padded`: rows with two values
more than the grid has points.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any

import numpy as np
from numba import njit

from gfmd_cli.physics.fields import Field

kernel: Any = njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})


class Rows:
    """Shares the rows of a grid out over threads."""

    def __init__(self, rows: int, threads: int) -> None:
        self.rows = rows
        self.pool = ThreadPoolExecutor(threads) if threads > 1 else None
        edges = np.linspace(0, rows, threads + 1).astype(int)
        self.parts = [(int(a), int(b)) for a, b in pairwise(edges) if a < b]

    def __call__(self, sweep: Callable[..., None], *arguments: Any) -> None:
        """Run a kernel over all rows."""
        if self.pool is None or len(self.parts) == 1:
            sweep(*arguments, 0, self.rows)
        else:
            list(self.pool.map(lambda part: sweep(*arguments, *part), self.parts))

    def sums(self, count: int, sweep: Callable[..., None], *arguments: Any) -> Field:
        """Run a kernel whose last array takes `count` sums a row; return their totals."""
        out = np.zeros((self.rows, count))
        self(sweep, *arguments, out)
        totals: Field = out.sum(axis=0)
        return totals


@kernel
def score(h, u, sigma, out, a, b):  # type: ignore[no-untyped-def]
    """Squares of the violation min(g, sigma), of the force on free points, of the tension."""
    for i in range(a, b):
        violation = free = tension = 0.0
        for j in range(h.shape[1]):
            gap, s = u[i, j] - h[i, j], sigma[i, j]
            least = min(gap, s)
            violation += least * least
            square = s * s
            if gap != 0.0:
                free += square
            elif s < 0.0:
                tension += square
        out[i, 0], out[i, 1], out[i, 2] = violation, free, tension


@kernel
def hold(h, u, sigma, release, held, out, a, b):  # type: ignore[no-untyped-def]
    """Mark the points held in contact: on the indenter and, if `release`, not under tension."""
    for i in range(a, b):
        count = 0
        for j in range(h.shape[1]):
            on = u[i, j] == h[i, j] and not (release and sigma[i, j] < 0.0)
            held[i, j] = on
            count += on
        out[i, 0] = count


@kernel
def free_force(sigma, held, padded, a, b):  # type: ignore[no-untyped-def]
    """padded <- force -sigma on the free points, 0 on those held."""
    for i in range(a, b):
        for j in range(sigma.shape[1]):
            padded[i, j] = 0.0 if held[i, j] else -sigma[i, j]


@kernel
def slopes(sigma, held, change, padded, out, a, b):  # type: ignore[no-untyped-def]
    """padded <- z, zero where held; sums of z force and of z change."""
    for i in range(a, b):
        descent = turned = 0.0
        for j in range(sigma.shape[1]):
            z = 0.0 if held[i, j] else padded[i, j]
            padded[i, j] = z
            descent -= z * sigma[i, j]
            turned += z * change[i, j]
        out[i, 0], out[i, 1] = descent, turned


@kernel
def turn(padded, sigma, held, beta, direction, out, a, b):  # type: ignore[no-untyped-def]
    """direction <- z + beta direction on the free points; sum of direction times force."""
    for i in range(a, b):
        descent = 0.0
        for j in range(sigma.shape[1]):
            d = 0.0 if held[i, j] else padded[i, j] + beta * direction[i, j]
            direction[i, j] = d
            descent -= d * sigma[i, j]
        out[i, 0] = descent


@kernel
def projected_move(h, u, direction, length, padded, out, a, b):  # type: ignore[no-untyped-def]
    """padded <- max(u + length d, h) - u; count of the points that were stopped at h."""
    for i in range(a, b):
        stopped = 0
        for j in range(h.shape[1]):
            step, room = length * direction[i, j], h[i, j] - u[i, j]
            stopped += step < room
            padded[i, j] = max(step, room)
        out[i, 0] = stopped


@kernel
def crossing(h, u, direction, length, out, a, b):  # type: ignore[no-untyped-def]
    """Count of the points that u + length direction takes below h."""
    for i in range(a, b):
        count = 0
        for j in range(h.shape[1]):
            count += length * direction[i, j] < h[i, j] - u[i, j]
        out[i, 0] = count


@kernel
def along_move(h, u, sigma, direction, length, padded, out, a, b):  # type: ignore[no-untyped-def]
    """Of the move that K was applied to (`padded` = K move): sums -move sigma, move K move."""
    for i in range(a, b):
        fall = curvature = 0.0
        for j in range(h.shape[1]):
            move = max(length * direction[i, j], h[i, j] - u[i, j])
            fall -= move * sigma[i, j]
            curvature += move * padded[i, j]
        out[i, 0], out[i, 1] = fall, curvature


@kernel
def advance(h, u, sigma, direction, length, share, padded, change, a, b):  # type: ignore[no-untyped-def]
    """u += share move, and sigma += change with change = share K move (`padded` = K move)."""
    for i in range(a, b):
        for j in range(h.shape[1]):
            floor, old = h[i, j], u[i, j]
            if share == 1.0:
                u[i, j] = max(old + length * direction[i, j], floor)
            else:
                u[i, j] = max(old + share * max(length * direction[i, j], floor - old), floor)
            moved = share * padded[i, j]
            change[i, j] = moved
            sigma[i, j] += moved


@kernel
def stiffen(padded, k, factor, a, b):  # type: ignore[no-untyped-def]
    """Coefficients times factor k(q)."""
    for i in range(a, b):
        for j in range(k.shape[1]):
            weight = factor * k[i, j]
            padded[i, 2 * j] *= weight
            padded[i, 2 * j + 1] *= weight


@kernel
def soften(padded, k, screening, factor, a, b):  # type: ignore[no-untyped-def]
    """Coefficients times factor / (k(q) + screening)."""
    for i in range(a, b):
        for j in range(k.shape[1]):
            weight = factor / (k[i, j] + screening)
            padded[i, 2 * j] *= weight
            padded[i, 2 * j + 1] *= weight
