"""From coarse to fine: each grid starts from the solution of the one before."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field as Key
from pydantic import model_validator

from gfmd_cli.physics.choice import Choice
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.fields import Field, Mask, row_blocks
from gfmd_cli.solvers.ccg import ConstrainedCG
from gfmd_cli.solvers.fire import Fire
from gfmd_cli.solvers.loop import State, Watch, solve
from gfmd_cli.solvers.pcg import ProjectedCG
from gfmd_cli.solvers.polonsky import PolonskyKeer
from gfmd_cli.solvers.sort import Sort, is_flat

Method = ProjectedCG | Sort | Fire | ConstrainedCG | PolonskyKeer
METHODS: dict[str, type[Method]] = {
    "pcg": ProjectedCG,
    "sort": Sort,
    "fire": Fire,
    "ccg": ConstrainedCG,
    "polonsky-keer": PolonskyKeer,
}
COARSEST = 64  # points per side; a solve there costs next to nothing
IN_SINGLE = 0.5  # of the tolerance: what is measured in single precision is a little off
SAME = 1000  # roundings of 1: how far indenters of two numbers of processes may differ
COARSE_TOLERANCE = 1e-2  # of the start that a coarse grid gives; measured: tighter does not pay


class SolverChoice(Choice):
    """How to solve, and how well."""

    kind: Literal["auto", "pcg", "sort", "fire", "ccg", "polonsky-keer"] = "auto"
    """"auto" sorts where the stiffness is flat (n = 0) and takes "pcg" elsewhere; "fire" (GFMD),
    "ccg" and "polonsky-keer" (n <= 1.5) are methods of others, for comparison."""
    tolerance: Annotated[float, Key(ge=1e-16, lt=1)] = 1e-6
    """Natural residual to reach."""
    max_steps: Annotated[int, Key(gt=0)] = 20000
    """Steps on one grid after which the solve is given up."""
    nested: bool = True
    """Start from the solution on coarser grids."""
    precision: Literal["double", "single"] = "double"
    """"single" (for "auto" and "pcg"): same numbers, seldom sooner. The residual is measured in
    double precision all the same; where it misses the tolerance, the status is "rounding"."""

    @model_validator(mode="after")
    def _has_it(self) -> Self:
        if self.precision == "single" and self.kind not in ("auto", "pcg"):
            raise ValueError(f'precision = "single": for "auto" and "pcg", not for "{self.kind}"')
        return self

    def method(self, contact: Contact) -> Method:
        """The solver of this contact."""
        kind = self.kind
        if kind == "auto":
            kind = "sort" if is_flat(contact) else "pcg"
        return METHODS[kind]()


@dataclass
class Solution:
    """A solved contact, its score measured afresh."""

    u: Field
    sigma: Field
    residual: float
    status: str
    """"converged", "max_steps", "rounding" or "diverged"."""
    solver: str
    steps: int
    transforms: float
    """Real transforms of the solved size; those of coarser grids count by their share of points."""


def levels(points: int, coarsest: int = COARSEST) -> list[int]:
    """Grids from coarse to fine, each half as fine (rounded up to even) as the next."""
    chain = [points]
    while chain[-1] > coarsest:
        half = (chain[-1] + 1) // 2
        chain.append(half + half % 2)
    return chain[::-1]


@dataclass
class Resume:
    """Where a checkpoint left off."""

    points: int
    state: State
    transforms: float
    """Of the coarser grids, in units of the finest."""
    moved: bool = False
    """Whether it was saved by another number of processes, whose indenter differs by rounding."""


def solve_contact(
    contact: Contact,
    choice: SolverChoice,
    watch: Watch,
    resume: Resume | None = None,
    start: Field | None = None,
    enter_level: Callable[[int, float], None] = lambda points, spent: None,
) -> Solution:
    """Solve one contact by the chosen method, nested over grids.

    Parameters
    ----------
    watch : sees every state of every grid
    resume : continue from here instead of from the coarsest grid
    start : displacement to begin with, on the grid of the contact, instead of coarser grids; taken
        over
    enter_level : told the points of each grid and the transforms spent before it
    """
    method = choice.method(contact)
    exact, tolerance = contact, choice.tolerance
    if choice.precision == "single" and not isinstance(method, Sort):
        contact, tolerance = exact.in_single(), IN_SINGLE * tolerance
    if isinstance(method, Sort):
        chain = [contact.grid.points]
    else:
        full = full_contact(exact, method.kind)
        if full is not None:
            return full
        nested = choice.nested and start is None
        chain = levels(contact.grid.points) if nested else [contact.grid.points]
    spent = 0.0 if isinstance(method, Sort) else 2.0  # the look at full contact
    state: State | None = None
    coarse: Contact | None = None
    if resume is not None:
        chain = chain[chain.index(resume.points) :]
        spent = resume.transforms
    grids = [contact]
    for points in chain[-2::-1]:
        grids.append(grids[-1].coarsen(points))
    while grids:
        fine = grids.pop()
        points = fine.grid.points
        if resume is not None and points == resume.points:
            state = resume.state
            if resume.moved:
                _touch(fine, state)
        else:
            u = _start(fine, coarse, state) if start is None else start.astype(fine.grid.real)
            coarse = state = None  # their memory is needed now
            state = method.begin(fine, u)
        enter_level(points, spent)
        last = fine is contact
        status = solve(
            fine,
            method,
            state,
            tolerance=tolerance if last else max(tolerance, COARSE_TOLERANCE),
            max_steps=choice.max_steps,
            watch=watch,
        )
        spent += state.transforms * fine.grid.size / contact.grid.size
        coarse = fine
    assert state is not None
    found = Solution(state.u, state.sigma, state.residual, status, method.kind, state.step, spent)
    if contact is exact:
        return found
    touching = found.u == contact.height
    found.sigma = exact.height  # of single precision no more
    del state, coarse, fine, contact  # their memory is needed now
    return _in_double(found, touching, exact, choice.tolerance)


def _in_double(found: Solution, touching: Mask, exact: Contact, tolerance: float) -> Solution:
    """A solution in single precision, its stress and its residual measured in double."""
    u, sigma = exact.grid.empty(), exact.grid.empty()
    u[...] = found.u
    np.copyto(u, exact.height, where=touching)
    np.maximum(u, exact.height, out=u)
    exact.stress(u, out=sigma)
    residual, status = exact.residual(u, sigma), found.status
    if residual < tolerance:
        status = "converged"  # where single precision asked for more than it could give, too
    elif status == "converged":
        status = "rounding"
    spent = found.transforms + 2
    return replace(found, u=u, sigma=sigma, residual=residual, status=status, transforms=spent)


def _start(fine: Contact, coarse: Contact | None, state: State | None) -> Field:
    """The coarse solution on the finer grid, or a flat body that touches the highest point."""
    if coarse is None or state is None:
        u = fine.grid.empty()
        u[...] = fine.grid.most(float(fine.height.max()))
        return u
    return coarse.grid.resample(state.u, fine.grid)


def _touch(contact: Contact, state: State) -> None:
    """Lay points of contact on the indenter again, where its last bits have changed.

    Contact is u = h, to the last bit: a point that is off by rounding would be free, pressed on
    the indenter, and stop every move.
    """
    near = SAME * np.finfo(state.u.dtype).eps
    for rows in row_blocks(state.u):
        u, h = state.u[rows], contact.height[rows]
        np.copyto(u, h, where=np.abs(u - h) < near)


def full_contact(contact: Contact, solver: str) -> Solution | None:
    """The solution u = h, where the stress is nowhere tensile; else None. Costs two transforms."""
    grid, h = contact.grid, contact.height
    stress = grid.padded[..., : grid.points]
    stress[...] = h
    grid.filter_padded(contact.stiffness)
    if contact.pressure < grid.most(-float(stress.min())):
        return None
    u, sigma = h.copy(), contact.grid.empty()
    np.add(stress, contact.pressure, out=sigma)
    return Solution(u, sigma, contact.residual(u, sigma), "converged", solver, 0, 2.0)
