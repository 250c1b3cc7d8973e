"""Projected preconditioned conjugate gradients, for every stiffness k(q) that is not flat.

Polak-Ribiere+ directions on the points that are free, a projected move u -> max(u + s d, h), and
the lowest point on the way there. One of three preconditioners:

- the screened Green's function 1 / (k(q) + k(q_c)), two transforms in single precision, which is
  enough and costs half. Contact pins the displacement every few patches, so waves longer than that
  are no softer than k(q_c); with plain 1/k the method degrades at n = 2 and fails from n = 3 on;
- the V-cycle of `multigrid`, which sees the contacts themselves and needs no transform;
- the sum over levels of `multilevel`, which does so too, for stiffnesses that grow in leaps.

A step applies K once, to the projected move: the length s is that of the step before, corrected by
what the move was found to be worth. The energy never rises, which rules out cycles: of a move that
would raise it only the part down to the lowest point is gone (all of that way is feasible), and a
move that leads up at once is halved (Bertsekas, SIAM J. Control Optim. 20, 221, 1982: a scaled
gradient projected on the feasible set descends for a short enough step as long as the binding
constraints are kept out of the scaling).
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Literal

import numpy as np

from gfmd_cli.physics import sweeps
from gfmd_cli.physics.choice import Choice
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.grid import Grid
from gfmd_cli.solvers.loop import State
from gfmd_cli.solvers.multigrid import Multigrid, suits
from gfmd_cli.solvers.multilevel import Multilevel

PROPORTION = 0.3  # of rms tension to rms free force; from 0.1 to 1 within 20 % at n = 1 to 4
HALVINGS = 60  # of a move that leads up; beyond, rounding alone decides
WORTH = 0.5  # a projected move is taken whole where the energy falls: its best share is over 1/2
TRUST = (0.6, 1.6)  # how far one clipped move may change the length of the next
SOFTEST = 1e-12  # curvature over descent below which a direction is a shift of the whole body
SINGLE_PAIR = 1  # transforms that a pair in single precision counts for: it takes half the time
STEEP = 0.9  # local exponent of k(q) from which the V-cycle pays
RESCREEN_AFTER = 4  # steps at least between two looks at the screening length ...
RESCREEN_GROWTH = 1.5  # ... and this factor in the step count
RESCREEN_CHANGE = 1.25  # relative change of q_c below which the old one stays
MEMORY = ("slope", "beta", "length", "screening", "multilevel", "rescreen_at", "free", "tension")


class ProjectedCG(Choice):
    """Projected preconditioned conjugate gradients."""

    kind: Literal["pcg"] = "pcg"

    def begin(self, contact: Contact, u: Field) -> State:
        """Start from `u`, lifted above the indenter and lowered until it touches."""
        contact.settle(u)
        sigma = contact.stress(u, out=contact.grid.empty())
        # single precision: they only choose where to go next; what was gone is known exactly
        fields = {name: np.zeros(u.shape, dtype=np.float32) for name in ("direction", "change")}
        return State(u, sigma, transforms=2, fields=fields, scalars=dict.fromkeys(MEMORY, 0.0))

    def iterate(self, contact: Contact, state: State) -> Iterator[State]:
        """Advance `state` in place by conjugate-gradient steps."""
        run = _Run(contact, state)
        while True:
            yield state
            if state.exact:
                run.judge(run.mark())
            run.screen()  # [1] which points are held, and how to precondition the others
            run.precondition()  # [2] z from the force on the free points
            run.advance()  # [3] a new direction, and the projected move along it
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
        self.framed_marks = self.rows.empty(self.h.shape[1], dtype=np.int8)
        self.marks = self.rows.inside(self.framed_marks)
        self.least = sweeps.PRESSED
        self.screened = replace(grid, precision="single")
        self.z = self.padded
        self.multilevel: Multigrid | Multilevel | None = None
        self.even = self.grid.dimension == 2 and suits(contact)
        sums = self.mark()
        if state.residual == np.inf:  # else it comes from a checkpoint, judged already
            self.judge(sums)

    def mark(self) -> Field:
        """Mark the points; what there is to judge the state by."""
        return self.rows.sums(3, sweeps.mark, self.h, self.u, self.sigma, self.marks)

    def judge(self, sums: Field) -> None:
        """Note the squares of the violation, of the force on free points and of the tension."""
        violation, free, tension = map(float, sums)
        self.state.residual = self.contact.as_residual(violation)
        self.memory |= {"free": free, "tension": tension}

    def screen(self) -> None:
        """Choose the points that are held in contact, and from their pattern the preconditioner.

        Points of contact under tension are let go once that tension outweighs the force left on
        the points that are free already (proportioning, Dostal, SIAM J. Optim. 7, 871, 1997): let
        go too early, they are pressed back, and the set of contacts wanders.
        """
        memory, step = self.memory, self.state.step
        release = memory["tension"] > PROPORTION**2 * memory["free"]
        self.least = sweeps.PRESSED if release else sweeps.TENSE
        if step < memory["rescreen_at"]:
            return
        memory["rescreen_at"] = max(step + RESCREEN_AFTER, int(RESCREEN_GROWTH * step))
        self.rows.meet(self.framed_marks)
        held, changes = self.rows.framed_sums(2, sweeps.pattern, self.framed_marks, self.least)
        stiffness, chord, exponent = screening(self.contact, float(held), float(changes))
        multilevel = prefers_levels(self.grid, self.even, chord, exponent)
        change = memory["screening"] / stiffness
        if multilevel != bool(memory["multilevel"]) or (
            not multilevel and not 1 / RESCREEN_CHANGE < change < RESCREEN_CHANGE
        ):
            memory |= {"screening": stiffness, "multilevel": float(multilevel)}
            memory |= {"slope": 0.0, "length": 0.0}

    def precondition(self) -> None:
        """Write the preconditioned force z to `z`; set the slope and the conjugation beta."""
        memory, bodies = self.memory, (self.sigma, self.marks, self.least)
        if memory["multilevel"]:
            self.z = self.padded
            if self.multilevel is None:
                kind = Multigrid if self.even else Multilevel
                self.multilevel = kind(self.contact, self.rows)
            bodies = (self.sigma, self.framed_marks, self.least)
            slope, turned = self.multilevel.apply(*bodies, self.change, self.padded)
        else:
            self.z = self.grid.as_rows(self.screened.padded)
            self.rows(sweeps.free_force, *bodies, self.z)
            self.screened.transform()
            modes = self.grid.as_rows(self.screened.spectrum)
            screened = (memory["screening"], 1.0 / self.grid.size)
            self.screened.spectral_rows(sweeps.soften, modes, self.k, *screened)
            self.screened.transform_back()
            self.state.transforms += SINGLE_PAIR
            slope, turned = self.rows.sums(2, sweeps.slopes, *bodies, self.change, self.z)
        # Polak and Ribiere, cut off at zero. The force has changed by -change since the last
        # direction: z (f - f_old) = -z change
        beta = max(0.0, -turned / memory["slope"]) if memory["slope"] > 0 else 0.0
        memory |= {"slope": float(slope), "beta": float(beta)}

    def stiffness(self) -> float:
        """padded <- K padded; the sum of their products."""
        self.state.transforms += 2
        return self.grid.filter_padded(self.contact.stiffness)

    def advance(self) -> None:
        """Turn, and move along the direction, projected on u >= h; never let the energy rise."""
        memory, rows, bodies = self.memory, self.rows, (self.h, self.u, self.sigma)
        descent, fall, stopped = self.turn()
        if descent <= 0:
            self.precondition()
            memory["beta"] = 0.0
            descent, fall, stopped = self.turn()
        share, moved = 0.0, memory["length"] > 0
        if not moved:
            memory["length"] = self.exact_length(descent)
        for _ in range(HALVINGS):
            length = memory["length"]
            if not moved:
                fall, stopped = rows.sums(
                    2, sweeps.move, *bodies, self.direction, length, self.padded
                )
            curvature = self.stiffness()
            if fall > 0:
                best = float(fall) / curvature if curvature > 0 else 1.0  # 1: a rigid shift
                share = self.share_of_move(best, stopped > 0)
                break
            memory |= {"length": 0.5 * length, "slope": 0.0}
            moved = False
        way = (self.direction, length, share, self.padded, self.change)
        self.judge(rows.sums(3, sweeps.advance, *bodies, *way, self.marks))
        self.state.exact = False

    def turn(self) -> Field:
        """The new direction, and the move along it; see `sweeps.turn`."""
        memory, bodies = self.memory, (self.h, self.u, self.sigma, self.marks, self.least)
        way = (memory["beta"], self.direction, memory["length"])
        return self.rows.sums(3, sweeps.turn, *bodies, self.z, *way, self.padded)

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

    def exact_length(self, descent: float) -> float:
        """The length that minimises the energy along the direction, were there no indenter."""
        self.padded[:, : self.h.shape[1]] = self.direction
        curvature = self.stiffness()
        if curvature > SOFTEST * descent:
            return float(descent) / curvature
        most = self.grid.most
        height = most(float(self.h.max())) + most(-float(self.h.min()))
        return height / most(float(np.abs(self.direction).max()))  # of a rigid shift, at most


def prefers_levels(grid: Grid, even: bool, chord: float, exponent: float) -> bool:
    """Whether a preconditioner over levels pays; `even`: where the V-cycle suits k(q)."""
    if even:
        return exponent > STEEP
    return grid.dimension == 2 and prefers_multilevel(chord, exponent)


def prefers_multilevel(chord: float, exponent: float) -> bool:
    """Whether the sum over levels is faster than the Green's function; `chord` in grid spacings.

    Measured on the default surface, p* = 0.001 to 1, and a paraboloid, 512^2, CPU seconds: equal
    at n = 1; for n = 2, 3, 4 it wins from chords of about 10, 20, 30 on; 5 times at n = 3, 250.
    """
    return exponent > 0.75 and chord > 8 * (exponent - 1)


def screening(contact: Contact, held: float, changes: float) -> tuple[float, float, float]:
    """Screening stiffness k(q_c), mean free chord l in grid spacings, local exponent n of k.

    Taken from how many points are held, and how many changes there are along rows and columns.

    q_c = c pi / l with c = 2^((n - 2)(1 - a_r)). Measured on the default surface of the paper at
    512^2, p* = 0.01, 0.1, 1: the fewest transforms, within some 20 %, were at c = 1/2 for n = 1,
    1 for n = 2, 2 for n = 3, 3 to 4 for n = 4 while a_r is small, 1 for n >= 2 near full contact.
    """
    grid, line = contact.grid, contact.line
    log_k = np.log(line[1:])
    log_m = np.log(np.arange(1, line.size))
    area = held / grid.size
    crossings = changes * grid.points / (grid.dimension * grid.size)  # of one line across the cell
    chord = 2 * (1 - area) / crossings if crossings > 0 else 1.0  # in units of L
    at = min(float(np.log(0.5 / max(chord, 1e-9))), log_m[-1])
    step = 0.1  # of log q, for the local exponent
    inside = min(max(at, step), log_m[-1] - step)
    n = float(np.diff(np.interp([inside - step, inside + step], log_m, log_k))[0]) / (2 * step)
    at = min(at + float(np.log(2)) * (n - 2) * (1 - area), log_m[-1])
    below = n * min(at, 0.0)  # patches further apart than L / 2: the power law goes on
    return float(np.exp(np.interp(at, log_m, log_k) + below)), chord * grid.points, n
