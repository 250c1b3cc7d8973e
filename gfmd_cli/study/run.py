"""Run a spec: what is missing is solved, task by task, on one or more processes."""

import faulthandler
import multiprocessing
import os
import signal
import sys
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager, suppress
from itertools import chain
from pathlib import Path
from threading import Thread, Timer
from typing import Any, NamedTuple

from gfmd_cli.errors import GfmdError, InputError, Interrupted, SpaceError, StudyError
from gfmd_cli.physics import wisdom
from gfmd_cli.physics.ranks import Ranks, agree, leads, together
from gfmd_cli.study import solve
from gfmd_cli.study.clock import Clock
from gfmd_cli.study.grids import scene_of
from gfmd_cli.study.record import read_status, record_path
from gfmd_cli.study.resources import check_memory, room, seconds_to_stop, share_out
from gfmd_cli.study.solve import Progress, Report, solve_task
from gfmd_cli.study.spec import Spec
from gfmd_cli.study.store import Study
from gfmd_cli.study.tasks import Task, plan

CHECKPOINT_EVERY = 600.0  # seconds
SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGUSR1, signal.SIGUSR2)


class Means(NamedTuple):
    """How to solve a task."""

    threads: int
    checkpoint_every: float
    """Seconds."""
    memory: float
    """Bytes that it may take."""
    reproducible: bool


def run_study(
    spec: Spec,
    text: str,
    path: Path,
    report: Report,
    *,
    shard: tuple[int, int] = (0, 1),
    jobs: int | None = None,
    checkpoint_every: float = CHECKPOINT_EVERY,
    max_seconds: float | None = None,
    reproducible: bool = False,
    ranks: Ranks | None = None,
) -> Counter[str]:
    """Solve the tasks of this shard that the study does not hold yet, and collect all records.

    Parameters
    ----------
    spec, text : the run spec and the text it was read from
    path : the study file
    report : told of every start, step and end of a task
    shard : (i, n) takes the tasks with index i modulo n
    jobs : worker processes, by default as many as cores, memory and tasks suggest
    max_seconds : wall time after which it has ended as a signal ends it
    reproducible : plan transforms without measuring, one thread a task
    ranks : the processes of an MPI run, which share every task; all of them call this

    Returns how many tasks of this shard ended in which status ("failed": raised an error).
    Raises InputError for a spec that does not fit the study or the machine, SpaceError, and
    Interrupted after a signal or the time given, when all states are saved.
    """
    if ranks is not None and (asked := spec.output.on_request()):
        raise InputError(f"output.{asked[0]}: takes whole grids; run it without mpiexec")
    study = Study(path)
    study.check_spec(spec)
    tasks = plan(spec)
    held = agree(ranks, study.held())
    share = [task for task in tasks if task.index % shard[1] == shard[0]]
    pending = [task for task in share if task.id not in held]
    outcome = Counter(held[task.id] for task in share if task.id in held)
    waiting = agree(ranks, study.uncollected())
    if not pending and not waiting:
        if leads(ranks) and study.parts.exists():  # of a run that was killed as it ended
            with study.work(spec):
                pass
        return outcome
    check_memory(pending, ranks)
    jobs, threads = share_out(pending, jobs, reproducible, ranks)
    means = Means(threads, checkpoint_every, room(ranks) / jobs, reproducible)
    seconds = _time_to_work(max_seconds, pending, jobs)
    report = Clock(pending, jobs).watched(report)
    with _signals_noted(), _timer(seconds), _folder(study, spec, ranks) as damaged:
        _warn(report, damaged, _plan_afresh(study.parts, means))
        try:
            solved = _solve_all(pending, study.parts, report, jobs, means, ranks)
        finally:
            with together(ranks):
                # a stopped shard ends soon: its records stand, others collect them
                if leads(ranks) and (shard[1] == 1 or not solve.stop.is_set()):
                    _warn(report, study.collect(spec, tasks, text))
            wisdom.plan_with(None)
        _check_ended(solved, len(pending))
    return outcome + solved


@contextmanager
def _folder(study: Study, spec: Spec, ranks: Ranks | None) -> Iterator[list[str]]:
    """The folder of unfinished work; where processes share the tasks, the first one holds it."""
    damaged: list[str] = []
    with ExitStack() as stack:
        with together(ranks):
            if leads(ranks):
                damaged = stack.enter_context(study.work(spec))
        yield damaged


def _check_ended(solved: Counter[str], asked: int) -> None:
    """Raise SpaceError or Interrupted where that ended the run."""
    if lacking := solved["no space"]:
        raise SpaceError(f"no space for the results of {lacking} tasks; make some, call again")
    left = asked - sum(solved.values())
    if solve.stop.is_set() and left:
        raise Interrupted(f"stopped, states saved; {left} tasks left, call again to go on")


def _plan_afresh(parts: Path, means: Means) -> list[str]:
    """Plan as this run is to, whatever this process did before; what is wrong with old plans."""
    scene_of.cache_clear()
    note = wisdom.plan_with(parts, estimated=means.reproducible)
    return [note] if note else []


def _warn(report: Report, *notes: list[str]) -> None:
    for note in chain.from_iterable(notes):
        report(Progress(-1, "warning", "", note=note))


def _solve_all(
    pending: list[Task],
    parts: Path,
    report: Report,
    jobs: int,
    means: Means,
    ranks: Ranks | None,
) -> Counter[str]:
    if jobs > 1:
        return _solve_in_pool(pending, parts, report, jobs, means)
    outcome: Counter[str] = Counter()
    for task in pending:
        outcome[_attempt(task, parts, report, means, ranks)] += 1
    del outcome["interrupted"]
    return outcome


def _is_stopped(ranks: Ranks | None) -> bool:
    """Whether a signal has come, to any process."""
    if ranks is not None and ranks.total(int(solve.stop.is_set())):
        solve.stop.set()
    return solve.stop.is_set()


def _status_of(path: Path) -> str | None:
    """Status of a record that is whole, None where there is none."""
    with suppress(StudyError):
        return read_status(path)
    return None


def _attempt(
    task: Task, parts: Path, report: Report, means: Means, ranks: Ranks | None = None
) -> str:
    """Solve one task, unless another process has just done so; an error ends this task only."""
    if _is_stopped(ranks):
        return "interrupted"
    if found := agree(ranks, _status_of(record_path(parts, task.id))):
        return found
    try:
        with together(ranks):
            return solve_task(
                task,
                parts,
                means.threads,
                report,
                means.checkpoint_every,
                means.memory,
                fixed=means.reproducible,
                ranks=ranks,
            )
    except Interrupted:
        report(Progress(task.index, "interrupted", task.label))
        return "interrupted"
    except (GfmdError, MemoryError, ArithmeticError, OSError) as error:
        reason = str(error) or type(error).__name__
        report(Progress(task.index, "failed", task.label, note=reason))
        return "no space" if isinstance(error, SpaceError) else "failed"


def _solve_in_pool(
    pending: list[Task], parts: Path, report: Report, jobs: int, means: Means
) -> Counter[str]:
    """Tasks side by side, the longest first, so that none is left over at the end."""
    context = multiprocessing.get_context("spawn")  # forked FFTW threads would hang
    reports = context.SimpleQueue()
    listener = Thread(target=_listen, args=(reports, report), daemon=True)
    listener.start()
    outcome: Counter[str] = Counter()
    begin = (_begin_worker, (reports, parts, means))
    with ProcessPoolExecutor(jobs, context, *begin) as pool:
        # a worker that begins keeps a signal for when it can note it
        signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
        futures = {
            pool.submit(_work, task, parts, means): task
            for task in sorted(pending, key=lambda task: -task.seconds)
        }
        signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
        for task, status in _as_they_end(futures, pool):
            if status == "killed":
                reason = "its worker process was killed (out of memory?)"
                report(Progress(task.index, "failed", task.label, note=reason))
            outcome["failed" if status == "killed" else status] += 1
    reports.put(None)
    listener.join()
    del outcome["interrupted"]
    return outcome


def _as_they_end(
    futures: dict[Future[str], Task], pool: ProcessPoolExecutor
) -> Iterator[tuple[Task, str]]:
    """Each task with its status; a signal is handed on to the workers, once."""
    told = False
    left = set(futures)
    while left:
        done, left = wait(left, timeout=0.1, return_when=FIRST_COMPLETED)
        for future in done:
            if not future.cancelled():
                killed = isinstance(future.exception(), BrokenProcessPool)
                yield futures[future], "killed" if killed else future.result()
        if solve.stop.is_set() and not told:
            told = True
            for future in left:
                future.cancel()
            for process in multiprocessing.active_children():
                os.kill(process.pid or 0, signal.SIGTERM)


def _listen(reports: Any, report: Report) -> None:
    for progress in iter(reports.get, None):
        report(progress)


_reports: Any = None  # of a worker process, to the one that prints


def _begin_worker(reports: Any, parts: Path, means: Means) -> None:
    global _reports
    _reports = reports
    faulthandler.enable(sys.__stderr__ or 2)
    wisdom.plan_with(parts, estimated=means.reproducible)
    Thread(target=_end_with_parent, daemon=True).start()
    for number in SIGNALS:
        signal.signal(number, lambda *_: solve.stop.set())
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)


def _end_with_parent() -> None:
    """No worker outlives a run that was killed."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _work(task: Task, parts: Path, means: Means) -> str:
    return _attempt(task, parts, _reports.put, means)


def _time_to_work(max_seconds: float | None, pending: list[Task], jobs: int) -> float | None:
    """Seconds after which to stop, so that all is saved and collected within `max_seconds`."""
    if max_seconds is None or not pending:
        return None
    return max(max_seconds / 2, max_seconds - seconds_to_stop(pending, jobs))


@contextmanager
def _timer(seconds: float | None) -> Iterator[None]:
    """Inside, an orderly stop is asked for after so much time, whatever the clock says."""
    if seconds is None:
        yield
        return
    timer = Timer(seconds, solve.stop.set)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


@contextmanager
def _signals_noted() -> Iterator[None]:
    """Inside, a signal asks for an orderly stop; a second SIGINT leaves at once."""
    solve.stop.clear()

    def note(number: int, _frame: Any) -> None:
        if number == signal.SIGINT and solve.stop.is_set():
            os._exit(130)
        solve.stop.set()

    before = {number: signal.signal(number, note) for number in SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
