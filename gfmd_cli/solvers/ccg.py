"""Constrained conjugate gradients in the displacement, without a preconditioner.

Bugnicourt, Sainsot, Dureisseix, Gauthier & Lubrecht, Tribol. Lett. 66, 29 (2018), without their
adhesion. A step of the method, with the numbers beside the code lines:

[1] Compute the force on all points but those that are pressed onto the indenter.
[2] Compute the Polak-Ribiere direction.
[3] Compute the step length that minimises the energy.
[4] Project the displacement on u >= h; the conjugation is continued after the projection.

The values of k(q) that matter are those of wavelengths from the distance of the contacts to the
grid spacing. The number of steps therefore grows as N^(n/2): by factors of 1.4, 2.1 and 2.9 from
256^2 to 512^2 at n = 1, 2 and 3 (p* = 0.1, residual 1e-4).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from gfmd_cli.grid.arrays import Field, Mask
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.contact import Contact
from gfmd_cli.solvers.loop import Solver, State


@dataclass(kw_only=True)
class CCGState(State):
    """State of constrained conjugate gradients."""

    direction: Field
    force: Field
    """Admissible force of the last step."""
    descent: float = 0.0
    """Sum of force times direction; 0 where the conjugation restarts."""


class ConstrainedCG(Solver):
    """Constrained conjugate gradients in the displacement."""

    kind: Literal["ccg"] = "ccg"
    fields_in_memory: ClassVar[float] = 10.5
    relative_time: ClassVar[float] = 5.0  # 2 to 27 at n = 0.5, 1 and 3

    state_type: ClassVar[type[State]] = CCGState

    def begin(self, contact: Contact, u: Field) -> CCGState:
        """Start from `u`, lifted above the indenter and lowered until it touches."""
        contact.settle(u)
        sigma = contact.stress(u, out=contact.grid.empty())
        zeros = np.zeros_like(u)
        return CCGState(u=u, sigma=sigma, transforms=2, direction=zeros, force=zeros.copy())

    def iterate(self, contact: Contact, state: CCGState) -> Iterator[CCGState]:
        """Advance `state` in place; a step takes one pair of transforms, two if it is projected."""
        h, u, sigma = contact.obstacle, state.u, state.sigma
        response, force = contact.grid.empty(), contact.grid.empty()
        while True:
            state.residual = contact.residual(u, sigma)
            yield state
            pressed: Mask = (u == h) & (sigma >= 0)
            np.multiply(sigma, -1.0, out=force)
            force[pressed] = 0.0  # [1]
            self._update_direction(contact.grid, state, force, pressed)  # [2]
            state.force, force = force, state.force
            contact.apply_stiffness(state.direction, out=response)
            state.transforms += 2
            length = self._length(contact, state, response)  # [3]
            np.multiply(state.direction, length, out=force)
            u += force
            below = u < h
            if contact.grid.any(below):
                u[below] = h[below]  # [4]
                contact.stress(u, out=sigma)
                state.transforms += 2
                state.exact = True
            else:
                response *= length
                sigma += response
                state.exact = False
            state.step += 1

    def _update_direction(self, grid: Grid, state: CCGState, force: Field, pressed: Mask) -> None:
        """d <- f + beta d, beta = f (f - f_old) / (length d K d), where length d K d = f_old d."""
        direction, beta = state.direction, 0.0
        if state.descent > 0:
            change = np.vdot(force, force) - np.vdot(force, state.force)
            beta = grid.total(float(change)) / state.descent
        direction *= beta
        direction += force
        direction[pressed] = 0.0
        state.descent = grid.dot(force, direction)

    def _length(self, contact: Contact, state: CCGState, response: Field) -> float:
        """Length that minimises the energy along the direction d; `response` is K d.

        Along a direction without elastic energy, which is a rigid shift, the height of the indenter
        limits the length.
        """
        grid = contact.grid
        direction, descent = state.direction, state.descent
        curvature = grid.dot(direction, response)
        reach = contact.height_range
        reach /= max(grid.max(float(np.abs(direction).max())), 1e-300)
        return descent / curvature if curvature * reach > abs(descent) else reach
