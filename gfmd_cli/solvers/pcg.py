"""Projected preconditioned conjugate gradients, for every stiffness k(q) that is not flat.

Polak-Ribiere+ directions on the points that are free, preconditioned by the screened Green's
function 1 / (k(q) + k(q_c)), an exact step, and a projection onto u >= h. Contact pins the
displacement every few patches, so waves longer than that are no softer than k(q_c): with plain
1/k the method degrades at n = 2 and fails from n = 3 on. The energy never rises, which rules
out cycles: of a projected step that would raise it, only the part down to the lowest point is gone
(all of that way is feasible), and a step that only leads up is halved (Bertsekas, SIAM J. Control
Optim. 20, 221, 1982: a scaled gradient projected on the feasible set descends for a short enough
step as long as the binding constraints are kept out of the scaling).
"""

from collections.abc import Iterator
from typing import Literal

import numpy as np

from gfmd_cli.physics.choice import Choice
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.fields import Field, Mask
from gfmd_cli.physics.observables import switches
from gfmd_cli.solvers.loop import State

PROPORTION = 0.3  # of rms tension to rms free force; from 0.1 to 1 within 20 % at n = 1 to 4
HALVINGS = 30  # of a step that only leads up; beyond, rounding alone decides
RESCREEN_AFTER = 4  # steps at least between two looks at the screening length ...
RESCREEN_GROWTH = 1.5  # ... and this factor in the step count
RESCREEN_CHANGE = 1.25  # relative change of q_c below which the old one stays


class ProjectedCG(Choice):
    """Projected preconditioned conjugate gradients."""

    kind: Literal["pcg"] = "pcg"

    def begin(self, contact: Contact, u: Field) -> State:
        """Start from `u`, lifted above the indenter and lowered until it touches."""
        np.maximum(u, contact.height, out=u)
        u -= np.min(u - contact.height)
        np.maximum(u, contact.height, out=u)
        sigma = contact.stress(u, out=contact.grid.empty())
        fields = {"direction": np.zeros_like(u), "force": np.zeros_like(u)}
        scalars = {"slope": 0.0, "screening": 0.0, "rescreen_at": 0.0}
        return State(u, sigma, transforms=2, fields=fields, scalars=scalars)

    def iterate(self, contact: Contact, state: State) -> Iterator[State]:
        """Advance `state` in place by conjugate-gradient steps."""
        grid = contact.grid
        memory = state.scalars
        force, z, trial = grid.empty(), grid.empty(), grid.empty()
        preconditioner = grid.operator(_screened(contact, memory["screening"]))
        while True:
            state.residual = contact.residual(state.u, state.sigma)
            yield state
            touching = self._free(contact, state, force)  # [1] the force on the free points
            if state.step >= memory["rescreen_at"]:
                stiffness = screening_stiffness(contact, touching)
                if not 1 / RESCREEN_CHANGE < memory["screening"] / stiffness < RESCREEN_CHANGE:
                    memory["screening"], memory["slope"] = stiffness, 0.0
                    preconditioner = grid.operator(_screened(contact, stiffness))
                memory["rescreen_at"] = max(
                    state.step + RESCREEN_AFTER, int(RESCREEN_GROWTH * state.step)
                )
            preconditioner(force, out=z)
            z[touching] = 0.0
            self._turn(state, force, z, touching)  # [2] the new direction
            state.fields["force"], force = force, state.fields["force"]
            self._advance(contact, state, z, trial, force)  # [3] the step and its projection
            state.step += 1

    def _free(self, contact: Contact, state: State, force: Field) -> Mask:
        """Write the force on the free points to `force`; return the points held in contact.

        Points of contact under tension are let go once that tension outweighs the force left on
        the points that are free already (proportioning, Dostal, SIAM J. Optim. 7, 871, 1997): let
        go too early, they are pressed back, and the set of contacts wanders.
        """
        touching: Mask = state.u == contact.height
        np.multiply(state.sigma, -1.0, out=force)
        on_contact = force[touching]
        free = float(np.vdot(force, force)) - float(on_contact @ on_contact)
        tension = on_contact[on_contact > 0]
        if float(tension @ tension) > PROPORTION**2 * free:
            touching &= force <= 0
        force[touching] = 0.0
        return touching

    def _turn(self, state: State, force: Field, z: Field, touching: Mask) -> None:
        """Conjugate direction d <- z + beta d, beta of Polak and Ribiere, cut off at zero."""
        direction, memory = state.fields["direction"], state.scalars
        slope = float(np.vdot(z, force))
        beta = 0.0
        if memory["slope"] > 0:
            beta = max(0.0, (slope - float(np.vdot(z, state.fields["force"]))) / memory["slope"])
        direction *= beta
        direction += z
        if beta > 0:
            direction[touching] = 0.0
            if not np.vdot(direction, force) > 0:
                direction[...] = z
        memory["slope"] = slope

    def _advance(
        self, contact: Contact, state: State, other: Field, trial: Field, move: Field
    ) -> None:
        """Minimise the energy along the direction, then project; never let the energy rise.

        `other`, `trial` and `move` are working space.
        """
        h, u, sigma = contact.height, state.u, state.sigma
        direction, force = state.fields["direction"], state.fields["force"]
        answer = contact.elasticity(direction, out=other)
        curvature = float(np.vdot(direction, answer))
        descent = float(np.vdot(direction, force))
        reach = float(np.ptp(h)) / max(float(np.abs(direction).max()), 1e-300)
        length = descent / curvature if curvature * reach > descent else reach
        np.multiply(direction, length, out=trial)
        trial += u
        state.transforms += 4
        if bool(np.all(trial >= h)):
            answer *= length
            sigma += answer
            u[...] = trial
            state.exact = False
            return
        for _ in range(HALVINGS):
            np.maximum(trial, h, out=trial)
            contact.stress(trial, out=other)
            state.transforms += 2
            np.subtract(trial, u, out=move)
            if float(np.vdot(move, sigma) + np.vdot(move, other)) <= 0:  # change of energy, doubled
                u[...] = trial
                sigma[...] = other
                state.exact = True
                return
            state.scalars["slope"] = 0.0  # start the conjugation anew
            other -= sigma
            fall, rise = -float(np.vdot(move, sigma)), float(np.vdot(move, other))
            if fall > 0:  # the move itself leads down: go to the lowest point on it
                move *= fall / rise
                other *= fall / rise
                u += move
                sigma += other
                state.exact = False
                return
            length *= 0.5
            np.multiply(direction, length, out=trial)
            trial += u


def _screened(contact: Contact, screening: float) -> Field:
    """1 / (k(q) + k(q_c)); ones where no screening is chosen yet."""
    if screening == 0.0:
        return np.ones_like(contact.stiffness)
    return 1.0 / (contact.stiffness + screening)


def screening_stiffness(contact: Contact, touching: Mask) -> float:
    """k(q_c) at the wavenumber q_c = c pi / l of the mean free chord l between contacts.

    c = 2^((n - 2)(1 - a_r)), n the local exponent of k at pi / l. Measured on the default surface
    of the paper at 512^2, p* = 0.01, 0.1, 1: the fewest transforms, within some 20 %, were at
    c = 1/2 for n = 1, 1 for n = 2, 2 for n = 3, 3 to 4 for n = 4 while a_r is small, and 1 for all
    n >= 2 near full contact.
    """
    line = contact.stiffness if contact.grid.dimension == 1 else contact.stiffness[0]
    log_k = np.log(line[1:])
    log_m = np.log(np.arange(1, line.size))
    area = np.count_nonzero(touching) / touching.size
    crossings = switches(touching) * contact.grid.points / (touching.ndim * touching.size)  # a line
    chord = 2 * (1 - area) / crossings if crossings > 0 else 1.0  # in units of L
    at = min(float(np.log(0.5 / max(chord, 1e-9))), log_m[-1])
    step = 0.1  # of log q, for the local exponent
    inside = min(max(at, step), log_m[-1] - step)
    n = float(np.diff(np.interp([inside - step, inside + step], log_m, log_k))[0]) / (2 * step)
    at = min(at + float(np.log(2)) * (n - 2) * (1 - area), log_m[-1])
    below = n * min(at, 0.0)  # patches further apart than L / 2: the power law goes on
    return float(np.exp(np.interp(at, log_m, log_k) + below))
