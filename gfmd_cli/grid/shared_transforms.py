"""Transforms in place that threads share: each takes a part of the rows, then of the columns.

The threads meet twice in a transform. Those of FFTW itself meet up to thousands of times, and wait
each time until the system runs the last one: with another process on one of two cores, a pair of
transforms of 3200^2 took 5 to 50 times as long as on one thread.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from operator import call

import numpy as np

from gfmd_cli.grid.arrays import Field, Modes
from gfmd_cli.grid.plans import Plan
from gfmd_cli.grid.rows import LocalRows
from gfmd_cli.grid.transposition import Span

CACHE_LINE = 8  # complex numbers in single precision in a line of the cache

Execute = Callable[[], None]
Pair = tuple[Execute, Execute]
"""A transform and its inverse."""
Pairs = tuple[list[Execute], list[Execute]]
"""The same for some parts of an array."""


def in_place(real: Field, work: Modes, rows: LocalRows, fftw: Plan) -> Pair:
    """The transform of real values to coefficients in the same memory, and back, without 1/size."""
    if rows.pool is None:
        axes = tuple(range(work.ndim))
        forward = fftw(real, work, axes, "FFTW_FORWARD")
        return forward.execute, fftw(work, real, axes, "FFTW_BACKWARD").execute
    along, back_along = along_rows(real, work, rows.parts, fftw)
    across, back_across = along_columns(work, len(rows.parts), fftw)
    return in_turn(rows.pool, along, across), in_turn(rows.pool, back_across, back_along)


def along_rows(real: Field, work: Modes, parts: Sequence[Span], fftw: Plan) -> Pairs:
    """The transforms of some parts of the rows of real values to coefficients, and back."""
    arrays = [(real[a:b], work[a:b]) for a, b in parts]
    forward = [fftw(values, modes, (1,), "FFTW_FORWARD").execute for values, modes in arrays]
    return forward, [fftw(modes, values, (1,), "FFTW_BACKWARD").execute for values, modes in arrays]


def along_columns(work: Modes, count: int, fftw: Plan) -> Pairs:
    """The transforms of `count` parts of the columns in place, and back."""
    lines = np.linspace(0, -(-work.shape[1] // CACHE_LINE), count + 1).astype(int)
    edges = np.minimum(lines * CACHE_LINE, work.shape[1])
    parts = [work[:, a:b] for a, b in pairwise(edges) if a < b]
    forward = [fftw(part, part, (0,), "FFTW_FORWARD").execute for part in parts]
    return forward, [fftw(part, part, (0,), "FFTW_BACKWARD").execute for part in parts]


def in_turn(pool: ThreadPoolExecutor | None, *stages: Sequence[Execute]) -> Execute:
    """A call that runs the stages one after the other, and the parts of a stage side by side."""

    def run() -> None:
        for stage in stages:
            side_by_side(pool, stage)

    return run


def side_by_side(pool: ThreadPoolExecutor | None, calls: Sequence[Execute]) -> None:
    """Run calls on the threads of a pool; without one, one after the other."""
    list(map(call, calls) if pool is None else pool.map(call, calls))
