"""From grid to grid: one contact on as many grids as its accuracy asks for."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import lru_cache
from math import nan, sqrt
from typing import Any

from gfmd_cli.errors import InputError
from gfmd_cli.physics.bodies import Wave
from gfmd_cli.physics.certificate import Certificate, certify
from gfmd_cli.physics.contact import Contact, Scene, build_scene
from gfmd_cli.physics.continuum import (
    Estimate,
    Level,
    Texture,
    estimate,
    local_exponent,
    texture,
)
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.grid import Grid
from gfmd_cli.physics.observables import QUANTITIES, Observables, observe
from gfmd_cli.physics.ranks import Ranks
from gfmd_cli.physics.surface import FileSurface, SelfAffine, Surface
from gfmd_cli.solvers.cascade import Resume, Solution, solve_contact
from gfmd_cli.study.tasks import FIRST, Task

FINAL = ("bound", "slow", "diverges")  # verdicts that no finer grid changes
NOT_REACHED = "accuracy_not_reached"
UNSOLVED = 0.1  # natural residual from which nothing is said of the continuum
ALGEBRAIC = 2.0
"""Largest errors of u_g and sigma_p on their grid that were met, in natural residuals times the
value x, or its root where that is less than 1: n = 0.5 to 4, slabs, p* = 0.003 to 1."""


@dataclass(frozen=True)
class Rung:
    """What one grid gave, in units that all grids share; what a checkpoint notes of it."""

    points: int
    a_r: float
    sigma_p: float
    """[Pa]."""
    u_g: float
    """[m]."""
    perimeter: float
    work: float
    """Transforms times grid points."""


@dataclass
class Solved:
    """A contact on the last of its grids."""

    scene: Scene
    contact: Contact
    solution: Solution
    seen: Observables
    certificate: Certificate | None
    estimates: dict[str, Estimate]
    """Errors and continuum values by column; empty where no accuracy is asked for."""

    def algebraic(self, name: str) -> float:
        """Estimated error of a column on this grid, from stopping at this residual."""
        assert self.certificate is not None
        if name == "a_r":
            return self.certificate.a_r
        value = float(getattr(self.seen, name))
        return ALGEBRAIC * self.solution.residual * max(value, sqrt(value))

    def columns(self) -> dict[str, Any]:
        """The errors as columns of a study."""
        if self.certificate is None:
            return {}
        row: dict[str, Any] = {
            "u_g_bound": self.certificate.u_g,
            "sigma_p_bound": self.certificate.sigma_p,
        }
        for name, found in self.estimates.items():
            algebraic = self.algebraic(name)
            row |= {
                f"{name}_error": found.error + algebraic,
                f"{name}_continuum": found.continuum,
                f"{name}_continuum_error": found.continuum_error + algebraic,
                f"{name}_verdict": found.verdict,
                f"{name}_algebraic": algebraic,
            }
        return row

    def short_of(self, asked: dict[str, float]) -> list[str]:
        """The columns whose continuum values are not as good as asked."""
        return [
            name
            for name, share in asked.items()
            if not self.estimates[name].continuum_error + self.algebraic(name)
            <= share * abs(self.estimates[name].continuum)
        ]


@lru_cache(maxsize=1)
def scene_of(surface: Any, elastomer: Any, points: int, threads: int, ranks: Ranks | None) -> Scene:
    """The scene of the task before is that of the next, as a rule."""
    return build_scene(surface, elastomer, points, threads, ranks)


def solve_on_grids(
    task: Task,
    threads: int,
    memory: tuple[float, bool],
    load: Callable[[Grid], Resume | None],
    notes: Any,
    note: Callable[[list[dict[str, Any]]], None],
    ranks: Ranks | None = None,
    **watchers: Any,
) -> Solved:
    """Solve a task on its grid, or on finer and finer ones until the errors are as asked.

    Parameters
    ----------
    threads, memory : what may be used; memory [bytes] ends the growth of an "auto" grid, as an
        error where its second part says so
    load, notes : reads the state of an unfinished solve, and what was noted with it
    note : told of the grids done before each solve
    ranks : the processes that share large grids
    watchers : `watch` and `enter_level` of `solve_contact`

    Raises InputError, and what the watchers raise.
    """
    _check_unit(task)
    rungs = [Rung(**rung) for rung in notes or []]
    points = _after(task, rungs[-1].points) if rungs else _first(task)
    before: tuple[Scene, Solution] | None = None
    while True:
        scene = scene_of(task.surface, task.elastomer, points, threads, ranks)
        contact = scene.contact(task.p_star(scene.delta_sigma))
        note([asdict(rung) for rung in rungs])
        resume = load(scene.grid)
        start = _carry(before, scene) if before is not None and resume is None else None
        before = None  # its memory is needed now
        solution = solve_contact(contact, task.solver, resume=resume, start=start, **watchers)
        contact.stress(solution.u, out=solution.sigma)  # what is stored is measured afresh
        solution.residual = contact.residual(solution.u, solution.sigma)
        seen = observe(contact, solution.u, solution.sigma)
        solved = Solved(scene, contact, solution, seen, None, {})
        rungs.append(_rung(solved))
        if task.accuracy is not None:
            solved.certificate = certify(contact, solution.u, solution.sigma)
            solved.estimates = _estimate(task, solved, rungs)
        goes_on = _goes_on(task, solved, memory)
        if not (goes_on if ranks is None else ranks.agree(goes_on)):
            solution.transforms = sum(rung.work for rung in rungs) / scene.grid.size
            if task.auto and solution.status == "converged" and _short(task, solved):
                solution.status = NOT_REACHED
            return solved
        before, points = (scene, solution), _after(task, points)
        load = no_state


def no_state(grid: Grid) -> Resume | None:
    """No state of this grid was saved."""


def _check_unit(task: Task) -> None:
    """The unit of p_star must not change from grid to grid where several are compared."""
    if task.accuracy is None or task.quantity != "p_star" or _is_band_limited(task.surface):
        return
    raise InputError(
        f"load.p_star: Delta_sigma of a {task.surface.kind} depends on the grid; with [accuracy] "
        "give load.pressure"
    )


def _is_band_limited(surface: Surface) -> bool:
    return isinstance(surface, SelfAffine | FileSurface | Wave)


def _first(task: Task) -> int:
    """The coarsest grid that is solved to the end."""
    if task.auto:
        return task.least_points
    half, needed = task.points // 2, task.surface.smallest_grid()
    fit = task.accuracy is not None and half % 2 == 0 and half >= max(needed, FIRST)
    return half if fit else task.points


def _after(task: Task, points: int) -> int:
    return 2 * points if task.auto else task.points


def _goes_on(task: Task, solved: Solved, memory: tuple[float, bool]) -> bool:
    """Whether a finer grid is to be solved after the present one. Raises InputError."""
    points = solved.contact.grid.points
    if not task.auto or task.accuracy is None:
        return points != task.points
    finer = _after(task, points)
    mendable = any(solved.estimates[name].verdict not in FINAL for name in _short(task, solved))
    wanted = mendable and finer <= task.accuracy.max_points
    fits = task.bytes_on(finer) <= memory[0]
    if wanted and not fits and memory[1]:
        raise InputError(
            f"accuracy: needs {finer} points per side, more than memory holds now; with "
            f"--reproducible give accuracy.max_points = {points}"
        )
    return wanted and fits and solved.solution.status == "converged"


def _short(task: Task, solved: Solved) -> list[str]:
    return [] if task.accuracy is None else solved.short_of(task.accuracy.asked())


def _carry(before: tuple[Scene, Solution], scene: Scene) -> Field:
    """The displacement found on a coarser grid, in the units of a finer scene."""
    old, solution = before
    u = old.grid.resample(solution.u, scene.grid)
    u *= old.h_std / scene.h_std
    u += (old.mean_height - scene.mean_height) / scene.h_std
    return u


def _rung(solved: Solved) -> Rung:
    seen, scene = solved.seen, solved.scene
    return Rung(
        points=scene.grid.points,
        a_r=seen.a_r,
        sigma_p=seen.sigma_p * scene.delta_sigma,
        u_g=seen.u_g * scene.h_std,
        perimeter=seen.perimeter,
        work=solved.solution.transforms * scene.grid.size,
    )


def _estimate(task: Task, solved: Solved, rungs: list[Rung]) -> dict[str, Estimate]:
    """Distance of the last rung to the continuum, in the units of its scene."""
    scene = solved.scene
    if not solved.solution.residual < UNSOLVED:
        return dict.fromkeys(QUANTITIES, Estimate(nan, nan, nan, "unknown"))
    levels = [
        Level(
            rung.points,
            rung.a_r,
            rung.sigma_p / scene.delta_sigma,
            rung.u_g / scene.h_std,
            rung.perimeter,
        )
        for rung in rungs
    ]
    points, length = scene.grid.points, scene.grid.length
    exponent = local_exponent(task.elastomer.stiffness, points, length)
    rough: Texture | None = None
    if isinstance(task.surface, SelfAffine | FileSurface):
        rough = texture(scene.shells, length)
    return estimate(levels, exponent, rough)
