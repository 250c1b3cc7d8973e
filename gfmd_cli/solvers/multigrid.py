"""A multigrid preconditioner that takes the contact points into account.

One V-cycle for a local approximation of K on the free points: on every level a nine-point
Laplacian or, where k(q) is steep, its square, scaled to k(q) of the waves that the level resolves,
so that any k(q) is possible.

On the finest level the points of contact are held. As in truncated multigrid (Kornhuber, Numer.
Math. 69, 167, 1994), the hat functions of coarser levels are truncated at these points, so that no
hat is lost because a contact lies under it. The energy of the truncation is not computed, but
approximated by a penalty: springs tie the coarse hats to zero at the points held, as stiff as the
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

The cycle is symmetric. It is positive as long as the eigenvalues of the damped Jacobi iteration,
the damping times A over its diagonal, are below 2. Without springs `JACOBI_EIGENVALUE` is the
largest. Springs do not increase it, because they act on waves for which the operator is soft.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
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

MIN_LEVEL_POINTS = 4  # points along the shorter side on the coarsest level
MAX_PIXEL_ASPECT = 1.5  # beyond, only the shorter side is coarsened, which leaves 1 / (2 / 1.5)
MAX_LAPLACIAN_GROWTH = 5.0  # growth of k(q) above which the Laplacian is squared; n = 2.3; measured
SPRING_STIFFNESS = 0.125, 0.25  # over diagonal element and k(2 q) / k(q): Laplacian, its square
JACOBI_EIGENVALUE = 1.76  # largest of the damped Jacobi iteration; 1.6 to 1.85 do as well
STEEPEST = 4.5  # exponent above which the levels limit the growth of k(q); measured, see below
COARSEST_STEP_PAIRS = 4  # pairs of smoothing steps on the coarsest level
TIE_UNIT = 1.0 / 64  # of the integers in `ties`


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
    """The operator of a level with pixels of dy x dx, and the stiffness of its springs.

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
    damping = JACOBI_EIGENVALUE * diagonal / largest
    spring = TIE_UNIT * SPRING_STIFFNESS[is_squared] * diagonal * growth * density
    laplacian = map(np.float32, (centre, along_y, along_x, corner))
    damped = map(np.float32, (diagonal / damping, spring, spring / damping))
    return kernels.Operator._make([*laplacian, is_squared, *damped])


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
        if _is_half(coarser, shape):
            rows = rows.coarser()
        elif rows.is_whole:
            rows = rows.with_count(coarser[0])
        else:
            return
        shape = coarser


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


class Multigrid:
    """The preconditioner of one contact."""

    transforms = 0

    def __init__(self, contact: Contact, grid: Grid) -> None:
        self.z = grid.as_rows(grid.padded)
        levels = _levels(contact)
        self.operators = [level.operator for level in levels]
        self.scale = np.float32(1.0 / levels[0].scale)
        self.ratios = [np.float32(fine.scale / coarse.scale) for fine, coarse in pairwise(levels)]
        self.rows, *self.coarse_rows = (level.rows for level in levels)
        # Fields between two levels whose points are not exactly halved: the residual of the finer
        # one, later P times the result on the coarser one. Elsewhere kernels do both on the way.
        self.between = [
            None if _is_half(coarse.shape, fine.shape) else np.empty(fine.shape, np.float32)
            for fine, coarse in pairwise(levels)
        ]
        sizes = [(level.rows, level.shape[1]) for level in levels[1:]]
        self.rhs, self.x, self.y = (
            [rows.empty_with_halo(n, dtype=np.float32) for rows, n in sizes] for _ in range(3)
        )
        self.weights = [rows.empty_with_halo(n, dtype=np.int8) for rows, n in sizes]
        self.ties = [rows.empty_with_halo(4, n + 1, dtype=np.uint8) for rows, n in sizes]

    def apply(
        self, sigma: Field, contact_state: ContactState, threshold: int, change: Field
    ) -> tuple[float, float]:
        """See `preconditioners.Preconditioner.apply`."""
        self.rows.exchange_halo(contact_state)
        self.set_ties(contact_state, threshold)  # penalty terms
        fields = (self.rows.with_halo(sigma), contact_state, threshold, self.operators[0])
        # one smoothing step from zero on the finest level, and the restriction of the residual
        self.restrict(kernels.first_residual, fields, 0)
        self.descend()  # pre-smoothing
        for level in range(len(self.coarse_rows) - 2, -1, -1):  # correction, post-smoothing
            x, y, correction = self.x[level], self.y[level], self.correction(level + 1)
            if self.operators[level + 1].is_squared:
                self.smooth(level, y, x, *correction)
                self.smooth(level, x, y)
            else:
                self.smooth(level, None, y, *correction)
        # correction and one smoothing step on the finest level, and the sums
        slope, z_change = self.rows.sums_with_halo(
            2, kernels.last_smooth, *fields, *self.correction(0), self.scale, change, self.z
        )
        return float(slope), float(z_change)

    def descend(self) -> None:
        """Smooth and restrict, from the finest of the coarse levels to the coarsest."""
        last = len(self.coarse_rows) - 1
        for level, rhs in enumerate(self.rhs[:last]):
            operator, y = self.operators[level + 1], self.y[level]
            if operator.is_squared:
                self.smooth(level, None, y)
            fields = (rhs, operator, self.ties[level], y, not operator.is_squared)
            self.restrict(kernels.residual, fields, level + 1)
        self.smooth(last, None, self.y[last])
        for _ in range(COARSEST_STEP_PAIRS):
            self.smooth(last, self.y[last], self.x[last])
            self.smooth(last, self.x[last], self.y[last])

    def restrict(self, kernel: Kernel, fields: tuple[Any, ...], level: int) -> None:
        """Restrict the residual that a kernel computes on the next finer level to `level`."""
        residual, rows = self.between[level], self.coarse_rows[level]
        if residual is None:
            rows.run_from_finer(kernel, fields, self.rhs[level : level + 1])
        else:
            self.finer_rows(level).run(kernel, *fields, residual)
            rows.run(transfer.restrict, residual, self.rhs[level])

    def correction(self, level: int) -> tuple[SingleField, np.float32]:
        """The result on a level as `_interpolate` takes it, and the ratio of the scales."""
        interpolated, y = self.between[level], self.y[level]
        if interpolated is None:
            return self.coarse_rows[level].aligned_with_finer(y), self.ratios[level]
        self.finer_rows(level).run(transfer.interpolate, y, interpolated)
        return interpolated, self.ratios[level]

    def finer_rows(self, level: int) -> LocalRows:
        """The rows of the next finer level."""
        return self.coarse_rows[level - 1] if level > 0 else self.rows

    def smooth(
        self,
        level: int,
        old: SingleField | None,
        new: SingleField,
        coarse: SingleField | None = None,
        ratio: np.float32 = kernels.ZERO,
    ) -> None:
        """Write the result of a smoothing step on `old` plus P coarse to `new`.

        Without `old`, the result of a smoothing step from zero takes its place.
        """
        rhs, rows = self.rhs[level], self.coarse_rows[level]
        matrix = (rhs, self.operators[level + 1], self.ties[level])
        start = (rhs if old is None else old, old is None, rhs if coarse is None else coarse, ratio)
        rows.run_with_halo(kernels.smooth, *matrix, *start, new)
        rows.exchange_halo(new)

    def set_ties(self, contact_state: ContactState, threshold: int) -> None:
        """Compute the penalty terms of the coarse levels from the points held."""
        for level, rows in enumerate(self.coarse_rows):
            targets = (self.ties[level], self.weights[level])
            if level == 0:
                source = (contact_state, threshold, 0)
            else:
                source = (self.weights[level - 1], transfer.WHOLE_WEIGHT, 1)
            halved = self.between[level] is None
            kernel = transfer.compute_ties if halved else transfer.compute_any_ties
            rows.run_from_finer(kernel, source, targets)
