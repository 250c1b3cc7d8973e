"""What the solves of a run share: options, progress reports, the request to stop."""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf
from threading import Event
from typing import Literal, NamedTuple

from gfmd_cli.grid.ranks import Ranks
from gfmd_cli.physics.contact import Contact
from gfmd_cli.solvers.loop import State
from gfmd_cli.solvers.nested_grids import Resume
from gfmd_cli.status import Status
from gfmd_cli.study.history import TaskHistory


class ProgressEvent(NamedTuple):
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
    """Status of a task that has ended."""
    message: str = ""
    """The error that ended the task, or the text of a warning."""
    tasks_left: int | None = None
    """Number of tasks of the run that have not ended, if known."""
    seconds_left: float = float("nan")
    """Estimated time that they take."""
    size: int = 0
    """Number of points of the grid."""
    p_star: float = float("nan")
    """Reduced pressure of the solve."""


Report = Callable[[ProgressEvent], None]


def ignore(progress: ProgressEvent) -> None:
    """A report that does nothing."""


@dataclass(frozen=True)
class WorkerOptions:
    """Options of the process that solves tasks, as plain data."""

    threads: int = 1
    memory: float = inf
    """Memory that one solve may take [bytes]; it limits the size of an "auto" grid."""
    reproducible: bool = False
    """Whether results must not depend on the machine: to reach `memory` is an error then."""
    checkpoint_every: float = inf
    """Time between two saves of the state of a solve [s]."""
    wait_until: float = inf
    """Time of the monotonic clock at which waits for locks end [s]."""


@dataclass(frozen=True)
class SolveContext:
    """What all solves of one process share."""

    options: WorkerOptions
    report: Report = ignore
    stop: Event = field(default_factory=Event)
    """Once set, unfinished solves save their states and end."""
    ranks: Ranks | None = None
    """The processes that share large grids."""

    def should_stop(self) -> bool:
        """Whether `stop` is set on any process; all of them must call this."""
        if self.ranks is not None and self.ranks.total(int(self.stop.is_set())):
            self.stop.set()
        return self.stop.is_set()

    def warn(self, *messages: str, task: int = -1, label: str = "") -> None:
        """Report warnings, by default on the whole run."""
        for message in messages:
            self.report(ProgressEvent(task, "warning", label, message=message))


class Watcher:
    """Follows the solve of one task; this one does nothing."""

    def __init__(self) -> None:
        self.history = TaskHistory()
        """What was solved before the present grid, to be saved with its state."""

    def saved_state(self, contact: Contact) -> Resume | None:
        """At the first call, the state of this contact that an earlier run saved."""

    def __call__(self, contact: Contact, state: State) -> None:
        """Is called with every state."""
