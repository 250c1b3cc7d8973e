"""Run a spec: what is missing is solved, task by task, on one or more processes."""

import multiprocessing
import os
import signal
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from typing import Any

from gfmd_cli.errors import GfmdError, Interrupted
from gfmd_cli.study import solve
from gfmd_cli.study.record import SUFFIX
from gfmd_cli.study.resources import HEADROOM, available_memory, check_memory, share_out
from gfmd_cli.study.solve import Progress, Report, solve_task
from gfmd_cli.study.spec import Spec
from gfmd_cli.study.store import Study
from gfmd_cli.study.tasks import Task, plan

CHECKPOINT_EVERY = 600.0  # seconds
SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGUSR1, signal.SIGUSR2)


def run_study(
    spec: Spec,
    text: str,
    path: Path,
    report: Report,
    *,
    shard: tuple[int, int] = (0, 1),
    jobs: int | None = None,
    checkpoint_every: float = CHECKPOINT_EVERY,
) -> Counter[str]:
    """Solve the tasks of this shard that the study does not hold yet, and collect all records.

    Parameters
    ----------
    spec, text : the run spec and the text it was read from
    path : the study file
    report : told of every start, step and end of a task
    shard : (i, n) takes the tasks with index i modulo n
    jobs : worker processes, by default as many as cores, memory and tasks suggest

    Returns how many tasks of this shard ended in which status ("failed": raised an error).
    Raises InputError for a spec that does not fit the study or the machine, SpaceError, and
    Interrupted after a signal, when all states are saved.
    """
    study = Study(path)
    study.check_spec(spec)
    tasks = plan(spec)
    held = study.held()
    share = [task for task in tasks if task.index % shard[1] == shard[0]]
    pending = [task for task in share if task.id not in held]
    outcome = Counter(held[task.id] for task in share if task.id in held)
    uncollected = any(study.parts.glob(f"*{SUFFIX}"))
    if pending:
        check_memory(pending)
        with _signals_noted():
            study.begin(spec)
            try:
                outcome += _solve_all(pending, study.parts, report, jobs, checkpoint_every)
            finally:
                if shard[1] == 1 or not solve.stop.is_set():  # a stopped shard ends soon: its
                    study.collect(spec, tasks, text)  # records stand, others collect them
            if solve.stop.is_set():
                left = len(share) - sum(outcome.values())
                raise Interrupted(f"stopped by a signal; {left} tasks left, call again to go on")
    elif uncollected:
        study.collect(spec, tasks, text)
    return outcome


def _solve_all(
    pending: list[Task], parts: Path, report: Report, jobs: int | None, every: float
) -> Counter[str]:
    jobs, threads = share_out(pending, jobs)
    memory = HEADROOM * available_memory() / jobs
    if jobs > 1:
        return _solve_in_pool(pending, parts, report, jobs, (threads, every, memory))
    outcome: Counter[str] = Counter()
    for task in pending:
        if solve.stop.is_set():
            break
        status = _attempt(task, parts, report, (threads, every, memory))
        if status != "interrupted":
            outcome[status] += 1
    return outcome


Means = tuple[int, float, float]
"""Of one task: threads, seconds between checkpoints, memory [bytes]."""


def _attempt(task: Task, parts: Path, report: Report, means: Means) -> str:
    """Solve one task; an error ends this task only."""
    threads, every, memory = means
    try:
        return solve_task(task, parts, threads, report, every, memory)
    except Interrupted:
        report(Progress(task.index, "interrupted", task.label))
        return "interrupted"
    except (GfmdError, MemoryError, ArithmeticError, OSError) as error:
        reason = str(error) or type(error).__name__
        report(Progress(task.index, "failed", task.label, note=reason))
        return "failed"


def _solve_in_pool(
    pending: list[Task], parts: Path, report: Report, jobs: int, means: Means
) -> Counter[str]:
    """Tasks side by side, the longest first, so that none is left over at the end."""
    context = multiprocessing.get_context("spawn")  # forked FFTW threads would hang
    reports = context.SimpleQueue()
    listener = Thread(target=_listen, args=(reports, report), daemon=True)
    listener.start()
    outcome: Counter[str] = Counter()
    with ProcessPoolExecutor(jobs, context, _begin_worker, (reports,)) as pool:
        futures = {
            pool.submit(_work, task, parts, means): task
            for task in sorted(pending, key=lambda task: -task.seconds)
        }
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


def _begin_worker(reports: Any) -> None:
    global _reports
    _reports = reports
    for number in SIGNALS:
        signal.signal(number, lambda *_: solve.stop.set())


def _work(task: Task, parts: Path, means: Means) -> str:
    return _attempt(task, parts, _reports.put, means)


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
