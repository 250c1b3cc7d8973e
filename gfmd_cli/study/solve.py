"""One task from its scene to its committed record."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import Any, Literal, NamedTuple

import numpy as np

from gfmd_cli.errors import Interrupted, SpaceError
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.ranks import Ranks, leads
from gfmd_cli.solvers.cascade import Solution
from gfmd_cli.solvers.loop import State
from gfmd_cli.study.checkpoint import Checkpoint
from gfmd_cli.study.further import observe_further
from gfmd_cli.study.grids import Solved
from gfmd_cli.study.layout import empty_row
from gfmd_cli.study.record import Record, write_record
from gfmd_cli.study.search import solve_task_on_grids
from gfmd_cli.study.tasks import Task

REPORT_EVERY = 0.2  # seconds between two reports of one task
stop = Event()
"""Set by a signal: unfinished solves save their state and end."""


class Progress(NamedTuple):
    """A word on one task."""

    task: int
    event: Literal["start", "step", "done", "failed", "interrupted", "warning"]
    label: str
    points: int = 0
    step: int = 0
    residual: float = float("nan")
    a_r: float = float("nan")
    note: str = ""
    """Status of a task that is done, the reason of one that failed, what there is to warn of."""
    tasks_left: int | None = None
    """Of the whole run, where that is counted."""
    seconds_left: float = float("nan")


Report = Callable[[Progress], None]


@dataclass
class _Watcher:
    """Reports, saves the state by wall time, and stops when asked to."""

    task: Task
    checkpoint: Checkpoint
    report: Report
    every: float
    ranks: Ranks | None = None
    last_report: float = 0.0
    last_save: float = 0.0
    spent: float = 0.0
    notes: Any = None

    def note(self, notes: Any) -> None:
        self.notes = notes

    def enter_level(self, points: int, spent: float) -> None:
        self.spent = spent

    def __call__(self, contact: Contact, state: State) -> None:
        now = time.monotonic()
        if now - self.last_report > REPORT_EVERY:
            self.last_report = now
            area = np.count_nonzero(state.u == contact.height) / state.u.size
            points, step = contact.grid.points, state.step
            self.report(
                Progress(
                    self.task.index, "step", self.task.label, points, step, state.residual, area
                )
            )
        if self.ranks is not None and contact.grid.whole:
            return  # a small grid, which each process solves on its own
        asked = 2.0 if stop.is_set() else float(now - self.last_save > self.every)
        asked = contact.grid.most(asked)  # of any process
        if asked > 1:
            stop.set()
            self.checkpoint.save(contact, state, self.spent, self.notes)
            raise Interrupted(f"{self.task.label}: stopped, state saved")
        if asked:
            try:
                self.checkpoint.save(contact, state, self.spent, self.notes)
            except SpaceError as error:  # the solve can do without
                self.warn(str(error))
            self.last_save = time.monotonic()

    def warn(self, note: str | None) -> None:
        """Say what went wrong with the checkpoint, if anything did."""
        if note is not None:
            self.report(Progress(self.task.index, "warning", self.task.label, note=note))


def solve_task(
    task: Task,
    parts: Path,
    threads: int,
    report: Report,
    checkpoint_every: float,
    memory: float = np.inf,
    fixed: bool = False,
    ranks: Ranks | None = None,
) -> str:
    """Solve one task and commit its record; return its status.

    `memory` [bytes] limits how far an "auto" grid may grow; where `fixed`, to reach that limit is
    an error instead. `ranks` are the processes that share the task. Raises Interrupted after the
    state was saved, InputError, SpaceError.
    """
    report(Progress(task.index, "start", task.label))
    begun = time.perf_counter()
    with Checkpoint.held(parts / task.id, ranks) as checkpoint:
        watcher = _Watcher(
            task, checkpoint, report, checkpoint_every, ranks, last_save=time.monotonic()
        )
        watcher.warn(checkpoint.restore())
        solved = solve_task_on_grids(
            task,
            threads,
            (memory, fixed),
            checkpoint.load,
            checkpoint.notes(),
            watcher.note,
            ranks,
            watch=watcher,
            enter_level=watcher.enter_level,
        )
        record = _record(task, solved, time.perf_counter() - begun)
        if leads(ranks):
            write_record(parts, record)
        checkpoint.remove()
    report(_done(task, record, solved.solution))
    return solved.solution.status


def _done(task: Task, record: Record, solution: Solution) -> Progress:
    return Progress(
        task.index,
        "done",
        task.label,
        record.row["points"],
        solution.steps,
        solution.residual,
        record.row["a_r"],
        solution.status,
    )


def _record(task: Task, solved: Solved, seconds: float) -> Record:
    """All that is kept of one solution."""
    scene, contact, solution, seen = solved.scene, solved.contact, solved.solution, solved.seen
    u, sigma = solution.u, solution.sigma
    row = (
        empty_row()
        | task.columns()
        | {
            "points": scene.grid.points,
            "p_star": contact.pressure,
            "a_r": seen.a_r,
            "sigma_p": seen.sigma_p,
            "u_g": seen.u_g,
            "residual": solution.residual,
            "solver": solution.solver,
            "transforms": solution.transforms,
            "seconds": seconds,
            "status": solution.status,
            "pressure": contact.pressure * scene.delta_sigma,
            "delta_sigma": scene.delta_sigma,
            "h_std": scene.h_std,
            "mean_height": scene.mean_height,
            "length": scene.grid.length,
            "mean_gap": seen.u_g * scene.h_std,
            "perimeter": seen.perimeter,
            "energy": seen.energy,
            "work": seen.work,
            "steps": solution.steps,
            "tolerance": task.solver.tolerance,
        }
        | solved.columns()
    )
    further = observe_further(task.output, solved)
    physical = {}
    if task.output.fields or task.output.cross_section:
        physical = {
            "u": u * scene.h_std + scene.mean_height,
            "sigma": sigma * scene.delta_sigma,
            "height": contact.height * scene.h_std + scene.mean_height,
        }
    return Record(
        task_id=task.id,
        row=row | further.columns,
        shells=scene.shells,
        distribution=further.distribution,
        spectra=further.spectra,
        autocorrelations=further.autocorrelations,
        fields={
            name: whole
            for name in task.output.fields
            if (whole := scene.grid.collect(physical[name])) is not None
        },
        cross_section={name: scene.grid.diagonal(values) for name, values in physical.items()}
        if task.output.cross_section
        else {},
    )
