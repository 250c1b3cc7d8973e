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

from gfmd_cli.physics.fields import Field, Mask

THREADED = 256  # rows of a coarse level from which a second thread pays
kernel: Any = njit(
    cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"}
)


class Rows:
    """Shares the rows of a grid out over threads.

    Where a process holds some of the rows only, the arrays of sweeps that reach over to other rows
    have a frame, a few rows of the neighbours above and below; see `slab_rows`. Here there is none.
    """

    def __init__(self, rows: int, threads: int) -> None:
        self.rows = rows
        self.pool = ThreadPoolExecutor(threads) if threads > 1 else None
        edges = np.linspace(0, rows, threads + 1).astype(int)
        self.parts = [(int(a), int(b)) for a, b in pairwise(edges) if a < b]

    def __call__(self, sweep: Callable[..., None], *arguments: Any, first: int = 0) -> None:
        """Run a kernel over all rows, which are those from `first` on in its arrays."""
        if self.pool is None or len(self.parts) == 1:
            sweep(*arguments, first, first + self.rows)
        else:
            parts = [(first + a, first + b) for a, b in self.parts]
            list(self.pool.map(lambda part: sweep(*arguments, *part), parts))

    def sums(self, count: int, sweep: Callable[..., None], *arguments: Any) -> Field:
        """Run a kernel whose last array takes `count` sums a row; return their totals."""
        out = np.zeros((self.rows, count))
        self(sweep, *arguments, out)
        totals: Field = out.sum(axis=0)
        return totals

    def empty(self, *shape: int, dtype: Any) -> Any:
        """An array of rows of this shape, with a frame."""
        return np.empty((self.rows, *shape), dtype)

    def inside(self, framed: Any) -> Any:
        """The rows without the frame."""
        return framed

    def framed(self, field: Field) -> Field:
        """A field with a frame; good until the next transform."""
        return field

    def meet(self, *framed: Any) -> None:
        """Fill the frames with what lies there."""

    def over(self, sweep: Callable[..., None], *arguments: Any) -> None:
        """Run a kernel over arrays with frames."""
        self(sweep, *arguments)

    def framed_sums(self, count: int, sweep: Callable[..., None], *arguments: Any) -> Field:
        """Likewise, with sums; see `sums`."""
        return self.sums(count, sweep, *arguments)

    def coarser(self) -> "Rows":
        """Every other row."""
        rows = self.rows // 2
        return Rows(rows, len(self.parts) if rows >= THREADED else 1)

    def from_finer(self, sweep: Callable[..., None], sources: Any, targets: Any) -> None:
        """Run a kernel from framed arrays of rows twice as dense into framed arrays of these."""
        self(sweep, *sources, *targets)

    def for_finer(self, framed: Any) -> Any:
        """Framed rows as a kernel over framed rows twice as dense takes them."""
        return framed

    def every(self, mask: Mask) -> bool:
        """Whether all of a framed mask is true."""
        return bool(mask.all())


FREE, TENSE, PRESSED = 0, 1, 2
"""Marks of a point: off the indenter; on it, but under tension; pressed against it.

A kernel holds the points whose mark is at least its `least`: PRESSED or, where tension is not let
go, TENSE.
"""


@kernel
def score(h, u, sigma, out, a, b):  # type: ignore[no-untyped-def]
    """Squares of the violation min(g, sigma)."""
    for i in range(a, b):
        violation = 0.0
        for j in range(h.shape[1]):
            worst = min(u[i, j] - h[i, j], sigma[i, j])
            violation += worst * worst
        out[i, 0] = violation


@kernel
def _judge(gap, s):  # type: ignore[no-untyped-def]
    """Squares of violation, free force and tension of a point, and its mark."""
    worst, square = min(gap, s), s * s
    off, drawn = gap != 0.0, s < 0.0
    return (
        worst * worst,
        square if off else 0.0,
        square if drawn and not off else 0.0,
        FREE if off else (TENSE if drawn else PRESSED),
    )


@kernel
def mark(h, u, sigma, marks, out, a, b):  # type: ignore[no-untyped-def]
    """Mark the points; squares of the violation, of the force on free points, of the tension."""
    for i in range(a, b):
        violation = free = tension = 0.0
        for j in range(h.shape[1]):
            v, f, t, marks[i, j] = _judge(u[i, j] - h[i, j], sigma[i, j])
            violation, free, tension = violation + v, free + f, tension + t
        out[i, 0], out[i, 1], out[i, 2] = violation, free, tension


@kernel
def pattern(marks, least, out, a, b):  # type: ignore[no-untyped-def]
    """Count of the points held, and of the changes to the next point along row and column."""
    rows, columns = marks.shape
    for i in range(a, b):
        below = i + 1 if i + 1 < rows else 0
        held = changes = 0
        for j in range(columns):
            here = marks[i, j] >= least
            held += here
            changes += here != (marks[below, j] >= least)
        for j in range(columns - 1):
            changes += (marks[i, j] >= least) != (marks[i, j + 1] >= least)
        changes += (marks[i, columns - 1] >= least) != (marks[i, 0] >= least)
        out[i, 0], out[i, 1] = held, changes


@kernel
def free_force(sigma, marks, least, padded, a, b):  # type: ignore[no-untyped-def]
    """padded <- force -sigma on the free points, 0 on those held."""
    for i in range(a, b):
        for j in range(sigma.shape[1]):
            padded[i, j] = 0.0 if marks[i, j] >= least else -sigma[i, j]


@kernel
def slopes(sigma, marks, least, change, padded, out, a, b):  # type: ignore[no-untyped-def]
    """Of z (`padded`) on the free points: sums of z force and of z change."""
    for i in range(a, b):
        descent = turned = 0.0
        for j in range(sigma.shape[1]):
            z = 0.0 if marks[i, j] >= least else padded[i, j]
            descent -= z * sigma[i, j]
            turned += z * change[i, j]
        out[i, 0], out[i, 1] = descent, turned


@kernel
def turn(h, u, sigma, marks, least, z, beta, direction, length, padded, out, a, b):  # type: ignore[no-untyped-def]
    """direction <- z + beta direction on the free points, and the projected move along it.

    padded <- move max(u + length d, h) - u; z may lie there. Sums of direction times force and of
    move times force; count of the points that were stopped at h.
    """
    for i in range(a, b):
        descent = fall = 0.0
        stopped = 0
        for j in range(h.shape[1]):
            d = 0.0 if marks[i, j] >= least else z[i, j] + beta * direction[i, j]
            direction[i, j] = d
            d = direction[i, j]  # as rounded
            step, room = length * d, h[i, j] - u[i, j]
            move = max(step, room)
            stopped += step < room
            descent -= d * sigma[i, j]
            fall -= move * sigma[i, j]
            padded[i, j] = move
        out[i, 0], out[i, 1], out[i, 2] = descent, fall, stopped


@kernel
def move(h, u, sigma, direction, length, padded, out, a, b):  # type: ignore[no-untyped-def]
    """padded <- max(u + length d, h) - u; sum of move times force, count of points stopped at h."""
    for i in range(a, b):
        fall = 0.0
        stopped = 0
        for j in range(h.shape[1]):
            step, room = length * direction[i, j], h[i, j] - u[i, j]
            way = max(step, room)
            stopped += step < room
            fall -= way * sigma[i, j]
            padded[i, j] = way
        out[i, 0], out[i, 1] = fall, stopped


@kernel
def crossing(h, u, direction, length, out, a, b):  # type: ignore[no-untyped-def]
    """Count of the points that u + length direction takes below h."""
    for i in range(a, b):
        count = 0
        for j in range(h.shape[1]):
            count += length * direction[i, j] < h[i, j] - u[i, j]
        out[i, 0] = count


@kernel
def advance(h, u, sigma, direction, length, share, padded, change, marks, out, a, b):  # type: ignore[no-untyped-def]
    """u += share move; sigma += change, change = share K move (`padded` = K move); and `mark`."""
    for i in range(a, b):
        violation = free = tension = 0.0
        for j in range(h.shape[1]):
            floor, old = h[i, j], u[i, j]
            way = max(length * direction[i, j], floor - old)
            new = max(old + share * way, floor)
            if share == 1.0:
                new = max(old + length * direction[i, j], floor)
            moved = share * padded[i, j]
            u[i, j], sigma[i, j], change[i, j] = new, sigma[i, j] + moved, moved
            v, f, t, marks[i, j] = _judge(u[i, j] - floor, sigma[i, j])  # as rounded
            violation, free, tension = violation + v, free + f, tension + t
        out[i, 0], out[i, 1], out[i, 2] = violation, free, tension


@kernel
def stiffen(padded, k, factor, first, final, out, a, b):  # type: ignore[no-untyped-def]
    """Coefficients times factor k(q); sum over all q of k(q) |coefficient|^2.

    `first` and `final`: whether a row begins at q_x = 0, and ends at the highest q_x.
    """
    last = k.shape[1] - 1
    for i in range(a, b):
        total = 0.0
        ends = first * k[i, 0] * (padded[i, 0] ** 2 + padded[i, 1] ** 2)
        ends += final * k[i, last] * (padded[i, 2 * last] ** 2 + padded[i, 2 * last + 1] ** 2)
        for j in range(k.shape[1]):
            weight, re, im = k[i, j], padded[i, 2 * j], padded[i, 2 * j + 1]
            total += weight * (re * re + im * im)
            padded[i, 2 * j] = factor * weight * re
            padded[i, 2 * j + 1] = factor * weight * im
        out[i, 0] = 2 * total - ends  # a coefficient stands for q and -q, but at both ends


@kernel
def soften(padded, k, screening, factor, a, b):  # type: ignore[no-untyped-def]
    """Coefficients times factor / (k(q) + screening)."""
    for i in range(a, b):
        for j in range(k.shape[1]):
            weight = factor / (k[i, j] + screening)
            padded[i, 2 * j] *= weight
            padded[i, 2 * j + 1] *= weight
