"""How far a study is, from its files alone: nothing is written, no lock is taken."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from gfmd_cli.errors import InputError, StudyError
from gfmd_cli.study.checkpoint import Checkpoint, Saved
from gfmd_cli.study.layout import MISSING
from gfmd_cli.study.reading import open_study, rows_of, texts_of
from gfmd_cli.study.record import read_status
from gfmd_cli.study.spec import Spec
from gfmd_cli.study.store import Study
from gfmd_cli.study.tasks import plan

CONVERGED = "converged"
MAGIC = b"\x89HDF\r\n\x1a\n"


@dataclass(frozen=True)
class TaskState:
    """How far one task is."""

    task: int
    label: str
    status: str
    """Of a task that is solved, else "missing"."""
    saved: Saved | None = None
    """The state that its next run goes on from."""


@dataclass(frozen=True)
class StudyState:
    """How far all tasks of a study are."""

    study: Path
    tasks: list[TaskState]
    records: int
    """Records that are not collected into the study file yet."""
    damaged: list[str]
    """Names of records that cannot be read; their tasks are solved again."""

    @property
    def counts(self) -> Counter[str]:
        """How many tasks have which status."""
        return Counter(task.status for task in self.tasks)

    @property
    def missing(self) -> list[int]:
        """Indices of the tasks that are not solved yet."""
        return [task.task for task in self.tasks if task.status == MISSING]

    @property
    def converged(self) -> bool:
        """Whether every task is solved to its tolerance."""
        return all(task.status == CONVERGED for task in self.tasks)

    def shard(self, index: int, count: int) -> Counter[str]:
        """How many tasks of one shard have which status."""
        return Counter(task.status for task in self.tasks if task.task % count == index)


def state_of_spec(spec: Spec, path: Path) -> StudyState:
    """How far a spec is in the study file `path`. Raises InputError where that has another spec."""
    study = Study(path)
    study.check_spec(spec)
    return _state(study, [(task.id, task.label) for task in plan(spec)])


def state_of_study(path: Path) -> StudyState:
    """How far a study file is; of what is missing it knows the number only."""
    with open_study(path) as file:
        ids, rows = texts_of(file, "task_id"), rows_of(file)
    labels = [
        f"{row['elastomer']} {row['points']} p*={row['p_star']:.4g}" if row["elastomer"] else ""
        for row in rows
    ]
    return _state(Study(path), list(zip(ids, labels, strict=True)))


def is_study(path: Path) -> bool:
    """Whether a path is meant as a study rather than as a spec."""
    if path.suffix == ".h5":
        return True
    try:
        with path.open("rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:
        return False


def check_shards(count: int, tasks: int) -> None:
    """Raise InputError where some shard would have no task."""
    if not 0 < count <= tasks:
        raise InputError(f"--shards {count}: the spec has {tasks} tasks; take 1 to {tasks}")


def _state(study: Study, tasks: list[tuple[str, str]]) -> StudyState:
    """Read in the order in which a task's files follow each other, so that none is overlooked."""
    saved = {name: Checkpoint(study.parts / name).saved() for name, _ in tasks}
    recorded: dict[str, str] = {}
    damaged = sorted(path.name for path in study.parts.glob("*.bad"))
    for path in study.record_paths():
        try:
            recorded[path.stem] = read_status(path)
        except StudyError:
            if path.exists():  # else it has just been collected
                damaged.append(path.name)
    known = study.collected() | recorded
    states = [
        TaskState(index, label, known.get(name, MISSING), None if name in known else saved[name])
        for index, (name, label) in enumerate(tasks)
    ]
    return StudyState(study.path, states, len(recorded), damaged)
