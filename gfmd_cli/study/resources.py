"""Cores and memory that a run may use on this machine."""

import os
import resource
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from gfmd_cli.errors import InputError
from gfmd_cli.grid.ranks import Ranks, cores_and_processes_on_node
from gfmd_cli.solvers.loop import Solver
from gfmd_cli.study.forecast import BASE_BYTES
from gfmd_cli.study.tasks import Task

THREADED_POINTS = 1024  # per side of a square; a second thread does not pay below it (measured)
ADDRESSES_PER_CORE = 2**29  # bytes that the heaps of threads reserve: 8 of 64 MiB a core (glibc)
HEADROOM = 0.9  # share of the available memory that a run may plan with
POOL_SECONDS = 3.0  # with less work than this, worker processes do not pay
DISK_SPEED = 1e8  # bytes a second; slower than most
STATE_FIELDS = 4  # u, sigma and the other fields of a solver's state
SECONDS_PER_STEP = 1e-7  # and grid point, on one thread; an upper limit
SECONDS_TO_END = 2.0  # for worker processes and small files


def own_cores() -> set[int]:
    """Numbers of the cores on which this process may run; macOS has no limit of a process."""
    if hasattr(os, "sched_getaffinity"):
        return os.sched_getaffinity(0)
    return set(range(os.cpu_count() or 1))


def available_cores() -> int:
    """Number of cores that this process may use: Slurm's grant, else its own cores."""
    return _granted("SLURM_CPUS_PER_TASK") or len(own_cores())


def _granted(name: str) -> int:
    """What Slurm grants by a variable of the environment; 0 where it does not say."""
    text = os.environ.get(name, "")
    return int(text) if text.isdecimal() else 0


def available_memory() -> float:
    """Bytes that this process may take: the least of kernel, `ulimit -v`, cgroups and Slurm.

    The free memory is known on Linux only; elsewhere it is all that the machine has.
    """
    cgroups = _cgroup_limits(Path("/proc/self/cgroup"), Path("/sys/fs/cgroup"))
    machine = float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    limits = [machine, available_addresses(), *cgroups]
    if (free := _kernel_number("/proc/meminfo", "MemAvailable:")) is not None:
        limits.append(1024.0 * free)
    per_core = available_cores() * _granted("SLURM_MEM_PER_CPU")
    limits += [2.0**20 * size for size in (_granted("SLURM_MEM_PER_NODE"), per_core) if size]
    return min(limits)


def _kernel_number(file: Path | str, name: str) -> int | None:
    """A number that the kernel gives in a file, after its name; None if it does not tell."""
    with suppress(OSError, ValueError, IndexError):
        return int(Path(file).read_text(encoding="ascii").partition(name)[2].split()[0])
    return None


def available_addresses() -> float:
    """Bytes of address space that `ulimit -v` leaves to this process."""
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit != resource.RLIM_INFINITY:
        with suppress(OSError, ValueError):
            pages, *_ = Path("/proc/self/statm").read_text(encoding="ascii").split()
            return float(limit - int(pages) * resource.getpagesize())
    return float("inf")


def _cgroup_limits(membership: Path, root: Path) -> Iterator[float]:
    """Bytes that the cgroups of this process leave, version 1 and 2: its own and all around it.

    `membership` lists the groups of the process, and their files lie below `root`. What a group
    uses includes the page cache of files, which the kernel gives back when memory is needed.
    """
    try:
        lines = membership.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        return
    for line in lines:
        _, controllers, group = line.split(":", 2)
        if not controllers:
            top, limit, used, prefix = root, "memory.max", "memory.current", ""
        elif "memory" in controllers.split(","):
            top, prefix = root / "memory", "total_"  # with the groups inside, as in `used`
            limit, used = "memory.limit_in_bytes", "memory.usage_in_bytes"
        else:
            continue
        own = top / group.strip("/")
        for folder in (own, *own.parents):
            with suppress(OSError, ValueError):  # "max" is no number: no limit
                left = int((folder / limit).read_text()) - int((folder / used).read_text())
                names = (f"\n{prefix}{kind}_file " for kind in ("active", "inactive"))
                cached = (_kernel_number(folder / "memory.stat", name) or 0 for name in names)
                yield float(left + sum(cached))
            if folder == top:
                break


def usable_memory(ranks: Ranks | None = None) -> float:
    """Bytes that one solve may take; of all `ranks` that share it, less their overhead."""
    memory = HEADROOM * available_memory()
    if ranks is None:
        return memory
    _, processes_on_node = cores_and_processes_on_node(ranks, set())
    own = min(ranks.gather(memory / processes_on_node - BASE_BYTES))
    fields = Solver.fields_in_memory
    return ranks.size * float(own) * fields / (fields + 1) + BASE_BYTES


def check_memory(tasks: list[Task], ranks: Ranks | None = None) -> None:
    """Raise InputError, before anything is allocated, if a single task does not fit."""
    memory = usable_memory(ranks)
    needs = ((task.bytes_on(task.least_points), task.least_points) for task in tasks)
    needed, points = max(needs, default=(0.0, 0))
    if needed > memory:
        raise InputError(
            f"grid.points: {points} points along x take {gib(needed)} of memory, "
            f"{gib(memory)} are available; take a smaller grid or a larger machine"
        )


def jobs_and_threads(
    tasks: list[Task],
    jobs: int | None,
    reproducible: bool = False,
    ranks: Ranks | None = None,
) -> tuple[int, int]:
    """Worker processes and threads of each, for these tasks.

    One process with one thread for each core, as far as the number of tasks and the memory allow.
    If there are fewer tasks than cores, large grids use the remaining cores as threads, unless the
    run is to be `reproducible`: the number of threads may change the last bits. The heaps of
    threads must fit into the address space.
    """
    if not tasks:
        return 1, 1
    cores, largest = available_cores(), max(task.bytes for task in tasks)
    is_large = max(task.size for task in tasks) >= THREADED_POINTS**2
    has_addresses = available_addresses() >= largest + ADDRESSES_PER_CORE * cores
    if ranks is not None:
        if jobs not in (None, 1):
            raise InputError(f"--jobs {jobs}: under mpiexec its processes share each task")
        jobs, on_node = 1, cores_and_processes_on_node(ranks, own_cores())
        cores = min(cores, on_node[0])
    elif jobs is None:
        is_short = sum(task.seconds for task in tasks) < POOL_SECONDS
        fitting = max(1, int(usable_memory() // largest))
        jobs = 1 if is_short else min(cores, len(tasks), fitting)
    return jobs, max(1, cores // jobs) if is_large and has_addresses and not reproducible else 1


def seconds_to_stop(tasks: list[Task], jobs: int) -> float:
    """Upper limit of the time to end a step, save every state and collect."""
    largest = max(tasks, key=lambda task: task.size)
    state = 8.0 * largest.size * STATE_FIELDS * jobs
    collected = 8.0 * sum(task.size * len(task.output.fields) for task in tasks)
    return SECONDS_TO_END + SECONDS_PER_STEP * largest.size + (state + collected) / DISK_SPEED


def out_of_memory_kills() -> int | None:
    """Number of processes that the kernel has killed to free memory; None if it does not tell."""
    return _kernel_number("/proc/vmstat", "\noom_kill ")


def gib(count: float) -> str:
    """A number of bytes in GiB."""
    return f"{count / 2**30:.3g} GiB"
