"""The progress of a study, read from its files; writes no file and takes no lock."""

import os
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from gfmd_cli.errors import InputError
from gfmd_cli.files.hdf5 import is_hdf5
from gfmd_cli.spec.models import Spec, load_text
from gfmd_cli.status import Status
from gfmd_cli.study.checkpoint import Checkpoint, SavedProgress
from gfmd_cli.study.reading import open_study
from gfmd_cli.study.store import Study
from gfmd_cli.study.tasks import plan
from gfmd_cli.study.unfinished_work import read_failure


@dataclass(frozen=True)
class TaskProgress:
    """The progress of one task."""

    task: int
    label: str
    status: Status
    saved: SavedProgress | None = None
    """The saved state from which the next run resumes."""
    failure: str = ""
    """The error that ended the last run of the task."""


@dataclass(frozen=True)
class StudyProgress:
    """The progress of all tasks of a study."""

    study: Path
    tasks: list[TaskProgress]
    records: int
    """Records that are not collected into the study file yet."""
    damaged: list[str]
    """Names of records that cannot be read; their tasks are solved again."""
    others: int = 0
    """Solved tasks of the study that the spec does not ask for."""

    @property
    def counts(self) -> Counter[Status]:
        """How many tasks have which status."""
        return Counter(task.status for task in self.tasks)

    @property
    def missing(self) -> list[int]:
        """Indices of the tasks that are not solved yet."""
        return [task.task for task in self.tasks if not task.status.is_solved]

    @property
    def converged(self) -> bool:
        """Whether every task has met its tolerance, accuracy and load."""
        return all(task.status.is_converged for task in self.tasks)

    def of_shards(self, shards: int) -> list[Counter[Status]]:
        """How many tasks of each shard have which status."""
        return [Counter(task.status for task in self.tasks[i::shards]) for i in range(shards)]


def progress_of_spec(spec: Spec, path: Path) -> StudyProgress:
    """The progress of the tasks of a spec in the study file `path`."""
    tasks = [(task.id, task.label) for task in plan(spec)]
    return _progress(Study(path), tasks, spec.output.names())


def progress_of_study(path: Path) -> StudyProgress:
    """The progress of a study file."""
    with open_study(path) as file:
        ids, rows = file.task_ids, file.rows
    labels = [f"{row['elastomer']} {load_text(row['load'], row['load_value'])}" for row in rows]
    return _progress(Study(path), list(zip(ids, labels, strict=True)))


def is_study(path: Path) -> bool:
    """Whether a path is meant as a study rather than as a spec."""
    return path.suffix == ".h5" or (os.path.isfile(path) and is_hdf5(path))


def check_shards(shards: int, tasks: int) -> None:
    """Raise InputError where some shard would have no task."""
    if not 0 < shards <= tasks:
        raise InputError(f"--shards {shards}: must be from 1 to {tasks}, the number of tasks")


def _progress(
    study: Study, tasks: list[tuple[str, str]], output: frozenset[str] = frozenset()
) -> StudyProgress:
    """The progress of these tasks (id, label); a result that lacks some of `output` is missing.

    Checkpoints and errors are read before records, and these before the study, in the order in
    which a task writes them, so that a task that ends meanwhile is not overlooked.
    """
    saved = {name: Checkpoint(study.parts / name).saved() for name, _ in tasks}
    failures = {name: read_failure(study.parts, name) for name, _ in tasks}
    damaged_files = study.damaged_paths()
    records, damaged = study.records()
    outcomes = study.outcomes()
    statuses = {name: result.status for name, result in outcomes.items() if result.stored >= output}
    names = [path.name for path in (*damaged_files, *damaged)]
    others = outcomes.keys() - {name for name, _ in tasks}
    each = [
        TaskProgress(index, label, statuses[name])
        if name in statuses
        else TaskProgress(index, label, Status.MISSING, saved[name], failures[name])
        for index, (name, label) in enumerate(tasks)
    ]
    return StudyProgress(study.path, each, len(records), names, len(others))
