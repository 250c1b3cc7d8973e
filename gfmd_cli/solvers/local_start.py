"""A start on the finest grid whose cost is in proportion to the contact.

At small pressure most of a grid is never in contact. From a coarse grid on, the contact is solved
only on tiles that it can reach: those around the contact of the next coarser grid. The unknown is
the pressure,

    minimise <s C s> / 2 - <s h>  over s >= 0 on the tiles, <s> = p,

and the method is that of Polonsky & Keer, Wear 231, 206 (1999), with the stiffness K restricted to
the tiles as preconditioner (Vollebregt, Tribol. Int. 78, 40, 2014, uses its transform on the whole
grid). On the finest grid C s is then evaluated at all points. This shows tiles that the
displacement enters elsewhere, which are added, and the error of the operators on tiles, which is
corrected in the next solve on the tiles. The displacement is finally laid on the indenter and
handed to the solver on the whole grid, which measures its residual.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gfmd_cli.grid.arrays import Field, Mask
from gfmd_cli.physics.contact import Contact
from gfmd_cli.solvers.local_kernels import penetration
from gfmd_cli.solvers.projected_move import choose
from gfmd_cli.solvers.tile_operators import TileOperators
from gfmd_cli.solvers.tiles import SIDE, Tiles

EXPONENTS = (0.2, 1.3)  # of k(q) for which the solve on tiles converges in about 20 steps
SMALLEST = 512  # points per side from which on a solve on tiles is faster
LARGEST_SHARE = 0.065  # of the tiles; with more a solve on the whole grid is faster: measured
REACH = 2  # points by which the contact may grow from a grid to the next
COARSE_TOLERANCE = 0.03  # on grids before the finest; measured: 0.01 to 0.1 differ by 5 %
FIRST_TOLERANCE = 6e-3  # before the operators on tiles are corrected
REDUCTION = (1e-3, 0.02)
"""Smallest and largest factor of the residual that a solve on tiles aims at. The smallest is the
relative error of their operators; the largest is a choice, because an evaluation at all points
takes longer than a few steps on tiles."""
MARGIN = 0.9  # of the tolerance, for the estimated residual of the displacement on the indenter
AIM = 0.25  # of the tolerance, for that residual after the next solve on the tiles
MAX_EVALUATIONS = 6  # of the displacement at all points
SWEEPS = 3  # of relaxation of the displacement on the indenter; 2 to 6 take about as long
DAMPING = 0.8  # of the relaxation
LAYING = 2.0  # largest gap that is closed, over the move that takes the stress off this point
MAX_STEPS = 60  # on the same tiles


@dataclass
class Start:
    """A displacement to start from."""

    u: Field
    """u >= h, and u = h at the points that are pressed on the indenter."""
    transforms: float
    """Transforms by their share of points of the finest grid."""
    contact: Contact
    """The contact on the grid of this displacement."""


def start_from(
    coarse: Contact,
    pressure: Field,
    finer: list[Contact],
    tolerance: float,
    pause: Callable[[], None] = lambda: None,
) -> Start | None:
    """The start on the last of the `finer` grids from the contact pressure on a coarser one.

    Each grid must have twice the points of the one before. `pause` is called at every step and may
    end the solve by an exception. None where a solve on the whole grid is faster or the operators
    on tiles do not apply.
    """
    last, transforms = finer[-1], 0.0
    shapes = [contact.grid.shape for contact in (coarse, *finer)]
    doubled = all(b == tuple(2 * n for n in a) for a, b in pairwise(shapes))
    if not doubled or not pressure.any() or not all(map(tiles_apply, finer)):
        return None
    for contact in finer:
        tiles = Tiles(_tiles_in_reach(coarse.grid.shape, pressure > 0))
        if tiles.count > LARGEST_SHARE * tiles.used.size:
            return None
        solve = _LocalSolve(contact, tiles, _refined(pressure, tiles), pause)
        del pressure  # its memory is needed now
        if contact is last:
            u = solve.displacement(tolerance)
        else:
            solve.run(COARSE_TOLERANCE)
            pressure = np.empty(contact.grid.shape)
            solve.tiles.put(solve.s, pressure)
        transforms += solve.transforms * contact.grid.size / last.grid.size
        coarse = contact
    return Start(u, transforms, last)


def tiles_apply(contact: Contact) -> bool:
    """Whether the operators on tiles apply, and a solve on tiles can be faster."""
    grid, (low, high) = contact.grid, EXPONENTS
    if contact.may_touch is not None or grid.dimension == 1 or not grid.whole:
        return False
    if min(grid.shape) < SMALLEST:
        return False
    if any(points % SIDE for points in grid.shape) or min(grid.spacings) < 0.5 * max(grid.spacings):
        return False
    exponents = np.diff(np.log(contact.line[1:])) / np.diff(np.log(np.arange(1, contact.line.size)))
    return bool(low <= exponents.min() and exponents.max() <= high)


def _tiles_in_reach(shape: tuple[int, ...], touching: Mask) -> Mask:
    """The tiles of a grid of twice the points that contact on a grid of this shape can reach."""
    down, right = (2 * points // SIDE for points in shape)
    used = np.zeros((down, right), dtype=np.bool_)
    i, j = np.nonzero(touching)
    for y in (2 * i - REACH, 2 * i + 1 + REACH):
        for x in (2 * j - REACH, 2 * j + 1 + REACH):
            used[y // SIDE % down, x // SIDE % right] = True
    return used


def _refined(field: Field, tiles: Tiles) -> Field:
    """A field, interpolated linearly to the tiles of a grid of twice the points."""
    half = SIDE // 2
    nodes = np.arange(half + 1)
    i = (tiles.rows[:, None] * half + nodes) % field.shape[0]
    j = (tiles.columns[:, None] * half + nodes) % field.shape[1]
    hats = np.maximum(1 - np.abs(np.arange(SIDE)[:, None] / 2 - nodes), 0.0)
    values: Field = hats @ field[i[:, :, None], j[:, None, :]] @ hats.T
    return values.reshape(tiles.count, -1)


@dataclass
class Evaluation:
    """C s at all points, compared with the indenter."""

    level: float
    """The level of C s where it is, in the mean, at the indenter in contact."""
    gap: Field
    """Gap on the tiles of the displacement that is laid on the indenter."""
    residual: float
    """Natural residual of s and C s."""
    laid_residual: float
    """Natural residual of the displacement that is laid on the indenter: an estimate, without the
    change of the stress by points outside of the tiles."""
    entered: Mask
    """Other tiles in which C s is below h."""


class _LocalSolve:
    """The pressure s on tiles of one grid."""

    def __init__(self, contact: Contact, tiles: Tiles, s: Field, pause: Callable[[], None]) -> None:
        self.contact, self.grid, self.pause = contact, contact.grid, pause
        self.operators = TileOperators(contact)
        self.transforms = 0.0
        self.place(tiles, s)

    def place(self, tiles: Tiles, s: Field) -> None:
        """Take these tiles, and s with the mean pressure of the contact."""
        self.tiles, self.s = tiles, s * (self.total / float(s.sum()))
        self.height = tiles.take(self.contact.height)
        self.correction: Field | float = 0.0
        self.map_pressure = self.operators.displacement(tiles)
        self.map_displacement = self.operators.stress(tiles)

    @property
    def total(self) -> float:
        """Sum of the pressure over the grid."""
        return self.contact.pressure * self.grid.size

    def compliance(self, s: Field) -> Field:
        """C s on the tiles."""
        self.transforms += self.operators.transforms
        return self.map_pressure(s)

    def displacement(self, tolerance: float) -> Field:
        """Solve, with the exact operator in the end; return the displacement on the indenter."""
        aim = FIRST_TOLERANCE
        for count in range(1, MAX_EVALUATIONS + 1):
            self.run(aim)
            result = self.evaluate()
            is_good = result.laid_residual < MARGIN * tolerance and not result.entered.any()
            if is_good or count == MAX_EVALUATIONS:
                break
            reduction = np.clip(AIM * tolerance / result.laid_residual, *REDUCTION)
            aim = result.residual * float(reduction)
            self.correct(result.entered)
        u = self.grid.empty()  # only now: the solves on tiles need memory, too
        np.subtract(self.values_everywhere, result.level, out=u)
        np.maximum(u, self.contact.height, out=u)
        self.tiles.overwrite(self.height + result.gap, u)
        return u

    def evaluate(self) -> Evaluation:
        """C s at all points, which stays in `grid.padded`, compared with the indenter."""
        contact, grid = self.contact, self.grid
        self.tiles.put(self.s, self.values_everywhere)
        grid.unfilter_padded(contact.stiffness)
        self.transforms += 2
        gap = self.tiles.take(self.values_everywhere) - self.height
        level = float(gap[self.s > 0].mean())
        gap -= level
        laid, stress = self.lay(gap)
        entered = np.zeros(self.tiles.used.shape, dtype=np.bool_)
        sweep = (self.values_everywhere, level, contact.height, self.tiles.used, entered)
        (outside,) = grid.rows.sums(1, penetration, *sweep)
        residual, laid_residual = (
            contact.as_residual(float(outside) + _dot(violation, violation))
            for violation in (np.minimum(gap, self.s), np.minimum(laid, stress))
        )
        return Evaluation(level, laid, residual, laid_residual, entered)

    def lay(self, gap: Field) -> tuple[Field, Field]:
        """The gap on the tiles after C s is laid on the indenter, and the stress.

        With C s the stress is s; K times the change of the gap is added. Laying leaves a residual
        of short waves, which projected Jacobi sweeps reduce.
        """
        stiffness = self.contact.point_stiffness
        laid = np.where(self.s > stiffness * gap, 0.0, np.maximum(gap, 0.0))
        stress = self.s + self.map_displacement(laid - gap)
        for _ in range(SWEEPS):
            move = stress / stiffness
            relaxed = np.maximum(laid - DAMPING * move, 0.0)
            laid = np.where(laid < LAYING * move, 0.0, relaxed)
            stress = self.s + self.map_displacement(laid - gap)
        return laid, stress

    def correct(self, entered: Mask) -> None:
        """Add tiles that were entered, and correct the operator on tiles by the exact C s."""
        if entered.any():
            tiles = Tiles(self.tiles.used | _with_neighbours(entered))
            s = np.zeros((tiles.count, SIDE * SIDE))
            s[self.tiles.used[tiles.used]] = self.s
            self.place(tiles, s)
        self.correction = self.tiles.take(self.values_everywhere) - self.compliance(self.s)

    @property
    def values_everywhere(self) -> Field:
        """The values that the grid transforms in place."""
        return self.grid.padded[..., : self.grid.points]

    def residual(self, gap: Field, s: Field) -> float:
        """The natural residual on the tiles."""
        violation = np.minimum(gap, s)
        return self.contact.as_residual(_dot(violation, violation))

    def run(self, tolerance: float) -> None:
        """Projected conjugate gradients on the tiles, to a natural residual on them."""
        s, height = self.s, self.height - self.correction
        w = self.compliance(s)
        direction, force = np.zeros_like(s), np.zeros_like(s)
        slope, length = 0.0, 1.0  # K preconditions well: the natural length of a move is 1
        for _ in range(MAX_STEPS):
            self.pause()
            gap = w - height
            pressed = s > 0
            gap -= float(gap[pressed].mean())
            if self.residual(gap, s) < tolerance:
                break
            active = pressed | (gap < 0)
            last, force = force, _balanced(-gap, active)
            z = _balanced(self.map_displacement(force), active)
            old, slope = slope, _dot(z, force)
            # Polak-Ribiere+
            beta = max(0.0, (slope - _dot(z, last)) / old) if old > 0 else 0.0
            direction = _balanced(z + beta * direction, active)
            if _dot(direction, force) <= 0:
                direction = z
            del last, z  # memory for the compliance
            step = length * direction
            move = np.maximum(step, -s)
            change = self.compliance(move)
            curvature = _dot(move, change)
            best = -_dot(move, gap) / curvature if curvature > 0 else 1.0
            exact = np.array_equal(step, move) and (
                best <= 1 or float((s + best * move).min()) >= 0
            )
            choice = choose(best, exact)
            length *= choice.factor
            if choice.restart:
                slope = 0.0
            s = np.maximum(s + choice.fraction * move, 0.0)
            w += choice.fraction * change
            scale = self.total / float(s.sum())
            s *= scale
            w *= scale
        self.s = s


def _balanced(values: Field, points: Mask) -> Field:
    """The values at some points, with a mean of zero over them; zero at the others."""
    balanced = np.where(points, values, 0.0)
    balanced -= points * (float(balanced.sum()) / np.count_nonzero(points))
    return balanced


def _dot(one: Field, other: Field) -> float:
    """Sum of products, which does not depend on the threads of BLAS."""
    return float(np.einsum("ij,ij->", one, other))


def _with_neighbours(used: Mask) -> Mask:
    """Tiles and the eight around each."""
    for axis in range(2):
        used = used | np.roll(used, 1, axis) | np.roll(used, -1, axis)
    return used
