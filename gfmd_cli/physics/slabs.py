"""A grid that many processes share: fields by rows, Fourier coefficients by columns.

Each process holds some rows of a field and, between the transforms, some columns (wavenumbers along
x) of the coefficients; one exchange of all with all turns the one into the other. Grids too small
to share out are `Grid`s that every process computes whole, and alike.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import pyfftw

from gfmd_cli.physics import wisdom
from gfmd_cli.physics.fields import Field, Modes
from gfmd_cli.physics.grid import PLANNING, Grid, Span
from gfmd_cli.physics.ranks import LONG_AWAKE, Ranks, leads
from gfmd_cli.physics.slab_rows import FRAME, SlabRows, SummedRows, suits
from gfmd_cli.physics.sweeps import Rows


def lay_out(points: int, dimension: int, length: float, ranks: Ranks | None) -> Grid:
    """The grid, shared out where there are processes to share it and enough of it."""
    if ranks is None or dimension == 1 or not suits(points, ranks.size):
        return Grid(points, dimension, length)
    return SlabGrid(points, dimension, length, ranks=ranks)


@dataclass(frozen=True)
class SlabGrid(Grid):
    """The share of one process in a two-dimensional grid; `size` is that of all of it."""

    ranks: Ranks | None = None

    @cached_property
    def team(self) -> Ranks:
        """The processes."""
        assert self.ranks is not None
        return self.ranks

    @cached_property
    def rows(self) -> SlabRows:
        """The rows of this process."""
        return SlabRows(self.team, self.points, self._threads, lambda: self._memory[1])

    @cached_property
    def spectral_rows(self) -> Rows:
        """All rows of coefficients, of some columns."""
        return SummedRows(self.team, self.points, self._threads)

    @cached_property
    def spans(self) -> list[Span]:
        """First and last but one column of each process."""
        columns, count = self.points // 2 + 1, self.team.size
        edges = [columns * rank // count for rank in range(count + 1)]
        return list(pairwise(edges))

    @property
    def span(self) -> Span:
        """The columns of this process."""
        return self.spans[self.team.rank]

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the rows of this process."""
        return self.rows.rows, self.points

    @property
    def spectral_shape(self) -> tuple[int, ...]:
        """Shape of the coefficients of this process."""
        first, last = self.span
        return self.points, last - first

    @property
    def own(self) -> slice:
        """The rows of this process."""
        return slice(self.rows.start, self.rows.stop)

    @property
    def whole(self) -> bool:
        """No: this process holds some of the rows only."""
        return False

    def total(self, values: Any) -> Any:
        """Sum over all processes."""
        return self.team.total(values)

    def most(self, value: float) -> float:
        """Largest over all processes."""
        return float(self.team.gather(value).max())

    def line(self, symbol: Field) -> Field:
        """The values of a symbol along x, of all processes."""
        return self._joined(symbol[0], [last - first for first, last in self.spans])

    def _joined(self, values: Field, counts: Any) -> Field:
        """One array of the values of all processes."""
        found = np.empty(sum(counts), values.dtype)
        self.team.wait(self.team.comm.Iallgatherv(np.ascontiguousarray(values), [found, counts]))
        return found

    @cached_property
    def _memory(self) -> tuple[Any, Field]:
        """Memory of coefficients, and as much again, as real values, for the exchange."""
        rows, columns = self.rows.rows, self.points // 2 + 1
        size = max(rows * columns, self.points * self.spectral_shape[1])
        kind = np.result_type(self.real, np.complex64)
        room = max(size, (rows + 2 * FRAME) * self.points // 2)
        return pyfftw.empty_aligned(size, kind), pyfftw.empty_aligned(2 * room, self.real)

    @cached_property
    def _workspace(self) -> tuple[Modes, Callable[[], None], Callable[[], None]]:
        shape = self.spectral_shape
        work = self._memory[0][: shape[0] * shape[1]].reshape(shape)
        lines = self._lines()
        real = lines.view(self.real)[:, : self.points]

        def plan(flags: tuple[str, ...]) -> list[Callable[[], None]]:
            ways = (
                (real, lines, 1, "FFTW_FORWARD"),
                (work, work, 0, "FFTW_FORWARD"),
                (work, work, 0, "FFTW_BACKWARD"),
                (lines, real, 1, "FFTW_BACKWARD"),
            )
            return [
                pyfftw.FFTW(
                    source,
                    target,
                    (axis,),
                    way,
                    flags,
                    threads=self._threads,
                    planning_timelimit=PLANNING[0] + PLANNING[1] * real.size,
                ).execute
                for source, target, axis, way in ways
            ]

        along, across, back_across, back_along = wisdom.planned(plan)

        def forward() -> None:
            along()
            self._turn(to_columns=True)
            across()

        def backward() -> None:
            back_across()
            self._turn(to_columns=False)
            back_along()

        return work, forward, backward

    @property
    def padded(self) -> Field:
        """Rows of real values in the same memory, two more than the grid has points a row."""
        self.work  # noqa: B018 - planning the transforms overwrites the memory: let it be first
        return self._lines().view(self.real)

    def _lines(self) -> Modes:
        """Memory of coefficients as rows, transformed along x."""
        rows, columns = self.rows.rows, self.points // 2 + 1
        lines: Modes = self._memory[0][: rows * columns].reshape(rows, columns)
        return lines

    def _turn(self, to_columns: bool) -> None:
        """Exchange all with all: rows of coefficients for columns, or back, in the same memory."""
        home, lines, rows = self._memory[0], self._lines(), self.rows.rows
        spare = self._memory[1].view(home.dtype)[: lines.size]
        blocks = [spare[rows * a : rows * b].reshape(rows, b - a) for a, b in self.spans]
        width = self.spectral_shape[1]
        in_lines = [spare, [block.size for block in blocks]]
        in_columns = [home[: self.points * width], np.diff(self.rows.edges) * width]
        if to_columns:
            for (a, b), block in zip(self.spans, blocks, strict=True):
                block[...] = lines[:, a:b]
            self._finish(self.team.comm.Ialltoallv(in_lines, in_columns))
        else:
            self._finish(self.team.comm.Ialltoallv(in_columns, in_lines))
            for (a, b), block in zip(self.spans, blocks, strict=True):
                lines[:, a:b] = block

    def _finish(self, exchange: Any) -> None:
        self.team.wait(exchange, awake=LONG_AWAKE)

    def coarser(self, points: int) -> Grid:
        """A grid of fewer points on the same cell; whole where it is too small to share out."""
        if suits(points, self.team.size):
            return super().coarser(points)
        return Grid(points, self.dimension, self.length, self.threads, self.precision)

    def cut(self, symbol: Field, target: Grid) -> Field:
        """The values of a symbol at the wavenumbers of a coarser grid."""
        half = target.points // 2
        rows = np.concatenate([symbol[:half], symbol[-half:]])
        moved: Field = self._moved(rows, self, target, half + 1)
        return moved

    def resample(self, field: Field, target: Grid) -> Field:
        """The same trigonometric polynomial on another grid; see `Grid.resample`."""
        return self._carried(self, field, target)

    def take(self, source: Grid, field: Field) -> Field:
        """A field of a grid that every process holds whole; that of the first counts."""
        return self._carried(source, field, self)

    def _carried(self, source: Grid, field: Field, target: Grid) -> Field:
        modes, out = source.forward_into_work(field), target.work
        finer = target.points > source.points
        half = min(source.points, target.points) // 2
        if finer:  # the highest mode stands for +q and -q alike
            modes[half] *= 0.5
            if source.ends[1]:
                modes[:, -1] *= 0.5
        kept = half + finer
        negative = slice(-half, None) if finer else slice(1 - half, None)
        rows = np.concatenate([modes[:kept], modes[negative]])
        rows = self._moved(rows, source, target, kept)
        out[...] = 0.0
        out[:kept, : rows.shape[1]] = rows[:kept]
        out[negative, : rows.shape[1]] = rows[kept:]
        resampled = target.empty()
        target.backward_into(resampled)
        resampled *= 1.0 / source.size
        return resampled

    def _moved(self, rows: Any, source: Grid, target: Grid, kept: int) -> Any:
        """The columns below `kept` of the rows of one grid, where another grid has them."""
        rank, count = self.team.rank, self.team.size
        have = _spans(source, [(0, kept), *[(0, 0)] * (count - 1)], kept)
        want = _spans(target, [(0, kept)] * count, kept)
        away = [_shared(have[rank], span) for span in want]
        come = [_shared(span, want[rank]) for span in have]
        sent = np.concatenate([rows[:, slice(*_from(s, have[rank]))].ravel() for s in away])
        height = len(rows)
        got = np.empty(height * sum(b - a for a, b in come), rows.dtype)
        outgoing = [sent, [height * (b - a) for a, b in away]]
        incoming = [got, [height * (b - a) for a, b in come]]
        self.team.wait(self.team.comm.Ialltoallv(outgoing, incoming))
        first, last = want[rank]
        found, at = np.empty((height, last - first), rows.dtype), 0
        for a, b in come:
            end = at + height * (b - a)
            found[:, a - first : b - first] = got[at:end].reshape(height, b - a)
            at = end
        return found

    def below(self, lines: Any) -> Any:
        """The first row of the next process."""
        rank, count = self.team.rank, self.team.size
        found = np.empty_like(lines[0])
        first = np.ascontiguousarray(lines[0])
        comm = self.team.comm
        self.team.wait(comm.Irecv(found, (rank + 1) % count), comm.Isend(first, (rank - 1) % count))
        return found

    def collect(self, field: Field) -> Field | None:
        """All of a field, on the first process; None on the others."""
        found = np.empty((self.points, self.points), field.dtype) if leads(self.team) else None
        counts = np.diff(self.rows.edges) * self.points
        target = None if found is None else [found, counts]
        self.team.wait(self.team.comm.Igatherv(np.ascontiguousarray(field), target))
        return found

    def diagonal(self, field: Field) -> Field:
        """Values along the diagonal of the cell, of all processes."""
        own = np.diagonal(field[:, self.own])
        return self._joined(own, np.diff(self.rows.edges))


def _spans(grid: Grid, whole: list[Span], kept: int) -> list[Span]:
    """The columns below `kept` that each process holds; `whole` where it is not shared out."""
    if not isinstance(grid, SlabGrid):
        return whole
    return [(min(a, kept), min(b, kept)) for a, b in grid.spans]


def _shared(one: Span, other: Span) -> Span:
    first, last = max(one[0], other[0]), min(one[1], other[1])
    return first, max(first, last)


def _from(span: Span, start: Span) -> Span:
    return span[0] - start[0], span[1] - start[0]
