"""Projected preconditioned conjugate gradients in the stress, for a free boundary.

The dual form of the contact (see `free_contact`) minimises <s C s> / 2 - <s h> over stresses s >= 0
with the mean p. Its gradient is the gap g = C s - h, up to the level c of the undeformed surface. A
step of the method, with the numbers beside the code lines:

[1] Set the level such that the mean gap in contact is zero. Choose the points whose stress may
    change: those in contact and, by proportioning (Dostal, SIAM J. Optim. 7, 871, 1997), those
    without stress that penetrate the indenter.
[2] Precondition the gap of these points by the stiffness K, and subtract the mean.
[3] Compute a Polak-Ribiere+ direction d, zero where it would make a stress of zero tensile.
[4] Project the move of length l on the constraints: s -> max(s + l d - shift, 0), where the shift
    restores the mean.
[5] Go to the point of lowest energy on the straight line to the projected point.

A step applies C once, to the projected move; l is that of the step before, corrected by the ratio
of the best move to the projected one, as in `pcg`. All points on the line satisfy the constraints
and the energy never rises. K restricted to the contact is close to the inverse of the restricted C
for n of about 1 and below; at n = 1.5 the method takes two to five times as many steps.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from gfmd_cli.grid.arrays import Field, Mask
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.free_contact import FreeContact
from gfmd_cli.solvers.loop import Solver, Start, State
from gfmd_cli.solvers.projected_move import (
    MAX_HALVINGS,
    choose,
    new_direction,
    polak_ribiere,
    projected,
)

MAX_PENETRATION = 0.3  # of the rms gap on penetrating points to that in contact; as in `pcg`


@dataclass(kw_only=True)
class DualState(State):
    """State of conjugate gradients in the stress `sigma`; `u` is derived from it."""

    gap: Field
    """C sigma - h, up to a constant."""
    direction: Field
    change: Field
    """Change of the gap by the last move."""
    length: float = 0.0
    """Step length of the last move; 0 before the first one."""
    slope: float = 0.0
    """Sum of preconditioned gap times gap; 0 where the conjugation restarts."""


class Dual(Solver):
    """Conjugate gradients in the stress at fixed mean pressure, for a free boundary."""

    kind: Literal["dual"] = "dual"
    fields_in_memory: ClassVar[float] = 22.0

    state_type: ClassVar[type[State]] = DualState
    starts_locally: ClassVar[bool] = True
    boundary: ClassVar[str] = "free"

    def begin(self, contact: Any, u: Field) -> DualState:
        """Start from a uniform stress."""
        return self._begin_with(contact, u, np.ones(contact.grid.shape))

    def continue_from(self, coarse: Contact, state: State, fine: Any) -> DualState:
        """Start from the stress on larger pixels."""
        stress = coarse.grid.average(state.sigma, fine.grid)
        return self._begin_with(fine, fine.grid.empty(), stress)

    def begin_from(self, start: Start) -> DualState:
        """Start from a stress of the mean p and the displacement that it causes."""
        assert start.sigma is not None
        assert isinstance(start.contact, FreeContact)
        state = _new_state(start.contact.grid.empty(), start.sigma, start.u)
        state.gap -= start.contact.height
        self._assess(start.contact, state)
        return state

    def _begin_with(self, contact: FreeContact, u: Field, stress: Field) -> DualState:
        """Start from a stress, where the surface can touch, scaled to the mean p."""
        contact.clear_untouchable(stress)
        stress *= contact.pressure * contact.grid.size / contact.grid.total(stress.sum())
        state = _new_state(u, stress, contact.grid.empty())
        self.refresh(contact, state)
        return state

    def refresh(self, contact: Any, state: Any) -> None:
        """Compute the gap, u and the residual from the stress."""
        contact.compliance.displacement(state.sigma, out=state.gap)
        state.transforms += contact.compliance.transforms
        state.gap -= contact.height
        state.exact = True
        self._assess(contact, state)

    def _assess(self, contact: FreeContact, state: DualState) -> None:
        """Set the level of the gap [1], u and the residual."""
        state.gap -= contact.grid.mean(state.gap[state.sigma > 0])
        state.residual = contact.residual(state.gap + contact.height, state.sigma)
        contact.set_displacement(state.u, state.gap, state.sigma > 0)

    def iterate(self, contact: Any, state: Any) -> Iterator[DualState]:
        """Advance `state` in place by steps of one application of C and one of K."""
        z = contact.grid.empty()
        while True:
            yield state
            chosen = _chosen(contact, state)  # [1]
            force = np.where(chosen, state.gap, 0.0)
            contact.compliance.approximate_stress(force, out=z)  # [2]
            state.transforms += contact.compliance.preconditioner_transforms
            z -= contact.grid.mean(z[chosen])
            z[~chosen] = 0.0
            beta = polak_ribiere(contact.grid.dot(z, state.change), state.slope)
            state.slope = contact.grid.dot(z, force)
            last, stress = beta * state.direction[chosen], state.sigma[chosen]
            direction = new_direction(contact.grid, -z[chosen], last, stress, -force[chosen])
            state.direction[...] = 0.0
            state.direction[chosen] = direction  # [3]
            if self._advance(contact, state, chosen):  # [4], [5]
                self._assess(contact, state)
                state.exact = False
            else:
                self.refresh(contact, state)
                state.count_miss()
            state.step += 1

    def _advance(self, contact: FreeContact, state: DualState, chosen: Mask) -> bool:
        """Move such that the energy falls; false if no length does that, because of rounding."""
        compliance, grid = contact.compliance, contact.grid
        stress, change = state.sigma, state.change
        if state.length == 0:
            compliance.displacement(state.direction, out=change)
            state.transforms += compliance.transforms
            curvature = grid.dot(state.direction, change)
            descent = -grid.dot(state.direction, state.gap)
            state.length = descent / curvature if curvature > 0 else 1.0
        for _ in range(MAX_HALVINGS):
            target = np.where(chosen, stress + state.length * state.direction, 0.0)
            clipped = grid.any(target < 0)
            target[chosen] = projected(grid, target[chosen], contact.pressure * grid.size)  # [4]
            move = target - stress
            fall = -grid.dot(move, state.gap)
            if fall > 0:
                break
            state.length, state.slope = 0.5 * state.length, 0.0
        else:
            change[...] = 0.0
            return False
        compliance.displacement(move, out=change)
        state.transforms += compliance.transforms
        curvature = grid.dot(move, change)
        best = fall / curvature if curvature > 0 else 1.0
        length = best * state.length
        exact = not clipped and (best <= 1 or not grid.any(stress + length * state.direction < 0))
        fraction, factor, restart = choose(best, exact)
        state.length *= factor
        if restart:
            state.slope = 0.0
        if fraction == 1.0:  # [5]
            stress[...] = target
        else:
            np.maximum(stress + fraction * move, 0.0, out=stress)
        change *= fraction
        state.gap += change
        return True


def _new_state(u: Field, stress: Field, gap: Field) -> DualState:
    """A state without a last direction."""
    direction, change = np.zeros_like(stress), np.zeros_like(stress)
    return DualState(u=u, sigma=stress, gap=gap, direction=direction, change=change)


def _chosen(contact: FreeContact, state: DualState) -> Mask:
    """The points whose stress may change."""
    touching: Mask = state.sigma > 0
    penetrating: Mask = contact.clear_untouchable(~touching & (state.gap < 0))
    inside, outside = state.gap[touching], state.gap[penetrating]
    if contact.grid.dot(outside, outside) > MAX_PENETRATION**2 * contact.grid.dot(inside, inside):
        touching |= penetrating
    return touching
