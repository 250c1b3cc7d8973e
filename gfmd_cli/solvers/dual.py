"""Projected preconditioned conjugate gradients in the stress, for a free boundary.

The dual form of the contact (see `free_contact`) minimises <s C s> / 2 - <s h> over stresses s >= 0
with the mean p. Its gradient is the gap g = C s - h, up to the level c of the undeformed surface. A
step of the method, with the numbers beside the code lines:

[1] Set the level such that the mean gap in contact is zero. Choose the points whose stress may
    change: those in contact and, by proportioning (Dostal, SIAM J. Optim. 7, 871, 1997), those
    without stress that penetrate the indenter.
[2] Precondition the gap of these points (see `stress_preconditioner`), and subtract the mean.
[3] Compute a Polak-Ribiere+ direction d, zero where it would make a stress of zero tensile.
[4] Project the move of length l on the constraints: s -> max(s + l d - shift, 0), where the shift
    restores the mean.
[5] Go to the point of lowest energy on the straight line to the projected point.

A step applies C once, to the projected move; l is that of the step before (at first 1, because the
preconditioner is close to the inverse), corrected by the ratio of the best move to the projected
one, as in `pcg`. All points on the line satisfy the constraints and the energy never rises.

C is applied to moves in single precision: they become smaller as the iteration converges, and so
does their rounding. The gap is computed afresh in double precision where that matters (see `loop`).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import hypot
from typing import Any, ClassVar, Literal

import numpy as np

from gfmd_cli.grid.arrays import Field, SingleField, dot
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.free_contact import FreeContact
from gfmd_cli.solvers import dual_kernels as kernels
from gfmd_cli.solvers.contact_state import PENETRATING, PRESSED
from gfmd_cli.solvers.loop import Solver, Start, State
from gfmd_cli.solvers.projected_move import choose, polak_ribiere
from gfmd_cli.solvers.stress_preconditioner import StressPreconditioner

MAX_PENETRATION = 0.3  # of the rms gap on penetrating points to that in contact; as in `pcg`
MIN_LENGTH = 1e-18
"""Of a move; a shorter one changes nothing in double precision. Where stresses close to zero make
the energy rise along a longer move, one as short as that sets them to zero."""
MAX_FRACTION = 100.0
"""Upper limit of the fraction `best` of a move. If a move consists of rounding only, `best` can be
1e5, and would multiply the rounding error of the gap as much. A choice: mostly `best` is about 1.
"""
MAX_STRESS_FRACTION = 2.0
"""Largest fraction f of a move that is added to the stress: a relative rounding error of the load
is multiplied by 1 - f. If f is larger, the stress is projected anew, with the length f l."""
CONVOLUTION_ROUNDING = 2.0
"""Relative rms error of the coefficients of a move and of its displacement, in units of eps.

The error of the gap in contact was at most 2.4 times what follows from it, in the median 0.4 times:
`scripts/free_rounding.py`."""


@dataclass(kw_only=True)
class DualState(State):
    """State of conjugate gradients in the stress `sigma`; `u` is derived from it.

    The direction and the change are in single precision, because they determine only the next move.
    """

    gap: Field
    """C sigma - h, up to a constant."""
    direction: SingleField
    change: SingleField
    """Change of the gap by the last move."""
    length: float = 1.0
    """Step length of the last move."""
    slope: float = 0.0
    """Sum of preconditioned gap times gap; 0 where the conjugation restarts."""


class Dual(Solver):
    """Conjugate gradients in the stress at fixed mean pressure, for a free boundary."""

    kind: Literal["dual"] = "dual"
    fields_in_memory: ClassVar[float] = 15.0

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
        state.rounding = _rounding_afresh(start.contact, start.sigma, start.u)
        state.gap -= start.contact.height
        state.residual = start.contact.balance(state.sigma, state.gap, state.u)
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
        state.exact, state.rounding = True, _rounding_afresh(contact, state.sigma, state.gap)
        state.gap -= contact.height
        state.residual = contact.balance(state.sigma, state.gap, state.u)

    def iterate(self, contact: Any, state: Any) -> Iterator[DualState]:
        """Advance `state` in place by steps of one application of C and some of K."""
        yield state  # a start that is good enough needs no working memory
        run = _Run(contact, state)
        while True:
            run.select()  # [1]
            run.update_direction()  # [2], [3]
            if run.advance():  # [4], [5]
                state.exact = False
            else:
                self.refresh(contact, state)
                state.count_miss()
            state.step += 1
            yield state


def _new_state(u: Field, stress: Field, gap: Field) -> DualState:
    """A state without a last direction."""
    direction, change = (np.zeros(stress.shape, np.float32) for _ in range(2))
    return DualState(u=u, sigma=stress, gap=gap, direction=direction, change=change)


def _rounding_afresh(contact: FreeContact, sigma: Field, displacement: Field) -> float:
    """Estimated contribution of the rounding of C sigma in double precision to the residual."""
    squares = np.array([dot(sigma, sigma), dot(displacement, displacement)])
    return _rounding(contact, np.float64, *contact.grid.total(squares).tolist())


def _rounding(contact: FreeContact, dtype: type, stress: float, displacement: float) -> float:
    """The same from sums of squares, also for a move in single precision and its displacement."""
    squares = displacement + contact.compliance.rms_symbol**2 * stress
    return CONVOLUTION_ROUNDING * float(np.finfo(dtype).eps) * contact.as_residual(squares)


class _Run:
    """Working memory of one solve; all fields have two axes, as the kernels require."""

    def __init__(self, contact: FreeContact, state: DualState) -> None:
        self.contact, self.state, self.compliance = contact, state, contact.compliance
        self.grid, self.rows = contact.grid, contact.grid.rows
        as_rows = self.grid.as_rows
        self.h, self.obstacle = as_rows(contact.height), as_rows(contact.obstacle)
        self.sigma, self.gap = as_rows(state.sigma), as_rows(state.gap)
        self.direction, self.change = as_rows(state.direction), as_rows(state.change)
        self.z = np.empty(self.h.shape, np.float32)  # later the move
        self.contact_state = np.empty(self.h.shape, np.int8)
        self.threshold = PRESSED
        self.preconditioner = StressPreconditioner(contact)

    @property
    def chosen(self) -> tuple[Any, int]:
        """The points whose stress may change, as the kernels take them."""
        return self.contact_state, self.threshold

    def select(self) -> None:
        """Choose the points whose stress may change."""
        fields = self.h, self.obstacle, self.sigma, self.gap, self.contact_state
        inside, outside = self.rows.sums(2, kernels.classify, *fields)
        enters = outside > MAX_PENETRATION**2 * inside
        self.threshold = PENETRATING if enters else PRESSED

    def update_direction(self) -> None:
        """Precondition the gap and set the direction."""
        state = self.state
        self.preconditioner.apply(self.gap, *self.chosen, out=self.z)
        state.transforms += self.preconditioner.transforms
        fields = self.z, self.gap, self.change, self.direction, *self.chosen
        sums = self.rows.sums(7, kernels.products, *fields)
        slope, z_change, z_sum, gap_sum, change_sum, last_sum, count = sums.tolist()
        mean = z_sum / count if count else 0.0
        beta = polak_ribiere(z_change - mean * change_sum, state.slope)
        state.slope = slope - mean * gap_sum
        if not self.combine(mean, beta, beta * last_sum / count if count else 0.0):
            self.combine(mean, 0.0, 0.0)

    def combine(self, z_mean: float, beta: float, mean: float) -> bool:
        """Set the direction to that of z + beta times the last; false if the energy rises along it.

        Along the direction of z alone (beta = 0) it falls. With points of zero stress that the
        direction would make tensile, the energy may rise along the projected direction, however
        short the move (Bertsekas, SIAM J. Control Optim. 20, 221, 1982).
        """
        means = np.float32(z_mean), np.float32(beta), np.float32(mean)
        fields = self.sigma, self.gap, *self.chosen, self.direction
        sums = self.rows.sums(4, kernels.combine, self.z, *means, *fields)
        total, descent, gap_sum, count = sums.tolist()
        mean = total / count if count else 0.0
        if descent + mean * gap_sum <= 0 and beta > 0:
            return False
        fields = self.direction, np.float32(mean), self.sigma, *self.chosen
        self.rows.run(kernels.subtract_mean, *fields)
        return True

    def project(self) -> tuple[float, float, bool]:
        """The largest s + l d, the shift relative to it, and whether negative values are cut off.

        The nearest stresses s >= 0 with the sum of the present ones are max(target - shift, 0)
        (Michelot, J. Optim. Theory Appl. 50, 195, 1986). The mean gap in contact is zero, so that
        a small shift does not change the energy; a factor would.
        """
        move = self.sigma, self.direction, self.state.length
        row_sums = np.full((self.rows.count, 2), (-np.inf, 0.0))
        self.rows.run(kernels.highest_target, *move, *self.chosen, row_sums)
        highest = self.grid.max(float(row_sums[:, 0].max()))
        clipped = self.rows.total(row_sums[:, 1].sum()) > 0
        total = self.contact.pressure * self.grid.size
        shift, count = -np.inf, np.inf
        while True:
            kept = *move, highest, shift, *self.chosen
            kept_sum, kept_count = self.rows.sums(2, kernels.kept_targets, *kept).tolist()
            if not 0 < kept_count < count:  # none: the direction is not finite
                return highest, shift, clipped
            shift, count = (kept_sum - total) / kept_count, kept_count

    def advance(self) -> bool:
        """Move such that the energy falls; false if no length does that, because of rounding."""
        state = self.state
        while state.length > MIN_LENGTH:
            highest, shift, clipped = self.project()  # [4]
            way = self.direction, state.length, highest, shift
            move = self.sigma, *way, self.gap, *self.chosen, self.z
            (fall,) = self.rows.sums(1, kernels.write_move, *move)
            if fall > 0:
                break
            state.length, state.slope = 0.5 * state.length, 0.0
        else:
            state.length, state.slope, self.change[...] = 1.0, 0.0, 0.0
            return False
        self.compliance.displacement_by_move(self.z, out=self.change)
        state.transforms += 0.5 * self.compliance.transforms
        sums = self.rows.sums(3, kernels.curvature, self.z, self.change)
        curvature, changed, moved = sums.tolist()
        best = min(fall / curvature, MAX_FRACTION) if curvature > 0 else 1.0
        length = best * state.length
        exact = not clipped and (best <= 1 or not self.crosses(length))
        fraction, factor, restart = choose(best, exact)
        state.length *= factor
        if restart:
            state.slope = 0.0
        stress_fraction = fraction
        if fraction > MAX_STRESS_FRACTION:
            highest, shift, _ = self.project()
            way, stress_fraction = (self.direction, state.length, highest, shift), 1.0
            self.change *= np.float32(fraction)
        fields = self.sigma, self.gap, *way, stress_fraction, *self.chosen, self.change
        sums = self.rows.sums(2, kernels.advance, *fields)  # [5]
        state.residual = self.contact.balance(state.sigma, state.gap, state.u, sums)
        squares = fraction**2 * moved, fraction**2 * changed
        state.rounding = hypot(state.rounding, _rounding(self.contact, np.float32, *squares))
        return True

    def crosses(self, length: float) -> bool:
        """Whether a stress would be tensile after a move of this length."""
        fields = self.sigma, self.direction, length
        return bool(self.rows.sums(1, kernels.crossing, *fields)[0] > 0)
