"""Slab decomposition: each process holds a block of consecutive rows of a field.

An array of a kernel whose stencil needs rows of other processes has a halo of `HALO_ROWS` rows
above and below the block. The inner `EXCHANGED_ROWS` of these are filled with rows of the
neighbouring processes. The halo is twice as wide as needed, so that row i of a coarser level lies
at row 2 i of the next finer level, as on one process, once the halo of the coarser array is cut to
half. The same kernels therefore run on one process and on several.
"""

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from gfmd_cli.grid.arrays import Field, Modes
from gfmd_cli.grid.ranks import Ranks
from gfmd_cli.grid.rows import Kernel, LocalRows

MIN_ROWS = 16  # of a block; every process computes smaller grids and levels as a whole
EXCHANGED_ROWS = 4  # rows beyond its block that a kernel may read
HALO_ROWS = 2 * EXCHANGED_ROWS


def block_edges(points: int, count: int) -> list[int]:
    """First row of each of the `count` blocks of a grid, and the number of rows.

    The edges are multiples of a power of two, so that the blocks of all coarser levels begin at the
    same positions.
    """
    unit = 1
    while points % (2 * unit) == 0 and points // (2 * unit) >= MIN_ROWS // 2 * count:
        unit *= 2
    return [unit * round(points // unit * rank / count) for rank in range(count + 1)]


def is_distributable(points: int, count: int) -> bool:
    """Whether a grid is large enough for `count` processes."""
    return points >= MIN_ROWS * count


class DistributedRows(LocalRows):
    """The block of rows of this process; `spare` returns memory for one field with a halo."""

    halo: ClassVar[int] = HALO_ROWS
    is_whole: ClassVar[bool] = False

    def __init__(
        self, ranks: Ranks, points: int, threads: int, spare: Callable[[], Modes] | None = None
    ) -> None:
        self.ranks, self.points, self.spare = ranks, points, spare
        self.edges = block_edges(points, ranks.size)
        self.start, self.stop = self.edges[ranks.rank : ranks.rank + 2]
        super().__init__(self.stop - self.start, threads)

    def total(self, values: Any) -> Any:
        """Sums over all processes."""
        return self.ranks.total(values)

    def with_halo(self, field: Field) -> Field:
        """A field with its halo, in the spare memory of the grid."""
        assert self.spare is not None
        shape = (self.count + 2 * HALO_ROWS, field.shape[1])
        array = self.spare().view(field.dtype)[: shape[0] * shape[1]].reshape(shape)
        self.interior(array)[...] = field
        self.exchange_halo(array)
        return array

    def exchange_halo(self, *arrays: Any) -> None:
        """Fill the halos of arrays with the rows of the neighbouring processes."""
        comm, rank, end = self.ranks.comm, self.ranks.rank, HALO_ROWS + self.count
        previous, following = (rank - 1) % self.ranks.size, (rank + 1) % self.ranks.size
        requests = []
        for tag, array in enumerate(arrays):
            requests += [
                comm.Irecv(array[end : end + EXCHANGED_ROWS], following, 2 * tag),
                comm.Irecv(array[HALO_ROWS - EXCHANGED_ROWS : HALO_ROWS], previous, 2 * tag + 1),
                comm.Isend(array[HALO_ROWS : HALO_ROWS + EXCHANGED_ROWS], previous, 2 * tag),
                comm.Isend(array[end - EXCHANGED_ROWS : end], following, 2 * tag + 1),
            ]
        self.ranks.wait(*requests)

    def coarser(self, count: int) -> LocalRows:
        """The rows of the next coarser level, half as many; distributed if these are enough."""
        if is_distributable(count, self.ranks.size):
            return DistributedRows(self.ranks, count, len(self.parts))
        return ReplicatedRows(self)


class ReplicatedRows(LocalRows):
    """All rows of the finest level that is not distributed; every process holds the same values."""

    def __init__(self, finer: DistributedRows) -> None:
        super().__init__(finer.points // 2, 1)
        self.ranks = finer.ranks
        self.start, self.stop = finer.start // 2, finer.stop // 2
        self.counts = np.diff(finer.edges) // 2

    def run_from_finer(self, kernel: Kernel, fine: Any, coarse: Any) -> None:
        """Run a kernel over the block of this process, and gather the blocks of all processes."""
        count = self.stop - self.start
        blocks = [np.zeros((count + 2 * EXCHANGED_ROWS, *t.shape[1:]), t.dtype) for t in coarse]
        kernel(*fine, *blocks, EXCHANGED_ROWS, EXCHANGED_ROWS + count)
        for block, array in zip(blocks, coarse, strict=True):
            own = block[EXCHANGED_ROWS : EXCHANGED_ROWS + count]
            counts = self.counts * array[0].size
            self.ranks.wait(self.ranks.comm.Iallgatherv(own, [array, counts]))

    def aligned_with_finer(self, array: Any) -> Any:
        """The rows at the block of this process on the finer level, with a halo."""
        rows = np.arange(self.start - EXCHANGED_ROWS, self.stop + EXCHANGED_ROWS)
        return array[rows % self.count]
