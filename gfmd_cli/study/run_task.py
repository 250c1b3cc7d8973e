"""One task from its scene to its committed record."""

import time
from contextlib import suppress
from functools import lru_cache, partial
from math import nan
from pathlib import Path

from gfmd_cli.errors import GfmdError, InputError, Interrupted, SpaceError, StudyError
from gfmd_cli.files.atomic import exists
from gfmd_cli.files.checksums import Version, file_digest, file_version
from gfmd_cli.grid.blas import one_blas_thread
from gfmd_cli.grid.fft_grid import Shape
from gfmd_cli.grid.ranks import is_root, on_root, shared_errors
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.observables import contact_points
from gfmd_cli.solvers.loop import State
from gfmd_cli.solvers.nested_grids import Resume
from gfmd_cli.status import Status
from gfmd_cli.study.checkpoint import Checkpoint
from gfmd_cli.study.context import ProgressEvent, SolveContext, Watcher
from gfmd_cli.study.load_search import solve_at_load
from gfmd_cli.study.measure import result
from gfmd_cli.study.provenance import gfmd_version
from gfmd_cli.study.signals import interruptible
from gfmd_cli.study.tasks import Task
from gfmd_cli.study.unfinished_work import read_record_entry, record_path, write_record
from gfmd_cli.units import duration

REPORT_EVERY = 0.2  # seconds between two reports of one task
SAVE, STOP = 1.0, 2.0  # requests to a solve; the largest one of all processes counts


class TaskWatcher(Watcher):
    """Reports the progress of a task, saves its state at intervals, and stops it on request.

    A task is stopped when it has a state that no earlier call saved: every call advances.
    """

    def __init__(self, task: Task, checkpoint: Checkpoint, context: SolveContext) -> None:
        super().__init__()
        self.task, self.checkpoint, self.context = task, checkpoint, context
        self._warn = partial(context.warn, task=task.index, label=task.label)
        self.begun = self.last_save = time.monotonic()
        self.last_report = 0.0
        self.first_state: tuple[Shape, int] | None = None
        """Grid and step of the first state of this call."""
        self.stops_early = False
        """Whether the stop was requested before a new state was reached."""
        self.has_loaded = False
        """Whether the saved state was asked for."""
        self.unsaved = False
        """Whether a state could not be saved and the user was warned."""
        if (message := checkpoint.restore()) is not None:
            self._warn(message)
        self.history = checkpoint.history

    def saved_state(self, contact: Contact) -> Resume | None:
        """At the first call, the state of this contact that an earlier run saved."""
        if self.has_loaded:
            return None
        self.has_loaded = True
        try:
            return self.checkpoint.load(contact.grid, self.task.solver.for_contact(contact))
        except StudyError:
            self._warn(self.checkpoint.set_aside())
            return None

    def __call__(self, contact: Contact, state: State) -> None:
        """Report, save or stop, if it is time to."""
        now = time.monotonic()
        if now - self.last_report > REPORT_EVERY:
            self.last_report = now
            self._report_step(contact, state)
        if self.context.ranks is not None and contact.grid.whole:
            return  # a small grid, which each process solves on its own
        self.first_state = self.first_state or (contact.grid.whole_shape, state.step)
        request = SAVE if now - self.last_save > self.context.options.checkpoint_every else 0.0
        if self.context.stop.is_set():
            request = STOP
        request = contact.grid.max(request)
        if request == STOP:
            self._stop(contact, state)
        elif request == SAVE:
            self._save(contact, state)

    def _stop(self, contact: Contact, state: State) -> None:
        """Save the state and raise Interrupted, unless it is the first one of this call."""
        self.context.stop.set()
        if self.first_state == (contact.grid.whole_shape, state.step):
            self.stops_early = True  # else calls with too little time would never get further
            return
        self.checkpoint.save(contact, state, self.history)
        if self.stops_early:
            seconds = duration(max(1.0, time.monotonic() - self.begun))
            self._warn(
                f"{self.task.label}: stopped after its first step, which took {seconds}; a shorter "
                "call makes no progress"
            )
        raise Interrupted(f"{self.task.label}: stopped, state saved")

    def _save(self, contact: Contact, state: State) -> None:
        """Save the state if there is space; the solve goes on without it."""
        try:
            self.checkpoint.save(contact, state, self.history)
        except SpaceError as error:
            if not self.unsaved:
                self._warn(f"checkpoint: {error}; the solve goes on without")
            self.unsaved = True
        self.last_save = time.monotonic()

    def _report_step(self, contact: Contact, state: State) -> None:
        grid, task, a_r = contact.grid, self.task, nan
        if grid.whole:  # else this process has a part of the contact
            a_r = float(contact_points(contact.obstacle, state.u, state.sigma).mean())
        numbers = grid.points, state.step, state.residual, a_r
        step = ProgressEvent(
            task.index, "step", task.label, *numbers, size=grid.size, p_star=contact.pressure
        )
        self.context.report(step)


def attempt(task: Task, parts: Path, context: SolveContext) -> Status:
    """Solve one task unless it has a record; an error ends this task only.

    `parts` is the folder of unfinished work.
    """
    if context.should_stop():
        return Status.INTERRUPTED
    if status := on_root(context.ranks, lambda: _recorded_status(parts, task)):
        return status
    try:
        with shared_errors(context.ranks):
            return solve_task(task, parts, context)
    except Interrupted:
        context.stop.set()  # also where a wait for a lock was too long, or the folder is gone
        status, message = Status.INTERRUPTED, ""
    except (GfmdError, MemoryError, ArithmeticError, OSError) as error:
        status = Status.NO_SPACE if isinstance(error, SpaceError) else Status.FAILED
        message = str(error) or type(error).__name__
    context.report(ProgressEvent(task.index, "end", task.label, status=status, message=message))
    return status


def _recorded_status(parts: Path, task: Task) -> Status | None:
    """The status in the record of a task, None without an intact record."""
    with suppress(StudyError):
        path = record_path(parts, task.id, task.output.names())
        return Status(read_record_entry(path).row["status"])
    return None


@one_blas_thread()
def solve_task(task: Task, parts: Path, context: SolveContext) -> Status:
    """Solve one task and commit its record; return its status.

    Raises Interrupted after the state was saved, and where `parts` was renamed or deleted, which
    ends the run; InputError, SpaceError.
    """
    if not (exists(parts) and parts.is_dir()):
        raise Interrupted(f"{parts}: renamed or deleted during the run")
    context.report(ProgressEvent(task.index, "start", task.label))
    _check_files(task)  # before the work for it begins
    gfmd_version()  # kept from now on: the source tree may be updated during the solve
    start = time.perf_counter()
    with Checkpoint.exclusive(parts / task.id, context.ranks) as checkpoint:
        with interruptible():
            solved = solve_at_load(task, context, TaskWatcher(task, checkpoint, context))
        record = result(task, solved, time.perf_counter() - start)
        _check_files(task)
        if is_root(context.ranks):
            write_record(parts, record)
        checkpoint.remove()
    numbers = (record.entry.row[name] for name in ("points", "steps", "residual", "a_r", "status"))
    context.report(ProgressEvent(task.index, "end", task.label, *numbers))
    return solved.solution.status


def _check_files(task: Task) -> None:
    """Raise InputError where a file is not the one whose checksum the task has.

    Its content is read only if its version has changed, as by `touch` or a copy of the same file.
    """
    for path, version, checksum in task.files.values():
        with suppress(OSError):  # a file that was deleted after it had been read
            now = file_version(path)
            if now != version and _digest(path, now) != checksum:
                raise InputError(f"{path}: the file was changed during the run; run again")


@lru_cache(maxsize=16)
def _digest(path: Path, version: Version) -> str:
    """The checksum of a file in this version; cached, because every task asks for it twice."""
    return file_digest(path)
