"""How long a run will still take, from what its tasks have taken so far."""

import time
from collections.abc import Callable, Sequence
from math import isfinite, log
from typing import Any, NamedTuple

from gfmd_cli.study.solve import Progress, Report
from gfmd_cli.study.tasks import SECONDS_PER_PAIR, Task

AGAIN = 0.5  # of the time spent is left at the least, where only the forecast tells
KNOWN = 0.1  # of the forecast work, from which on its speed is told by that
FOUND = 0.05  # of the way to the tolerance, from which on the way that is left is told by it


class _Running(NamedTuple):
    """A task at work."""

    since: float
    points: int = 0
    """Of the grid it is on."""
    reached: float = 0.0
    """When it came to that grid."""
    first: float = float("nan")
    """Residual there at first."""
    last: float = float("nan")
    work: float = 0.0
    """Steps times grid points, on the grids before."""
    step: int = 0
    stepped: float = 0.0
    """When it took its first step."""


class Clock:
    """The time left of a run, as its tasks start, step and end.

    A task that has not begun is taken to need what was forecast, times what the ended ones of the
    same body took over their forecasts; one at work, to go on as fast as so far. On its finest
    grid it is taken to bring down the logarithm of its residual as fast as so far, the more the
    further it has come.
    """

    def __init__(
        self, tasks: Sequence[Task], jobs: int, now: Callable[[], float] = time.monotonic
    ) -> None:
        self.tasks = {task.index: task for task in tasks}
        self.jobs, self.now = jobs, now
        self.seconds = {task.index: task.seconds for task in tasks}
        self.waiting = set(self.tasks)
        self.ahead: dict[Any, float] = {}
        """Seconds forecast of the tasks that wait, by body."""
        for task in tasks:
            self.ahead[task.elastomer] = self.ahead.get(task.elastomer, 0.0) + task.seconds
        self.running: dict[int, _Running] = {}
        self.taken: dict[Any, tuple[float, float]] = {}
        """Seconds measured and forecast of ended tasks, by body, and of all under None."""

    def watched(self, report: Report) -> Report:
        """A report that is told the number of tasks left and the time that they will take."""

        def tell(progress: Progress) -> None:
            self.take_in(progress)
            left = len(self.waiting) + len(self.running)
            report(progress._replace(tasks_left=left, seconds_left=self.left()))

        return tell

    def take_in(self, progress: Progress) -> None:
        """Note one word on a task."""
        index, now = progress.task, self.now()
        if progress.event == "start":
            self._leave(index)
            self.running[index] = _Running(now)
        elif progress.event == "step" and index in self.running:
            was = self.running[index]
            if progress.points != was.points:
                work, stepped = self._work(index), was.stepped or now
                was = _Running(
                    was.since, progress.points, now, progress.residual, work=work, stepped=stepped
                )
            self.running[index] = was._replace(last=progress.residual, step=progress.step)
        elif progress.event in ("done", "failed", "interrupted"):
            self._leave(index)
            was = self.running.pop(index, _Running(now))
            if progress.event == "done":
                for body in (self.tasks[index].elastomer, None):
                    measured, forecast = self.taken.get(body, (0.0, 0.0))
                    self.taken[body] = (measured + now - was.since, forecast + self.seconds[index])

    def _leave(self, index: int) -> None:
        """A task waits no longer."""
        if index in self.waiting:
            self.waiting.remove(index)
            self.ahead[self.tasks[index].elastomer] -= self.seconds[index]

    def left(self) -> float:
        """Seconds until all tasks have ended."""
        at_work = [self._left_of(index) for index in self.running]
        waiting = sum(seconds * self._pace(body) for body, seconds in self.ahead.items())
        return max([*at_work, (sum(at_work) + waiting) / self.jobs])

    def _pace(self, body: Any) -> float:
        """Seconds that tasks of a body take, over those forecast."""
        measured, forecast = self.taken.get(body) or self.taken.get(None, (1.0, 1.0))
        return measured / forecast

    def _work(self, index: int) -> float:
        """Steps times grid points that a task has done."""
        task, was = self.tasks[index], self.running[index]
        return was.work + was.step * float(was.points**task.surface.dimension)

    def _left_of(self, index: int) -> float:
        """Seconds that a task at work will still take."""
        task, was, now = self.tasks[index], self.running[index], self.now()
        seconds, spent = self.seconds[index], now - was.since
        forecast = seconds * self._pace(task.elastomer)
        alone = SECONDS_PER_PAIR * self._work(index)
        if alone > KNOWN * seconds:  # how fast this machine is just now
            prepared = was.stepped - was.since
            forecast = prepared + seconds * (spent - prepared) / alone
        left = max(forecast - spent, AGAIN * spent)
        if was.points == task.points and isfinite(was.first) and was.last > 0:
            way = log(max(was.first / task.solver.tolerance, 1.0))
            gone = log(max(was.first / was.last, 1.0))
            if way > gone > FOUND * way:
                by_residual = (now - was.reached) * (way - gone) / gone
                return float(by_residual ** (gone / way) * left ** (1 - gone / way))
        return left
