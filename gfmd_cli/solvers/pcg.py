"""Projected preconditioned conjugate gradients, for every stiffness k(q) that is not flat.

A step of the method, with the numbers beside the code lines:

[1] Choose the points of contact that are held, by proportioning (Dostal, SIAM J. Optim. 7, 871,
    1997), and a preconditioner that suits their pattern (see `preconditioners`).
[2] Precondition the force on the free points.
[3] Compute a direction d on the free points, from the preconditioned force and the last direction.
[4] Project the move of length l on the constraint: u -> max(u + l d, h).
[5] Go to the point of lowest energy on the straight line to the projected point.

A step applies K once, to the projected move. This is done in single precision, except on lines:
moves become smaller as the iteration converges, and so does their rounding. White noise of u has
the stress k_max times as large, which gives an estimate of the rounding of sigma. sigma is computed
afresh in double precision where the residual falls below it (residual replacement; van der Vorst &
Ye, SIAM J. Sci. Comput. 22, 835, 2000).

The length l is that of the step before (in the first step, that of the coarser grid), corrected
by the ratio of the best move to the projected one. The energy never rises, so that the method
cannot cycle: a move beyond the lowest point is shortened to it (all points on the line are
feasible), and a move along which the energy rises from the start is halved. A scaled gradient that
is projected on the feasible set decreases the energy for a short enough step if the binding
constraints are excluded from the scaling (Bertsekas, SIAM J. Control Optim. 20, 221, 1982).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import hypot, isfinite
from typing import ClassVar, Literal

import numpy as np

from gfmd_cli.grid.arrays import Field, SingleField
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.observables import contact_points
from gfmd_cli.solvers import pcg_kernels as kernels
from gfmd_cli.solvers.contact_state import PRESSED, TENSILE, refined
from gfmd_cli.solvers.loop import Solver, Start, State
from gfmd_cli.solvers.multigrid import largest_growth
from gfmd_cli.solvers.preconditioners import Preconditioner, create, select
from gfmd_cli.solvers.projected_move import MAX_HALVINGS, choose, conjugation

MAX_TENSION_RATIO = 0.3  # of rms tension to rms free force
"""With 0.1 the transforms are 0.96 to 1.06 times as many, with 1: 1.03 to 1.16 times (n = 1 to 4,
64^2 to 256^2, seeds 3 to 5):
`scripts/solver_constants.py pcg.MAX_TENSION_RATIO 0.1 1 --exponents 1 2 3 4`."""
MAX_OVERLAP = 0.3  # of z with the force before the last move, over that with the force itself
"""Powell (Math. Program. 12, 241, 1977) has 0.2. Without restarts (1e9) the transforms are 0.98 to
1.23 times as many, with 0.1 and 0.5: 0.98 to 1.06 times (n = 0.1 to 3, 64^2 to 256^2, seeds 3 to
5): `scripts/solver_constants.py pcg.MAX_OVERLAP 0.1 0.5 1e9 --exponents 0.1 0.5 1 3`. At p* = 0.001
and 0.003 without restarts: 0.83 to 1.21 times, with 0.1: 0.93 to 1.26, with 0.5: 0.78 to 1.08 times
(`--p-star 0.001 0.003`)."""
MAX_SOFT_GROWTH = 3.0  # of k(q) per octave, up to which the conjugation restarts after any move
"""With 0 transforms are 0.98 to 1.04 times as many at n = 0.5 and 1, with 99 1.00 times at n = 2
and 1.00 to 1.05 times at n = 3 (64^2 to 256^2, seeds 3 to 5), 1.01 and 1.05 times on 512^2 (seeds
20 and 21): `scripts/solver_constants.py pcg.MAX_SOFT_GROWTH 0 99 --exponents 0.5 1 2 3`."""
MIN_DETERMINANT = 0.3  # of the plane of z and the last direction: 1 if conjugate, 0 if parallel
"""With 0 some line profiles diverge (n = 3 to 4), and transforms are 0.99 to 1.51 times as many,
most at n = 4, with 0.1: 0.99 to 1.05 times, with 0.5: 0.96 to 1.07 times (n = 2 to 4, 64^2 to
256^2, seeds 3 to 5): `scripts/solver_constants.py pcg.MIN_DETERMINANT 0 0.1 0.5 --exponents 2 3 4`,
and the same with `--p-star 0.0003 0.003`. Up to MAX_SOFT_GROWTH the restarts suffice."""
MIN_SELECTION_INTERVAL = 4  # smallest number of steps between two selections of the preconditioner
MAX_SCREENING_CHANGE = 1.25  # factor in k(q_c) up to which the old value is kept
"""With 1 the transforms are 0.99 to 1.05 times as many (n = 0.25 to 0.4, 64^2 to 256^2, seeds 3 to
5): `scripts/solver_constants.py pcg.MAX_SCREENING_CHANGE 1 --exponents 0.25 0.35 0.4`."""
SELECTION_GROWTH = 1.5  # growth of the number of steps from one selection to the next
"""With one selection per grid the transforms are 0.89 to 1.03 times as many, in the mean 0.97 (n
and grids as above, seeds 3 to 5): `scripts/solver_constants.py pcg.SELECTION_GROWTH 1e9 --exponents
0.25 0.35 0.4`. Larger n select the V-cycle once and for all."""


@dataclass(kw_only=True)
class PCGState(State):
    """State of projected conjugate gradients.

    The direction and the change are in single precision. They determine only the next direction;
    the move itself is computed in double precision.
    """

    direction: SingleField
    change: SingleField
    """Change of sigma by the last move."""
    length: float = 0.0
    """Step length of the last move; 0 before the first one."""
    moved: float = 0.0
    """Length of the last move along the direction; 0 where the conjugation restarts."""
    best_length: float = 0.0
    """Length along the direction at which the energy was lowest."""
    curvature: float = 0.0
    """Sum of the direction times K times the direction."""
    slope: float = 0.0
    """Sum of preconditioned force times force before the last move."""
    screening: float = 0.0
    """k(q_c) of the screened Green's function; 0 where the preconditioner is the V-cycle."""
    select_at: int = 0
    """Step of the next selection of the preconditioner."""
    free: float = 0.0
    """Sum of the squares of the force on the free points."""
    tension: float = 0.0
    """Sum of the squares of the tension on points in contact."""


class ProjectedCG(Solver):
    """Projected preconditioned conjugate gradients, for every n > 0."""

    kind: Literal["pcg"] = "pcg"

    state_type: ClassVar[type[State]] = PCGState
    starts_locally: ClassVar[bool] = True

    def begin(self, contact: Contact, u: Field) -> PCGState:
        """Start from `u`, lifted above the indenter and lowered until it touches."""
        contact.settle(u)
        state = _new_state(contact, u, contact.stress(u, out=contact.grid.empty()))
        state.transforms = 2
        return state

    def begin_from(self, start: Start) -> PCGState:
        """Start with the stress of the start, if it is known; else compute it from u."""
        if start.sigma is None:
            return self.begin(start.contact, start.u)
        state = _new_state(start.contact, start.u, start.sigma)
        state.exact, state.rounding = False, start.rounding
        return state

    def continue_from(self, coarse: Contact, state: State, fine: Contact) -> PCGState:
        """Start from the interpolated displacement, laid on the indenter in the coarse contact.

        The step length depends little on the grid. Lines start without it: their transforms cost
        nothing, and the exact length saves steps at n >= 3.
        """
        assert isinstance(state, PCGState)
        u = coarse.grid.resample(state.u, fine.grid)
        if fine.grid.dimension == 1:
            return self.begin(fine, u)
        if fine.grid.whole:
            pressed = contact_points(coarse.obstacle, state.u, state.sigma)
            np.copyto(u, fine.obstacle, where=refined(pressed, fine))
        fresh = self.begin(fine, u)
        fresh.length, fresh.screening = state.length, state.screening
        return fresh

    def iterate(self, contact: Contact, state: PCGState) -> Iterator[PCGState]:
        """Advance `state` in place by conjugate-gradient steps."""
        yield state  # a start that is good enough needs no working memory
        if contact.rounding(state.u) > 1:  # the rounding of the stress exceeds the pressure
            return
        run = _Run(contact, state)
        while True:
            run.select()  # [1]
            beta = run.precondition()  # [2]
            run.advance(beta)  # [3] to [5]
            state.step += 1
            yield state
            if state.exact:  # sigma was computed afresh
                run.classify()


def _new_state(contact: Contact, u: Field, sigma: Field) -> PCGState:
    """A state without a last direction."""
    direction, change = (np.zeros(u.shape, dtype=np.float32) for _ in range(2))
    residual = contact.residual(u, sigma)
    return PCGState(u=u, sigma=sigma, residual=residual, direction=direction, change=change)


class _Run:
    """Working memory of one solve; all fields have two axes, as the kernels require."""

    def __init__(self, contact: Contact, state: PCGState) -> None:
        self.contact, self.state = contact, state
        self.grid = grid = contact.grid
        self.rows = grid.rows
        self.moves = contact.grid_of_moves
        self.stress_rounding = contact.stress_rounding(self.moves.real)
        self.h, self.padded = grid.as_rows(contact.obstacle), grid.as_rows(self.moves.padded)
        self.u, self.sigma = grid.as_rows(state.u), grid.as_rows(state.sigma)
        self.direction, self.change = map(grid.as_rows, (state.direction, state.change))
        self.contact_state = self.rows.empty_with_halo(self.h.shape[1], dtype=np.int8)
        self.own_state = self.rows.interior(self.contact_state)
        self.threshold = PRESSED
        self.is_soft = largest_growth(contact) <= MAX_SOFT_GROWTH
        self.preconditioner: Preconditioner | None = None
        self.classify()

    def classify(self) -> None:
        """Compute the contact state; if sigma was computed from u, also the sums of `assess`."""
        fields = (self.h, self.u, self.sigma)
        sums = self.rows.sums(3, kernels.classify, *fields, self.own_state)
        if self.state.exact:
            self.assess(sums)
            self.state.rounding = 0.0

    def assess(self, sums: Field) -> None:
        """Store the residual and the sums of squares of the free force and of the tension."""
        violation, self.state.free, self.state.tension = sums.tolist()
        self.state.residual = self.contact.as_residual(violation)

    def select(self) -> None:
        """Choose the points that are held and, at some steps, the preconditioner.

        Points of contact under tension are released once their tension outweighs the force on the
        points that are free already. If they were released earlier, they would be pressed back in
        later steps.
        """
        state, step = self.state, self.state.step
        release = state.tension > MAX_TENSION_RATIO**2 * state.free
        self.threshold = PRESSED if release else TENSILE
        if step < state.select_at:
            return
        state.select_at = max(step + MIN_SELECTION_INTERVAL, int(SELECTION_GROWTH * step))
        screening = select(self.contact, self.contact_state, self.threshold)
        low, high = sorted((screening, state.screening))
        if high > MAX_SCREENING_CHANGE * low:
            state.screening, state.moved, self.preconditioner = screening, 0.0, None

    def precondition(self) -> float:
        """Precondition the force, and return the factor beta of the conjugation."""
        state = self.state
        if self.preconditioner is None:
            self.preconditioner = create(self.contact, self.moves, state.screening)
        fields = (self.sigma, self.contact_state, self.threshold)
        slope, z_change = self.preconditioner.apply(*fields, self.change)
        state.transforms += self.preconditioner.transforms
        last_slope, state.slope = state.slope, slope
        if state.moved == 0.0 or slope <= 0.0:
            return 0.0
        overlap = slope + z_change  # z f', with the force f' before the last move
        # At the lowest point along the last line, which is farther by a factor of r, the force is
        # f* = f' + r (f - f'), and z* = z' + r (z - z'). Below: z* f' and z* f*, as z' f = z f'.
        r = state.best_length / state.moved
        exact_overlap = r * overlap - (r - 1) * last_slope
        exact_slope = r * (r * slope - (r - 1) * overlap) - (r - 1) * exact_overlap
        may_restart = self.is_soft or state.moved == state.best_length
        if may_restart and abs(exact_overlap) > MAX_OVERLAP * exact_slope:
            return 0.0
        move = state.moved, state.best_length, state.curvature
        return conjugation(slope, z_change, *move, 0.0 if self.is_soft else MIN_DETERMINANT)

    def apply_stiffness(self) -> float:
        """Replace the values in `padded` by K times them; return the sum of their products."""
        self.state.transforms += self.moves.pair_cost
        return self.moves.filter_padded(self.contact.stiffness)

    def advance(self, beta: float) -> None:
        """Compute the new direction, and move along it such that the energy does not rise."""
        state, fields = self.state, (self.h, self.u, self.sigma)
        descent, fall, square, stopped = self.update_direction(beta)  # [3], [4]
        if descent <= 0:
            self.precondition()  # z was overwritten by the projected move
            descent, fall, square, stopped = self.update_direction(0.0)
        fraction = 0.0
        if state.length <= 0:
            state.length = self.exact_length(descent)
            _, fall, square, stopped = self.update_direction(0.0, is_kept=True)
        for _ in range(MAX_HALVINGS):
            length = state.length
            curvature = self.apply_stiffness()
            is_finite = isfinite(curvature)  # else the move overflows in single precision
            if fall > 0 and is_finite:
                best = float(fall) / curvature if curvature > 0 else 1.0  # 1: a rigid shift
                exact = not stopped and (best <= 1 or not self.crosses(best * length))
                fraction, factor, restart = choose(best, exact)
                state.length = factor * length
                state.moved = 0.0 if restart or curvature <= 0 else fraction * length
                state.best_length, state.curvature = best * length, curvature / length / length
                break
            state.length = 0.5 * length if is_finite else min(0.5 * length, self.longest())
            state.moved = 0.0
            _, fall, square, stopped = self.update_direction(0.0, is_kept=True)  # [4]
        way = (self.direction, length, fraction, self.padded, self.change)
        self.assess(self.rows.sums(3, kernels.advance, *fields, *way, self.own_state))  # [5]
        state.exact = False
        rounding = self.stress_rounding * fraction * self.contact.as_residual(square)
        state.rounding = hypot(state.rounding, rounding)  # of the moves so far

    def update_direction(self, beta: float, *, is_kept: bool = False) -> Field:
        """Compute the direction and the projected move along it; see `pcg_kernels`."""
        fields = (self.h, self.u, self.sigma, self.own_state, self.threshold)
        direction = (beta, self.direction, is_kept, self.state.length)
        return self.rows.sums(4, kernels.update_direction, *fields, *direction, self.padded)

    def crosses(self, length: float) -> bool:
        """Whether the indenter would stop a move of this length at some point."""
        fields = (self.h, self.u, self.direction, length)
        return bool(self.rows.sums(1, kernels.crossing, *fields)[0] > 0)

    def exact_length(self, descent: float) -> float:
        """Length that minimises the energy along the direction without constraints."""
        self.padded[:, : self.h.shape[1]] = self.direction
        curvature = self.apply_stiffness()
        if curvature > 0:
            return float(descent) / curvature
        return self.longest()  # upper limit of a rigid shift

    def longest(self) -> float:
        """Length at which the point that moves farthest moves by the range of the heights.

        Zero where no point moves.
        """
        largest = self.grid.max(float(np.abs(self.direction).max()))
        return self.contact.height_range / largest if largest else 0.0
