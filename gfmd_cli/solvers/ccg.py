"""Constrained conjugate gradients in the displacement, without a preconditioner.

Bugnicourt, Sainsot, Dureisseix, Gauthier & Lubrecht, Tribol. Lett. 66, 29 (2018), without their
adhesion: Polak-Ribiere directions on all points but those that are pressed onto the indenter, an
exact step, and a projection onto u >= h after which the conjugation simply goes on. Nothing tames
the range of k(q), from the distance of the contacts to the grid, so the steps grow as N^(n/2): by
1.4, 2.1 and 2.9 from 256^2 to 512^2 at n = 1, 2 and 3 (p* = 0.1, residual 1e-4).
"""

from collections.abc import Iterator
from typing import Literal

import numpy as np

from gfmd_cli.physics.choice import Choice
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.fields import Field, Mask
from gfmd_cli.physics.grid import Grid
from gfmd_cli.solvers.loop import State


class ConstrainedCG(Choice):
    """Constrained conjugate gradients in the displacement."""

    kind: Literal["ccg"] = "ccg"

    def begin(self, contact: Contact, u: Field) -> State:
        """Start from `u`, lifted above the indenter and lowered until it touches."""
        contact.settle(u)
        sigma = contact.stress(u, out=contact.grid.empty())
        fields = {"direction": np.zeros_like(u), "force": np.zeros_like(u)}
        return State(u, sigma, transforms=2, fields=fields, scalars={"descent": 0.0})

    def iterate(self, contact: Contact, state: State) -> Iterator[State]:
        """Advance `state` in place: one pair of transforms a step, two where points touch down."""
        h, u, sigma = contact.height, state.u, state.sigma
        answer, force = contact.grid.empty(), contact.grid.empty()
        while True:
            state.residual = contact.residual(u, sigma)
            yield state
            pressed = self._force(contact, state, force)  # [1] admissible residual
            self._turn(contact.grid, state, force, pressed)  # [2] the new direction
            state.fields["force"], force = force, state.fields["force"]
            direction = state.fields["direction"]
            contact.elasticity(direction, out=answer)
            state.transforms += 2
            length = self._length(contact, state, answer)  # [3] the exact step
            np.multiply(direction, length, out=force)
            u += force
            below = u < h
            if contact.grid.total(np.count_nonzero(below)):
                u[below] = h[below]  # [4] admissible displacement
                contact.stress(u, out=sigma)
                state.transforms += 2
                state.exact = True
            else:
                answer *= length
                sigma += answer
                state.exact = False
            state.step += 1

    def _force(self, contact: Contact, state: State, force: Field) -> Mask:
        """Write -sigma to `force`, zero where the indenter carries it; return these points."""
        pressed: Mask = (state.u == contact.height) & (state.sigma >= 0)
        np.multiply(state.sigma, -1.0, out=force)
        force[pressed] = 0.0
        return pressed

    def _turn(self, grid: Grid, state: State, force: Field, pressed: Mask) -> None:
        """d <- f + beta d, beta = f (f - f_old) / (length d K d), where length d K d = f_old d."""
        direction, descent = state.fields["direction"], state.scalars["descent"]
        beta = 0.0
        if descent > 0:
            change = np.vdot(force, force) - np.vdot(force, state.fields["force"])
            beta = grid.total(float(change)) / descent
        direction *= beta
        direction += force
        direction[pressed] = 0.0
        state.scalars["descent"] = grid.total(float(np.vdot(force, direction)))

    def _length(self, contact: Contact, state: State, answer: Field) -> float:
        """The length that minimises the energy along the direction d; `answer` is K d.

        Along a direction that costs no energy, as when nothing touches, the height of the
        indenter limits it.
        """
        grid, h = contact.grid, contact.height
        direction, descent = state.fields["direction"], state.scalars["descent"]
        curvature = grid.total(float(np.vdot(direction, answer)))
        reach = grid.most(float(h.max())) + grid.most(-float(h.min()))
        reach /= max(grid.most(float(np.abs(direction).max())), 1e-300)
        return descent / curvature if curvature * reach > abs(descent) else reach
