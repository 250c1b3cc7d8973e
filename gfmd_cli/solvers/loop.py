"""State, the solver protocol, and the one loop that drives every solver."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from math import isfinite
from typing import Protocol

from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.fields import Field

MISSES = 5  # one or two happen when sigma has drifted; so many in a row mean that rounding ...
PROGRESS = 0.7  # ... is the limit, where none brings the true residual down by this factor


@dataclass
class State:
    """All that the next step needs. A checkpoint is a state on disk."""

    u: Field
    """Displacement, u >= h."""
    sigma: Field
    """Stress K u + p, up to the rounding of its updates since `exact` was true."""
    exact: bool = True
    """Whether sigma was computed from u, not updated."""
    residual: float = float("inf")
    step: int = 0
    misses: int = 0
    """How often in a row the residual was too large, and hardly less than before, when sigma was
    computed afresh."""
    least: float = float("inf")
    """The least residual found so."""
    transforms: int = 0
    """Transforms on this grid so far."""
    scalars: dict[str, float] = field(default_factory=dict)
    """What else the solver remembers, by name."""
    fields: dict[str, Field] = field(default_factory=dict)
    """Likewise, shape `grid.shape`."""


class Solver(Protocol):
    """A way to solve the contact problem."""

    def begin(self, contact: Contact, u: Field) -> State:
        """The state that starts from displacement `u`, which is taken over."""

    def iterate(self, contact: Contact, state: State) -> Iterator[State]:
        """Yield the state, with its residual, and advance it in place, again and again."""


Watch = Callable[[Contact, State], None]
"""Sees every state: progress, checkpoints and speed-against-error records are watchers."""


def solve(
    contact: Contact,
    solver: Solver,
    state: State,
    *,
    tolerance: float,
    max_steps: int,
    watch: Watch,
) -> str:
    """Drive `solver` until the natural residual is below `tolerance`; say how it ended.

    The residual that ends it is measured on sigma computed afresh from u. Returns "converged",
    "max_steps", "diverged", or "rounding" where the tolerance lies below what double precision
    can tell; the solution stays in `state`.
    """
    for current in solver.iterate(contact, state):
        if current.residual < tolerance and not current.exact:
            refresh(contact, current)
            if current.residual >= tolerance:
                progress = current.residual < PROGRESS * current.least
                current.misses = 0 if progress else current.misses + 1
                current.least = min(current.least, current.residual)
        watch(contact, current)
        if not isfinite(current.residual):
            return "diverged"
        if current.residual < tolerance:
            return "converged"
        if current.misses >= MISSES:
            return "rounding"
        if current.step >= max_steps:
            refresh(contact, current)
            return "max_steps"
    return "converged" if state.residual < tolerance else "rounding"  # of an exact method


def refresh(contact: Contact, state: State) -> None:
    """Compute sigma and the residual from u."""
    contact.stress(state.u, out=state.sigma)
    state.exact = True
    state.transforms += 2
    state.residual = contact.residual(state.u, state.sigma)
