"""The processes (ranks) of one MPI run, and how an error of one ends all of them.

mpi4py is imported only if the environment variables of a launcher announce more than one process.
"""

import logging
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import numpy as np

from gfmd_cli.errors import INSTALL, GfmdError, InputError
from gfmd_cli.grid.arrays import Field

T = TypeVar("T")
SIZE_VARIABLES = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "MV2_COMM_WORLD_SIZE", "PMIX_SIZE")
RANK_VARIABLES = ("PMI_RANK", "OMPI_COMM_WORLD_RANK", "MV2_COMM_WORLD_RANK", "PMIX_RANK")
EXPECTED_ERRORS = (GfmdError, MemoryError, ArithmeticError, OSError)
SPIN_SECONDS, LONG_SPIN_SECONDS = 2e-4, 2e-2  # of testing a request without sleeping
REQUEST_POLL_SECONDS = 2e-5  # of sleep between two tests after that
ERROR_POLL_SECONDS = 1e-3
ABORT_AFTER_SECONDS = 10.0  # that a rank with an error waits for the others before it ends them all
FORWARD_SECONDS = 1.0  # for the launcher to forward the last message
log = logging.getLogger(__name__)


class Ranks:
    """All ranks of a run; every method but `abort` is collective: all ranks must call it."""

    def __init__(self, comm: Any) -> None:
        self.comm = comm
        self.error_comm = comm.Dup()  # for errors, so that no other message can match
        self.rank: int = comm.Get_rank()
        self.size: int = comm.Get_size()

    def wait(self, *requests: Any, spin: float = SPIN_SECONDS) -> None:
        """Wait for requests: test them without sleeping for `spin` seconds, then sleep in between.

        Large messages progress only while they are tested. MPI's own wait never sleeps, and takes
        shared cores from the rank that is waited for.
        """
        end = time.perf_counter() + spin
        for request in requests:
            while not request.Test():
                if time.perf_counter() > end:
                    time.sleep(REQUEST_POLL_SECONDS)

    def gather(self, values: Any) -> Field:
        """The arrays of all ranks, stacked in rank order, on every rank."""
        own = np.array(values, order="C")
        gathered = np.empty((self.size, *own.shape), own.dtype)
        self.wait(self.comm.Iallgather(own, gathered))
        return gathered

    def total(self, values: Any) -> Any:
        """Sum over the ranks, added in one order: the same bits on every rank."""
        own = np.asarray(values)
        if own.nbytes < 2**16:
            return self.gather(own).sum(axis=0)
        total = np.empty_like(own)
        self.wait(self.comm.Ireduce(own, total))
        self.wait(self.comm.Ibcast(total))
        return total

    def raise_on_all(self, error: BaseException | None) -> None:
        """Raise, on all ranks, the error of the first that has one.

        If other ranks do not call this in time, because they wait for data from this one, all
        ranks are aborted.
        """
        if error is not None and not isinstance(error, (*EXPECTED_ERRORS, SystemExit)):
            log.error("rank %d: unexpected error", self.rank, exc_info=error)
        own = np.array([_status(error)])
        statuses = np.zeros(self.size, own.dtype)
        request = self.error_comm.Iallgather(own, statuses)
        deadline = time.monotonic() + ABORT_AFTER_SECONDS
        while not request.Test():
            if error is not None and time.monotonic() > deadline:
                self.abort(error)
            time.sleep(ERROR_POLL_SECONDS)
        failed = np.flatnonzero(statuses)
        if failed.size:
            raise self.error_comm.bcast(_portable(error, self.rank), root=int(failed[0]))

    def abort(self, error: BaseException) -> None:
        """End all ranks, with the exit status of this error.

        The launcher drops what it has not yet forwarded of the output, hence the pause; and
        MPI's own abort may return.
        """
        log.critical("gfmd: rank %d: %s", self.rank, _text(error))
        time.sleep(FORWARD_SECONDS)
        self.comm.Abort(_status(error))
        os._exit(_status(error))


@contextmanager
def shared_errors(ranks: Ranks | None) -> Iterator[None]:
    """Raise an error inside the block on one rank on all ranks; see `Ranks.raise_on_all`."""
    if ranks is None:
        yield
        return
    failed: BaseException | None = None
    try:
        yield
    except (Exception, SystemExit) as error:  # a signal that ends the process, too
        failed = error
    ranks.raise_on_all(failed)


def on_root(ranks: Ranks | None, make: Callable[[], T]) -> T:
    """What `make` returns on the first or only rank, on all ranks; all raise an error of it."""
    if ranks is None:
        return make()
    with shared_errors(ranks):
        value = make() if is_root(ranks) else None
    shared: T = ranks.comm.bcast(value)
    return shared


def is_root(ranks: Ranks | None) -> bool:
    """Whether this process is the first or only rank, which prints and writes files."""
    return ranks is None or ranks.rank == 0


def _status(error: BaseException | None) -> int:
    if isinstance(error, SystemExit):
        return int(error.code or 0)
    return 0 if error is None else getattr(error, "exit_status", 1)


def _text(error: BaseException) -> str:
    """The message of an error, with its type where it is not one of this program."""
    return str(error) if isinstance(error, GfmdError) else f"{type(error).__name__}: {error}"


def _portable(error: BaseException | None, rank: int) -> BaseException | None:
    """The error, or one that can be sent to other ranks."""
    if error is None or isinstance(error, GfmdError | MemoryError | SystemExit):
        return error
    return GfmdError(f"rank {rank}: {_text(error)}")


def process_count() -> int:
    """Number of processes that the launcher announces; 1 without a launcher."""
    counts = [os.environ.get(name, "") for name in SIZE_VARIABLES]
    if any(name in os.environ for name in RANK_VARIABLES):
        counts.append(os.environ.get("SLURM_STEP_NUM_TASKS", ""))
    return next((int(text) for text in counts if text.isdigit()), 1)


def is_first() -> bool:
    """Whether this is the only process or the first rank, from the variables of the launcher."""
    numbers = [os.environ.get(name, "0") for name in RANK_VARIABLES]
    return process_count() == 1 or all(text in ("0", "") for text in numbers)


def mpi_ranks() -> Ranks | None:
    """The ranks of this run, None for a single process.

    Raises InputError if mpi4py is missing, or was built for another MPI than the launcher.
    """
    if process_count() == 1:
        return None
    try:
        from mpi4py import MPI
    except (ImportError, RuntimeError) as error:  # RuntimeError: no MPI library
        raise InputError(
            f"started as {process_count()} processes, but mpi4py cannot be used ({error}): "
            f"{INSTALL.format('mpi')}, or run one process"
        ) from error
    size = MPI.COMM_WORLD.Get_size()
    if size != process_count():
        raise InputError(
            f"started as {process_count()} processes, of which mpi4py's MPI sees {size}: "
            "launch with the mpiexec of the MPI that mpi4py was built for"
        )
    return Ranks(MPI.COMM_WORLD)


def cores_and_processes_on_node(ranks: Ranks, cores: set[int]) -> tuple[int, int]:
    """Cores for this process, and the number of processes of the run on this machine.

    `cores` are those that this process may use. The cores of all processes are divided equally.
    """
    from mpi4py import MPI

    node = ranks.comm.Split_type(MPI.COMM_TYPE_SHARED)
    count, all_cores = int(node.Get_size()), set().union(*node.allgather(cores))
    node.Free()
    return max(1, len(all_cores) // count), count
