"""A grid that several processes share, by a slab decomposition.

Each process holds a block of rows of a field and, between the transforms along the two axes, some
columns (wavenumbers along x) of the coefficients. An all-to-all exchange converts one into the
other. Every process computes smaller grids as a whole, with identical results.
"""

from dataclasses import dataclass, fields
from functools import cached_property
from itertools import pairwise
from typing import Any
from weakref import proxy

import numpy as np

from gfmd_cli.grid.arrays import Field
from gfmd_cli.grid.fft_grid import Grid, Shape
from gfmd_cli.grid.halo import DistributedRows, is_distributable
from gfmd_cli.grid.ranks import Ranks, is_root
from gfmd_cli.grid.transposition import Span, Transposition


def create_grid(grid: Grid, ranks: Ranks | None) -> Grid:
    """The grid, distributed if every process gets enough rows, and columns of coefficients."""
    if ranks is None or grid.dimension == 1 or grid.points // 2 + 1 < ranks.size:
        return grid
    if not is_distributable(grid.points_y, ranks.size):
        return grid
    return DistributedGrid(**_fields(grid), ranks=ranks)


def _fields(grid: Grid) -> dict[str, Any]:
    return {field.name: getattr(grid, field.name) for field in fields(Grid)}


@dataclass(frozen=True, kw_only=True)
class DistributedGrid(Grid):
    """The part of a two-dimensional grid that this process holds; `size` is that of the grid."""

    ranks: Ranks
    """The processes that share the grid."""

    @cached_property
    def rows(self) -> DistributedRows:
        """The rows of this process."""
        grid = proxy(self)  # a cycle of references would keep the memory of a grid that is done
        return DistributedRows(self.ranks, self.points_y, self._threads, lambda: grid._memory[1])

    @cached_property
    def spans(self) -> list[Span]:
        """First column of each process, and the column after its last."""
        return self._transposition(self.points // 2 + 1).spans

    @property
    def span(self) -> Span:
        """The columns of this process."""
        return self.spans[self.ranks.rank]

    @property
    def row_span(self) -> Span:
        """First row of this process, and the row after its last."""
        return self.rows.start, self.rows.stop

    def max(self, value: float) -> float:
        """Maximum over all processes."""
        return float(self.ranks.gather(value).max())

    def gather_columns(self, values: Field) -> Field:
        """Values over rows and the columns of `span`, of all columns, on every process."""
        counts = [len(values) * (last - first) for first, last in self.spans]
        own = np.ascontiguousarray(values.T)
        gathered = np.empty((sum(counts) // len(values), len(values)), values.dtype)
        self.ranks.wait(self.ranks.comm.Iallgatherv(own, [gathered, counts]))
        return gathered.T

    def _transposition(self, columns: int) -> Transposition:
        return Transposition(self.ranks, self.rows.edges, columns)

    def coarser(self, shape: Shape) -> Grid:
        """A grid of fewer points on the same cell; not distributed if it is too small."""
        return create_grid(Grid(**_fields(self)).coarser(shape), self.ranks)

    def select_modes(self, values: Any, m_y: Any, kept: int, source: Grid, target: Grid) -> Any:
        """The values at some wavenumbers, from the processes of one grid to those of another."""
        rows, rank, count = values[m_y], self.ranks.rank, self.ranks.size
        source_spans = _spans(source, [(0, kept), *[(0, 0)] * (count - 1)], kept)
        target_spans = _spans(target, [(0, kept)] * count, kept)
        own, wanted = source_spans[rank], target_spans[rank]
        parts = [rows[:, _shared(own, span, own[0])] for span in target_spans]
        columns = [_shared(span, wanted) for span in source_spans]
        sizes = [len(rows) * (c.stop - c.start) for c in columns]
        blocks = np.split(self._exchanged(parts, sizes), np.cumsum(sizes)[:-1])
        return np.concatenate([block.reshape(len(rows), -1) for block in blocks], axis=1)

    def gather_rows(self, values: Any, span: Span) -> Any:
        """The rows `span` of the grid, of all processes; each process may need others."""
        own = self.row_span
        parts = [values[_shared(own, (int(a), int(b)), own[0])] for a, b in self.ranks.gather(span)]
        rows = [_shared(other, span) for other in pairwise(self.rows.edges)]
        sizes = [(r.stop - r.start) * values[0].size for r in rows]
        return self._exchanged(parts, sizes).reshape(-1, *values.shape[1:])

    def _exchanged(self, parts: list[Any], sizes: list[int]) -> Any:
        """Send a part to each process; return the numbers of these sizes that each has sent."""
        sent = np.concatenate([part.ravel() for part in parts])
        received = np.empty(sum(sizes), sent.dtype)
        outgoing, incoming = [sent, [part.size for part in parts]], [received, sizes]
        self.ranks.wait(self.ranks.comm.Ialltoallv(outgoing, incoming))
        return received

    def collect(self, field: Field) -> Field | None:
        """All of a field, on the first process; None on the others."""
        gathered = np.empty(self.whole_shape, field.dtype) if is_root(self.ranks) else None
        counts = np.diff(self.rows.edges) * self.points
        target = None if gathered is None else [gathered, counts]
        self.ranks.wait(self.ranks.comm.Igatherv(np.ascontiguousarray(field), target))
        return gathered


def _spans(grid: Grid, whole: list[Span], kept: int) -> list[Span]:
    """The columns below `kept` of each process; `whole` if the grid is not distributed."""
    if not isinstance(grid, DistributedGrid):
        return whole
    return [(min(a, kept), min(b, kept)) for a, b in grid.spans]


def _shared(one: Span, other: Span, origin: int = 0) -> slice:
    """The indices in both spans, counted from `origin`."""
    first, last = max(one[0], other[0]), min(one[1], other[1])
    return slice(first - origin, max(first, last) - origin)
