"""The rows of the grid that a process holds, and how compiled kernels run over them.

A kernel takes its arrays and a range of rows [a, b), and releases the interpreter lock, so that
threads can share the rows. A kernel that computes sums writes one set of sums for each row; these
are added in a fixed order. The results therefore do not depend on the number of threads.
"""

import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from threading import Barrier
from typing import Any, ClassVar

import numpy as np

from gfmd_cli.grid.arrays import Field

MIN_THREADED_ROWS = 256  # smallest number of rows of a coarser level for which a second thread pays

Kernel = Callable[..., None]


def started_pool(threads: int) -> ThreadPoolExecutor | None:
    """A pool whose threads have all started; None, with a warning, where the system refuses one."""
    pool, started = ThreadPoolExecutor(threads), Barrier(threads)
    try:
        list(pool.map(lambda _: started.wait(), range(threads)))
    except RuntimeError as error:
        pool.shutdown(wait=False, cancel_futures=True)
        _warn_once(f"{error} (see ulimit -u, -v); one thread is used")
        return None
    finally:
        started.abort()  # else the threads would wait for ever for those that have not started
    return pool


@cache
def _warn_once(message: str) -> None:
    """Give a warning at its first call with this message: every grid has threads."""
    warnings.warn(message, RuntimeWarning, stacklevel=1)


class LocalRows:
    """The rows of a field that this process holds, here all; `halo.DistributedRows` has a block."""

    halo: ClassVar[int] = 0
    """Number of rows of a halo above the block, and below it."""
    is_whole: ClassVar[bool] = True
    """Whether this process holds all rows."""

    def __init__(self, count: int, threads: int) -> None:
        self.count = count
        self.pool = started_pool(threads) if threads > 1 else None
        edges = np.linspace(0, count, threads + 1).astype(int)
        self.parts = [(int(a), int(b)) for a, b in pairwise(edges) if a < b]

    def run(self, kernel: Kernel, *arguments: Any, first: int = 0) -> None:
        """Run a kernel over the rows, which begin at index `first` of its arrays.

        For arrays with a halo, `first` is `halo`.
        """
        if self.pool is None or len(self.parts) == 1:
            kernel(*arguments, first, first + self.count)
        else:
            parts = [(first + a, first + b) for a, b in self.parts]
            list(self.pool.map(lambda part: kernel(*arguments, *part), parts))

    def sums(self, count: int, kernel: Kernel, *arguments: Any, first: int = 0) -> Field:
        """Run a kernel whose last array receives `count` sums for each row; return the totals."""
        row_sums = np.zeros((self.count + 2 * first, count))
        self.run(kernel, *arguments, row_sums, first=first)
        return self.total(row_sums[first : first + self.count].sum(axis=0))

    def total(self, values: Any) -> Any:
        """Sums over all processes."""
        return values

    def empty_with_halo(self, *shape: int, dtype: Any) -> Any:
        """An array of zeros with a halo; `shape` is the shape of one row."""
        return np.zeros((self.count + 2 * self.halo, *shape), dtype)

    def interior(self, array: Any) -> Any:
        """The rows of an array without its halo."""
        return array[self.halo : self.halo + self.count]

    def with_halo(self, field: Field) -> Field:
        """A field with its halo; the values are valid until the next transform."""
        return field

    def exchange_halo(self, *arrays: Any) -> None:
        """Fill the halos of arrays with the rows of the neighbouring processes."""

    def coarser(self, count: int) -> "LocalRows":
        """The rows of the next coarser level, `count` of them."""
        return LocalRows(count, len(self.parts) if count >= MIN_THREADED_ROWS else 1)

    def run_from_finer(self, kernel: Kernel, fine: Any, coarse: Any) -> None:
        """Run a kernel from arrays of the next finer level to this one, and exchange the halos."""
        self.run(kernel, *fine, *map(self.aligned_with_finer, coarse), first=self.halo // 2)
        self.exchange_halo(*coarse)

    def aligned_with_finer(self, array: Any) -> Any:
        """An array with half of its halo: row i lies at row 2 i of the next finer level."""
        return array[self.halo // 2 : len(array) - self.halo // 2]
