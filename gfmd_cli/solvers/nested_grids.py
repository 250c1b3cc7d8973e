"""Solve a contact on grids from coarse to fine; each starts from the solution of the last one."""

from dataclasses import dataclass
from functools import partial
from math import hypot, inf, prod

import numpy as np

from gfmd_cli.grid.arrays import Field, row_blocks
from gfmd_cli.grid.fft_grid import Grid, Shape
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.observables import contact_points, contact_pressure
from gfmd_cli.solvers.direct_start import direct_start
from gfmd_cli.solvers.local_solve import MAX_ROUNDING
from gfmd_cli.solvers.local_start import COARSE_TOLERANCE, start_from, tiles_apply
from gfmd_cli.solvers.loop import Solver, Start, State, Watch, ignore, is_certain, solve
from gfmd_cli.solvers.multigrid import coarsened_axes
from gfmd_cli.status import Status

COARSEST_POINTS = 64  # points per side of a square; a solve on as many points costs next to nothing
MIN_AXIS_POINTS = 8  # with which an axis is not coarsened; a choice: fewer resolve no contact
HEIGHT_ROUNDING = 1000  # units of rounding by which indenters on other numbers of processes differ


@dataclass
class Solution:
    """A solved contact with its residual, both up to rounding that is far below the tolerance."""

    u: Field
    sigma: Field
    residual: float
    status: Status
    solver: str
    steps: int
    transforms: float
    """Real transforms, in units of those of the solved grid."""
    is_direct: bool = False
    """Whether sigma was solved for directly, and u follows from it."""

    def recompute(self, contact: Contact) -> None:
        """Compute sigma and the residual from u. Of a direct solution both are exact already."""
        if not self.is_direct:
            self.residual = contact.recompute(self.u, self.sigma)


@dataclass
class Resume:
    """The state of an unfinished solve, as a checkpoint stored it."""

    shape: Shape
    """Shape of the whole grid of the state."""
    state: State
    moved: bool = False
    """Whether another number of processes saved it, whose indenter differs by rounding."""


def solve_contact(
    contact: Contact, solver: Solver, watch: Watch = ignore, resume: Resume | None = None
) -> Solution:
    """Solve one contact, nested over grids.

    Returns the displacement, stress and residual on the grid of the contact, in reduced units, and
    the status that says how the solve ended. Raises InputError where the solver does not support
    the boundary of the contact.

    Parameters
    ----------
    watch : is called with every state on every grid, and with the last state of the coarse grid at
        every step of a start on tiles and for every set of points of a direct one
    resume : the state of an unfinished solve; without it the solve starts on the coarsest grid.
        A solver that does not iterate needs none
    """
    solver = solver.for_contact(contact)
    if not solver.iterative:
        resume = None
    loose = solver.model_copy(update={"tolerance": max(solver.tolerance, COARSE_TOLERANCE)})
    grids = _grids(contact, solver, resume)
    transforms = 0.0  # of the size of the finest grid
    can_touch_everywhere = contact.is_periodic and contact.may_touch is None
    if solver.iterative and can_touch_everywhere and resume is None:
        full, transforms = _full_contact(grids[::-1], solver)
        if full is not None:
            return full
    coarse: Contact | None = None
    state: State | None = None
    start: Start | None = None
    direct: State | None = None
    while grids:
        fine = grids.pop()
        current = solver if fine is contact else loose
        residual = inf if start is None else start.residual
        if resume is not None:
            state = _resumed(fine, resume, solver.tolerance)
            transforms, resume = state.coarser_transforms, None
        else:
            state = _begin(solver, fine, coarse, state, start)
            coarse = start = None  # frees their memory, which is needed now
            state.coarser_transforms = transforms
        direct = _direct_solution(fine, current, state, residual, watch)
        if direct is None:
            status = solve(fine, current, state, watch)
        else:
            state, is_converged = direct, direct.residual < current.tolerance
            status = Status.CONVERGED if is_converged else Status.ROUNDING
        transforms += state.transforms * fine.grid.size / contact.grid.size
        coarse = fine
        if grids and solver.starts_locally:
            start = _local_start(fine, state, grids[::-1], solver.tolerance, watch)
            if start is not None:
                transforms += start.transforms
                while grids[-1] is not start.contact:
                    grids.pop()
    assert state is not None
    has_laid = direct is not None or state.step > 0
    if contact.is_periodic and status.is_converged and not has_laid:
        state, status = _with_pressed_laid(contact, solver, state, watch)
    transforms = state.coarser_transforms + state.transforms
    fields, work = (state.u, state.sigma, state.residual), (state.step, transforms)
    is_direct = direct is not None or not solver.iterative
    return Solution(*fields, status, solver.kind, *work, is_direct)


def _with_pressed_laid(
    contact: Contact, solver: Solver, state: State, watch: Watch
) -> tuple[State, Status]:
    """A converged state whose pressed points are laid on the indenter, and how its solve ends."""
    rounding = contact.lay_pressed(state.u, state.sigma, state.residual)
    if rounding == 0:
        return state, Status.CONVERGED
    pair, rounding = contact.grid_of_moves.pair_cost, hypot(state.rounding, rounding)
    transforms = state.coarser_transforms + state.transforms + pair
    state = solver.begin_from(Start(contact, pair, state.u, state.sigma, rounding))
    state.coarser_transforms = transforms
    return state, solve(contact, solver, state, watch)


def _local_start(
    coarse: Contact, state: State, finer: list[Contact], tolerance: float, watch: Watch
) -> Start | None:
    """The start on tiles or by direct solves, where one of them applies.

    `watch` is called with the coarse state, from which a solve that is stopped goes on. After this
    function nothing holds the coarse state: its memory is needed on the finest grid.
    """
    pressure = contact_pressure(coarse.obstacle, state.u, state.sigma)
    pause = partial(watch, coarse, state)
    if tiles_apply(finer[-1]):
        return start_from(coarse, pressure, finer, tolerance, pause)
    return direct_start(pressure > 0, finer, pause) if coarse.is_periodic else None


def _direct_solution(
    contact: Contact, solver: Solver, state: State, residual: float, watch: Watch
) -> State | None:
    """The state of a direct solution, or None if an iteration has to follow.

    A state that was solved directly is taken as it is. Otherwise a direct solve is tried where the
    rounding of u keeps an iteration, whose stress is K u + p, from its tolerance. A solution is
    refused where its residual is above both the tolerance and this rounding.

    Parameters
    ----------
    residual : natural residual if the state was solved directly, else infinite
    watch : is called with the state before its first step, from which a stopped solve goes on
    """
    if not (solver.starts_locally and contact.is_periodic) or state.step > 0:
        return None
    rounding = contact.rounding(state.u)
    if residual == inf and rounding >= MAX_ROUNDING * solver.tolerance:
        touching = contact_points(contact.obstacle, state.u, state.sigma)
        if not touching.any():  # by rounding of sigma, which can exceed the pressure
            touching = state.u == contact.obstacle
        start = direct_start(touching, [contact], partial(watch, contact, state))
        if start is not None and start.residual < inf:
            spent, before = state.transforms + start.transforms, state.coarser_transforms
            state, residual = solver.begin_from(start), start.residual
            state.transforms, state.coarser_transforms = spent, before
    if residual >= max(solver.tolerance, rounding):
        return None
    state.residual = residual
    return state


def nested_shapes(shape: Shape, sides: tuple[float, ...]) -> list[Shape]:
    """Shapes of grids from coarse to fine, each with half the points (made even) of the next.

    Pixels that are far from square are first coarsened along their shorter side only.
    """
    chain = [shape]
    while (coarser := _coarser(chain[-1], sides)) != chain[-1]:
        chain.append(coarser)
    return chain[::-1]


def _coarser(shape: Shape, sides: tuple[float, ...]) -> Shape:
    """The next coarser grid, or the same."""
    if prod(shape) <= COARSEST_POINTS ** len(shape):
        return shape
    return tuple(
        2 * ((points + 3) // 4) if is_coarsened and points > MIN_AXIS_POINTS else points
        for points, is_coarsened in zip(shape, coarsened_axes(shape, sides), strict=True)
    )


def solved_shapes(solver: Solver, grid: Grid) -> list[Shape]:
    """Shapes of the grids on which a solver solves, from coarse to fine."""
    nested = solver.iterative and solver.nested
    return nested_shapes(grid.whole_shape, grid.sides) if nested else [grid.whole_shape]


def _grids(contact: Contact, solver: Solver, resume: Resume | None) -> list[Contact]:
    """The contact on all grids that are to be solved, the finest first.

    Where a small contact will be solved on tiles, heights at every other point of a grid predict
    the contact as well as filtered ones (docs/solvers.md), and need no transform.
    """
    chain = solved_shapes(solver, contact.grid)
    if resume is not None:
        chain = chain[chain.index(resume.shape) :]
    contacts = [contact]
    is_sampled = solver.starts_locally and tiles_apply(contact)
    for shape in chain[-2::-1]:
        contacts.append(contacts[-1].coarsen(shape, is_sampled=is_sampled))
    return contacts


def _begin(
    solver: Solver, fine: Contact, coarse: Contact | None, state: State | None, start: Start | None
) -> State:
    """The first state: from a start, a coarser grid, or u flat on the highest point."""
    if start is not None:
        return solver.begin_from(start)
    if coarse is not None and state is not None:
        return solver.continue_from(coarse, state, fine)
    u = fine.grid.empty()
    u[...] = fine.grid.max(float(fine.height.max()))
    return solver.begin(fine, u)


def _resumed(contact: Contact, resume: Resume, tolerance: float) -> State:
    """The stored state; a stress that is claimed to be exact is computed afresh.

    That gives the same bits again, and a forged state cannot end a solve. Nor can a stress that is
    claimed to be updated: no state is saved that would end a solve by such a stress.

    Contact is u = h to the last bit: a point that is off by rounding would be free, pressed on the
    indenter, and stop every move. So where the last bits of the indenter have changed, points of
    contact are laid on it again.
    """
    state = resume.state
    if resume.moved:
        near = HEIGHT_ROUNDING * np.finfo(state.u.dtype).eps
        for rows in row_blocks(state.u):
            u, h = state.u[rows], contact.obstacle[rows]
            np.copyto(u, h, where=np.abs(u - h) < near)
    if state.exact:
        state.residual = contact.recompute(state.u, state.sigma)
    elif is_certain(contact, state, tolerance):
        state.rounding = 0.0  # unknown
    return state


def _full_contact(grids: list[Contact], solver: Solver) -> tuple[Solution | None, float]:
    """The solution u = h on the last grid if no stress is tensile on any, and transforms taken.

    A rough contact that is not full on a coarse grid is not full on a finer one, where the stress
    varies more; elsewhere the iteration finds full contact, too.
    """
    transforms = 0.0
    for contact in grids:
        grid, h = contact.grid, contact.height
        stress = grid.padded[..., : grid.points]
        stress[...] = h
        grid.filter_padded(contact.stiffness)
        transforms += 2 * grid.size / grids[-1].grid.size
        if grid.min(float(stress.min())) < -contact.pressure:
            return None, transforms
    u, sigma = h.copy(), grid.empty()
    np.add(stress, contact.pressure, out=sigma)
    residual = contact.residual(u, sigma)
    return Solution(u, sigma, residual, Status.CONVERGED, solver.kind, 0, transforms), transforms
