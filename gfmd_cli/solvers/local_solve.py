"""The contact on tiles of a grid, solved for the pressure at a cost in proportion to the contact.

On the tiles that the contact can reach

    minimise <s C s> / 2 - <s h>  over s >= 0,  <s> = p.

The method is projected conjugate gradients in the pressure, as in `dual`, but with the stiffness K
restricted to the tiles as preconditioner (Vollebregt, Tribol. Int. 78, 40, 2014, uses its transform
on the whole grid). C s is then evaluated at all points by the exact operator. This shows tiles that
the displacement enters elsewhere, which are added, and the error of the operators on tiles, which
is corrected in the next solve on the tiles.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt
from typing import ClassVar

import numpy as np
from scipy.ndimage import maximum_filter

from gfmd_cli.grid.arrays import Field, dot
from gfmd_cli.physics.contact import Contact
from gfmd_cli.solvers import local_kernels as kernels
from gfmd_cli.solvers.loop import ROUNDING_MARGIN, Start
from gfmd_cli.solvers.projected_move import choose
from gfmd_cli.solvers.tile_operators import TileOperators
from gfmd_cli.solvers.tiles import SIDE, Tiles

UNCORRECTED_TOLERANCE = 6e-3  # of the first solve, before the operators are corrected; a choice
REDUCTION_RANGE = (1e-3, 0.02)
"""Smallest and largest factor by which a solve on tiles shall reduce the residual. The smallest is
the relative error of the operators; the largest is a choice, because an evaluation at all points
takes longer than a few steps on tiles."""
ACCEPTED_FRACTION = 0.75
"""Fraction of the tolerance below which the predicted residual of the start is accepted. The
residual itself may be larger (docs/solver_measurements.md)."""
TARGET_FRACTION = 0.5  # of the tolerance, for that residual after the next solve; a choice
MAX_ROUNDING = sqrt(1 - ACCEPTED_FRACTION**2) / ROUNDING_MARGIN
"""Fraction of the tolerance: largest rounding of a state whose residual is accepted. Here of the
last evaluation, in single precision; in `nested_grids` of the start of an iteration. The
squares of residual and rounding add if they are independent; if not, sigma is computed afresh."""
MAX_GROWTH = 1.5  # of the number of tiles in an evaluation that may be the last one; a choice
MAX_EVALUATIONS = 6  # of the displacement at all points; a choice
MAX_STEPS = 60  # on the same tiles; a choice


@dataclass
class Evaluation:
    """C s at all points, compared with the indenter."""

    level: float
    """Mean of C s - h in contact."""
    gap: Field
    """Gap of the start, on the tiles."""
    residual: float
    """Natural residual of s and C s."""
    start_residual: float
    """Natural residual of the start."""
    rounding: float
    """Estimate of what single precision adds to that residual; 0 in double precision."""


class LocalSolve:
    """The pressure s on tiles of one grid; the subclasses are for the two boundaries.

    Parameters
    ----------
    s : pressure on the tiles to start from, zero where nothing can touch
    pause : is called at every step and may end the solve by an exception
    """

    operators_type: ClassVar[Callable[..., TileOperators]]
    min_points: ClassVar[int]
    """Points per side from which the solve is faster than one on the whole grid; measured, as are
    the other limits."""
    max_exponent: ClassVar[float]
    """Largest exponent n of k(q) for which it is."""

    def __init__(self, contact: Contact, tiles: Tiles, s: Field, pause: Callable[[], None]) -> None:
        self.contact, self.grid, self.pause = contact, contact.grid, pause
        self.operators = self.operators_type(contact)
        self.transforms = 0.0
        self.total = contact.pressure * contact.grid.size  # sum of the pressure over the grid
        self.place(tiles, s)

    @staticmethod
    def max_fraction(exponent: float) -> float:
        """Largest fraction of tiles that the contact can reach; the largest n of k(q) is given."""
        raise NotImplementedError

    def place(self, tiles: Tiles, s: Field) -> None:
        """Take these tiles, and s with the mean pressure of the contact."""
        self.tiles, self.s = tiles, s * (self.total / float(s.sum()))
        self.obstacle = tiles.take(self.contact.obstacle)
        self.correction: Field | float = 0.0
        self.map_pressure = self.operators.displacement(tiles)
        self.map_displacement = self.operators.stress(tiles)

    def compliance(self, s: Field) -> Field:
        """C s on the tiles."""
        self.transforms += self.operators.transforms
        return self.map_pressure(s)

    def compliance_everywhere(self, *, in_single_precision: bool) -> Field:
        """C s at all points, in single precision if that is allowed and possible.

        Valid until the next call.
        """
        raise NotImplementedError

    def lay(self, gap: Field, tolerance: float) -> tuple[Field, float]:
        """The gap of the start on the tiles, from the gap of C s, and its natural residual.

        No more work is done than it takes to bring the residual below the tolerance.
        """
        return gap, self.residual(gap, self.s)

    def residual(self, gap: Field, stress: Field) -> float:
        """Natural residual, if it is zero beyond the tiles."""
        violation = np.minimum(gap, stress)
        return self.contact.as_residual(dot(violation, violation))

    def start(self, tolerance: float) -> Start:
        """Solve until the start has a residual below the tolerance; return the start."""
        raise NotImplementedError

    def solve(self, tolerance: float) -> tuple[Evaluation, Field]:
        """Solve until the start has a residual below the tolerance, with the exact C in the end.

        Returns the last evaluation, and C s at all points. The first evaluation corrects operators
        with an error of 1e-3 and is in single precision. Where that is accurate enough, it may be
        the last one, and the others are in single precision, too.
        """
        target, accepted = UNCORRECTED_TOLERANCE, ACCEPTED_FRACTION * tolerance
        in_single_precision = True
        for count in range(1, MAX_EVALUATIONS + 1):
            self.run(target)
            displacement = self.compliance_everywhere(in_single_precision=in_single_precision)
            max_tiles = MAX_GROWTH * self.tiles.count  # before `evaluate` adds some
            result = self.evaluate(displacement, accepted)
            is_accurate = result.rounding < MAX_ROUNDING * tolerance
            in_single_precision &= is_accurate
            is_final = is_accurate and self.tiles.count <= max_tiles
            if (is_final and result.start_residual < accepted) or count == MAX_EVALUATIONS:
                break
            if result.start_residual > 0:  # it can be zero: one point in contact, or all
                factor = TARGET_FRACTION * tolerance / result.start_residual
                target = result.residual * float(np.clip(factor, *REDUCTION_RANGE))
            self.correction = self.tiles.take(displacement) - self.compliance(self.s)
        return result, displacement

    def evaluate(self, displacement: Field, tolerance: float) -> Evaluation:
        """Compare C s at all points with the indenter, and add the tiles in which it is penetrated.

        The tolerance is that of the residual of the start.
        """
        gap = self.tiles.take(displacement) - self.obstacle
        level = float(gap[self.s > 0].mean())
        squares = self.add_penetrated(displacement, level)
        gap = self.tiles.take(displacement) - self.obstacle - level
        gap_of_start, start_residual = self.lay(gap, tolerance)
        rounding = 0.0
        if displacement.dtype == np.float32:
            relative = self.contact.stress_rounding(displacement.dtype)
            rounding = relative * self.contact.as_residual(squares)
        return Evaluation(level, gap_of_start, self.residual(gap, self.s), start_residual, rounding)

    def add_penetrated(self, displacement: Field, level: float) -> float:
        """Add tiles in which C s - level is below h, and those around.

        Returns the sum of the squares of C s over the grid.
        """
        penetrated = np.zeros(self.tiles.used.shape, dtype=np.bool_)
        fields = (displacement, level, self.contact.obstacle, self.tiles.used, penetrated)
        squares = float(self.grid.rows.sums(1, kernels.mark_penetrated, *fields)[0])
        if penetrated.any():
            is_periodic = self.tiles.is_periodic
            around = maximum_filter(penetrated, 3, mode="wrap" if is_periodic else "constant")
            tiles = Tiles(self.tiles.used | around, is_periodic=is_periodic)
            s = np.zeros((tiles.count, SIDE * SIDE))
            s[self.tiles.used[tiles.used]] = self.s
            self.place(tiles, s)
        return squares

    def run(self, tolerance: float) -> None:
        """Projected conjugate gradients on the tiles, to a natural residual on them.

        At points that are not active, s = 0 and the gap is not negative: nothing moves there, and
        they do not count in the residual.
        """
        s, height = self.s, self.obstacle - self.correction
        w = self.compliance(s).astype(np.float64)
        active = np.zeros(s.shape, dtype=np.bool_)
        force, last_force, direction, last_direction, move = (np.zeros_like(s) for _ in range(5))
        slope, length = 0.0, 1.0  # K preconditions well: the natural length of a move is 1
        for _ in range(MAX_STEPS):
            self.pause()
            gap = w - height
            force, last_force = last_force, force
            squares = kernels.balance(s, gap, active, force)
            if self.contact.as_residual(squares) < tolerance:
                break
            z = self.map_displacement(force)
            direction, last_direction = last_direction, direction
            fields = (s, active, force, last_force, last_direction, direction, move)
            slope, is_clipped = kernels.find_move(z, *fields, slope, length, self.total)
            change = self.compliance(move)
            curvature = dot(move, change)
            best = -dot(move, gap) / curvature if curvature > 0 else 1.0
            exact = not is_clipped and (best <= 1 or float((s + best * move).min()) >= 0)
            fraction, factor, restart = choose(best, exact)
            length *= factor
            if restart:
                slope = 0.0
            s = np.maximum(s + fraction * move, 0.0)
            w += fraction * change
        self.s = s
