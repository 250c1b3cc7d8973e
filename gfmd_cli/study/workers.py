"""Tasks at work: one attempt each, or many side by side on worker processes."""

import faulthandler
import multiprocessing
import os
import signal
import sys
import traceback
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import Any, NamedTuple

from gfmd_cli.errors import GfmdError, Interrupted, SpaceError, StudyError
from gfmd_cli.physics import wisdom
from gfmd_cli.physics.ranks import Ranks, agree, together
from gfmd_cli.study import solve
from gfmd_cli.study.record import read_status, record_path
from gfmd_cli.study.solve import Progress, Report, solve_task
from gfmd_cli.study.tasks import Task

SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGUSR1, signal.SIGUSR2)
"""They ask for an orderly stop."""


class Means(NamedTuple):
    """How to solve a task."""

    threads: int
    checkpoint_every: float
    """Seconds."""
    memory: float
    """Bytes that it may take."""
    reproducible: bool


def is_stopped(ranks: Ranks | None) -> bool:
    """Whether a signal has come, to any process."""
    if ranks is not None and ranks.total(int(solve.stop.is_set())):
        solve.stop.set()
    return solve.stop.is_set()


def _status_of(path: Path) -> str | None:
    """Status of a record that is whole, None where there is none."""
    with suppress(StudyError):
        return read_status(path)
    return None


def attempt(
    task: Task, parts: Path, report: Report, means: Means, ranks: Ranks | None = None
) -> str:
    """Solve one task, unless another process has just done so; an error ends this task only."""
    if is_stopped(ranks):
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


def solve_in_pool(
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
        try:
            futures = {
                pool.submit(_work, task, parts, means): task
                for task in sorted(pending, key=lambda task: -task.seconds)
            }
        finally:
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
    """Tell what the workers say; were nobody to listen, they would wait for ever."""
    for progress in iter(reports.get, None):
        try:
            report(progress)
        except Exception:  # a display that fails is no reason to lose a run
            traceback.print_exc()


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
    return attempt(task, parts, _reports.put, means)
