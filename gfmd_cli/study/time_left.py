"""Estimate of the remaining time of a run, from the times that its tasks have taken so far."""

import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite, log
from typing import Any

from gfmd_cli.study.context import ProgressEvent
from gfmd_cli.study.forecast import SECONDS_PER_PAIR
from gfmd_cli.study.tasks import Task

# Choices; scripts/time_left.py compares the estimates with the true times.
MIN_REMAINING_SHARE = 0.5  # smallest remaining time by the forecast alone, over the elapsed time
FINAL_PAIRS = 1.5  # pairs of transforms after the last step, which show and store the result
RATE_FROM = 0.05  # share of the decrease of ln(residual) after which its rate predicts the rest


@dataclass
class _Running:
    """A running task."""

    started: float
    size: int = 0
    """Points of the grid that is being solved."""
    grid_started: float = 0.0
    """Time of the first step on that grid."""
    first: float = float("nan")
    """First residual on that grid."""
    last: float = float("nan")
    p_star: float = float("nan")
    """Reduced pressure; of a load in Pa it is known only once the surface is prepared."""


class RemainingTime:
    """The remaining time of a run, updated as its tasks start, step and end.

    The estimate for a waiting task is its forecast times the ratio of measured to forecast time of
    the ended tasks of the same elastomer, and that for a running task the same less the elapsed
    time. On its finest grid the rate at which ln(residual) decreases is used as well, with a weight
    that increases with the decrease reached so far.
    """

    def __init__(
        self, tasks: Sequence[Task], jobs: int, now: Callable[[], float] = time.monotonic
    ) -> None:
        self.tasks = {task.index: task for task in tasks}
        self.jobs, self.now = jobs, now
        self.waiting = set(self.tasks)
        self.waiting_seconds: dict[Any, float] = defaultdict(float)
        """Forecast seconds of the waiting tasks, by elastomer."""
        for task in tasks:
            self.waiting_seconds[task.elastomer] += task.seconds
        self.running: dict[int, _Running] = {}
        self.measured: dict[Any, float] = defaultdict(float)
        """Seconds that the ended tasks took, by elastomer; None has those of all."""
        self.forecast: dict[Any, float] = defaultdict(float)
        """Forecast seconds of the same tasks."""

    def with_time_left(self, progress: ProgressEvent) -> ProgressEvent:
        """An event, by which the estimate is updated, with the tasks that remain and their time."""
        self.update(progress)
        left = len(self.waiting) + len(self.running)
        return progress._replace(tasks_left=left, seconds_left=self.left())

    def update(self, progress: ProgressEvent) -> None:
        """Update the estimate by one progress event of a task."""
        index, now = progress.task, self.now()
        if progress.event in ("start", "end") and index in self.waiting:
            self.waiting.remove(index)
            self.waiting_seconds[self.tasks[index].elastomer] -= self.tasks[index].seconds
        if progress.event == "start":
            self.running[index] = _Running(now)
        elif progress.event == "step" and index in self.running:
            state = self.running[index]
            if progress.size != state.size:
                state.size, state.grid_started, state.first = progress.size, now, progress.residual
            state.last, state.p_star = progress.residual, progress.p_star
        elif progress.event == "end":
            state = self.running.pop(index, _Running(now))
            if progress.status is not None and progress.status.is_solved:
                for elastomer in (self.tasks[index].elastomer, None):
                    self.measured[elastomer] += now - state.started
                    self.forecast[elastomer] += self.tasks[index].seconds

    def left(self) -> float:
        """Seconds until all tasks have ended."""
        all_left = [self._left_of(index) for index in self.running]
        waiting = sum(
            seconds * self._speed_ratio(elastomer)
            for elastomer, seconds in self.waiting_seconds.items()
        )
        shared = (sum(all_left) + waiting) / self.jobs  # at the end, by rounding, below zero
        return max([0.0, *all_left, shared])

    def _speed_ratio(self, elastomer: Any) -> float:
        """Measured over forecast seconds of the ended tasks of an elastomer, or else of all."""
        ended = elastomer if elastomer in self.forecast else None
        return self.measured[ended] / self.forecast[ended] if self.forecast else 1.0

    def _left_of(self, index: int) -> float:
        """Remaining seconds of a running task."""
        task, state, now = self.tasks[index], self.running[index], self.now()
        spent = now - state.started
        # once a task of the elastomer has ended, the ratio accounts for the pressure
        needs_pressure = task.elastomer not in self.forecast and isfinite(state.p_star)
        forecast = task.seconds_at(state.p_star) if needs_pressure else task.seconds
        forecast *= self._speed_ratio(task.elastomer)
        left = max(forecast - spent, MIN_REMAINING_SHARE * spent)
        if state.size == task.size and isfinite(state.first) and state.last > 0:
            total_decrease = log(max(state.first / task.solver.tolerance, 1.0))
            decrease = log(max(state.first / state.last, 1.0))
            ending = FINAL_PAIRS * SECONDS_PER_PAIR * task.size
            if decrease >= total_decrease:
                return ending
            if decrease > RATE_FROM * total_decrease:
                to_decrease = total_decrease - decrease
                by_residual = ending + (now - state.grid_started) * to_decrease / decrease
                weight = decrease / total_decrease
                return float(by_residual**weight * left ** (1 - weight))
        return left
