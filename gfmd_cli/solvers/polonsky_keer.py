"""Constrained conjugate gradients in the pressure.

Polonsky & Keer, Wear 231, 206 (1999): minimise the complementary energy <s K^-1 s> / 2 - <s h> over
s >= 0 at the mean pressure p. The gradient is the gap. A step of the method, with the numbers
beside the code lines:

[1] Compute the gap, with a mean of zero over the contact area.
[2] Compute the sum of the squares of the gap in contact, for the conjugation.
[3] Compute the conjugate direction.
[4] Compute the displacement due to the direction.
[5] Compute the step length.
[6] Set negative pressures to zero.
[7] Increase the pressure at points without pressure that penetrate the indenter; restart.
[8] Scale to the mean pressure.

The method is suitable for n of about 1 and below. For larger n, step [7] presses on points without
regard to their neighbours, and each such step restarts the conjugation. Pairs of transforms at
p* = 0.02, 0.1, 1 from a flat displacement to a residual of 1e-4 (256^2, cutoff 0.02): 57, 128, 294
for n = 1; 301, 819, 4415 for n = 1.5; 2107 and 7011 for n = 2 at the lower two pressures. It fails
for n = 3 and 4 (p* = 0.1, residual above 1 after 20000) and for a slab of t = 0.02 L (p* = 0.02 and
0.3, 128^2, above 0.1 after 4000).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, Literal

import numpy as np

from gfmd_cli.grid.arrays import Field, Mask
from gfmd_cli.physics.contact import Contact
from gfmd_cli.solvers.loop import Solver, State


@dataclass(kw_only=True)
class PolonskyKeerState(State):
    """State of conjugate gradients in the pressure; u and sigma are derived from it."""

    pressure: Field
    response: Field
    """Displacement K^-1 pressure, except for its mean."""
    direction: Field
    conjugate: bool = False
    """Whether the next direction is conjugate to the last one."""
    norm: float = 1.0
    """Sum of the squares of the gap in contact at the last step."""


class PolonskyKeer(Solver):
    """Conjugate gradients in the pressure at fixed mean pressure (n <= 1.5); for comparison."""

    kind: Literal["polonsky-keer"] = "polonsky-keer"
    fields_in_memory: ClassVar[float] = 12.5
    relative_time: ClassVar[float] = 13.0  # 4 to 150 at n = 0.5 and 1

    state_type: ClassVar[type[State]] = PolonskyKeerState
    max_exponent: ClassVar[float] = 1.5

    def begin(self, contact: Contact, u: Field) -> PolonskyKeerState:
        """Start from the compressive part of the stress that belongs to `u`."""
        grid = contact.grid
        sigma = contact.stress(u, out=grid.empty())
        pressure = contact.clear_untouchable(np.maximum(sigma, 0.0))
        pressure *= contact.pressure / grid.mean(pressure)
        response = grid.apply(compliance_symbol(contact), pressure, out=grid.empty())
        return PolonskyKeerState(
            u=u,
            sigma=sigma,
            transforms=4,
            pressure=pressure,
            response=response,
            direction=np.zeros_like(u),
        )

    def iterate(self, contact: Contact, state: PolonskyKeerState) -> Iterator[PolonskyKeerState]:
        """Advance `state` in place by steps of one pair of transforms, two after steps [6] or [7].

        The state that is yielded takes one more pair, for sigma = K u + p. This pair is needed for
        the residual, not for the method, and is not counted.
        """
        s, w, t, grid = state.pressure, state.response, state.direction, contact.grid
        compute_displacement = partial(grid.apply, compliance_symbol(contact))
        gap, displacement = grid.empty(), grid.empty()
        while True:
            touching: Mask = s > 0
            np.subtract(w, contact.height, out=gap)
            gap -= grid.mean(gap[touching])  # [1]
            contact.set_displacement(state.u, gap, touching)
            contact.stress(state.u, out=state.sigma)
            state.residual = contact.residual(state.u, state.sigma)
            yield state
            inside = gap[touching]
            norm = grid.dot(inside, inside)  # [2]
            t *= state.conjugate * norm / state.norm
            t += gap
            t[~touching] = 0.0  # [3]
            state.norm = max(norm, 1e-300)
            compute_displacement(t, out=displacement)
            displacement -= grid.mean(displacement[touching])  # [4]
            curvature = grid.dot(displacement, t)
            descent = grid.dot(gap, t)
            length = descent / curvature if curvature > 0 else 0.0  # [5]
            s -= length * t
            cut = grid.any(s < 0)
            np.maximum(s, 0.0, out=s)  # [6]
            penetrating = contact.clear_untouchable((s == 0) & (gap < 0))
            s[penetrating] -= length * gap[penetrating]  # [7]
            state.conjugate = not grid.any(penetrating)
            scale = contact.pressure / grid.mean(s)
            s *= scale  # [8]
            state.transforms += 2
            if cut or not state.conjugate:
                compute_displacement(s, out=w)
                state.transforms += 2
            else:  # w is linear in s; its mean has no influence
                displacement *= length
                w -= displacement
                w *= scale
            state.step += 1


def compliance_symbol(contact: Contact) -> Field:
    """1 / k(q), zero at q = 0."""
    k = contact.stiffness
    return np.divide(1.0, k, out=np.zeros_like(k), where=k > 0)
