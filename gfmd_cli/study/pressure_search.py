"""Searches of a pressure on one grid: which pressure to try next, by the trials made so far."""

from math import copysign, exp, expm1, inf, isfinite, log
from typing import NamedTuple

import numpy as np

from gfmd_cli.physics.contact import PRESSURE_RANGE, Scene
from gfmd_cli.study.history import Trial
from gfmd_cli.study.tasks import Task

# Choices, which change the number of trials (one to three on a grid) and hardly the result:
COARSE_DISTANCE = 0.02  # relative, to the load or of two pressures, at which a search on them ends
MAX_STEP = log(8.0)  # of ln p, until the root is enclosed
ROUNDING = 1e-13  # width in ln p of the narrowest enclosure: 450 roundings of p
RESOLVED = 1e-12  # p / k of the stiffest wave [h_std], below which none is tried; a choice
SMOOTH = 0.01  # of the solver's tolerance in ln p: gaps and displacements have no steps
MAX_TRIALS = 60  # on one grid; 44 halve an interval of MAX_STEP down to ROUNDING
ENTERING = 0.05  # points expected to enter contact within the narrowest enclosure; a choice
MIN_SLOPE = 1e-3  # of ln(value) over ln(p), from which a step is made


def _stiffest(task: Task, scene: Scene) -> float:
    """The larger k of the longest and the shortest wave along an axis [Delta_sigma / h_std]."""
    length = scene.grid.length
    q = np.array([2 * np.pi / length, np.pi / min(scene.grid.spacings)])
    k = float(task.elastomer.stiffness(q, length).max())
    return k * scene.h_std / scene.delta_sigma


class _Point(NamedTuple):
    """One trial as the search sees it."""

    x: float
    """ln p."""
    y: float
    """ln(value / load), with the sign of a pressure that is too high."""
    trial: Trial


UNBOUNDED = tuple(_Point(x, x, Trial(0, 0.0, x, 0.0)) for x in (-inf, inf))  # not enclosed yet


class PressureSearch:
    """The search on one grid.

    Secant steps from the two nearest trials of different values, held within the enclosure of the
    root; the middle of the enclosure where such a step leaves it or hardly shrinks it. Where
    several trials have the same value, as areas between two jumps have, a step is at least as long
    as the interval of these trials.
    """

    def __init__(self, task: Task, scene: Scene, first: float, slope: float) -> None:
        self.task, self.scene, self._slope = task, scene, slope
        is_area, is_last = task.load_key == "contact_area", scene.grid.points == task.points
        self.sign = -1 if task.load_key == "mean_gap" else 1
        self.point_area = 1 / scene.grid.size if is_area else 0.0
        tolerance = task.load_tolerance if is_last else COARSE_DISTANCE
        self.tolerance = max(tolerance, 0.5 * self.point_area / task.load)  # no area is nearer
        apart = (1.0 if is_area else SMOOTH) * task.solver.tolerance
        apart = max(apart, ENTERING * self.point_area / task.load, ROUNDING)
        self.min_interval = apart if is_last else COARSE_DISTANCE
        self.lowest = max(PRESSURE_RANGE[0], RESOLVED * _stiffest(task, scene) if is_area else 0.0)
        """Reduced pressure above which the load is sought."""
        self.first = max(first, self.lowest * scene.delta_sigma)
        self.points: list[_Point] = []
        """Nearest to the root first; on a plateau (full contact) the innermost."""

    def add(self, trial: Trial) -> None:
        """Take a trial into account.

        Where a pressure has no contact, rounding has taken it: the trial is left out, and lower
        pressures are not tried. The continuum value of an area can be 0 although points touch.
        """
        if self.point_area > 0 and trial.value == 0 and not trial.is_touching:
            self.lowest = max(self.lowest, trial.pressure / self.scene.delta_sigma)
            self.first = trial.pressure * exp(MAX_STEP)  # where no trial has had contact yet
            return
        excess = log(trial.value / self.task.load) if trial.value > 0 else -inf
        self.points.append(_Point(log(trial.pressure), self.sign * excess, trial))
        self.points.sort(key=lambda at: (self._deviation(at), at.x if at.y > 0 else -at.x))

    def _deviation(self, point: _Point) -> float:
        """Relative difference of the value and the load."""
        return abs(expm1(self.sign * point.y))

    @property
    def nearest(self) -> Trial:
        """The trial whose value is nearest to the load."""
        return self.points[0].trial

    @property
    def slope(self) -> float:
        """Slope of ln(value) over ln(p), by the nearest trial and the next one of another value."""
        nearest = self.points[0]
        for other in self.points[1:]:
            if isfinite(other.y - nearest.y) and not self._are_same(nearest, other):
                return max((other.y - nearest.y) / (other.x - nearest.x), MIN_SLOPE)
        return self._slope

    def _are_same(self, one: _Point, other: _Point) -> bool:
        """Whether two trials have the same value: for an area, the same number of points."""
        return abs(one.trial.value - other.trial.value) <= 0.5 * self.point_area

    @property
    def result(self) -> float:
        """ln p of the root, a secant step away from the nearest trial; of that without success."""
        if not self.succeeded:
            return log(self.nearest.pressure)
        low, high = self._enclosure()
        return min(max(low.x, self._secant(self.points[0])), high.x)

    def _secant(self, start: _Point, least: float = 0.0) -> float:
        """ln p after a secant step from a trial, at least `least` and at most MAX_STEP long."""
        step = max(abs(start.y) / self.slope, least)
        return start.x - copysign(min(step, MAX_STEP), start.y)

    @property
    def succeeded(self) -> bool:
        """Whether the nearest trial is within the tolerance, or the contact area jumps there."""
        within = self._deviation(self.points[0]) <= self.tolerance
        return within or (self.point_area > 0 and self.is_exhausted)

    @property
    def is_exhausted(self) -> bool:
        """Whether no pressure between comes nearer, or the solver cannot tell them apart."""
        low, high = self._enclosure()
        step = abs(high.trial.value - low.trial.value)
        return high.x - low.x < self.min_interval or step < 1.5 * self.point_area

    def _enclosure(self) -> tuple[_Point, _Point]:
        """The highest pressure known to be too low, and the lowest known to be too high."""
        low = max((point for point in self.points if point.y < 0), default=UNBOUNDED[0])
        high = min((point for point in self.points if point.y > 0), default=UNBOUNDED[1])
        return low, high

    def next(self) -> float | None:
        """The pressure to try next, None where the search has ended."""
        if not self.points:
            return self.first
        if self.succeeded or self.is_exhausted or len(self.points) >= MAX_TRIALS:
            return None
        start, (low, high) = self.points[0], self._enclosure()
        is_enclosed = isfinite(high.x - low.x)
        if not is_enclosed:
            start = low if start.y < 0 else high
        plateau = max(abs(at.x - start.x) for at in self.points if self._are_same(at, start))
        x = self._secant(start, max(plateau, self.min_interval))  # its length is about 0 at a jump
        margin = 0.5 * self.min_interval
        is_inside = low.x + margin < x < high.x - margin
        if is_enclosed and (not is_inside or len(self.points) % 5 == 4):
            x = 0.5 * (low.x + high.x)
        unit = self.scene.delta_sigma
        p = min(exp(x), PRESSURE_RANGE[1] * unit)  # the largest one is tried, too
        is_new = all(p != point.trial.pressure for point in self.points)
        return p if is_new and p > self.lowest * unit else None
