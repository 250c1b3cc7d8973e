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

from collections.abc import Sequence
from dataclasses import replace
from math import exp, expm1, isfinite, log, log1p, nan
from typing import NamedTuple

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.approach import estimated_pressures, touching_displacement
from gfmd_cli.physics.contact import PRESSURE_RANGE, Scene
from gfmd_cli.physics.error_estimates import with_shift
from gfmd_cli.physics.observables import MAIN_OBSERVABLES
from gfmd_cli.physics.persson import Persson
from gfmd_cli.spec.models import LOADS
from gfmd_cli.status import Status
from gfmd_cli.study.context import SolveContext, Watcher
from gfmd_cli.study.history import Trial
from gfmd_cli.study.measure import measured
from gfmd_cli.study.plausibility import loaded_value
from gfmd_cli.study.pressure_search import MIN_SLOPE, PressureSearch
from gfmd_cli.study.refinement import TaskSolution, has_coarser_grid, solve_on_grids, task_scene
from gfmd_cli.study.tasks import Task

# Choices, which change the number of trials (one to three on a grid) and hardly the result:
COARSER_GRIDS = 2  # each of half the points, on which the search begins
COARSE_RESIDUAL = 1e-3  # natural residual of a solve on them
NEARBY = 0.95  # of a load, at which the theory gives the slope
AREA_RATIO = 0.5
"""Shift of ln p at one contact area from a grid to the next, over that before: the error of the
area is proportional to the spacing. 0.37 to 0.67 on 256^2, 512^2 and 1024^2 (n = 0.5 to 3, areas of
0.01 to 0.3, two seeds), except for one shift that was a 50th of the next."""
NEIGHBOURS = (1.25, 2.0)
"""Limits of the ratio of pressures between the root and two trials, one above and one below, that
give the slopes there; a choice. One of the chords is less steep than the curve, the other steeper.
"""
JUMP = {1: 2, 2: 8}
"""Points that enter contact together on a symmetric surface, by its dimension."""
JUMPS = 6  # by so many jumps the area should change from the root to a neighbour; a choice
LARGEST_ERROR = 1.0  # of a pressure, relative, above which it is unknown; a choice


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
    if not LOADS[task.load_key].searched:
        return solve_on_grids(task, context, watcher)
    solves = _Solves(task, context, watcher)
    grids = _grids(task)
    has_error = task.accuracy is not None and LOADS[task.load_key].searched in MAIN_OBSERVABLES
    measured_on = grids[max(len(grids) - 2, 0)] if has_error else 0
    searches: list[PressureSearch] = []
    slopes = _Slopes()
    for points in grids:
        is_last = points == task.points
        scene = task_scene(task, points, context)
        if reason := _out_of_reach(task, scene):
            if is_last:
                raise InputError(reason)
            continue
        search = PressureSearch(task, scene, *_start(task, scene, searches))
        if not solves.search(search):
            if is_last:
                return solves.latest()
            continue
        if points == measured_on and (search.succeeded or search.is_exhausted):
            slopes = solves.slopes(search)
        searches.append(search)
    solved = solves.latest(search.nearest)
    cost = sum(trial.cost for trial in solves.trials)
    solved.solution.transforms = cost / solved.contact.grid.size
    _check_known(task, solved)
    if has_error:
        _with_errors_at_load(task, solved, slopes if search.succeeded else _Slopes())
    if solved.solution.status.is_accurate and not search.succeeded:
        solved.solution.status = Status.LOAD_NOT_REACHED
    return solved


class _Slopes(NamedTuple):
    """How quantities change with the pressure at the load."""

    chords: Sequence[dict[str, float]] = ()
    """Absolute changes over ln p from the root to its neighbours [1, Pa, m]; empty: not known."""
    uncertain: float = 0.0
    """Part of a slope of a contact area that may be due to the grid."""


class _Solves:
    """The solves of a search: one per trial, stored in the history of the task."""

    def __init__(self, task: Task, context: SolveContext, watcher: Watcher) -> None:
        self.task, self.context, self.watcher = task, context, watcher
        self.trials = watcher.history.trials
        self._latest: TaskSolution | None = None

    def latest(self, trial: Trial | None = None) -> TaskSolution:
        """The latest solution; that of a trial on the last grid, solved again where it is older."""
        if trial is not None and (self._latest is None or self.trials[-1] != trial):
            self._solve(self.task.points, trial.pressure)
        assert self._latest is not None
        return self._latest

    def search(self, search: PressureSearch) -> bool:
        """Make all trials of a search that are not stored; false if the solver diverges."""
        points = search.scene.grid.points
        for trial in self.trials:
            if trial.points == points and not trial.is_neighbour:
                search.add(trial)
        while (pressure := search.next()) is not None:
            if not self._solve(points, pressure):
                return False
            search.add(self.trials[-1])
        return True

    def slopes(self, search: PressureSearch) -> _Slopes:
        """The slopes at the root of a search, by trials at two pressures beside it."""
        scene, root = search.scene, search.nearest
        jump = JUMP[scene.grid.dimension] * search.point_area
        ratio = min(max(NEIGHBOURS[0], 1 + JUMPS * jump / self.task.load), NEIGHBOURS[1])
        made = sum(trial.is_neighbour for trial in self.trials)
        for step in (ratio, 1 / ratio)[made:]:
            pressure = step * root.pressure
            if search.lowest < pressure / scene.delta_sigma < PRESSURE_RANGE[1]:
                self._solve(scene.grid.points, pressure, is_neighbour=True)
        return _Slopes(_chords(root, self.trials), jump / log(ratio))

    def _solve(self, points: int, pressure: float, *, is_neighbour: bool = False) -> bool:
        """Make one trial; false if the solver diverges, whose solution is no trial."""
        self._latest = None  # frees its memory, which is needed now
        solved = solve_on_grids(_at(self.task, points, pressure), self.context, self.watcher)
        self._latest = solved
        if solved.solution.status is Status.DIVERGED:
            return False
        row = measured(self.task, solved)
        value = loaded_value(self.task.load_key, row)
        cost = solved.solution.transforms * solved.contact.grid.size
        units, observables = _units(solved.scene), dict[str, float]()
        if solved.solution.status.is_accurate:
            values = row | {LOADS[self.task.load_key].searched: value}
            observables = {name: float(values[name]) * units[name] for name in MAIN_OBSERVABLES}
        is_touching = row["a_r"] > 0
        self.trials.append(
            Trial(points, pressure, value, cost, observables, is_neighbour, is_touching)
        )
        return True


def _units(scene: Scene) -> dict[str, float]:
    """The units of the quantities of a scene, which may depend on the grid [1, Pa, m]."""
    return {"a_r": 1.0, "sigma_p": scene.delta_sigma, "u_g": scene.h_std}


def _chords(root: Trial, trials: list[Trial]) -> list[dict[str, float]]:
    """See `_Slopes`; empty if a solve has not converged, or a neighbour is out of range."""
    neighbours = [trial for trial in trials if trial.is_neighbour]
    if len(neighbours) < 2 or not all(trial.observables for trial in (root, *neighbours)):
        return []
    return [
        {
            name: abs(value - root.observables[name]) / abs(log(trial.pressure / root.pressure))
            for name, value in trial.observables.items()
        }
        for trial in neighbours
    ]


def _with_errors_at_load(task: Task, solved: TaskSolution, slopes: _Slopes) -> None:
    """Set the error of a pressure that was searched, and those of the other quantities at the load.

    Where more than half of a slope of the searched quantity may be due to the grid, the slope is
    not known.

    The continuum has the load at another pressure than the one that was found. By a power law the
    error of ln p is the logarithm of the value over the value less its error, over the exponent.
    The other quantities change over it, at most in proportion to p.
    """
    name, units = LOADS[task.load_key].searched, _units(solved.scene)
    estimates, estimate = solved.estimates, solved.estimates[name]
    least = min((chord[name] for chord in slopes.chords), default=0.0) / units[name]
    slope = least - slopes.uncertain
    value = estimate.continuum
    distance = estimate.continuum_error + solved.algebraic(name) + abs(value - task.load)
    if slope > slopes.uncertain and distance < value:
        error = -log1p(-distance / value) * value / slope  # of ln p
        if error < log1p(LARGEST_ERROR):
            solved.pressure_error = expm1(error)
    for other in estimates.keys() - {name}:
        steepest = max((chord[other] for chord in slopes.chords), default=nan) / units[other]
        estimates[other] = with_shift(estimates[other], steepest * solved.pressure_error)


def _check_known(task: Task, solved: TaskSolution) -> None:
    """Raise InputError where [accuracy] asks for a continuum value that cannot be given."""
    estimate = solved.estimates.get(LOADS[task.load_key].searched)
    if estimate is None or isfinite(estimate.continuum):
        return
    if solved.scene.has_voids:
        reason = 'no continuum value is known with surface.missing = "void"; '
    elif estimate.is_final:
        reason = f"{LOADS[task.load_key].words} {estimate.verdict.explanation}; "
    else:
        reason = f"the continuum value is not known on a grid with {task.points} points along x; "
        reason += "try a finer grid, or "
    remedy = "leave out [accuracy] for the value on the grid"
    raise InputError(f"load.{task.load_key}: {reason}{remedy}")


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
        accuracy = accuracy if task.load_key == "contact_area" else None  # others hardly change
    return replace(
        task,
        solver=solver,
        load_key="pressure",
        load=pressure,
        points=points,
        points_y=task.points_y_on(points),
        accuracy=accuracy,
    )


def _out_of_reach(task: Task, scene: Scene) -> str:
    """Why no pressure gives the load on a grid; "" if one does."""
    if task.load_key == "contact_area" and task.load * scene.grid.size < 1:
        return (
            f"load.contact_area: {task.load:g} is less than one of the {scene.grid.size} "
            "points of the grid"
        )
    if task.load_key == "mean_gap" and task.load >= scene.highest:
        return (
            f"load.mean_gap = {task.load:g} h_std is not reached: without load the mean gap is "
            f"{scene.highest:g} h_std"
        )
    if task.load_key == "displacement":
        smallest = touching_displacement(scene, task.surface.peak())
        if task.load <= smallest:
            return (
                f"load.displacement = {task.load:g} m is not reached: the highest grid point first "
                f"touches at {smallest:.6g} m, as the highest point of the surface lies between "
                "grid points; use more points, or check that heights and lengths are in m"
            )
    return ""


def _start(task: Task, scene: Scene, searches: list[PressureSearch]) -> tuple[float, float]:
    """The first pressure [Pa] of a search, and the slope of ln(value) over ln(p) there.

    By the searches on coarser grids; without any by Persson theory.
    """
    if searches:
        last = searches[-1]
        return exp(last.result + _shift(task, searches)), last.slope
    p, nearby = _pressures(task, scene, np.array([task.load, NEARBY * task.load])).tolist()
    return p, max(abs(log(NEARBY) / log(nearby / p)), MIN_SLOPE) if nearby != p else 1.0


def _pressures(task: Task, scene: Scene, loads: Field) -> Field:
    """The pressures [Pa] of some loads in Persson theory."""
    if task.load_key == "displacement":
        return estimated_pressures(scene, task.surface.peak(), task.elastomer, loads)
    theory = Persson(scene.shells)
    if task.load_key == "contact_area":
        return theory.pressure_at_area(loads)
    return theory.pressure_at_gap(np.clip(loads * scene.h_std, *theory.gap_range))


def _shift(task: Task, searches: list[PressureSearch]) -> float:
    """Expected shift of ln p from the last of these grids to the next one, at the same load.

    The error of a contact area on the grid is about proportional to the spacing. Continuum values,
    mean gaps and displacements hardly depend on the grid.
    """
    if task.load_key != "contact_area" or task.accuracy is not None or len(searches) < 2:
        return 0.0
    return AREA_RATIO * (searches[-1].result - searches[-2].result)
