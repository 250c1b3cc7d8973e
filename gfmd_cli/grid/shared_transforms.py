"""Transforms in place along the rows and the columns of an array, whose parts threads share.

The threads meet after the rows and after the columns. Those of FFTW itself meet up to thousands of
times, and wait each time until the system runs the last one: with another process on one of two
cores, a pair of transforms of 3200^2 took twice as long as on one thread (docs/performance.md).

The columns of a large or padded array are copied in blocks, which stay in the cache of a core while
they are transformed, multiplied and transformed back.
"""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import cycle, pairwise
from math import ceil, prod
from operator import call
from typing import Any

import numpy as np
import pyfftw

from gfmd_cli.grid.arrays import Field, Modes, aligned
from gfmd_cli.grid.plans import Planner, planned_transforms
from gfmd_cli.grid.rows import LocalRows
from gfmd_cli.grid.transposition import Transposition

BLOCK_COEFFICIENTS = 2**17  # in a block of columns; 2^16 to 2^18 take as long
MIN_BLOCK_COLUMNS = 32  # shorter pieces of rows take longer to copy
MIN_COPIED_BYTES = 24 * 2**20  # columns are copied where a thread has more coefficients; measured
PLANNED_COEFFICIENTS = 2**19
"""In a block of rows, whose plan serves for all. Planning the rows of 4096^2 in both precisions
takes 2.0 s then instead of 5.5 s. The transforms take as long, within the scatter of a tenth
(`scripts/row_blocks.py`)."""
BLOCK_ROWS = 8  # rows per call where rows of zeros are skipped; each block begins aligned
CACHE_LINE = 8  # complex numbers in single precision in a line of the cache

Execute = Callable[[], None]
Planned = Callable[[Callable[[Planner], Any]], Any]
"""`planned_transforms` for the size of a grid."""


class RowTransforms:
    """Transforms of real rows to coefficients in the same memory, and back, without a factor.

    Parameters
    ----------
    values, lines : the rows as real values and as coefficients
    rows : the threads, and the rows that each transforms
    planned : makes plans that are needed later
    """

    def __init__(
        self, values: Field, lines: Modes, rows: LocalRows, fftw: Planner, planned: Planned
    ) -> None:
        self.values, self.lines, self.pool, self.planned = values, lines, rows.pool, planned
        shares = [_equal_blocks(*part, lines.shape[1]) for part in rows.parts]

        def plan(source: Any, target: Any, way: str) -> list[Execute]:
            plans = ([fftw(source[r], target[r], (1,), way).execute for r in s] for s in shares)
            return [partial(side_by_side, None, blocks) for blocks in plans]

        self._forward = plan(values, lines, "FFTW_FORWARD")
        self._backward = plan(lines, values, "FFTW_BACKWARD")
        self._count = len(rows.parts) if len(lines) % BLOCK_ROWS == 0 else 0

    def forward(self, blocks: Sequence[int] | None = None) -> None:
        """Transform all rows, or some blocks of `BLOCK_ROWS` rows while the others are zero."""
        calls, count = self._forward, self._count
        if blocks is not None and count:
            self.lines.view(self.values.dtype)[:, self.values.shape[1] :] = 0.0
            shares = ((plan, blocks[i::count]) for i, plan in enumerate(self._of_block))
            calls = [partial(self._transform, *share) for share in shares]
        side_by_side(self.pool, calls)

    @cached_property
    def _of_block(self) -> Any:
        """Plans of a block for each thread, made when they are needed."""
        block = pyfftw.empty_aligned((BLOCK_ROWS, self.lines.shape[1]), dtype=self.lines.dtype)
        real = block.view(self.values.dtype)[:, : self.values.shape[1]]

        def make(fftw: Planner) -> list[Any]:
            return [fftw(real, block, (1,), "FFTW_FORWARD") for _ in range(self._count)]

        return self.planned(make)

    def backward(self) -> None:
        """Transform all rows back."""
        side_by_side(self.pool, self._backward)

    def _transform(self, plan: Any, blocks: Iterable[int]) -> None:
        for block in blocks:
            rows = slice(BLOCK_ROWS * block, BLOCK_ROWS * (block + 1))
            plan.update_arrays(self.values[rows], self.lines[rows])
            plan.execute()


def _equal_blocks(first: int, last: int, columns: int) -> list[slice]:
    """Blocks of as many rows each, so that the plan of one serves for all; each begins aligned.

    All rows are one block where their number is not a multiple of `BLOCK_ROWS`.
    """
    count = last - first
    most = min(PLANNED_COEFFICIENTS // columns, count)
    size = max(
        (n for n in range(BLOCK_ROWS, most + 1, BLOCK_ROWS) if count % n == 0), default=count
    )
    return [slice(a, a + size) for a in range(first, last, size)]


@dataclass
class Columns:
    """Some columns of coefficients, in place or copied."""

    part: slice
    """Which columns of all."""
    array: Modes
    """Holds their coefficients, all rows of them."""
    first: int
    """The column of `array` with the first of them."""
    forward: Execute
    """Transforms them."""
    backward: Execute
    """Transforms them back."""

    @property
    def coefficients(self) -> Modes:
        """The coefficients of these columns."""
        return self.array[:, self.first : self.first + self.part.stop - self.part.start]


class ColumnTransforms:
    """Transforms of the columns of coefficients, and back, without a factor; see `run`.

    Parameters
    ----------
    work : the coefficients
    rows : the threads
    length : number of rows to which the columns are padded by zeros
    """

    def __init__(self, work: Modes, rows: LocalRows, fftw: Planner, length: int) -> None:
        self.work, self.pool = work, rows.pool
        count, columns = len(rows.parts), work.shape[1]
        is_large = work.nbytes >= MIN_COPIED_BYTES * count and len(work) > 1
        self.is_copied = length > len(work) or is_large

        def plan(array: Modes) -> tuple[Execute, Execute]:
            directions = ("FFTW_FORWARD", "FFTW_BACKWARD")
            forward, backward = (fftw(array, array, (0,), way).execute for way in directions)
            return forward, backward

        if self.is_copied:
            width = max(BLOCK_COEFFICIENTS // length, MIN_BLOCK_COLUMNS)
            width = ceil(columns / (count * max(1, round(columns / width / count))))
            parts = [slice(a, min(a + width, columns)) for a in range(0, columns, width)]
            blocks = [pyfftw.empty_aligned((length, width), work.dtype) for _ in range(count)]
            plans = [plan(block) for block in blocks]
            for block in blocks:
                block[...] = 0.0
            of_thread = list(zip(blocks, plans, strict=True))
            pairs = zip(parts, cycle(of_thread))
            self.blocks = [Columns(part, block, 0, *both) for part, (block, both) in pairs]
        else:
            lines = np.linspace(0, -(-columns // CACHE_LINE), count + 1).astype(int)
            edges = np.minimum(lines * CACHE_LINE, columns)
            parts = [slice(int(a), int(b)) for a, b in pairwise(edges) if a < b]
            self.blocks = [Columns(p, work, p.start, *plan(work[:, p])) for p in parts]
        self.shares = [range(i, len(self.blocks), count) for i in range(count)]

    def run(self, step: Callable[[Columns], None], kept: int | None = None) -> None:
        """Call `step` for all columns, or for blocks that contain one of the first `kept`."""
        rows, end = len(self.work), self.work.shape[1] if kept is None else kept

        def share(numbers: range) -> None:
            for i in numbers:
                columns = self.blocks[i]
                if columns.part.start >= end:
                    continue
                if self.is_copied:
                    columns.coefficients[:rows] = self.work[:, columns.part]
                    columns.coefficients[rows:] = 0.0
                step(columns)
                if self.is_copied:
                    self.work[:, columns.part] = columns.coefficients[:rows]

        side_by_side(self.pool, [partial(share, numbers) for numbers in self.shares])


def transform_memory(
    rows: LocalRows, columns: int, kind: Any, transposition: Transposition | None
) -> list[Modes]:
    """Memory of the coefficients of a field; with a transposition, a second array for the exchange.

    The second array is also enough for a real field with its halo.

    Parameters
    ----------
    columns : number of coefficients of a row of the field
    """
    if transposition is None:
        return [aligned(rows.count * columns, kind)]
    first, last = transposition.span
    size = max(rows.count * columns, transposition.edges[-1] * (last - first))
    return [aligned(size, kind), aligned((rows.count + 2 * rows.halo) * columns, kind)]


class FieldTransforms:
    """Transforms of a field along both axes and back, in one memory, without a factor.

    Transforms in place need a field less and a third less time than those between two arrays. The
    plans are made with the arrays, because measuring a plan overwrites them.

    Parameters
    ----------
    memory : from `transform_memory`
    points : number of real values of a row
    rows : the rows of this process
    transposition : exchange between the processes that share the field; None for one process
    padded_rows : number of rows to which the columns are padded by zeros; 0 for no padding
    is_temporary : as of `planned_transforms`
    """

    def __init__(
        self,
        memory: Sequence[Modes],
        points: int,
        rows: LocalRows,
        transposition: Transposition | None,
        *,
        padded_rows: int = 0,
        is_temporary: bool = False,
    ) -> None:
        shape = (rows.count, points // 2 + 1)
        self.lines: Modes = memory[0][: prod(shape)].reshape(shape)
        """Coefficients transformed along x: all of the rows of this process."""
        self.work = self.lines
        """Coefficients of the columns of this process, all rows of them; in the same memory."""
        if transposition is not None:
            first, last = transposition.span
            shape = (transposition.edges[-1], last - first)
            self.work = memory[0][: prod(shape)].reshape(shape)
        real = self.lines.real.dtype
        self.values: Field = self.lines.view(real)[:, :points]
        """The rows as real values."""
        self._transposition = transposition
        self._arrays = self.lines, self.work, memory[-1]

        size = len(self.work) * points
        planned = partial(planned_transforms, size=size, is_temporary=is_temporary)

        def make(fftw: Planner) -> tuple[RowTransforms, ColumnTransforms]:
            length = padded_rows or len(self.work)
            along_columns = ColumnTransforms(self.work, rows, fftw, length)
            return RowTransforms(self.values, self.lines, rows, fftw, planned), along_columns

        self.along_rows, self.along_columns = planned(make)

    def to_columns(self, blocks: Sequence[int] | None = None) -> None:
        """`work` <- `values` transformed along x; `blocks` as in `RowTransforms.forward`."""
        self.along_rows.forward(blocks)
        if self._transposition is not None:
            self._transposition.to_columns(*self._arrays)

    def to_values(self) -> None:
        """`values` <- `work` transformed back along x."""
        if self._transposition is not None:
            self._transposition.to_lines(*self._arrays)
        self.along_rows.backward()

    def filter(
        self, multiply: Callable[[Columns], None], blocks: Sequence[int] | None = None
    ) -> None:
        """Transform `values`, multiply the coefficients and transform them back."""

        def step(columns: Columns) -> None:
            columns.forward()
            multiply(columns)
            columns.backward()

        self.to_columns(blocks)
        self.along_columns.run(step)
        self.to_values()


def side_by_side(pool: ThreadPoolExecutor | None, calls: Sequence[Execute]) -> None:
    """Run calls on the threads of a pool; without one, one after the other."""
    list(map(call, calls) if pool is None else pool.map(call, calls))
