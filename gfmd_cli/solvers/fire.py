"""Green's function molecular dynamics, relaxed by the fast inertial relaxation engine (FIRE).

Zhou, Moseler & Muser, Phys. Rev. B 99, 144103 (2019), in the variant of the program contMech of
Muser's group: Verlet steps u_new = 2 u - u_old + f dt^2 / m with f = -(K u + p), the indenter as a
hard wall, a time step that grows while the kinetic energy does, and a halt once it no longer does.
It has no mixing of force and velocity (contMech's default; FIRE's alpha = 0).

The inertia m is the same for all q, so that the step may be taken in real space, with one
application of K; its q = 0 mode feels -p and, through the wall, the contacts. A fixed point is at
rest and obeys u = max(u - sigma dt^2 / m, h), which are the conditions of contact. A step from rest
is a projected gradient step, too short to raise the energy: no halt is final before that point.
"""

from collections.abc import Iterator
from typing import Annotated, Literal

import numpy as np
from pydantic import Field as Key

from gfmd_cli.physics.choice import Choice
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.fields import Field
from gfmd_cli.solvers.loop import State

GROWTH = 1.2  # of the time step; fireIncrmt of contMech
SHRINKAGE = 0.5  # at a halt; fireDecrmt of contMech
FALLING = 0.999  # kinetic energy that grows by less counts as falling; contMech


class Fire(Choice):
    """GFMD with FIRE."""

    kind: Literal["fire"] = "fire"
    time_step: Annotated[float, Key(gt=0, lt=2)] = 1.9
    """Longest time step in units of (m / k_max)^(1/2). Verlet is stable below 2. contMech's own
    is 0.5, twice its initial one, and needs 2 to 4 times as many steps (256^2, n = 0.5 to 4)."""

    def begin(self, contact: Contact, u: Field) -> State:
        """Start at rest from `u`, lifted above the indenter."""
        np.maximum(u, contact.height, out=u)
        sigma = contact.stress(u, out=contact.grid.empty())
        scalars = {"time_step": 0.5 * self.time_step, "kinetic": 0.0}  # half: as in contMech
        return State(u, sigma, transforms=2, scalars=scalars, fields={"velocity": np.zeros_like(u)})

    def iterate(self, contact: Contact, state: State) -> Iterator[State]:
        """Advance `state` in place by Verlet steps, one pair of transforms each."""
        h, u, sigma, memory = contact.height, state.u, state.sigma, state.scalars
        velocity = state.fields["velocity"]  # (u - u_old) / dt: the time step changes
        grid, k_max = contact.grid, contact.grid.most(float(contact.stiffness.max()))
        trial, stress, move = (grid.empty() for _ in range(3))
        while True:
            state.residual = contact.residual(u, sigma)
            yield state
            dt = memory["time_step"]
            np.multiply(sigma, -dt / k_max, out=move)
            velocity += move  # [1] the kick
            np.multiply(velocity, dt, out=trial)
            trial += u
            np.maximum(trial, h, out=trial)  # [2] the move, with the wall
            velocity[trial == h] = 0.0  # the wall takes the momentum
            contact.stress(trial, out=stress)
            state.transforms += 2
            np.subtract(trial, u, out=move)
            change = np.vdot(move, sigma) + np.vdot(move, stress)  # of energy, x 2 size
            change, kinetic = grid.total(np.array([change, np.vdot(velocity, velocity)]))
            if change <= 0:  # [3] else stay
                u[...] = trial
                sigma[...] = stress
            if change > 0 or FALLING * kinetic < memory["kinetic"]:  # [4] halt
                velocity[...] = 0.0
                memory["time_step"], memory["kinetic"] = SHRINKAGE * dt, 0.0
            else:
                memory["time_step"] = min(GROWTH * dt, self.time_step)
                memory["kinetic"] = float(kinetic)
            state.step += 1
