"""A multigrid preconditioner that takes the contact points into account.

One V-cycle for a local approximation of K on the free points: on every level a nine-point
Laplacian or, where k(q) is steep, its square, scaled to k(q) of the waves that the level resolves,
so that any k(q) is possible.

On the finest level the points of contact are held. As in truncated multigrid (Kornhuber, Numer.
Math. 69, 167, 1994), the hat functions of coarser levels are truncated at these points, so that no
hat is lost because a contact lies under it. The energy of the truncation is not computed, but
approximated by a penalty on coarse hats that are not zero at the points held, as stiff as the
operator of the level itself. This takes four bytes per coarse point, less than Galerkin stencils,
and the levels are not too stiff, as bilinear hats would be for a plate.

One smoothing step (damped Jacobi) before and after the correction suffices for the Laplacian, as
it does on the finest level. Its square takes two: with one, conjugate gradients take a tenth more
steps at n = 3 and a quarter more at n = 4.

The points of a level need not be half of those of the next finer one. An odd number is followed by
its half, rounded up to an even number, and hats are evaluated at the points of the finer level. On
pixels far from square, the second differences along y and x have the weights 1 / dy^2 and 1 / dx^2,
and only the direction of strong coupling is coarsened until the pixels are about square
(semi-coarsening; Trottenberg, Oosterlee & Schueller, Multigrid, 2001, section 5.1). A line is one
row of pixels without coupling along y.

Between contacts, the V-cycle moves waves that are longer than the distances of the contacts too
little. Such waves hardly change the residual, but determine the mean gap. Therefore, on large grids
and where k(q) is not steep, a coarse level is solved by two steps of conjugate gradients for K
itself and a softer penalty, which are preconditioned by the V-cycle from this level on
(`_LongWaves`). The result of these steps is not quite linear in the force.

Without these steps the cycle is symmetric. It is positive as long as the eigenvalues of the damped
Jacobi iteration, the damping times A over its diagonal, are below 2. Without a penalty
`JACOBI_EIGENVALUE` gives the largest. The penalty does not increase it, because it acts on waves
for which the operator is soft. The weight of a correction may be any positive number.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise, starmap
from math import inf, prod
from typing import Any

import numpy as np

from gfmd_cli.grid.arrays import Field, SingleField
from gfmd_cli.grid.fft_grid import Grid, Shape
from gfmd_cli.grid.rows import Kernel, LocalRows
from gfmd_cli.physics.contact import Contact
from gfmd_cli.solvers import multigrid_kernels as kernels
from gfmd_cli.solvers import multigrid_transfer_kernels as transfer
from gfmd_cli.solvers.contact_state import ContactState

# Transforms with other values of the constants, on 64^2 to 256^2, seeds 3 to 5:
# scripts/solver_constants.py with the arguments that stand beside them.
MIN_LEVEL_POINTS = 4  # points along the shorter side on the coarsest level
"""With 2 and 8 the transforms are 0.96 to 1.06 times as many, with 16: 0.97 to 1.15 times:
`multigrid.MIN_LEVEL_POINTS 2 8 16 --exponents 1 2 3 4`."""
MAX_PIXEL_ASPECT = 1.5  # beyond, only the shorter side is coarsened, to 3 : 4 at least
"""On pixels of 3 : 4 the transforms are 1.08 to 1.21 times as many with 1.1 or 1.3, the same with
2.5: `multigrid.MAX_PIXEL_ASPECT 1.1 1.3 2.5 --aspect 1.3333 --points 96 192 --exponents 1 2 3`. On
pixels of 1 : 2 with 2.5: 0.91 to 0.98 times at n = 1, 1.02 to 1.13 times at n = 2, 1.41 to 1.64
times at n = 3: `multigrid.MAX_PIXEL_ASPECT 2.5 --aspect 2 --exponents 1 2 3`."""
MAX_LAPLACIAN_GROWTH = 5.0  # growth of k(q) above which the Laplacian is squared; n = 2.3
"""If it is squared: 2 % fewer to 2 % more at n = 2, 4 to 7 % fewer at n = 2.2, where a step takes
longer by as much; if it is not: 8 to 12 % more at n = 2.5, 18 to 38 % more at n = 3:
`multigrid.MAX_LAPLACIAN_GROWTH 3 20 --exponents 2 2.2 2.5 3`."""
PENALTY_STIFFNESS = 0.125, 0.25  # of the Laplacian, of its square
"""Penalty over the product of the diagonal element and the growth k(2 q) / k(q). Half: 3 % fewer to
39 % more (n = 2); double: the same to 23 % more (n = 4):
`multigrid.PENALTY_STIFFNESS "(0.0625, 0.125)" "(0.25, 0.5)" --exponents 1 2 3 4`."""
JACOBI_EIGENVALUE = (1.04, 0.18), (1.76, 0.0)
"""The largest of the damped Jacobi iteration, as lines (a, b): at the growth g = k(2 q) / k(q) this
is the smallest a + b g. With 1.76 for all k the transforms are 1.19 to 1.48 times as many at
n = 0.5 to 1, 1.00 to 1.02 times from n = 1.5 on; with 1.6 in place of 1.76: 1.02 to 1.11 times
from n = 2 on, with 1.85: 0.93 to 1.00:
`multigrid.JACOBI_EIGENVALUE "((1.76, 0),)" "((1.04, 0.18), (1.6, 0))" "((1.04, 0.18), (1.85, 0))"
--exponents 0.5 0.75 1 1.5 2 3 4`."""
COARSE_WEIGHT = (0.55, 0.19), (1.16, -0.01)
"""Of the correction by the next coarser level, as lines (a, b) likewise. With the weight 1 the
transforms are 1.04 to 1.20 times as many at n = 0.5 and 0.75, 0.98 to 1.05 times at n = 1 to 2:
`multigrid.COARSE_WEIGHT "((1, 0),)" --exponents 0.5 0.75 1 1.5 2`; at p* = 0.001 and 0.003, 0.92 to
1.15 times (`--p-star 0.001 0.003`); at n = 3, 0.99 to 1.02 times. At n = 4 the weight is 1; with
1.12, 0.97 to 1.00 times: `"((1, 0),)" "((0.55, 0.19), (1.12, 0))" --exponents 3 4`."""
STEEPEST = 4.5  # exponent above which the levels limit the growth of k(q): `_with_limited_growth`
COARSEST_STEP_PAIRS = 4  # of smoothing steps on the coarsest level
"""With 1, 2 and 8, 4 % fewer to 5 % more:
`multigrid.COARSEST_STEP_PAIRS 1 2 8 --exponents 1 2 3 4`."""
LONG_WAVE_FRACTION = 0.02  # of the points: an eighth a side
"""With 0.07 the transforms are 1.05 to 1.07 times as many, with 0.005: 1.20 to 1.24 times. The
options for this and the next constants are `multigrid.LONG_WAVE_FRACTION 0.07 0.005 --points 1024
--exponents 0.5 1 --p-star 0.0001 0.003 0.03 0.1 0.5`."""
LONG_WAVE_STEPS = 2
"""With 1 the transforms are 1.00 to 1.05 times as many, with 3: 1.00 to 1.01 times."""
MIN_LONG_WAVE_POINTS = 96  # along the shorter side of the level; a choice
MAX_LONG_WAVE_GROWTH = 2.2  # of k(q) per octave; n = 1.1
"""Without the steps (0) the transforms are 1.20 to 1.24 times as many. With them for all k(q) (20),
0.96 to 1.02 times at n = 1.25 to 2 (`--exponents 1.25 1.5 2 --p-star 0.03 0.1 0.5`), in steps that
take longer."""
LONG_WAVE_PENALTY = 0.3  # factor of the penalty, per growth of k(q)
"""With 0.2 and 0.4 the transforms are 1.00 to 1.04 times as many, with 0.5: 1.01 to 1.06 times."""
PENALTY_UNIT = 1.0 / 64  # of the integers in `_CoarseLevel.penalty`


def has_coarser_level(grid: Grid) -> bool:
    """Whether the grid has a coarser level, without which the cycle is of no use."""
    return len(list(level_rows(grid))) > 1


def largest_growth(contact: Contact) -> float:
    """Largest growth of k(q) per octave on the levels."""
    return max(level.growth for level in _levels(contact))


@dataclass(frozen=True)
class Level:
    """Points and operator of a level."""

    shape: Shape
    rows: LocalRows
    operator: kernels.Operator
    scale: float
    """k(q) over the eigenvalue of the operator at a period of four points; energies are sums over
    the points of the finest level."""
    growth: float
    """k(2 q) / k(q), at most 2^STEEPEST."""


def _levels(contact: Contact) -> list[Level]:
    """The levels from the finest to the coarsest."""
    grid, levels = contact.grid, []
    finer = grid.size
    for shape, rows in level_rows(grid):
        dy, dx = (side / points for side, points in zip(_sides(grid), shape, strict=True))
        k_along = contact.k_along_x if dx <= dy else grid.along_y(contact.stiffness)
        m, k_along = _with_limited_growth(k_along)
        points = shape[1] if dx <= dy else shape[0]
        k, k_twice = np.interp([points / 4, points / 2], m, k_along).tolist()
        growth = k_twice / k
        operator = _operator(dy, dx, growth, 4 * prod(shape) / finer)
        quarter = 4.0 if operator.is_squared else 2.0  # eigenvalue at a period of four points
        scale = grid.size / prod(shape) * k / quarter
        levels.append(Level(shape, rows, operator, scale, growth))
        finer = prod(shape)
    return levels


def _with_limited_growth(k: Field) -> tuple[Field, Field]:
    """Modes m >= 1, and the least stiffness above k(q) that grows nowhere faster than q^STEEPEST.

    If a level were softer than that, its corrections, interpolated, would have large energies on
    the finer level. scripts/steep_stiffness.py counts the transforms with and without the limit.
    """
    m = np.arange(1.0, k.size)
    power = m**STEEPEST
    return m, np.maximum.accumulate((k[1:] / power)[::-1])[::-1] * power


def _operator(dy: float, dx: float, growth: float, density: float) -> kernels.Operator:
    """The operator of a level with pixels of dy x dx, and the stiffness of its penalty.

    The operator is A(q) = y l_y + x l_x - c l_y l_x with l = 2 - 2 cos(q d) along either axis, the
    weights y = 1 / dy^2 and x = 1 / dx^2, the larger of which is 1, and c = min(y, x) / 6; or its
    square. On square pixels this is the nine-point stencil whose error of order q^4 is the same in
    all directions. On oblong ones a larger c takes more steps. `density` is four times the number
    of points of the level over that of the next finer one.
    """
    y, x = ((min(dy, dx) / spacing) ** 2 for spacing in (dy, dx))
    corner = min(y, x) / 6
    centre, along_y, along_x = 2 * (y + x) - 4 * corner, y - 2 * corner, x - 2 * corner
    diagonal, largest = centre, 4 * (y + x) - 16 * corner
    is_squared = growth > MAX_LAPLACIAN_GROWTH
    if is_squared:
        diagonal = centre**2 + 2 * (along_y**2 + along_x**2) + 4 * corner**2
        largest **= 2
    damping = _at_growth(JACOBI_EIGENVALUE, growth) * diagonal / largest
    penalty = PENALTY_UNIT * PENALTY_STIFFNESS[is_squared] * diagonal * growth * density
    laplacian = map(np.float32, (centre, along_y, along_x, corner))
    damped = map(np.float32, (diagonal / damping, penalty, penalty / damping))
    return kernels.Operator._make([*laplacian, is_squared, *damped])


def _at_growth(lines: tuple[tuple[float, float], ...], growth: float) -> float:
    """The smallest a + b growth of some lines (a, b)."""
    return min(a + b * growth for a, b in lines)


def level_rows(grid: Grid) -> Iterator[tuple[Shape, LocalRows]]:
    """Numbers of points of the levels, and their rows, from the finest to the coarsest.

    A level has half the points of the next finer one, or the next even number, along x and y; if
    its pixels are far from square, only along their shorter side. A level that several processes
    share is followed only by one of exactly half the points along both.
    """
    shape: Shape = grid.points_y, grid.points
    rows, sides = grid.rows, _sides(grid)
    while True:
        yield shape, rows
        axes = list(zip(shape, coarsened_axes(shape, sides), strict=True))
        if any(n // 2 < MIN_LEVEL_POINTS for n, halved in axes if halved):
            return
        coarser = tuple(_half(n) if halved else n for n, halved in axes)
        if not (rows.is_whole or _is_half(coarser, shape)):
            return
        shape, rows = coarser, rows.coarser(coarser[0])


def _sides(grid: Grid) -> tuple[float, ...]:
    """Sides of the cell along y and x; a line is a row of pixels that are infinitely high."""
    return grid.sides if grid.dimension == 2 else (inf, *grid.sides)


def coarsened_axes(shape: Shape, sides: tuple[float, ...]) -> list[bool]:
    """Along which axes a grid is coarsened: where pixels are far from square, the shorter side."""
    spacings = [side / points for side, points in zip(sides, shape, strict=True)]
    return [spacing <= MAX_PIXEL_ASPECT * min(spacings) for spacing in spacings]


def _half(points: int) -> int:
    """Half of an even number, or the next even number."""
    return points // 2 if points % 2 == 0 else 2 * ((points + 3) // 4)


def _is_half(coarse: Shape, fine: Shape) -> bool:
    """Whether a level has exactly half the points of the next finer one along both axes."""
    return all(2 * few == many for few, many in zip(coarse, fine, strict=True))


def _level_of_long_waves(contact: Contact, levels: list[Level]) -> tuple[int, Grid] | None:
    """Number and grid of the level on which `_LongWaves` solves; None where this does not pay."""
    most = LONG_WAVE_FRACTION * contact.grid.size
    small = [number for number, level in enumerate(levels) if prod(level.shape) <= most]
    if not small or max(level.growth for level in levels) > MAX_LONG_WAVE_GROWTH:
        return None
    level = levels[small[0]]
    grid = replace(contact.grid.coarser(level.shape), precision="single")
    is_large = min(level.shape) >= MIN_LONG_WAVE_POINTS
    if not is_large or grid.rows.is_whole != level.rows.is_whole:
        return None
    return small[0], grid


class _CoarseLevel:
    """The fields of a level below the finest one, and the steps of the cycle on it."""

    def __init__(self, finer: Level, level: Level) -> None:
        self.operator, self.rows, self.finer_rows = level.operator, level.rows, finer.rows
        weight = _at_growth(COARSE_WEIGHT, finer.growth)
        self.ratio = np.float32(weight * finer.scale / level.scale)
        # Needed where the points are not exactly halved: the residual of the finer level, later P
        # times the result on this one. Elsewhere kernels do both on the way.
        is_half = _is_half(level.shape, finer.shape)
        self.between = None if is_half else np.empty(finer.shape, np.float32)
        zeros, n = level.rows.empty_with_halo, level.shape[1]
        self.rhs, self.x, self.y = (zeros(n, dtype=np.float32) for _ in range(3))
        self.weights = zeros(n, dtype=np.int8)
        self.penalty = zeros(4, n + 1, dtype=np.uint8)

    def set_penalty(self, finer: ContactState, threshold: int, weighted: int) -> None:
        """Compute the penalty from the points held, or the weights, of the finer level."""
        kernel = transfer.compute_penalty if self.between is None else transfer.compute_any_penalty
        self.rows.run_from_finer(kernel, (finer, threshold, weighted), (self.penalty, self.weights))

    def restrict(self, kernel: Kernel, *fields: Any) -> None:
        """Restrict the residual that a kernel computes on the finer level."""
        if self.between is None:
            self.rows.run_from_finer(kernel, fields, (self.rhs,))
        else:
            self.finer_rows.run(kernel, *fields, self.between)
            self.rows.run(transfer.restrict, self.between, self.rhs)

    def correction(self) -> tuple[SingleField, np.float32]:
        """The result as the kernel `_interpolate` takes it, and the ratio of the scales."""
        if self.between is None:
            return self.rows.aligned_with_finer(self.y), self.ratio
        self.finer_rows.run(transfer.interpolate, self.y, self.between)
        return self.between, self.ratio

    def smooth(
        self, old: SingleField | None, new: SingleField, coarser: "_CoarseLevel | None" = None
    ) -> None:
        """Write the result of a smoothing step on `old`, plus the correction, to `new`.

        Without `old`, the result of a smoothing step from zero takes its place.
        """
        matrix = (self.rhs, self.operator, self.penalty)
        start = (self.rhs if old is None else old, old is None)
        correction = coarser.correction() if coarser else (self.rhs, kernels.ZERO)
        arrays = (*matrix, *start, *correction, new)
        self.rows.run(kernels.smooth, *arrays, first=self.rows.halo)
        self.rows.exchange_halo(new)

    def post_smooth(self, coarser: "_CoarseLevel") -> None:
        """Add the correction, and smooth the result."""
        if self.operator.is_squared:
            self.smooth(self.y, self.x, coarser)
            self.smooth(self.x, self.y)
        else:
            self.smooth(None, self.y, coarser)


def _descend(levels: list[_CoarseLevel]) -> None:
    """Smooth and restrict, from the first of some levels to the last."""
    for finer, level in pairwise(levels):
        is_squared = finer.operator.is_squared
        if is_squared:
            finer.smooth(None, finer.y)
        fields = (finer.rhs, finer.operator, finer.penalty, finer.y, not is_squared)
        level.restrict(kernels.residual, *fields)


def _ascend(levels: list[_CoarseLevel]) -> None:
    """Correct and smooth, from the last of some levels to the first."""
    for coarser, level in pairwise(levels[::-1]):
        level.post_smooth(coarser)


def _v_cycle(levels: list[_CoarseLevel]) -> None:
    """The V-cycle on some levels, the last of which is the coarsest."""
    _descend(levels)
    last = levels[-1]
    last.smooth(None, last.y)
    for _ in range(COARSEST_STEP_PAIRS):
        last.smooth(last.y, last.x)
        last.smooth(last.x, last.y)
    _ascend(levels)


class _LongWaves:
    """Conjugate gradients for K itself and the penalty, on one coarse level.

    The V-cycle from this level on is their preconditioner. First comes the exact step along the
    constant, to which all directions are then kept conjugate: where few points are held, a uniform
    displacement is far softer than any wave. `grid` has the points of the level, and `levels` are
    the fields of this level and the coarser ones.
    """

    def __init__(self, contact: Contact, grid: Grid, level: Level, levels: list[_CoarseLevel]):
        self.grid, self.rows, self.levels = grid, level.rows, levels
        self.stiffness = contact.grid.cut(contact.stiffness, grid)
        self.stiffness *= contact.grid.size / grid.size / level.scale
        penalty = np.float32(LONG_WAVE_PENALTY * level.growth * level.operator.penalty_scale)
        zero = kernels.ZERO
        self.penalty_alone = level.operator._replace(
            centre=zero, y=zero, x=zero, corner=zero, penalty_scale=penalty
        )
        zeros = partial(level.rows.empty_with_halo, grid.points, dtype=np.float32)
        self.direction, self.change, self.change_of_constant = zeros(), zeros(), zeros()

    @np.errstate(over="ignore", invalid="ignore")  # no warnings, as in kernels
    def solve(self) -> None:
        """Compute `y` of the level from its `rhs`, which is overwritten by the residual."""
        first, total = self.levels[0], self.grid.total
        fields = first.y, first.rhs, self.direction, self.change, self.change_of_constant
        z, residual, direction, change, of_constant = map(self.rows.interior, fields)
        direction[...] = 1.0
        change[...] = 0.0  # K times a constant
        self._subtract_penalty()
        of_constant[...] = change
        held = -total(float(change.sum()))
        if not held > 0:  # the mean of the displacement is arbitrary
            _v_cycle(self.levels)
            return
        shift = np.float32(total(float(residual.sum())) / held)
        result, curvature = np.full_like(z, shift), 0.0
        residual += shift * of_constant
        self.rows.exchange_halo(first.rhs)
        for _ in range(LONG_WAVE_STEPS):
            _v_cycle(self.levels)
            if curvature > 0:
                direction *= np.float32(self.grid.dot(z, change) / curvature)
                direction += z
            else:
                direction[...] = z
            direction += np.float32(self.grid.dot(direction, of_constant) / held)
            self._apply_stiffness()
            self._subtract_penalty()
            curvature = -self.grid.dot(direction, change)
            if not curvature > 0:
                break
            length = np.float32(self.grid.dot(direction, residual) / curvature)
            result += length * direction
            residual += length * change
            self.rows.exchange_halo(first.rhs)
        z[...] = result
        self.rows.exchange_halo(first.y)

    def _apply_stiffness(self) -> None:
        """`change` <- minus K times the direction."""
        values = self.grid.padded[:, : self.grid.points]
        values[...] = self.rows.interior(self.direction)
        self.grid.filter_padded(self.stiffness)
        np.negative(values, out=self.rows.interior(self.change))

    def _subtract_penalty(self) -> None:
        """Subtract the penalty times the direction from `change`, which is the rhs of the kernel.

        The kernel reads a row of the rhs only to write the same row of the result.
        """
        self.rows.exchange_halo(self.direction)
        penalty = self.penalty_alone, self.levels[0].penalty
        fields = self.change, *penalty, self.direction, False, self.change
        self.rows.run(kernels.residual, *fields, first=self.rows.halo)


class Multigrid:
    """The preconditioner of one contact."""

    def __init__(self, contact: Contact, grid: Grid) -> None:
        self.z = grid.as_rows(grid.padded)
        levels = _levels(contact)
        finest = levels[0]
        self.rows, self.operator = finest.rows, finest.operator
        self.scale = np.float32(1.0 / finest.scale)
        self.coarse = list(starmap(_CoarseLevel, pairwise(levels)))
        self.finer = self.coarse[:1]
        self.solve_rest: Callable[[], None] = partial(_v_cycle, self.coarse)
        self.transforms = 0.0
        if (long_waves := _level_of_long_waves(contact, levels)) is not None:
            number, level_grid = long_waves
            self.finer, rest = self.coarse[:number], self.coarse[number - 1 :]
            self.solve_rest = _LongWaves(contact, level_grid, levels[number], rest).solve
            pairs = LONG_WAVE_STEPS * level_grid.size / contact.grid.size
            self.transforms = level_grid.pair_cost * pairs

    def apply(
        self, sigma: Field, contact_state: ContactState, threshold: int, change: Field
    ) -> tuple[float, float]:
        """See `preconditioners.Preconditioner.apply`."""
        first = self.coarse[0]
        self.rows.exchange_halo(contact_state)
        first.set_penalty(contact_state, threshold, 0)
        for finer, level in pairwise(self.coarse):
            level.set_penalty(finer.weights, transfer.WHOLE_WEIGHT, 1)
        fields = (self.rows.with_halo(sigma), contact_state, threshold, self.operator)
        # one smoothing step from zero on the finest level, and the restriction of the residual
        first.restrict(kernels.first_residual, *fields)
        _descend(self.finer)
        self.solve_rest()
        _ascend(self.finer)
        # correction and one smoothing step on the finest level, and the sums
        arrays = (*fields, *first.correction(), self.scale, change, self.z)
        slope, z_change = self.rows.sums(2, kernels.last_smooth, *arrays, first=self.rows.halo)
        return float(slope), float(z_change)
