"""Projected preconditioned conjugate gradients, for every stiffness k(q) that is not flat.

Polak-Ribiere+ directions on the points that are free, a projected move u -> max(u + s d, h), and
the lowest point on the way there. One of two preconditioners, chosen from the contact pattern:

- the screened Green's function 1 / (k(q) + k(q_c)), two transforms. Contact pins the displacement
  every few patches, so waves longer than that are no softer than k(q_c); with plain 1/k the method
  degrades at n = 2 and fails from n = 3 on;
- the multilevel one of `multilevel`, which sees the contacts themselves and needs no transform.

A step applies K once, to the projected move: the length s is that of the step before, corrected by
what the move was found to be worth. The energy never rises, which rules out cycles: of a move that
would raise it only the part down to the lowest point is gone (all of that way is feasible), and a
move that leads up at once is halved (Bertsekas, SIAM J. Control Optim. 20, 221, 1982: a scaled
gradient projected on the feasible set descends for a short enough step as long as the binding
constraints are kept out of the scaling).
"""

from collections.abc import Iterator
from typing import Literal

import numpy as np

from gfmd_cli.physics import sweeps
from gfmd_cli.physics.choice import Choice
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.fields import Field, Mask
from gfmd_cli.physics.observables import switches
from gfmd_cli.solvers.loop import State
from gfmd_cli.solvers.multilevel import Multilevel

PROPORTION = 0.3  # of rms tension to rms free force; from 0.1 to 1 within 20 % at n = 1 to 4
HALVINGS = 60  # of a move that leads up; beyond, rounding alone decides
WORTH = 0.5  # a projected move is taken whole where the energy falls: its best share is over 1/2
TRUST = (0.6, 1.6)  # how far one clipped move may change the length of the next
SOFTEST = 1e-12  # curvature over descent below which a direction is a shift of the whole body
RESCREEN_AFTER = 4  # steps at least between two looks at the screening length ...
RESCREEN_GROWTH = 1.5  # ... and this factor in the step count
RESCREEN_CHANGE = 1.25  # relative change of q_c below which the old one stays


class ProjectedCG(Choice):
    """Projected preconditioned conjugate gradients."""

    kind: Literal["pcg"] = "pcg"

    def begin(self, contact: Contact, u: Field) -> State:
        """Start from `u`, lifted above the indenter and lowered until it touches."""
        contact.settle(u)
        sigma = contact.stress(u, out=contact.grid.empty())
        fields = {"direction": np.zeros_like(u), "change": np.zeros_like(u)}
        names = ("slope", "length", "screening", "multilevel", "rescreen_at")
        return State(u, sigma, transforms=2, fields=fields, scalars=dict.fromkeys(names, 0.0))

    def iterate(self, contact: Contact, state: State) -> Iterator[State]:
        """Advance `state` in place by conjugate-gradient steps."""
        run = _Run(contact, state)
        while True:
            free, tension = run.score()
            yield state
            run.hold(free, tension)  # [1] which points are held in contact
            run.precondition()  # [2] z from the force on the others
            run.turn()  # [3] the new direction
            run.advance()  # [4] the projected move
            state.step += 1


class _Run:
    """Working space of one solve: rows of u, sigma, ... as the sweeps take them."""

    def __init__(self, contact: Contact, state: State) -> None:
        self.contact, self.state, self.memory = contact, state, state.scalars
        self.grid = grid = contact.grid
        self.rows = grid.rows
        self.h, self.u, self.sigma, self.direction, self.change, self.k, self.padded = map(
            grid.as_rows,
            (
                contact.height,
                state.u,
                state.sigma,
                state.fields["direction"],
                state.fields["change"],
                contact.stiffness,
                grid.padded,
            ),
        )
        self.held = np.empty(self.h.shape, dtype=np.bool_)
        self.multilevel: Multilevel | None = None

    def score(self) -> tuple[float, float]:
        """Set the natural residual; return the squares of free force and tension."""
        state = self.state
        state.residual, free, tension = self.contact.score(state.u, state.sigma)
        return free, tension

    def hold(self, free: float, tension: float) -> None:
        """Choose the points that are held in contact, and from their pattern the preconditioner.

        Points of contact under tension are let go once that tension outweighs the force left on
        the points that are free already (proportioning, Dostal, SIAM J. Optim. 7, 871, 1997): let
        go too early, they are pressed back, and the set of contacts wanders.
        """
        release = tension > PROPORTION**2 * free
        self.rows.sums(1, sweeps.hold, self.h, self.u, self.sigma, release, self.held)
        memory, step = self.memory, self.state.step
        if step < memory["rescreen_at"]:
            return
        memory["rescreen_at"] = max(step + RESCREEN_AFTER, int(RESCREEN_GROWTH * step))
        held = self.held.reshape(self.grid.shape)
        stiffness, chord, exponent = pattern(self.contact, held)
        multilevel = self.grid.dimension == 2 and prefers_multilevel(chord, exponent)
        change = memory["screening"] / stiffness
        if multilevel != bool(memory["multilevel"]) or (
            not multilevel and not 1 / RESCREEN_CHANGE < change < RESCREEN_CHANGE
        ):
            memory |= {"screening": stiffness, "multilevel": float(multilevel)}
            memory |= {"slope": 0.0, "length": 0.0}

    def precondition(self) -> None:
        """Write the preconditioned force to `padded`."""
        if self.memory["multilevel"]:
            self.multilevel = self.multilevel or Multilevel(self.contact, self.rows)
            self.multilevel.apply(self.sigma, self.held, self.padded)
            return
        self.rows(sweeps.free_force, self.sigma, self.held, self.padded)
        self.grid.transform()
        screening = self.memory["screening"]
        self.rows(sweeps.soften, self.padded, self.k, screening, 1.0 / self.grid.size)
        self.grid.transform_back()
        self.state.transforms += 2

    def turn(self) -> None:
        """direction <- z + beta direction, beta of Polak and Ribiere, cut off at zero."""
        memory = self.memory
        slope, turned = self.rows.sums(
            2, sweeps.slopes, self.sigma, self.held, self.change, self.padded
        )
        # the force has changed by -change since the last direction: z (f - f_old) = -z change
        beta = max(0.0, -turned / memory["slope"]) if memory["slope"] > 0 else 0.0
        memory["slope"] = slope
        for factor in (beta, 0.0):
            (descent,) = self.rows.sums(
                1, sweeps.turn, self.padded, self.sigma, self.held, factor, self.direction
            )
            if descent > 0:
                break

    def stiffness(self) -> None:
        """padded <- K padded."""
        self.grid.filter_padded(self.contact.stiffness)
        self.state.transforms += 2

    def advance(self) -> None:
        """Move along the direction, projected on u >= h; never let the energy rise."""
        memory, rows, bodies = self.memory, self.rows, (self.h, self.u)
        if memory["length"] == 0.0:
            memory["length"] = self.exact_length()
        share = 0.0
        for _ in range(HALVINGS):
            length = memory["length"]
            (stopped,) = rows.sums(
                1, sweeps.projected_move, *bodies, self.direction, length, self.padded
            )
            self.stiffness()
            fall, curvature = rows.sums(
                2, sweeps.along_move, *bodies, self.sigma, self.direction, length, self.padded
            )
            if fall > 0:
                best = fall / curvature if curvature > 0 else 1.0  # 1: a rigid shift
                share = self.share_of_move(best, stopped > 0)
                break
            memory["length"] *= 0.5
            memory["slope"] = 0.0
        moved = (self.sigma, self.direction, length, share, self.padded, self.change)
        rows(sweeps.advance, *bodies, *moved)
        self.state.exact = False

    def share_of_move(self, best: float, stopped: bool) -> float:
        """How much of a move to go, where the energy is least at the share `best` of it."""
        memory, length = self.memory, self.memory["length"]
        if not stopped and (best <= 1 or not self.crosses(best * length)):
            memory["length"] = length * best  # the exact step of conjugate gradients
            return best
        if best >= WORTH:
            low, high = TRUST
            memory["length"] = length * min(max(best, low), high)
            return 1.0
        memory |= {"length": length * best, "slope": 0.0}  # start the conjugation anew
        return best

    def crosses(self, length: float) -> bool:
        """Whether a move of this length would be stopped by the indenter."""
        moved = (self.h, self.u, self.direction, length)
        return bool(self.rows.sums(1, sweeps.crossing, *moved)[0] > 0)

    def exact_length(self) -> float:
        """The length that minimises the energy along the direction, were there no indenter."""
        columns = self.h.shape[1]
        self.padded[:, :columns] = self.direction
        self.stiffness()
        curvature = float(np.einsum("ij,ij", self.direction, self.padded[:, :columns]))
        descent = -float(np.einsum("ij,ij", self.direction, self.sigma))
        if curvature > SOFTEST * descent:
            return descent / curvature
        return float(np.ptp(self.h) / np.abs(self.direction).max())  # of a rigid shift, at most


def prefers_multilevel(chord: float, exponent: float) -> bool:
    """Whether the multilevel preconditioner is the faster one; `chord` in grid spacings.

    Measured on the default surface, p* = 0.001 to 1, and a paraboloid, 512^2, CPU seconds: equal
    at n = 1; for n = 2, 3, 4 it wins from chords of about 10, 20, 30 on; 5 times at n = 3, 250.
    """
    return exponent > 0.75 and chord > 8 * (exponent - 1)


def pattern(contact: Contact, held: Mask) -> tuple[float, float, float]:
    """Screening stiffness k(q_c), mean free chord l in grid spacings, local exponent n of k.

    q_c = c pi / l with c = 2^((n - 2)(1 - a_r)). Measured on the default surface of the paper at
    512^2, p* = 0.01, 0.1, 1: the fewest transforms, within some 20 %, were at c = 1/2 for n = 1,
    1 for n = 2, 2 for n = 3, 3 to 4 for n = 4 while a_r is small, 1 for n >= 2 near full contact.
    """
    points = contact.grid.points
    line = contact.stiffness if contact.grid.dimension == 1 else contact.stiffness[0]
    log_k = np.log(line[1:])
    log_m = np.log(np.arange(1, line.size))
    area = np.count_nonzero(held) / held.size
    crossings = switches(held) * points / (held.ndim * held.size)  # of one line across the cell
    chord = 2 * (1 - area) / crossings if crossings > 0 else 1.0  # in units of L
    at = min(float(np.log(0.5 / max(chord, 1e-9))), log_m[-1])
    step = 0.1  # of log q, for the local exponent
    inside = min(max(at, step), log_m[-1] - step)
    n = float(np.diff(np.interp([inside - step, inside + step], log_m, log_k))[0]) / (2 * step)
    at = min(at + float(np.log(2)) * (n - 2) * (1 - area), log_m[-1])
    below = n * min(at, 0.0)  # patches further apart than L / 2: the power law goes on
    return float(np.exp(np.interp(at, log_m, log_k) + below)), chord * points, n
