"""Progress events of the tasks of a run."""

from collections.abc import Callable
from typing import Literal, NamedTuple

from gfmd_cli.status import Status


class Progress(NamedTuple):
    """Progress event of one task."""

    task: int
    """Index of the task; -1 in a warning that concerns the whole run."""
    event: Literal["start", "step", "end", "warning"]
    label: str
    points: int = 0
    step: int = 0
    residual: float = float("nan")
    a_r: float = float("nan")
    status: Status | None = None
    """Of a task that has ended."""
    message: str = ""
    """The error that ended the task, or the text of a warning."""
    tasks_left: int | None = None
    """Number of tasks of the run that have not ended, if known."""
    seconds_left: float = float("nan")
    """Estimated time that they take."""
    size: int = 0
    """Number of points of the grid."""


Report = Callable[[Progress], None]


def ignore(progress: Progress) -> None:
    """A report that does nothing."""
