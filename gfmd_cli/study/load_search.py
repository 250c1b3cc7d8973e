"""The pressure at which a contact has the contact area, mean gap or displacement asked for.

Contact area and displacement rise and the mean gap falls with the pressure. One root is sought: on
coarser grids first, where a trial costs little, then on the grid itself. The results of the coarser
grids predict the first pressure there. Each trial is a solve of its own. The contact area of a
plate (n = 4) may also fall, as that under a paraboloid does: of several roots the search finds one,
or it ends in a jump where another pressure has the area.

With `[accuracy]` a contact area or mean gap is that in the continuum on the last grid; on a coarser
grid a contact area is, where its continuum value is known. A coarser grid also gives the slope from
which the error of the pressure follows.

The contact area of a grid has steps. Where the requested area lies between two attainable ones, the
search ends with the nearest contact, at a pressure that may depend on rounding errors.
"""

from dataclasses import replace
from math import copysign, exp, expm1, inf, isfinite, log, log1p, nan
from typing import NamedTuple

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.approach import estimated_pressures, touching_displacement
from gfmd_cli.physics.contact import PRESSURE_RANGE, Scene
from gfmd_cli.physics.error_estimates import with_shift
from gfmd_cli.physics.observables import QUANTITIES
from gfmd_cli.physics.persson import Persson
from gfmd_cli.spec.models import LOADS
from gfmd_cli.status import Status
from gfmd_cli.study.context import SolveContext, Watcher
from gfmd_cli.study.measure import measured
from gfmd_cli.study.notes import Trial
from gfmd_cli.study.plausibility import loaded_value
from gfmd_cli.study.refinement import (
    TaskSolution,
    has_coarser_grid,
    solve_on_grids,
    task_scene,
)
from gfmd_cli.study.tasks import Task

# Choices, which change the number of trials (one to three on a grid) and hardly the result:
COARSER_GRIDS = 2  # each of half the points, on which the search begins
COARSE_DISTANCE = 0.02  # relative, to the load or of two pressures, at which a search on them ends
COARSE_RESIDUAL = 1e-3  # natural residual of a solve on them
MAX_STEP = log(8.0)  # of ln p, until the root is enclosed
NEARBY = 0.95  # of a load, at which the theory gives the slope
MIN_SLOPE = 1e-3  # of ln(value) over ln(p), from which a step is made
ROUNDING = 1e-13  # width in ln p of the narrowest enclosure: 450 roundings of p
RESOLVED = 1e-12  # p / k of the stiffest wave [h_std], below which none is tried; a choice
SMOOTH = 0.01  # of the solver's tolerance in ln p: gaps and displacements have no steps
AREA_RATIO = 0.5
"""Shift of ln p at one contact area from a grid to the next, over that before: the error of the
area is proportional to the spacing. 0.37 to 0.67 on 256^2, 512^2 and 1024^2 (n = 0.5 to 3, areas of
0.01 to 0.3, two seeds), except for one shift that was a 50th of the next."""
MAX_TRIALS = 60  # on one grid; 44 halve an interval of MAX_STEP down to ROUNDING
NEIGHBOURS = (1.25, 2.0)
"""Limits of the ratio of pressures between the root and two trials, one above and one below, that
give the slopes there; a choice. One of the chords is less steep than the curve, the other steeper.
"""
JUMP = {1: 2, 2: 8}
"""Points that enter contact together on a symmetric surface, by its dimension."""
JUMPS = 6  # by so many jumps the area should change from the root to a neighbour; a choice
LARGEST_ERROR = 1.0  # of a pressure, relative, above which it is unknown; a choice
ENTERING = 0.05  # points expected to enter contact within the narrowest enclosure; a choice
SOLVED = (Status.CONVERGED, Status.ROUNDING)  # how a solve ends


def solve_at_load(task: Task, context: SolveContext, watcher: Watcher) -> TaskSolution:
    """Solve a task, searching its pressure if that is not given; else as `solve_on_grids`.

    The search returns the nearest contact that it met. It succeeds where that is within
    `task.load_tolerance` of the load. A contact area is a whole number of grid points, several of
    which may enter contact together. Therefore a search of an area also succeeds, with a warning,
    within half a grid point of the load, and where the area jumps there: the areas on either side
    of the load differ by one grid point, or the pressures so little that hardly one point is
    expected to enter contact between them, or by less than the tolerance of the solver, which then
    cannot tell them apart. Otherwise the status is "load_not_reached".

    Where the solver diverges, the search on this grid ends, on the last grid with that solution.

    Raises InputError for a mean gap or displacement that no pressure has, and an area below one
    grid point.
    """
    if not LOADS[task.quantity].searched:
        return solve_on_grids(task, context, watcher)
    trials = watcher.notes.trials

    def attempt(points: int, pressure: float, *, is_neighbour: bool = False) -> TaskSolution:
        solved = solve_on_grids(_at(task, points, pressure), context, watcher)
        if solved.solution.status is Status.DIVERGED:
            return solved
        row = measured(task, solved)
        value = loaded_value(task.quantity, row)
        work = solved.solution.transforms * solved.contact.grid.size
        units, observables = _units(solved.scene), dict[str, float]()
        if solved.solution.status in SOLVED:
            values = row | {LOADS[task.quantity].searched: value}
            observables = {name: float(values[name]) * units[name] for name in QUANTITIES}
        is_touching = row["a_r"] > 0
        trial = Trial(points, pressure, value, work, observables, is_neighbour, is_touching)
        trials.append(trial)
        return solved

    solved: TaskSolution | None = None
    first = slope = 0.0
    roots: list[float] = []
    slopes: list[dict[str, float]] = []
    uncertain = 0.0
    grids = _grids(task)
    has_error = task.accuracy is not None and LOADS[task.quantity].searched in QUANTITIES
    measured_on = grids[max(len(grids) - 2, 0)] if has_error else 0
    for points in grids:
        scene = task_scene(task, points, context)
        if reason := _out_of_reach(task, scene):
            if points == task.points:
                raise InputError(reason)
            continue  # on a coarser grid
        if roots:
            first = exp(roots[-1] + _shift(task, roots))
        else:
            first, slope = _guess(task, scene)
        search = _Search(task, scene, first, slope)
        for trial in trials:
            if trial.points == points and not trial.is_neighbour:
                search.add(trial)
        while (pressure := search.next()) is not None:
            solved = None  # frees its memory, which is needed now
            solved = attempt(points, pressure)
            if solved.solution.status is Status.DIVERGED:
                if points == task.points:
                    return solved
                break
            search.add(trials[-1])
        if pressure is not None:
            continue  # the solver has diverged on a coarser grid
        ended_near = search.succeeded or search.is_exhausted
        if has_error and points == measured_on and ended_near:
            jump = JUMP[scene.grid.dimension] * search.quantum
            ratio = min(max(NEIGHBOURS[0], 1 + JUMPS * jump / task.load), NEIGHBOURS[1])
            ended = sum(trial.is_neighbour for trial in trials)
            for pressure in (step * search.nearest.pressure for step in (ratio, 1 / ratio)[ended:]):
                if search.lowest < pressure / scene.delta_sigma < PRESSURE_RANGE[1]:
                    solved = None
                    attempt(points, pressure, is_neighbour=True)
            slopes = _slopes(search.nearest, trials)
            uncertain = jump / log(ratio)
        roots.append(search.root if search.succeeded else log(search.nearest.pressure))
        slope = search.slope
    if solved is None or trials[-1] != search.nearest:
        solved = None
        solved = attempt(task.points, search.nearest.pressure)
    solved.solution.transforms = sum(trial.work for trial in trials) / solved.contact.grid.size
    _check_known(task, solved)
    if has_error:
        _with_errors_at_load(task, solved, slopes if search.succeeded else [], uncertain)
    if solved.solution.status in SOLVED and not search.succeeded:
        solved.solution.status = Status.LOAD_NOT_REACHED
    return solved


def _units(scene: Scene) -> dict[str, float]:
    """The units of the quantities of a scene, which may depend on the grid [1, Pa, m]."""
    return {"a_r": 1.0, "sigma_p": scene.delta_sigma, "u_g": scene.h_std}


def _slopes(root: Trial, trials: list[Trial]) -> list[dict[str, float]]:
    """Absolute changes of the quantities over ln p from the root to its neighbours [1, Pa, m].

    Empty if a solve has not converged, or a neighbour is out of the range of pressures.
    """
    neighbours = [trial for trial in trials if trial.is_neighbour]
    is_complete = len(neighbours) == 2
    if not (is_complete and all(trial.observables for trial in (root, *neighbours))):
        return []
    return [
        {
            name: abs(value - root.observables[name]) / abs(log(trial.pressure / root.pressure))
            for name, value in trial.observables.items()
        }
        for trial in neighbours
    ]


def _with_errors_at_load(
    task: Task, solved: TaskSolution, slopes: list[dict[str, float]], uncertain: float
) -> None:
    """Set the error of a pressure that was searched, and those of the other quantities at the load.

    `uncertain` is the part of a slope of the searched quantity that may be due to the grid. Where
    it is more than half, the slope is not known.

    The continuum has the load at another pressure than the one that was found. By a power law the
    error of ln p is the logarithm of the value over the value less its error, over the exponent.
    The other quantities change over it, at most in proportion to p.
    """
    name, units = LOADS[task.quantity].searched, _units(solved.scene)
    estimate = solved.estimates[name]
    slope = min((each[name] for each in slopes), default=0.0) / units[name] - uncertain
    value = estimate.continuum
    distance = estimate.continuum_error + solved.algebraic(name) + abs(value - task.load)
    if slope > uncertain and distance < value:
        error = -log1p(-distance / value) * value / slope  # of ln p
        if error < log1p(LARGEST_ERROR):
            solved.pressure_error = expm1(error)
    for other in solved.estimates.keys() - {name}:
        steepest = max((each[other] for each in slopes), default=nan) / units[other]
        estimates = solved.estimates
        estimates[other] = with_shift(estimates[other], steepest * solved.pressure_error)


def _check_known(task: Task, solved: TaskSolution) -> None:
    """Raise InputError where [accuracy] asks for a continuum value that cannot be given."""
    estimate = solved.estimates.get(LOADS[task.quantity].searched)
    if estimate is None or isfinite(estimate.continuum):
        return
    remedy = "leave out [accuracy] for the value on the grid"
    if solved.scene.has_voids:
        raise InputError(
            f"load.{task.quantity}: no continuum value is known with surface.missing = "
            f'"void"; {remedy}'
        )
    if estimate.is_final:
        raise InputError(
            f"load.{task.quantity}: {LOADS[task.quantity].words} {estimate.verdict.explanation}; "
            f"{remedy}"
        )
    raise InputError(
        f"load.{task.quantity}: the continuum value is not known on a grid of {task.points} "
        f"points per side; try a finer grid, or {remedy}"
    )


def _grids(task: Task) -> list[int]:
    """Points along x of the grids to search on, the task's own the last.

    The coarser ones resolve the surface, but may not have the load: see `_out_of_reach`.
    """
    grids = [task.points]
    while len(grids) <= COARSER_GRIDS and has_coarser_grid(task, grids[0]):
        grids.insert(0, grids[0] // 2)
    return grids


def _at(task: Task, points: int, pressure: float) -> Task:
    """The contact of one trial; on a coarser grid only as accurate as the search needs it."""
    solver, accuracy = task.solver, task.accuracy
    if points != task.points:
        tolerance = max(solver.tolerance, COARSE_RESIDUAL)
        solver = solver.model_copy(update={"tolerance": tolerance})
        accuracy = accuracy if task.quantity == "contact_area" else None  # others hardly change
    return replace(
        task,
        solver=solver,
        quantity="pressure",
        load=pressure,
        points=points,
        points_y=task.points_y_on(points),
        accuracy=accuracy,
    )


def _out_of_reach(task: Task, scene: Scene) -> str:
    """Why no pressure gives the load on a grid; "" if one does."""
    if task.quantity == "contact_area" and task.load * scene.grid.size < 1:
        return (
            f"load.contact_area: {task.load:g} is less than one of the {scene.grid.size} "
            "points of the grid"
        )
    if task.quantity == "mean_gap" and task.load >= scene.highest:
        return (
            f"load.mean_gap = {task.load:g} h_std is not reached: without load the mean gap is "
            f"{scene.highest:g} h_std"
        )
    if task.quantity == "displacement":
        smallest = touching_displacement(scene, task.surface.peak())
        if task.load <= smallest:
            return (
                f"load.displacement = {task.load:g} m is not reached: the highest grid point first "
                f"touches at {smallest:.6g} m, as the highest point of the surface lies between "
                "grid points; use more points, or check that heights and lengths are in m"
            )
    return ""


def _guess(task: Task, scene: Scene) -> tuple[float, float]:
    """The pressure [Pa] of Persson theory, and the slope of ln(value) over ln(p) there."""
    p, nearby = _pressures(task, scene, np.array([task.load, NEARBY * task.load])).tolist()
    return p, max(abs(log(NEARBY) / log(nearby / p)), MIN_SLOPE) if nearby != p else 1.0


def _pressures(task: Task, scene: Scene, loads: Field) -> Field:
    """The pressures [Pa] of some loads in Persson theory."""
    if task.quantity == "displacement":
        return estimated_pressures(scene, task.surface.peak(), task.elastomer, loads)
    theory = Persson(scene.shells)
    if task.quantity == "contact_area":
        return theory.pressure_at_area(loads)
    return theory.pressure_at_gap(np.clip(loads * scene.h_std, *theory.gap_range))


def _shift(task: Task, roots: list[float]) -> float:
    """Expected shift of ln p from the last of these grids to the next one, at the same load.

    The error of a contact area on the grid is about proportional to the spacing. Continuum values,
    mean gaps and displacements hardly depend on the grid.
    """
    if task.quantity != "contact_area" or task.accuracy is not None or len(roots) < 2:
        return 0.0
    return AREA_RATIO * (roots[-1] - roots[-2])


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


class _Search:
    """The search on one grid.

    Secant steps from the two nearest trials of different values, held within the enclosure of the
    root; the middle of the enclosure where such a step leaves it or hardly shrinks it. Where
    several trials have the same value, as areas between two jumps have, a step is at least as long
    as the interval of these trials.
    """

    def __init__(self, task: Task, scene: Scene, first: float, slope: float) -> None:
        self.task, self.scene, self._slope = task, scene, slope
        is_area, is_last = task.quantity == "contact_area", scene.grid.points == task.points
        self.sign = -1 if task.quantity == "mean_gap" else 1
        self.quantum = 1 / scene.grid.size if is_area else 0.0
        tolerance = task.load_tolerance if is_last else COARSE_DISTANCE
        self.tolerance = max(tolerance, 0.5 * self.quantum / task.load)  # no area is nearer
        apart = (1.0 if is_area else SMOOTH) * task.solver.tolerance
        apart = max(apart, ENTERING * self.quantum / task.load, ROUNDING)
        self.resolution = apart if is_last else COARSE_DISTANCE
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
        if self.quantum > 0 and trial.value == 0 and not trial.is_touching:
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
        return abs(one.trial.value - other.trial.value) <= 0.5 * self.quantum

    @property
    def root(self) -> float:
        """Estimate of ln p at the load: a secant step from the nearest trial, in the enclosure."""
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
        return within or (self.quantum > 0 and self.is_exhausted)

    @property
    def is_exhausted(self) -> bool:
        """Whether no pressure between comes nearer, or the solver cannot tell them apart."""
        low, high = self._enclosure()
        step = abs(high.trial.value - low.trial.value)
        return high.x - low.x < self.resolution or step < 1.5 * self.quantum

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
        x = self._secant(start, max(plateau, self.resolution))  # its length is about 0 at a jump
        margin = 0.5 * self.resolution
        is_inside = low.x + margin < x < high.x - margin
        if is_enclosed and (not is_inside or len(self.points) % 5 == 4):
            x = 0.5 * (low.x + high.x)
        p = exp(x)
        return p if self.lowest < p / self.scene.delta_sigma < PRESSURE_RANGE[1] else None
