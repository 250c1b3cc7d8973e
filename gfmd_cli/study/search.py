"""The pressure at which a contact has the contact area or the mean gap asked for.

Contact area rises and mean gap falls with the pressure, so that one root is sought: on coarser
grids first, where a trial costs little, then on the grid itself. Each trial is a solve of its own.
"""

from collections.abc import Callable
from dataclasses import replace
from math import exp, expm1, inf, log
from typing import Any, NamedTuple

from gfmd_cli.errors import InputError
from gfmd_cli.physics.contact import PRESSURES, Scene
from gfmd_cli.physics.grid import Grid
from gfmd_cli.physics.persson import Persson
from gfmd_cli.physics.ranks import Ranks
from gfmd_cli.solvers.cascade import Resume
from gfmd_cli.study.grids import Solved, no_state, scene_of, solve_on_grids
from gfmd_cli.study.spec import SOUGHT
from gfmd_cli.study.tasks import FIRST, Task

NOT_REACHED = "load_not_reached"
COARSER = 2  # grids, each of half the points, on which the search begins
COARSE = 0.02  # relative distance to the aim that is good enough on them
STEP = log(8.0)  # of ln p at the most, until the root is enclosed
FLATTEST = 1e-3  # slope of ln(value) over ln(p) that a step is made from
SAME = 1e-13  # width in ln p of an enclosure that holds nothing more to be found
TRIALS = 30  # on one grid; three to five are usual


class Trial(NamedTuple):
    """One solve of a search."""

    points: int
    pressure: float
    """[Pa]."""
    value: float
    """What the contact area or mean gap was."""
    work: float
    """Transforms times grid points."""


def solve_task_on_grids(
    task: Task,
    threads: int,
    memory: tuple[float, bool],
    load: Callable[[Grid], Resume | None],
    notes: Any,
    note: Callable[[Any], None],
    ranks: Ranks | None = None,
    **watchers: Any,
) -> Solved:
    """Solve a task, searching its pressure where that is not given; else as `solve_on_grids`.

    The status is "load_not_reached" where no pressure brings the value within `task.within`: the
    share of whole grid points in contact, for one, has steps.

    Raises InputError for a mean gap that no pressure has.
    """
    noted = notes or {}

    def solve(trial: Task, tell: Callable[[Any], None]) -> Solved:
        nonlocal load, noted
        rungs, noted = noted.get("rungs"), {}
        solved = solve_on_grids(trial, threads, memory, load, rungs, tell, ranks, **watchers)
        load = no_state
        return solved

    if task.quantity not in SOUGHT:
        return solve(task, lambda rungs: note({"rungs": rungs}))
    found = [Trial(*trial) for trial in noted.get("found", [])]
    solved, first, slope = None, 0.0, 1.0
    for points in _grids(task):
        scene = scene_of(task.surface, task.elastomer, points, threads, ranks)
        search = _Search(task, scene, first or _guess(task, scene), slope)
        for trial in found:
            if trial.points == points:
                search.take_in(trial)
        while (pressure := search.next()) is not None:
            solved = solve(
                _at(task, points, pressure), lambda rungs: note({"found": found, "rungs": rungs})
            )
            value = float(getattr(solved.seen, SOUGHT[task.quantity]))
            work = solved.solution.transforms * solved.contact.grid.size
            found.append(Trial(points, pressure, value, work))
            search.take_in(found[-1])
        first, slope = search.best, search.slope
    assert solved is not None
    solved.solution.transforms = sum(trial.work for trial in found) / solved.contact.grid.size
    missed = abs(found[-1].value / task.load - 1) > task.within
    if missed and solved.solution.status == "converged":
        solved.solution.status = NOT_REACHED
    return solved


def _grids(task: Task) -> list[int]:
    """Points per side of the grids to search on, the task's own the last."""
    grids, needed = [task.points], max(task.surface.smallest_grid(), FIRST)
    while len(grids) <= COARSER and grids[0] % 4 == 0 and grids[0] // 2 >= needed:
        grids.insert(0, grids[0] // 2)
    return grids


def _at(task: Task, points: int, pressure: float) -> Task:
    """The contact of one trial."""
    accuracy = task.accuracy if points == task.points else None
    return replace(task, quantity="pressure", load=pressure, points=points, accuracy=accuracy)


def _guess(task: Task, scene: Scene) -> float:
    """The pressure [Pa] of Persson theory."""
    if task.quantity == "contact_area":
        return float(Persson(scene.shells).pressure_at_area(task.load))
    highest = scene.grid.most(float(scene.height.max()))
    if task.load >= highest:
        raise InputError(
            f"load.mean_gap: {task.load:g} h_std are never reached: without load it is {highest:g}"
        )
    return float(Persson(scene.shells).pressure_at_gap(task.load * scene.h_std))


class _Search:
    """The search on one grid: the pressures tried, as x = ln p, and how far each was off.

    Secant steps from the two best, held within the enclosure of the root; the middle of it where
    they do not serve.
    """

    def __init__(self, task: Task, scene: Scene, first: float, slope: float) -> None:
        self.task, self.scene, self.first, self._slope = task, scene, first, slope
        self.sign = 1 if task.quantity == "contact_area" else -1
        self.within = task.within if scene.grid.points == task.points else COARSE
        self.known: list[tuple[float, float]] = []
        """Nearest to the root first; on a plateau (full contact) the innermost."""

    def take_in(self, trial: Trial) -> None:
        """Note ln(value / aim) with the sign of a pressure that is too high."""
        excess = log(trial.value / self.task.load) if trial.value > 0 else -inf
        self.known.append((log(trial.pressure), self.sign * excess))
        self.known.sort(key=lambda point: (abs(point[1]), point[0] if point[1] > 0 else -point[0]))

    @property
    def best(self) -> float:
        """The pressure nearest to the root."""
        return exp(self.known[0][0])

    @property
    def slope(self) -> float:
        """Of ln(value) over ln(p), as far as known."""
        if len(self.known) < 2 or abs(self.known[1][1]) == inf:
            return self._slope
        (x, y), (x_2, y_2) = self.known[:2]
        return max((y_2 - y) / (x_2 - x), FLATTEST)

    def next(self) -> float | None:
        """The pressure to try next, None where the search has ended."""
        if not self.known:
            return self.first
        low = max((x for x, y in self.known if y < 0), default=-inf)
        high = min((x for x, y in self.known if y > 0), default=inf)
        x, y = self.known[0]
        tries = len(self.known)
        if abs(expm1(self.sign * y)) <= self.within or tries >= TRIALS or high - low < SAME:
            return None
        x -= max(-STEP, min(y / self.slope, STEP))
        if high - low < inf and (not low < x < high or tries % 5 == 4):
            x = 0.5 * (low + high)
        p = exp(x)
        return p if PRESSURES[0] < p / self.scene.delta_sigma < PRESSURES[1] else None
