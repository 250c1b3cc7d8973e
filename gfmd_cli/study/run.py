"""Run a spec: what is missing is solved, task by task, on one or more processes."""

import os
import signal
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from itertools import chain
from pathlib import Path
from threading import Timer, current_thread, main_thread
from typing import Any

from gfmd_cli.errors import InputError, Interrupted, SpaceError
from gfmd_cli.physics import wisdom
from gfmd_cli.physics.ranks import Ranks, agree, leads, together
from gfmd_cli.study import solve
from gfmd_cli.study.clock import Clock
from gfmd_cli.study.grids import scene_of
from gfmd_cli.study.resources import check_memory, room, seconds_to_stop, share_out
from gfmd_cli.study.solve import Progress, Report
from gfmd_cli.study.spec import Spec
from gfmd_cli.study.store import Study
from gfmd_cli.study.tasks import Task, plan
from gfmd_cli.study.workers import SIGNALS, Means, attempt, solve_in_pool

CHECKPOINT_EVERY = 600.0  # seconds


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
        return solve_in_pool(pending, parts, report, jobs, means)
    outcome: Counter[str] = Counter()
    for task in pending:
        outcome[attempt(task, parts, report, means, ranks)] += 1
    del outcome["interrupted"]
    return outcome


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
    """Inside, a signal asks for an orderly stop; a second SIGINT leaves at once.

    Only the main thread of a program can take signals; in another they stay what they are.
    """
    solve.stop.clear()
    if current_thread() is not main_thread():
        yield
        return

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
