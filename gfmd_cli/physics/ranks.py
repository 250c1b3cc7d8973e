"""The processes of one MPI run, and how they come to one mind.

Nothing here imports mpi4py until `launched` has seen, in the environment that launchers set, that
there is more than one process.
"""

import os
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import numpy as np

from gfmd_cli.errors import GfmdError, InputError
from gfmd_cli.physics.fields import Field

T = TypeVar("T")
SIZES = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "MV2_COMM_WORLD_SIZE", "PMIX_SIZE")
NUMBERS = ("PMI_RANK", "OMPI_COMM_WORLD_RANK", "MV2_COMM_WORLD_RANK", "PMIX_RANK")
EXPECTED = (GfmdError, MemoryError, ArithmeticError, OSError)
AWAKE, LONG_AWAKE, NAP = 2e-4, 2e-2, 2e-5  # seconds
PATIENCE = 10.0  # seconds that a process with an error waits for the others, then ends them all


class Ranks:
    """All processes of a run; every method but `abort` must be called by all of them."""

    def __init__(self, comm: Any) -> None:
        self.comm = comm
        self.last_words = comm.Dup()  # errors are told where no other message can be mistaken
        self.rank: int = comm.Get_rank()
        self.size: int = comm.Get_size()

    def wait(self, *requests: Any, awake: float = AWAKE) -> None:
        """Until these are done: watching out at first, then asleep in between.

        Large data need someone awake to move them on, piece by piece. But MPI's own waiting never
        sleeps: where cores are shared it takes them from the very process that is waited for.
        """
        tired = time.perf_counter() + awake
        for request in requests:
            while not request.Test():
                if time.perf_counter() > tired:
                    time.sleep(NAP)

    def gather(self, values: Any) -> Field:
        """The numbers of all ranks, in rank order, on every rank."""
        own = np.array(values, order="C")
        found = np.empty((self.size, *own.shape), own.dtype)
        self.wait(self.comm.Iallgather(own, found))
        return found

    def total(self, values: Any) -> Any:
        """Sum over the ranks, added in one order: the same bits on every rank."""
        own = np.asarray(values)
        if own.nbytes < 2**16:
            return self.gather(own).sum(axis=0)
        found = np.empty_like(own)
        self.wait(self.comm.Ireduce(own, found))
        self.wait(self.comm.Ibcast(found))
        return found

    def agree(self, value: T) -> T:
        """What the first rank says."""
        said: T = self.comm.bcast(value)
        return said

    def settle(self, error: BaseException | None) -> None:
        """Raise, on all ranks, the error of the first that has one.

        Where the others do not come to be told, as they wait for data that will not be sent, all
        processes are ended.
        """
        if error is not None and not isinstance(error, EXPECTED):
            traceback.print_exception(error)
        own = np.array([_status(error)])
        found = np.zeros(self.size, own.dtype)
        request = self.last_words.Iallgather(own, found)
        patience = time.monotonic() + PATIENCE
        while not request.Test():
            if error is not None and time.monotonic() > patience:
                self.abort(error)
            time.sleep(0.001)
        bad = np.flatnonzero(found)
        if bad.size:
            raise self.last_words.bcast(_portable(error, self.rank), root=int(bad[0]))

    def abort(self, error: BaseException) -> None:
        """End all processes, with the exit status of this error."""
        print(f"gfmd: rank {self.rank}: {_portable(error, self.rank)}", flush=True)
        self.comm.Abort(_status(error))


@contextmanager
def together(ranks: Ranks | None) -> Iterator[None]:
    """What fails inside on one process fails on all; see `Ranks.settle`."""
    if ranks is None:
        yield
        return
    failed: Exception | None = None
    try:
        yield
    except Exception as error:
        failed = error
    ranks.settle(failed)


def agree(ranks: Ranks | None, value: T) -> T:
    """What the first process says."""
    return value if ranks is None else ranks.agree(value)


def leads(ranks: Ranks | None) -> bool:
    """Whether this process is the one that prints and writes the study."""
    return ranks is None or ranks.rank == 0


def _status(error: BaseException | None) -> int:
    return 0 if error is None else getattr(error, "exit_status", 1)


def _portable(error: BaseException | None, rank: int) -> BaseException | None:
    """An error as other ranks can take it."""
    if error is None or isinstance(error, GfmdError | MemoryError):
        return error
    return GfmdError(f"rank {rank}: {type(error).__name__}: {error}")


def announced() -> int:
    """How many processes the launcher says that there are; 1 where there is none."""
    said = [os.environ.get(name, "") for name in SIZES]
    if any(name in os.environ for name in NUMBERS):
        said.append(os.environ.get("SLURM_STEP_NUM_TASKS", ""))
    return next((int(text) for text in said if text.isdigit()), 1)


def is_first() -> bool:
    """Whether this process is alone or the first, as far as the launcher says."""
    said = [os.environ.get(name, "0") for name in NUMBERS]
    return announced() == 1 or all(text in ("0", "") for text in said)


def launched() -> Ranks | None:
    """The processes of this run, None where there is one only.

    Raises InputError where there are more and mpi4py is missing, or is of another MPI.
    """
    if announced() == 1:
        return None
    try:
        from mpi4py import MPI
    except (ImportError, RuntimeError) as error:  # RuntimeError: no MPI library
        raise InputError(
            f"started as {announced()} processes, but mpi4py cannot be used ({error}): "
            'pip install "gfmd-cli[mpi]", or run one process'
        ) from error
    size = MPI.COMM_WORLD.Get_size()
    if size != announced():
        raise InputError(
            f"started as {announced()} processes, of which mpi4py's MPI sees {size}: "
            "launch with the mpiexec of the MPI that mpi4py was built for"
        )
    return Ranks(MPI.COMM_WORLD)


def cores_and_company(ranks: Ranks, cores: set[int]) -> tuple[int, int]:
    """Cores for this process, and how many processes of the run share this machine.

    `cores` are those that this process may use; what is shared is shared out.
    """
    from mpi4py import MPI

    node = ranks.comm.Split_type(MPI.COMM_TYPE_SHARED)
    count, together = int(node.Get_size()), set().union(*node.allgather(cores))
    node.Free()
    return max(1, len(together) // count), count
