"""One contact on one grid, or on finer and finer ones until its errors are as requested."""

import os
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from math import nan, prod
from threading import get_ident
from typing import Any

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.grid.arrays import Field
from gfmd_cli.grid.fft_grid import Shape
from gfmd_cli.grid.plans import are_estimated
from gfmd_cli.grid.ranks import on_root
from gfmd_cli.physics import discretisation_error
from gfmd_cli.physics.contact import Contact, Scene
from gfmd_cli.physics.error_bounds import ErrorBounds, error_bounds, full_contact_errors
from gfmd_cli.physics.error_estimates import NO_ERRORS, Estimate, GridValues, Verdict, unknown
from gfmd_cli.physics.free_contact import SCENES
from gfmd_cli.physics.observables import (
    Observables,
    border_contact,
    contact_points,
    contact_pressure,
    observe,
)
from gfmd_cli.solvers.nested_grids import Solution, solve_contact
from gfmd_cli.status import Status
from gfmd_cli.study.context import SolveContext, Watcher, WorkerOptions
from gfmd_cli.study.forecast import MIN_FIRST_POINTS
from gfmd_cli.study.history import SolvedGrid
from gfmd_cli.study.tasks import Task

MAX_UNKNOWN_GRIDS = 3  # after which an unknown error stays so: two give all that is calibrated
MAX_RESIDUAL = 0.1  # natural residual from which no continuum value is estimated


@dataclass
class TaskSolution:
    """A contact on the last of its grids."""

    scene: Scene
    contact: Contact
    solution: Solution
    observables: Observables
    bounds: ErrorBounds | None = None
    estimates: dict[str, Estimate] = field(default_factory=dict)
    """Errors and continuum values by column; empty unless an accuracy is requested."""
    pressure_error: float = nan
    """Relative error of a pressure that was searched; NaN if unknown, or if it was given."""

    def algebraic(self, name: str) -> float:
        """Estimated error of a column on this grid, from stopping at this residual."""
        assert self.bounds is not None
        return self.bounds.estimated_error(name, self.observables, self.solution.residual)

    def field(self, name: str) -> Field:
        """One of the fields that [output] can store, in m or Pa."""
        u, sigma = self.solution.u, self.solution.sigma
        if name == "u":
            return self.scene.in_metres(u)
        if name == "height":
            return self.scene.in_metres(self.contact.height)
        if name == "contact_pressure":
            sigma = contact_pressure(self.contact.obstacle, u, sigma)
        return sigma * self.scene.delta_sigma


@lru_cache(maxsize=1)
def _scenes(thread: int, estimated: bool, *description: Any) -> dict[Shape, Scene]:
    """The scenes of one surface and elastomer by shape of the grid, see `task_scene`.

    They are kept for one thread only: the transforms of a scene work in one memory.
    """
    return {}


def task_scene(task: Task, points: int, context: SolveContext) -> Scene:
    """The scene of a task on a grid of `points` points along x.

    Consecutive tasks mostly share their scenes. Those of grids with at least four times the points
    are kept: together with a solve they take less memory than a solve on their grid.
    """
    shared = context.options.threads, context.ranks
    here = get_ident(), are_estimated()
    scenes = _scenes(*here, task.boundary, task.surface, task.elastomer, *shared)
    shape = task.points_y_on(points), points
    for other in set(scenes) - {shape}:
        if prod(other) < 4 * prod(shape):
            del scenes[other]
    if shape not in scenes:
        build = SCENES[task.boundary]
        scenes[shape] = build(task.surface, task.elastomer, points, *shared, points_y=shape[0])
    return scenes[shape]


def forget_scenes() -> None:
    """Free the memory of the last scenes."""
    _scenes.cache_clear()


os.register_at_fork(after_in_child=forget_scenes)
"""A process that is forked, as by `multiprocessing`, has none of the threads of their grids."""


def solve_on_grids(task: Task, context: SolveContext, watcher: Watcher) -> TaskSolution:
    """Solve a task on its grid, or on finer and finer grids until the errors are as requested.

    The history of the watcher names the grids that an earlier run solved. Raises InputError,
    and what the watcher raises.
    """
    sizes = _sizes(task)
    grids = watcher.history.grids
    if [grid.points for grid in grids] != sizes[:-1][: len(grids)]:  # the history is of other sizes
        grids = watcher.history.grids = []
    solved: TaskSolution | None = None
    for points in sizes[len(grids) :]:
        solved = None  # frees its memory, which is needed now
        scene = task_scene(task, points, context)
        contact = scene.contact(task.p_star(scene.delta_sigma))
        solved = _solve_on_grid(task, scene, contact, watcher)
        grids.append(_solved_grid(solved))
        if task.accuracy is not None and (task.auto or points == sizes[-1]):
            solution = solved.solution
            solved.bounds = error_bounds(contact, solution.u, solution.sigma)
            solved.estimates = _estimates(task, solved, grids)
        continues = partial(_continues, task, solved, len(grids), context.options)
        if points == sizes[-1] or not on_root(context.ranks, continues):
            break
    assert solved is not None
    watcher.history.grids = []
    solution = solved.solution
    solution.transforms = sum(grid.cost for grid in grids) / scene.grid.size
    if task.auto and solution.status.is_converged and inaccurate_columns(task, solved):
        solution.status = Status.ACCURACY_NOT_REACHED
    return solved


def _solve_on_grid(task: Task, scene: Scene, contact: Contact, watcher: Watcher) -> TaskSolution:
    """Solve a contact; its stress and residual are those of the displacement that is stored.

    The solve does not start from the solution on the grid before: interpolated, that would lead to
    neither tiles nor direct solutions, which make small contacts fast.
    """
    solution = solve_contact(contact, task.solver, watcher, watcher.saved_state(contact))
    solution.recompute(contact)
    if solution.status.is_converged and not solution.residual < task.solver.tolerance:
        solution.status = Status.ROUNDING
    return TaskSolution(scene, contact, solution, observe(contact, solution.u, solution.sigma))


def _sizes(task: Task) -> list[int]:
    """Points along x of the grids that may be solved to the end, from coarse to fine."""
    if task.auto and task.accuracy is not None:
        sizes = [task.least_points]
        while 2 * sizes[-1] <= task.accuracy.max_points:
            sizes.append(2 * sizes[-1])
        return sizes
    if task.accuracy is not None and has_coarser_grid(task, task.points):
        return [task.points // 2, task.points]
    return [task.points]


def has_coarser_grid(task: Task, points: int) -> bool:
    """Whether half of so many points along x, and of those along y, are a grid to solve on.

    The answer is the same for a map that is turned.
    """
    is_line = task.surface.dimension == 1
    numbers = (points,) if is_line else (points, task.points_y_on(points))
    enough = any(n % 4 == 0 and n >= 2 * MIN_FIRST_POINTS for n in numbers)
    least = task.surface.smallest_grid(), task.surface.smallest_grid_y()
    is_resolved = points // 2 >= least[0] and task.points_y_on(points // 2) >= least[1]
    return enough and all(n % 2 == 0 for n in numbers) and is_resolved


def _continues(task: Task, solved: TaskSolution, grids: int, options: WorkerOptions) -> bool:
    """Whether a finer grid follows the `grids` before it, where there is one.

    Raises InputError where a reproducible run lacks memory.
    """
    if not task.auto:
        return True
    if not solved.solution.status.is_converged:
        return False
    points = solved.contact.grid.points
    inaccurate = [solved.estimates[name] for name in inaccurate_columns(task, solved)]
    improvable = any(_is_improvable(each, grids) for each in inaccurate)
    fits = task.bytes_on(2 * points) <= options.memory
    if improvable and not fits and options.reproducible:
        raise InputError(
            f"accuracy: needs {2 * points} points along x, more than memory holds now; with "
            f"--reproducible give accuracy.max_points = {points}"
        )
    return improvable and fits


def _is_improvable(estimate: Estimate, grids: int) -> bool:
    """Whether a grid finer than the `grids` so far may give a smaller error."""
    is_unknown = estimate.verdict is Verdict.UNKNOWN and not estimate.is_too_coarse
    return not (estimate.is_final or (is_unknown and grids >= MAX_UNKNOWN_GRIDS))


def inaccurate_columns(task: Task, solved: TaskSolution) -> list[str]:
    """The columns whose continuum values have larger relative errors than the task requests."""
    if task.accuracy is None:
        return []
    return [
        name
        for name, share in task.accuracy.tolerances().items()
        if not solved.estimates[name].continuum_error + solved.algebraic(name)
        <= share * abs(solved.estimates[name].continuum)
    ]


def _solved_grid(solved: TaskSolution) -> SolvedGrid:
    measured, scene, contact = solved.observables, solved.scene, solved.contact
    return SolvedGrid(
        points=scene.grid.points,
        a_r=measured.a_r,
        sigma_p=measured.sigma_p * scene.delta_sigma,
        u_g=measured.u_g * scene.h_std,
        perimeter=measured.perimeter,
        cost=solved.solution.transforms * scene.grid.size,
        border=None if contact.is_periodic else border_share(contact, solved.solution),
    )


def border_share(contact: Contact, solution: Solution) -> float:
    """Share of the points at the border of the cell that are in contact."""
    touching = contact_points(contact.obstacle, solution.u, solution.sigma)
    return border_contact(contact.grid, touching)


def _estimates(task: Task, solved: TaskSolution, grids: list[SolvedGrid]) -> dict[str, Estimate]:
    """Distance of the finest grid to the continuum, in the units of its scene."""
    scene = solved.scene
    if not solved.solution.residual < MAX_RESIDUAL or scene.has_voids:  # voids have no law
        return unknown()
    effective_points, length = scene.grid.effective_points, scene.grid.length
    if discretisation_error.has_step(task.elastomer, effective_points, length):
        return unknown()
    is_rough = task.surface.rough
    copies = scene.texture.copies if is_rough and task.boundary == "periodic" else 1
    levels = [
        GridValues(
            grid.points * (effective_points / scene.grid.points),
            grid.a_r,
            grid.sigma_p / scene.delta_sigma,
            grid.u_g / scene.h_std,
            grid.perimeter,
            scene.grid.area / (copies * length**scene.grid.dimension),
            grid.border,
        )
        for grid in grids
    ]
    exponent = discretisation_error.local_exponent(task.elastomer, effective_points, length)
    area_exponent = discretisation_error.excess_exponent(task.elastomer, effective_points, length)
    # a grid in full contact shows only a part of these waves
    has_hidden_waves = solved.observables.a_r == 1 and scene.texture.has_nyquist_waves
    return discretisation_error.estimate(
        levels,
        exponent,
        scales_of(scene, task.surface.band_limited) if is_rough else None,
        area_exponent,
        same_waves=task.surface.band_limited and not has_hidden_waves,
        stepped=task.surface.stepped,
        tip=discretisation_error.IndenterTip(task.surface.tip_exponent, scene.grid.dimension),
        full_contact_errors=_full_contact_errors(task, solved),
    )


def _full_contact_errors(task: Task, solved: TaskSolution) -> dict[str, float]:
    """Errors in full contact, of tensile stress between the points of the grid; zero otherwise."""
    scene, sigma = solved.scene, solved.solution.sigma
    variance = scene.shells.variance
    if solved.observables.a_r < 1 or not variance.any():
        return NO_ERRORS
    curvature = float(variance @ scene.shells.q**2 / variance.sum())
    shares = (1 - scene.texture.along_x, scene.texture.along_x)[-scene.grid.dimension :]
    bend = curvature * float(np.square(scene.grid.spacings) @ shares)
    shortest = np.array(np.pi / min(scene.grid.spacings))
    stiffness = task.elastomer.stiffness(shortest, scene.grid.length)
    reduced = float(stiffness) * scene.h_std / scene.delta_sigma
    return full_contact_errors(solved.contact, sigma, bend, reduced, solved.observables.sigma_p)


def scales_of(scene: Scene, band_limited: bool) -> discretisation_error.RoughnessScales:
    """The scales of a rough surface, as `estimate` needs them."""
    grid, texture = scene.grid, scene.texture
    return replace(
        discretisation_error.roughness_scales(scene.shells, grid.length),
        anisotropy=texture.anisotropy,
        band_limited=band_limited,
        aspect=max(grid.spacings) / min(grid.spacings),
        highest=scene.highest,
        plateau=grid.mean(scene.height > scene.highest - discretisation_error.PLATEAU_DEPTH),
        repetitions=texture.repetitions,
    )
