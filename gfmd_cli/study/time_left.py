"""Estimate of the remaining time of a run, from the times that its tasks have taken so far."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite, log
from typing import Any

from gfmd_cli.study.context import Progress, Report
from gfmd_cli.study.tasks import SECONDS_PER_PAIR, Task

AGAIN = 0.5  # least share of the elapsed time that the forecast alone says to remain
KNOWN = 0.1  # share of the forecast work after which the measured speed is used
ENDING = 2.0  # pairs of transforms after the last step, which show and store the result
FOUND = 0.05  # share of the decrease of ln(residual) after which its rate predicts the rest


@dataclass
class _Running:
    """A running task."""

    since: float
    size: int = 0
    """Points of the grid that is being solved."""
    reached: float = 0.0
    """Time of the first step on that grid."""
    first: float = float("nan")
    """First residual on that grid."""
    last: float = float("nan")
    work: float = 0.0
    """Steps times grid points, summed over the earlier grids."""
    step: int = 0
    stepped: float = 0.0
    """Time of the first step of the task."""

    def done(self) -> float:
        """Steps times grid points that the task has done."""
        return self.work + self.step * float(self.size)


class Clock:
    """The remaining time of a run, updated as its tasks start, step and end.

    The estimate for a waiting task is its forecast times the ratio of measured to forecast time of
    the ended tasks of the same elastomer. A running task is assumed to continue at its present
    speed. On its finest grid the rate at which ln(residual) decreases is used as well, with a
    weight that increases with the decrease reached so far.
    """

    def __init__(
        self, tasks: Sequence[Task], jobs: int, now: Callable[[], float] = time.monotonic
    ) -> None:
        self.tasks = {task.index: task for task in tasks}
        self.jobs, self.now = jobs, now
        self.seconds = {task.index: task.seconds for task in tasks}
        self.waiting = set(self.tasks)
        self.ahead: dict[Any, float] = {}
        """Forecast seconds of the waiting tasks, by elastomer."""
        for task in tasks:
            self.ahead[task.elastomer] = self.ahead.get(task.elastomer, 0.0) + task.seconds
        self.running: dict[int, _Running] = {}
        self.taken: dict[Any, tuple[float, float]] = {}
        """Measured and forecast seconds of the ended tasks, by elastomer; None has those of all."""

    def watched(self, report: Report) -> Report:
        """A report that also receives the number of remaining tasks and the remaining time."""

        def tell(progress: Progress) -> None:
            self.take_in(progress)
            left = len(self.waiting) + len(self.running)
            report(progress._replace(tasks_left=left, seconds_left=self.left()))

        return tell

    def take_in(self, progress: Progress) -> None:
        """Update the estimate by one progress event of a task."""
        index, now = progress.task, self.now()
        if progress.event == "start":
            self._leave(index)
            self.running[index] = _Running(now)
        elif progress.event == "step" and index in self.running:
            was = self.running[index]
            if progress.size != was.size:
                was.work, was.stepped = was.done(), was.stepped or now
                was.size, was.reached, was.first = progress.size, now, progress.residual
            was.last, was.step = progress.residual, progress.step
        elif progress.event == "end":
            self._leave(index)
            was = self.running.pop(index, _Running(now))
            if progress.status is not None and progress.status.is_solved:
                for elastomer in (self.tasks[index].elastomer, None):
                    measured, forecast = self.taken.get(elastomer, (0.0, 0.0))
                    self.taken[elastomer] = (
                        measured + now - was.since,
                        forecast + self.seconds[index],
                    )

    def _leave(self, index: int) -> None:
        """Remove a task from the waiting ones."""
        if index in self.waiting:
            self.waiting.remove(index)
            self.ahead[self.tasks[index].elastomer] -= self.seconds[index]

    def left(self) -> float:
        """Seconds until all tasks have ended."""
        at_work = [self._left_of(index) for index in self.running]
        waiting = sum(seconds * self._pace(elastomer) for elastomer, seconds in self.ahead.items())
        return max([*at_work, (sum(at_work) + waiting) / self.jobs])

    def _pace(self, elastomer: Any) -> float:
        """Measured over forecast seconds of the ended tasks of an elastomer."""
        measured, forecast = self.taken.get(elastomer) or self.taken.get(None, (1.0, 1.0))
        return measured / forecast

    def _left_of(self, index: int) -> float:
        """Remaining seconds of a running task."""
        task, was, now = self.tasks[index], self.running[index], self.now()
        seconds, spent = self.seconds[index], now - was.since
        forecast = seconds * self._pace(task.elastomer)
        alone = SECONDS_PER_PAIR * was.done()
        if alone > KNOWN * seconds:  # use the measured speed of this machine
            prepared = was.stepped - was.since
            forecast = prepared + seconds * (spent - prepared) / alone
        left = max(forecast - spent, AGAIN * spent)
        if was.size == task.size and isfinite(was.first) and was.last > 0:
            way = log(max(was.first / task.solver.tolerance, 1.0))
            gone = log(max(was.first / was.last, 1.0))
            ending = ENDING * SECONDS_PER_PAIR * task.size
            if gone >= way:
                return ending
            if gone > FOUND * way:
                by_residual = (now - was.reached) * (way - gone) / gone
                return float(ending + by_residual ** (gone / way) * left ** (1 - gone / way))
        return left
