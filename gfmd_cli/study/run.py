"""Run a spec: solve the tasks that have no result yet, on one or more processes."""

from collections import Counter
from contextlib import ExitStack
from dataclasses import dataclass
from math import inf
from pathlib import Path
from threading import Event
from time import monotonic

from gfmd_cli.errors import InputError, Interrupted, SpaceError
from gfmd_cli.files.file_cache import forget_files
from gfmd_cli.files.locks import AS_LONG_AS_NEEDED, WaitOptions
from gfmd_cli.grid import plans
from gfmd_cli.grid.ranks import Ranks, is_root, on_root, shared_errors
from gfmd_cli.spec.models import Spec
from gfmd_cli.status import Status
from gfmd_cli.study.context import ProgressEvent, Report, SolveContext, WorkerOptions
from gfmd_cli.study.plausibility import unit_of_grids
from gfmd_cli.study.pool import Pool, Worker
from gfmd_cli.study.refinement import forget_scenes
from gfmd_cli.study.resources import check_memory, jobs_and_threads, seconds_to_stop, usable_memory
from gfmd_cli.study.result import Outcome
from gfmd_cli.study.run_task import attempt
from gfmd_cli.study.signals import signal_handlers
from gfmd_cli.study.store import Study, without_result
from gfmd_cli.study.tasks import Task, plan
from gfmd_cli.study.time_left import RemainingTime
from gfmd_cli.study.unfinished_work import forget_failure, note_failure
from gfmd_cli.units import count


@dataclass(frozen=True)
class RunOptions:
    """How the tasks of a spec are run. Raises InputError where that cannot be done."""

    shard: tuple[int, int] = (0, 1)
    """(i, n) takes the tasks with index i modulo n."""
    overwrite: bool = False
    """Whether to rename the study and its unfinished work, and to solve all tasks anew."""
    jobs: int | None = None
    """Worker processes; by default as many as cores, memory and tasks suggest."""
    checkpoint_every: float = 600.0
    """Time between two saves of the state of a solve [s]."""
    max_seconds: float | None = None
    """Wall time before which the run saves all states and stops, as after a signal; a wait for
    another process ends with it."""
    reproducible: bool = False
    """Whether to plan transforms without measuring, with one thread a task."""
    ranks: Ranks | None = None
    """The processes of an MPI run, which share every task."""
    may_exit: bool = False
    """Whether a second SIGINT ends the process at once; otherwise it raises KeyboardInterrupt."""

    def __post_init__(self) -> None:
        if self.overwrite and self.shard[1] != 1:
            raise InputError("--overwrite: not with --shard; each shard would start a new study")

    def shard_of(self, tasks: list[Task]) -> list[Task]:
        """The tasks of the shard."""
        index, shards = self.shard
        return [task for task in tasks if task.index % shards == index]


def run_study(
    spec: Spec, text: str, path: Path, report: Report, options: RunOptions
) -> Counter[Status]:
    """Solve the tasks of this shard that the study does not hold yet, and collect all records.

    What the study holds of other specs stays.

    Parameters
    ----------
    spec, text : the run spec and the text it was read from
    path : the study file
    report : receives an event at every start, step and end of a task
    options : how the tasks are run; all processes of an MPI run call this

    Returns how many tasks of this shard ended in which status (`FAILED`: an error ended it).
    Raises InputError for a spec that does not fit the machine, SpaceError, and Interrupted after a
    signal or the time given, when all states are saved, and where tasks are left whose workers
    were killed.
    """
    ranks = options.ranks
    forget_files()
    forget_scenes()
    stop = Event()
    end = monotonic() + (inf if options.max_seconds is None else options.max_seconds)
    # ranks stop together
    wait_options = WaitOptions(stop, end) if ranks is None else AS_LONG_AS_NEEDED
    study = Study(path, wait_options)
    tasks = plan(spec)
    if ranks is not None and (names := spec.output.on_request()):
        raise InputError(f"output.{names[0]}: takes whole grids; run it without mpiexec")
    moved = on_root(ranks, study.move_aside) if options.overwrite else []
    outcomes = on_root(ranks, study.outcomes)
    shard = options.shard_of(tasks)
    pending = without_result(shard, outcomes)
    to_solve = {task.id for task in pending}
    counts = Counter(outcomes[task.id].status for task in shard if task.id not in to_solve)
    if not pending and not on_root(ranks, study.record_paths):
        if is_root(ranks) and study.parts.exists():  # of a run that was killed as it ended
            with study.work(tasks):
                pass
        return counts
    check_memory(pending, ranks)
    jobs, threads = jobs_and_threads(pending, options.jobs, options.reproducible, ranks)
    worker_options = WorkerOptions(
        threads, usable_memory(ranks) / jobs, options.reproducible, options.checkpoint_every, end
    )
    remaining, last = RemainingTime(pending, jobs), inf
    if options.max_seconds is not None and pending:  # early enough to save all and to collect it
        seconds = max(options.max_seconds / 2, options.max_seconds - seconds_to_stop(pending, jobs))
        last = monotonic() + seconds

    def watch(progress: ProgressEvent) -> None:
        report(remaining.with_time_left(progress))
        if is_root(ranks):
            _keep_failure(progress, tasks, study.parts)
        if progress.task >= 0 and monotonic() > last:  # every call advances a task before it stops
            stop.set()

    context = SolveContext(worker_options, watch, stop, ranks)
    with signal_handlers(stop, may_exit=options.may_exit), ExitStack() as work:
        damaged = on_root(ranks, lambda: work.enter_context(study.work(tasks)))
        work.callback(forget_scenes)  # their plans are those of this run
        work.callback(plans.plan_with, None)
        unusable = plans.plan_with(
            study.parts, estimated=options.reproducible, wait_options=wait_options
        )
        context.warn(*(f"{study.path}: the old one is kept as {new}" for new in moved))
        context.warn(*damaged, *filter(None, [unusable, unit_of_grids(pending)]))
        try:
            solved = _solve_all(pending, study.parts, jobs, context)
        finally:
            with shared_errors(ranks):
                # a stopped shard ends soon: its records are kept, others collect them
                is_shard = options.shard[1] > 1
                if is_root(ranks) and not (is_shard and stop.is_set()):
                    try:
                        context.warn(*study.collect(spec, tasks, text))
                    except Interrupted:  # another process collects for too long
                        if not is_shard:
                            raise
        again = "run again without --overwrite" if options.overwrite else "run again"
        _check_ended(solved, len(pending), stop, again)
        if not any(status.is_failure for status in solved):
            _check_stored([*shard, *pending], on_root(ranks, study.outcomes), study.path)
    return counts + solved


def _keep_failure(progress: ProgressEvent, tasks: list[Task], parts: Path) -> None:
    """Keep the error of a task that has failed, until the task starts again."""
    if progress.event == "start":
        forget_failure(parts, tasks[progress.task].id)
    elif progress.status is not None and progress.status.is_failure:
        note_failure(parts, tasks[progress.task].id, progress.message)


def _check_ended(solved: Counter[Status], pending: int, stop: Event, again: str) -> None:
    """Raise SpaceError or Interrupted if that ended the run; `again` says how to continue."""
    if lost := solved[Status.NO_SPACE]:
        raise SpaceError(f"no space for {count(lost, 'result')}; free some and {again}")
    unsolved = pending - sum(solved.values())
    left = count(unsolved, "task")
    if stop.is_set() and unsolved:
        raise Interrupted(f"stopped, states saved; {left} left; {again} to continue")
    if unsolved and not any(status.is_failure for status in solved):
        raise Interrupted(f"{left} left whose workers were killed; {again} to continue")


def _check_stored(solved: list[Task], outcomes: dict[str, Outcome], path: Path) -> None:
    """Raise Interrupted where results are missing: another process has deleted the study.

    Also where another run of the same tasks, with other output, came first.
    """
    lacking = {task.id for task in without_result(solved, outcomes)}
    if lost := lacking - outcomes.keys():
        raise Interrupted(
            f"{path}: deleted or replaced during the run, with {count(len(lost), 'result')}; run "
            "again to solve what is missing"
        )
    if lacking:
        raise Interrupted(
            f"another run solved {count(len(lacking), 'task')} at the same time, with other "
            "output; run again to add the output of this one"
        )


def _solve_all(
    pending: list[Task], parts: Path, jobs: int, context: SolveContext
) -> Counter[Status]:
    """Solve tasks, on worker processes if there are several jobs; the statuses of those ended."""
    counts: Counter[Status] = Counter()
    if jobs > 1:
        pool = Pool(pending, context, jobs, lambda: Worker(parts, context.options))
        counts, pending = pool.run(), list(pool.waiting)  # for which no worker could be started
    counts.update(attempt(task, parts, context) for task in pending)
    del counts[Status.INTERRUPTED]
    return counts
