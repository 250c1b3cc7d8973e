"""A start for contacts of few points: the equations of the points in contact are solved directly.

The stress is zero outside the contact, and the displacement is that of the indenter inside. With
the compliance C = 1 / k(q) and the points A of contact this is a linear system for their stresses s
and the level c of the displacement,

    C_AA s + c = h_A,    sum of s = p times the number of grid points.

A is found by the primal-dual active set method (Hintermueller, Ito & Kunisch, SIAM J. Optim. 13,
865, 2002): after each solution the points with s < 0 leave A, and those that the displacement
enters join it, the deepest first. Four to ten sets mostly suffice on a grid that starts from the
contact of the next coarser one. For k(q) steeper than q^2 the sets may begin to repeat.
Therefore, as soon as the number of misclassified points does not decrease, stresses s >= 0 are kept
from set to set, and none of the steps raises the energy:

[1] Solve for the stresses t of the points A.
[2] If some are negative, go from s towards t. If the energy falls, all points of negative stress
    leave A; else half of them, a quarter, and so on, those whose stress vanishes first on the way;
    at last the very first. Back to [1].
[3] Otherwise s = t, and the points that the displacement enters join A. Back to [1].

Step [2] with the very first point is the inner loop of the active set method of Lawson & Hanson
(Solving Least Squares Problems, 1974, chapter 23).

A solution costs m^3 / 3 operations for m points, and the displacement at all points a pair of
transforms. The stress is the unknown, and the displacement C s + c follows from it without loss of
digits: the residual is the rounding of the displacement. To compute K u from the displacement
instead would multiply its rounding by k_max, which exceeds the pressure in small contacts of stiff
elastomers.
"""

from collections.abc import Callable
from math import inf
from typing import Any

import numpy as np
import scipy

from gfmd_cli.grid.arrays import Field, Integers, Mask, row_blocks
from gfmd_cli.grid.compilation import kernel
from gfmd_cli.grid.shared_transforms import BLOCK_ROWS
from gfmd_cli.physics.contact import Contact
from gfmd_cli.solvers.contact_state import refined
from gfmd_cli.solvers.local_start import COARSE_TOLERANCE
from gfmd_cli.solvers.loop import Start
from gfmd_cli.solvers.multigrid import largest_growth

MAX_COST = 80
"""Largest m^3 over points of a grid and square of the growth of k(q) per octave, for m points in
contact; measured: with more, the iteration is faster. At n = 1.5 and 2 the direct solution takes
0.54 to 0.72 of the processor time near m^3 / N = 140 to 510 and 0.77 to 0.80 near 1100 to 1400
(128^2 and 256^2, whole solves to 1e-6; the limit is at 640 and 1280)."""
MAX_LINE_COST = 20000  # the same for lines
EXPECTED_GROWTH = 1.3  # of the sets: largest number of points over that of the first one; a choice
MAX_JOINING_FRACTION = 0.4  # of a set, that joins it at a time; measured: 0.3 to 0.6 are as good
MAX_SETS = 60  # of the largest size, or eight times as many of half; a choice; 5 to 60 are taken

Points = tuple[Any, ...]
"""Rows and columns of points, as indices of a field."""


def direct_start(
    touching: Mask, finer: list[Contact], pause: Callable[[], None] = lambda: None
) -> Start | None:
    """The start on the finest of the `finer` grids that can be reached by direct solves.

    `touching` are the points in contact on a coarser grid. `pause` is called for every set and may
    end the solve by an exception. None where even the first of the grids has too many points in
    contact.
    """
    last, touching = finer[-1], np.atleast_2d(touching)
    solved: _DirectSolve | None = None
    transforms = 0.0
    for contact in finer:
        largest = _largest_count(contact)
        if not contact.grid.whole or np.count_nonzero(touching) > largest:
            break
        touching = refined(touching, contact)
        if EXPECTED_GROWTH * np.count_nonzero(touching) > largest:
            break
        solve = _DirectSolve(contact, touching)
        is_solved = solve.run(largest, 0.0 if contact is last else COARSE_TOLERANCE, pause)
        transforms += solve.transforms * contact.grid.size / last.grid.size
        if not is_solved:
            break
        solved, touching = solve, solve.touching
    return solved.start(transforms) if solved else None


def _largest_count(contact: Contact) -> int:
    """Largest number of points in contact for which a direct solve is faster than the iteration."""
    is_line = contact.grid.dimension == 1
    cost = MAX_LINE_COST if is_line else MAX_COST * largest_growth(contact) ** 2
    return int((cost * contact.grid.size) ** (1 / 3))


class _DirectSolve:
    """The points in contact on one grid."""

    def __init__(self, contact: Contact, touching: Mask) -> None:
        self.contact, self.grid, self.touching = contact, contact.grid, touching
        self.obstacle = self.grid.as_rows(contact.obstacle)
        self.values = self.grid.as_rows(self.grid.padded)[:, : self.grid.points]
        self.stress: Field | None = None
        """Stresses s >= 0 that are kept from set to set; None before."""
        self.solution: tuple[Points, Field, float] | None = None
        """Points in contact, their stresses and the residual, once no point is misclassified."""
        self.transforms = 0.0
        self.evaluate((0, 0), 1.0)
        rows, columns = self.values.shape
        self.compliance = self.values[: rows // 2 + 1, : columns // 2 + 1].copy()
        """Displacement by a unit stress at the first point; it is even along both axes, and only
        one quadrant is kept."""

    def evaluate(self, points: Points, s: Field | float) -> None:
        """`values` <- C s, without its mean."""
        self.values[...] = 0.0
        self.values[points] = s
        blocks = np.unique(np.asarray(points[0]) // BLOCK_ROWS)
        self.grid.unfilter_padded(self.contact.stiffness, blocks.tolist())
        self.transforms += 2

    def run(self, largest: int, tolerance: float, pause: Callable[[], None]) -> bool:
        """Find the points in contact, up to a residual; false where a direct solve is not possible.

        That is so with no point or more than `largest` in contact, and where rounding makes the
        matrix indefinite. The displacement stays in `values`, its level above the indenter in
        `level`. If the work ends before the points are found, `solution` is None.
        """
        fewest, work = self.grid.size, MAX_SETS * largest**3
        while work > 0:
            pause()
            points = np.nonzero(self.touching)
            if not 0 < points[0].size <= largest:
                return False
            work -= max(points[0].size, largest // 2) ** 3
            try:
                t, factor = self.equilibrium(points)  # [1]
            except scipy.linalg.LinAlgError:  # rounding, at very steep k(q)
                return False
            if self.stress is not None and np.any(t < 0):
                self.approach(points, t, factor)  # [2]
                del factor  # before the next one, which is as large as some fields
                continue
            self.evaluate(points, t)
            gap = self.values[points] - self.obstacle[points]
            self.level = float(gap.mean())
            misclassified, residual = self.compare(points, t)
            count = int(np.count_nonzero(misclassified))
            if count == 0:
                self.solution = (points, t, self.rounding(gap - self.level, factor))
            if count == 0 or residual < tolerance:
                break
            del factor
            if self.stress is None and count >= fewest:
                self.stress = np.zeros(self.touching.shape)
                self.stress[points] = _without_tension(t)
                self.touching[points] = t > 0
                continue
            if self.stress is not None:
                self.stress[points] = t
            fewest = count
            self.exchange(misclassified, max(1, int(MAX_JOINING_FRACTION * t.size)))  # [3]
        return True

    def approach(self, points: Points, t: Field, factor: Field) -> None:
        """Go from the stresses s towards t without raising the energy; some points leave A.

        All points with t < 0 leave if that lowers the energy; otherwise half of them, a quarter,
        and so on, those first whose stress vanishes first on the way to t.
        """
        assert self.stress is not None
        s = self.stress[points]
        lengths = np.divide(s, s - t, out=np.full_like(s, np.inf), where=t < 0)
        leaving = np.sort(lengths[t < 0])
        energy, last, target = _energy(factor, s - t), leaving.size, _without_tension(t)
        while last > 0 and _energy(factor, target - t) >= energy:
            last //= 2
            length = leaving[last]
            partly = np.where(lengths == length, 0.0, s + length * (t - s))
            target = _without_tension(partly)
        self.stress[points] = target
        self.touching[points] = (target > 0) | (t >= 0)

    def rounding(self, gap: Field, factor: Field) -> float:
        """Natural residual by rounding: of the gaps in contact and the stresses that close them."""
        change = _balanced(factor, -gap, 0.0)
        return self.contact.as_residual(float(np.square(gap).sum() + np.square(change).sum()))

    def compare(self, points: Points, s: Field) -> tuple[Mask, float]:
        """The points that are in contact or not by mistake, and the natural residual of that."""
        misclassified = np.empty(self.touching.shape, dtype=np.bool_)
        squares = 0.0
        for rows in row_blocks(self.values):
            gap = self.values[rows] - self.obstacle[rows]
            np.less(gap, self.level, out=misclassified[rows])
            misclassified[rows] &= ~self.touching[rows]
            squares += float(np.square(gap[misclassified[rows]] - self.level).sum())
        misclassified[points] = s < 0
        squares += float(np.square(s[s < 0]).sum())
        return misclassified, self.contact.as_residual(squares)

    def exchange(self, misclassified: Mask, limit: int) -> None:
        """Change whether these points are in contact; up to `limit` of the penetrating join.

        They are the deepest.
        """
        penetrating = np.nonzero(misclassified & ~self.touching)
        if penetrating[0].size > limit:
            gap = self.values[penetrating] - self.obstacle[penetrating]
            shallow = np.argpartition(gap, limit)[limit:]
            misclassified[tuple(places[shallow] for places in penetrating)] = False
        self.touching ^= misclassified

    def equilibrium(self, points: Points) -> tuple[Field, Field]:
        """The stresses t of the points A, and U of C_AA = U^T U (Cholesky).

        Raises scipy.linalg.LinAlgError if rounding makes C_AA indefinite.
        """
        rows, columns = points
        matrix = np.empty((rows.size, rows.size))
        _fill_lower_triangle(matrix, rows, columns, self.compliance, *self.values.shape)
        # The lower triangle by rows is the upper one by columns, which LAPACK overwrites.
        factor, _ = scipy.linalg.cho_factor(matrix.T, overwrite_a=True, check_finite=False)
        load = self.contact.pressure * self.grid.size
        return _balanced(factor, self.obstacle[points], load), factor

    def start(self, transforms: float) -> Start:
        """The displacement, laid on the indenter in contact; with the stress if that is exact."""
        u = self.grid.empty()
        gap = self.grid.as_rows(u)
        np.subtract(self.values, self.grid.as_rows(self.contact.height), out=gap)
        gap -= self.level
        sigma, residual = None, inf
        if self.solution is not None:
            points, t, residual = self.solution
            sigma = np.zeros(u.shape)
            self.grid.as_rows(sigma)[points] = t
        self.contact.set_displacement(u, u, self.touching.reshape(u.shape))
        return Start(self.contact, transforms, u, sigma, residual=residual)


@kernel
def _fill_lower_triangle(
    matrix: Field, rows: Integers, columns: Integers, compliance: Field, height: int, width: int
) -> None:
    """Write the displacement at each point by a unit stress at it and at each point before it."""
    for a in range(rows.size):
        for b in range(a + 1):
            y, x = abs(rows[a] - rows[b]), abs(columns[a] - columns[b])
            matrix[a, b] = compliance[min(y, height - y), min(x, width - x)]


def _balanced(factor: Field, h: Field, load: float) -> Field:
    """The stresses s with C s + c = h for some level c, and the sum `load`; C = U^T U.

    The level is that of all h first, so that the stresses are small. The load is balanced twice,
    as the first time rounding of larger stresses remains.
    """
    sides = np.stack([h - h.mean(), np.ones(h.size)], axis=1)
    s, by_level = scipy.linalg.cho_solve((factor, False), sides, check_finite=False).T
    for _ in range(2):
        s = s + by_level * ((load - s.sum()) / by_level.sum())
    return s


def _without_tension(t: Field) -> Field:
    """The stresses t with zero in place of negative ones, and the same sum."""
    s = np.maximum(t, 0.0)
    s *= t.sum() / s.sum()
    return s


def _energy(factor: Field, s: Field) -> float:
    """Twice the elastic energy s C s of stresses, with the factor U of C = U^T U."""
    dtrmv: Any = scipy.linalg.blas.dtrmv  # its stub wants arrays whose types state the dimension
    strain = dtrmv(factor, s)
    return float(np.vdot(strain, strain))
