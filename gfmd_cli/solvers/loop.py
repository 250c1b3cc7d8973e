"""The base class of all solvers, their state, and the one loop that drives them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import hypot, inf, isfinite
from typing import Annotated, Any, ClassVar

from pydantic import Field as Key

from gfmd_cli.errors import InputError
from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.linear_elastomer import LinearElastomer
from gfmd_cli.spec_table import SpecTable
from gfmd_cli.status import Status

MAX_MISSES, PROGRESS_FACTOR = 5, 0.7
"""One or two misses occur when sigma has drifted. So many in a row, none of which reduces the true
residual by this factor, mean that rounding is the limit."""
ROUNDING_MARGIN = 3.0  # over the estimate of the rounding; the error was at most 2.5 times it


@dataclass(kw_only=True)
class State:
    """All that the next step needs; a checkpoint stores exactly these attributes.

    A solver that needs more has a subclass with further arrays and numbers (bool, int, float).
    """

    u: Field
    """Displacement, u >= h."""
    sigma: Field
    """Stress K u + p, up to the rounding of its updates since `exact` was true.

    With a free boundary it is the unknown, and what is updated is the gap."""
    exact: bool = True
    """Whether sigma was computed from u, not updated."""
    residual: float = inf
    """Natural residual of u and sigma."""
    step: int = 0
    """Steps on this grid so far."""
    rounding: float = 0.0
    """Estimate of what the rounding of sigma (free boundary: of the gap) adds to the residual; 0 if
    unknown."""
    transforms: float = 0
    """Transforms on this grid so far."""
    coarser_transforms: float = 0.0
    """Transforms before this grid was entered, in units of transforms on the finest grid."""
    misses: int = 0
    """Number of consecutive computations afresh, of sigma from u or of the gap from sigma, whose
    residual missed the tolerance with little progress."""
    best_residual: float = inf
    """Smallest residual measured on a sigma computed afresh."""

    def count_miss(self) -> None:
        """Count a residual that misses the tolerance although it was computed afresh."""
        has_progressed = self.residual < PROGRESS_FACTOR * self.best_residual
        self.misses = 0 if has_progressed else self.misses + 1
        self.best_residual = min(self.best_residual, self.residual)


@dataclass
class Start:
    """What a solver starts from on a grid."""

    contact: Contact
    """The contact on this grid."""
    transforms: float
    """Transforms that it took, in units of transforms on the finest grid of the solve."""
    u: Field
    """Displacement u >= h, and u = h in contact. With a free boundary C sigma."""
    sigma: Field | None = None
    """Stress, if it is known; always with a free boundary."""
    rounding: float = 0.0
    """Estimate of what the rounding of sigma adds to the residual; 0 if unknown."""
    residual: float = inf
    """Natural residual of sigma and of the displacement that was computed from it, where sigma was
    solved for; else infinite."""


class Solver(SpecTable):
    """The keys that all kinds of solvers share."""

    kind: str
    tolerance: Annotated[float, Key(ge=1e-16, lt=1)] = 1e-6
    """Natural residual at which a solution counts as converged."""
    max_steps: Annotated[int, Key(gt=0, lt=2**63)] = 20000
    """Largest number of steps on one grid."""
    nested: bool = True
    """Whether to start from the solution on coarser grids."""

    state_type: ClassVar[type[State]] = State
    """Class of the states of this solver."""
    iterative: ClassVar[bool] = True
    """Whether a start close to the solution saves work."""
    starts_locally: ClassVar[bool] = False
    """Whether a solve on tiles may replace the grids between a coarse one and the finest."""
    fields_in_memory: ClassVar[float] = 6.65
    """Fields of double precision at the peak of a solve: h, u, sigma, work; at half the size
    direction, change, k(q); contact marks, coarse levels. scripts/memory.py measures it."""
    relative_time: ClassVar[float] = 1.0
    """Time of a solve over that of `auto`, for forecasts: the geometric mean at p* = 0.01 to 1 on
    512^2, which scripts/forecast_pairs.py measures."""
    boundary: ClassVar[str] = "periodic"
    """The boundary of the contacts that the solver solves."""
    max_exponent: ClassVar[float] = inf
    """Largest exponent n of k(q) ~ q^n for which the solver is of use."""

    def shared_keys(self) -> dict[str, Any]:
        """The keys that all solvers have, without the kind."""
        return {name: getattr(self, name) for name in ("tolerance", "max_steps", "nested")}

    def fields_for(self, boundary: str, exponent: float | None) -> float:
        """Fields at the peak of a solve with this boundary, for k(q) ~ q^n or any other k(q)."""
        return self.fields_in_memory

    def for_contact(self, contact: Contact) -> "Solver":
        """The solver to use for this contact. Raises InputError for another boundary."""
        self.check_boundary(contact.boundary)
        return self

    def check_boundary(self, boundary: str) -> None:
        """Raise InputError for a boundary that the solver does not support."""
        if boundary != self.boundary:
            raise InputError(
                f'solver.kind: "{self.kind}" solves contacts with grid.boundary = '
                f'"{self.boundary}", not "{boundary}"; "auto" takes a solver that does'
            )

    def check_elastomer(self, elastomer: LinearElastomer) -> None:
        """Raise InputError for an elastomer that the solver does not support."""

    def begin(self, contact: Any, u: Field) -> State:
        """Return the state that starts from displacement `u`, which is overwritten."""
        raise NotImplementedError

    def begin_from(self, start: Start) -> State:
        """Return the state that begins with a start, whose fields are overwritten."""
        return self.begin(start.contact, start.u)

    def continue_from(self, coarse: Contact, state: State, fine: Any) -> State:
        """Return the state that starts from a solution on a coarser grid."""
        return self.begin(fine, coarse.grid.resample(state.u, fine.grid))

    def refresh(self, contact: Any, state: Any) -> None:
        """Compute sigma and the residual from u."""
        state.residual = contact.recompute(state.u, state.sigma)
        state.exact = True
        state.transforms += 2

    def iterate(self, contact: Any, state: Any) -> Iterator[State]:
        """Yield the state, with its residual, and advance it in place, repeatedly."""
        raise NotImplementedError


Watch = Callable[[Contact, State], None]
"""Is called with every state that does not end the solve by its updated sigma: progress,
checkpoints and work-precision records are watchers."""


def ignore(contact: Contact, state: State) -> None:
    """A watcher that does nothing."""


def is_certain(contact: Contact, state: State, tolerance: float) -> bool:
    """Whether the residual of an updated sigma is below a tolerance despite all rounding.

    The residual consists of the minimum of gap and stress, which changes by no more than the one
    that is updated.
    """
    if state.rounding == 0 or state.residual + ROUNDING_MARGIN * state.rounding >= tolerance:
        return False
    rounding = hypot(state.rounding, contact.rounding(state.u))
    return state.residual + ROUNDING_MARGIN * rounding < tolerance


def solve(contact: Contact, solver: Solver, state: State, watch: Watch = ignore) -> Status:
    """Drive `solver` until the natural residual is below its tolerance; return how it ended.

    Where the rounding of sigma is not known to be far below the tolerance, the residual that ends
    the solve is measured on sigma computed afresh from u; sigma is also computed afresh where the
    residual is below its rounding. The solution is in `state`. The status is `ROUNDING` if double
    precision does not allow the tolerance.
    """
    for current in solver.iterate(contact, state):
        if not current.exact and is_certain(contact, current, solver.tolerance):
            return Status.CONVERGED  # not watched: a state that is saved has more steps to do
        if current.residual < max(solver.tolerance, current.rounding) and not current.exact:
            solver.refresh(contact, current)
            if current.residual >= solver.tolerance:
                current.count_miss()
        watch(contact, current)
        if not isfinite(current.residual):
            return Status.DIVERGED
        if current.residual < solver.tolerance:
            return Status.CONVERGED
        if current.misses >= MAX_MISSES:
            return Status.ROUNDING
        if current.step >= solver.max_steps:
            solver.refresh(contact, current)
            return Status.MAX_STEPS
    # an exact method has ended
    return Status.CONVERGED if state.residual < solver.tolerance else Status.ROUNDING
