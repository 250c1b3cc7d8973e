"""Green's function molecular dynamics, relaxed by the fast inertial relaxation engine (FIRE).

Zhou, Moseler & Muser, Phys. Rev. B 99, 144103 (2019), in the variant of the program contMech of
Muser's group, which does not mix force and velocity (contMech's default; FIRE's alpha = 0). A step
of the method, with the numbers beside the code lines:

[1] Accelerate: v += dt f / m with f = -(K u + p).
[2] Move: u -> max(u + dt v, h), with the indenter as a hard wall; the velocity is zero there.
[3] Accept the move if the energy does not rise.
[4] Stop (v = 0) and shorten the time step if the move was not accepted or the kinetic energy falls;
    otherwise lengthen the time step.

The mass m is the same for all q, so that a step is taken in real space, with one application of K.
The q = 0 mode is subject to -p and, through the wall, to the contacts. A fixed point is at rest and
satisfies u = max(u - sigma dt^2 / m, h), which is equivalent to the conditions of contact. A step
from rest is a projected gradient step that is too short to raise the energy. The method therefore
continues after every stop until it reaches the fixed point.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field as Key

from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.contact import Contact
from gfmd_cli.solvers.loop import Solver, State

TIME_STEP_GROWTH = 1.2  # of the time step; fireIncrmt of contMech
TIME_STEP_SHRINKAGE = 0.5  # at a stop; fireDecrmt of contMech
KINETIC_FACTOR = 0.999  # of the kinetic energy when it is compared with the last one; contMech


@dataclass(kw_only=True)
class FireState(State):
    """State of GFMD with FIRE."""

    velocity: Field
    """(u - u_old) / dt, as the time step changes."""
    time_step: float
    """In units of (m / k_max)^(1/2)."""
    kinetic: float = 0.0
    """Sum of the squares of the velocity at the last step; 0 after a stop."""


class Fire(Solver):
    """Green's function molecular dynamics (GFMD), relaxed by FIRE; for comparison."""

    kind: Literal["fire"] = "fire"
    fields_in_memory: ClassVar[float] = 9.2
    relative_time: ClassVar[float] = 8.0  # 3.5 to 25 at n = 0.5, 1 and 3
    time_step: Annotated[float, Key(gt=0, lt=2)] = 1.9
    """Largest time step in units of (m / k_max)^(1/2). The Verlet algorithm is stable below 2. The
    program contMech uses 0.5, which needs 2 to 4 times as many steps (256^2, n = 0.5 to 4)."""

    state_type: ClassVar[type[State]] = FireState

    def begin(self, contact: Contact, u: Field) -> FireState:
        """Start at rest from `u`, lifted above the indenter."""
        np.maximum(u, contact.obstacle, out=u)
        sigma = contact.stress(u, out=contact.grid.empty())
        dt = 0.5 * self.time_step  # half: as in contMech
        return FireState(u=u, sigma=sigma, transforms=2, velocity=np.zeros_like(u), time_step=dt)

    def iterate(self, contact: Contact, state: FireState) -> Iterator[FireState]:
        """Advance `state` in place by Verlet steps, one pair of transforms each."""
        h, u, sigma, velocity = contact.obstacle, state.u, state.sigma, state.velocity
        grid, k_max = contact.grid, contact.largest_stiffness
        trial, stress, move = (grid.empty() for _ in range(3))
        while True:
            state.residual = contact.residual(u, sigma)
            yield state
            dt = state.time_step
            np.multiply(sigma, -dt / k_max, out=move)
            velocity += move  # [1]
            np.multiply(velocity, dt, out=trial)
            trial += u
            np.maximum(trial, h, out=trial)  # [2]
            velocity[trial == h] = 0.0
            contact.stress(trial, out=stress)
            state.transforms += 2
            np.subtract(trial, u, out=move)
            change = np.vdot(move, sigma) + np.vdot(move, stress)  # of energy, x 2 size
            change, kinetic = grid.total(np.array([change, np.vdot(velocity, velocity)]))
            if change <= 0:  # [3]
                u[...] = trial
                sigma[...] = stress
            if change > 0 or KINETIC_FACTOR * kinetic < state.kinetic:  # [4]
                velocity[...] = 0.0
                state.time_step, state.kinetic = TIME_STEP_SHRINKAGE * dt, 0.0
            else:
                state.time_step = min(TIME_STEP_GROWTH * dt, self.time_step)
                state.kinetic = float(kinetic)
            state.step += 1
