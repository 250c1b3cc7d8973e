"""Rows of a grid that many processes share: sweeps with frames, and the levels of a V-cycle.

Each process holds a slab, some rows on end. Where a sweep reaches over to rows of others its arrays
have a frame of `FRAME` rows, of which the inner `REACH` are kept: rows of the slabs next to it.
Row i of a level then lies beside row 2 i of the next finer one as it does in whole arrays, once
the frame of the coarser is cut by half: the same kernels run on both.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from gfmd_cli.physics.fields import Field, Mask
from gfmd_cli.physics.ranks import Ranks
from gfmd_cli.physics.sweeps import Rows

LEAST_ROWS = 16  # of a slab; levels and grids with fewer are computed whole, by each process
REACH = 4  # rows beyond its own that a sweep may ask for
FRAME = 2 * REACH


def slab_edges(points: int, count: int) -> list[int]:
    """Where the slabs of a grid begin, and its end.

    Multiples of a power of two, so that the slabs of all coarser levels lie side by side with
    these.
    """
    unit = 1
    while points % (2 * unit) == 0 and points // (2 * unit) >= LEAST_ROWS // 2 * count:
        unit *= 2
    return [unit * round(points // unit * rank / count) for rank in range(count + 1)]


def suits(points: int, count: int) -> bool:
    """Whether a grid is worth being shared out."""
    return points >= LEAST_ROWS * count


class SlabRows(Rows):
    """The rows of one process; `spare` is memory for one framed field."""

    def __init__(
        self, ranks: Ranks, points: int, threads: int, spare: Callable[[], Field] | None = None
    ) -> None:
        self.ranks, self.points, self.spare = ranks, points, spare
        self.edges = slab_edges(points, ranks.size)
        self.start, self.stop = self.edges[ranks.rank : ranks.rank + 2]
        super().__init__(self.stop - self.start, threads)

    def sums(self, count: int, sweep: Callable[..., None], *arguments: Any) -> Field:
        """Totals over all slabs; see `Rows.sums`."""
        return np.asarray(self.ranks.total(super().sums(count, sweep, *arguments)))

    def empty(self, *shape: int, dtype: Any) -> Any:
        """Rows with a frame that is not filled yet."""
        return np.zeros((self.rows + 2 * FRAME, *shape), dtype)

    def inside(self, framed: Any) -> Any:
        """The rows without the frame."""
        return framed[FRAME:-FRAME]

    def framed(self, field: Field) -> Field:
        """A field with a frame, in the spare memory of the grid."""
        assert self.spare is not None
        shape = (self.rows + 2 * FRAME, field.shape[1])
        framed = self.spare()[: shape[0] * shape[1]].reshape(shape)
        self.inside(framed)[...] = field
        self.meet(framed)
        return framed

    def meet(self, *framed: Any) -> None:
        """Fill the frames with rows of the neighbours."""
        comm, rank, end = self.ranks.comm, self.ranks.rank, FRAME + self.rows
        above, below = (rank - 1) % self.ranks.size, (rank + 1) % self.ranks.size
        under_way = []
        for tag, array in enumerate(framed):
            under_way += [
                comm.Irecv(array[end : end + REACH], below, 2 * tag),
                comm.Irecv(array[FRAME - REACH : FRAME], above, 2 * tag + 1),
                comm.Isend(array[FRAME : FRAME + REACH], above, 2 * tag),
                comm.Isend(array[end - REACH : end], below, 2 * tag + 1),
            ]
        self.ranks.wait(*under_way)

    def over(self, sweep: Callable[..., None], *arguments: Any) -> None:
        """Run a kernel over arrays with frames."""
        self(sweep, *arguments, first=FRAME)

    def framed_sums(self, count: int, sweep: Callable[..., None], *arguments: Any) -> Field:
        """Likewise, with sums over all slabs."""
        out = self.empty(count, dtype=np.float64)
        self.over(sweep, *arguments, out)
        return np.asarray(self.ranks.total(self.inside(out).sum(axis=0)))

    def coarser(self) -> Rows:
        """Every other row: a slab, or all of them where slabs would be thin."""
        points = self.points // 2
        if suits(points, self.ranks.size):
            return SlabRows(self.ranks, points, len(self.parts))
        return GatheredRows(self)

    def from_finer(self, sweep: Callable[..., None], sources: Any, targets: Any) -> None:
        """Run the kernel and fill the frames of what it wrote."""
        self(sweep, *sources, *map(self.for_finer, targets), first=REACH)
        self.meet(*targets)

    def for_finer(self, framed: Any) -> Any:
        """The frame cut by half."""
        return framed[REACH:-REACH]

    def every(self, mask: Mask) -> bool:
        """Whether all of a mask is true, on all slabs."""
        return not self.ranks.total(np.count_nonzero(~self.inside(mask)))


class GatheredRows(Rows):
    """All rows of the first level that is not shared out, on each process alike."""

    def __init__(self, finer: SlabRows) -> None:
        super().__init__(finer.points // 2, 1)
        self.ranks = finer.ranks
        self.start, self.stop = finer.start // 2, finer.stop // 2
        self.counts = np.diff(finer.edges) // 2

    def from_finer(self, sweep: Callable[..., None], sources: Any, targets: Any) -> None:
        """Run the kernel over a slab and collect all slabs."""
        count = self.stop - self.start
        parts = [np.zeros((count + 2 * REACH, *t.shape[1:]), t.dtype) for t in targets]
        sweep(*sources, *parts, REACH, REACH + count)
        for part, target in zip(parts, targets, strict=True):
            width = target[0].size
            own = part[REACH : REACH + count]
            self.ranks.wait(self.ranks.comm.Iallgatherv(own, [target, self.counts * width]))

    def for_finer(self, framed: Any) -> Any:
        """The rows beside a slab, and their neighbours."""
        return framed[np.arange(self.start - REACH, self.stop + REACH) % self.rows]


class SummedRows(Rows):
    """All rows of arrays whose columns the processes share out."""

    def __init__(self, ranks: Ranks, rows: int, threads: int) -> None:
        super().__init__(rows, threads)
        self.ranks = ranks

    def sums(self, count: int, sweep: Callable[..., None], *arguments: Any) -> Field:
        """Totals over all processes; see `Rows.sums`."""
        return np.asarray(self.ranks.total(super().sums(count, sweep, *arguments)))
