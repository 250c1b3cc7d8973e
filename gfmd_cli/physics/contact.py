"""The contact problem, in reduced units.

Minimise sum_q k(q) |u(q)|^2 / 2 + p <u> over u >= h. At the solution sigma = K u + p >= 0,
g = u - h >= 0 and sigma g = 0 everywhere; K is diagonal in q with symbol k(q), k(0) = 0.

Heights, displacements and gaps are in units of h_std, stresses in Delta_sigma, so that the solvers
see one scale, whatever the units of a scene; the stiffness is then in Delta_sigma / h_std.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import sqrt
from typing import Any, ClassVar

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.grid.arrays import Field, Mask, dot, row_blocks
from gfmd_cli.grid.fft_grid import ALL_ROWS, Grid, Shape
from gfmd_cli.physics import kernels
from gfmd_cli.physics.persson import Shells
from gfmd_cli.physics.waves import Texture, texture

PRESSURE_RANGE = (1e-30, 1e6)
"""Reduced pressures that are solved. Above 2^17 every grid is in full contact, and sigma - p only
loses digits: the maximum of |K h| on N x N points is at most N times its rms value, and N <= 2^17.
Far below the lower limit squares of p* underflow; rounding errors of sigma exceed p* much earlier.
"""
RANGE_ROUNDING = 1e-12  # of a pressure at a limit, as the last one of a geometric sequence
UNCERTAINTY_FACTOR = 2.0
"""Factor of the rms of min(g, sigma) below which gaps and stresses may be errors.

The contact state of a point with such a gap and such a stress is uncertain. Measured for n = 0.5 to
4 and slabs at residuals of 1e-2 to 1e-4 (128^2): the area was wrong by at most three points more
than these, and with a factor of 1 by up to 17. At n = 0.25 by up to 9.
"""
VOID_HEIGHT = -1e30
"""Height where nothing can touch [h_std]: below all displacements, with a square in range."""


def is_solved(p_star: float) -> bool:
    """Whether a reduced pressure is in the range of those that are solved, up to rounding."""
    low, high = PRESSURE_RANGE
    return low * (1 - RANGE_ROUNDING) <= p_star <= high * (1 + RANGE_ROUNDING)


@dataclass(frozen=True)
class Contact:
    """Contact problem of a scene at one pressure."""

    boundary: ClassVar[str] = "periodic"
    """What `grid.boundary` is."""
    grid: Grid
    height: Field
    """Indenter h, shape `grid.shape`, zero mean; filled in where it is unknown."""
    stiffness: Field
    """k(q), shape `grid.spectral_shape`, zero at q = 0."""
    pressure: float
    """Nominal pressure p* = p / Delta_sigma."""
    may_touch: Mask | None = None
    """Points where the height is known; the others never touch. None where all are known."""

    @property
    def is_periodic(self) -> bool:
        """Whether the cell is repeated periodically."""
        return self.boundary == "periodic"

    @cached_property
    def obstacle(self) -> Field:
        """Lower limit of u: the height where it is known, `VOID_HEIGHT` elsewhere."""
        if self.may_touch is None:
            return self.height
        return np.where(self.may_touch, self.height, VOID_HEIGHT)

    @cached_property
    def k_along_x(self) -> Field:
        """k(q) of the waves along x, from q = 0 on, shape (points/2 + 1,)."""
        return self.grid.along_x(self.stiffness)

    @cached_property
    def grid_of_moves(self) -> Grid:
        """The grid for K times a move: in single precision, because moves are small.

        Lines stay in double precision: their transforms cost nothing, and a line contact at n = 4
        needs the digits.
        """
        return self.grid.in_single() if self.grid.dimension == 2 else self.grid

    @property
    def exponents(self) -> tuple[float, float]:
        """Smallest and largest exponent d ln k / d ln q of the waves along x."""
        k = self.k_along_x[1:]
        exponents = np.diff(np.log(k)) / np.diff(np.log(np.arange(1, k.size + 1)))
        return float(exponents.min()), float(exponents.max())

    @cached_property
    def dispersion(self) -> tuple[Field, Field]:
        """|q| L / 2 pi of the waves along the axes, rising from the longest wave, and their k(q).

        L is the side along x. On a square grid the waves along x are all of them.
        """
        grid = self.grid
        m, k = np.arange(1.0, self.k_along_x.size), self.k_along_x[1:]
        is_square = grid.points == grid.points_y and grid.length == grid.length_y
        if grid.dimension == 1 or is_square:
            return m, k
        column = grid.along_y(self.stiffness)
        m = np.concatenate([m, np.arange(1, column.size) * (grid.length / grid.length_y)])
        order = np.argsort(m, kind="stable")
        return m[order], np.concatenate([k, column[1:]])[order]

    def apply_stiffness(self, field: Field, out: Field) -> Field:
        """K times a field. Written to `out`, which is returned."""
        return self.grid.apply(self.stiffness, field, out)

    def stress(self, u: Field, out: Field) -> Field:
        """sigma = K u + p. Written to `out`, which is returned."""
        return self.grid.apply(self.stiffness, u, out, self.pressure)

    def recompute(self, u: Field, sigma: Field) -> float:
        """Compute sigma from u, or u from sigma if that is the unknown; return the residual."""
        self.stress(u, out=sigma)
        return self.residual(u, sigma)

    def reference_level(self, u: Field, sigma: Field) -> float:
        """Level from which displacements enter the energy: their mean, as k(0) = 0."""
        return self.grid.mean(u)

    def clear_untouchable(self, values: Any, rows: slice = ALL_ROWS) -> Any:
        """Set values on some rows to zero, or false, where nothing can touch, in place."""
        if self.may_touch is not None:
            values *= self.may_touch[rows]
        return values

    @cached_property
    def height_range(self) -> float:
        """Highest minus lowest height [h_std]."""
        return self.grid.max(float(self.height.max())) - self.grid.min(float(self.height.min()))

    def settle(self, u: Field) -> Field:
        """Lift `u` above the indenter and lower it until it touches, in place; return it."""
        nearest = np.inf
        for rows in row_blocks(u):
            np.maximum(u[rows], self.obstacle[rows], out=u[rows])
            nearest = min(nearest, float(np.min(u[rows] - self.obstacle[rows])))
        nearest = self.grid.min(nearest)
        if nearest > 0:
            for rows in row_blocks(u):
                u[rows] -= nearest
                np.maximum(u[rows], self.obstacle[rows], out=u[rows])
        return u

    def lay_pressed(self, u: Field, sigma: Field, residual: float) -> float:
        """Lay pressed points on the indenter if the gap of some is below the error of u.

        Contact is u = h to the last bit. The residual contains only the gap of such a point.
        A point is laid if its stress is larger than the error of sigma and stays compressive when
        this point alone is laid. `residual` is the natural residual of u and sigma. Returns the
        estimate of what the rounding of the change of sigma adds to the residual, 0 if no point was
        laid.
        """
        error = UNCERTAINTY_FACTOR * residual * min(self.pressure, 1.0)
        moves = self.grid_of_moves
        change = moves.padded[..., : moves.points]
        fields = map(moves.as_rows, (self.obstacle, u, sigma, change))
        limits = (self.point_stiffness, error)
        missed, squares = moves.rows.sums(2, kernels.lay_pressed, *fields, *limits)
        if not missed:
            return 0.0
        for rows in row_blocks(u):
            np.copyto(u[rows], self.obstacle[rows], where=change[rows] != 0)
        moves.filter_padded(self.stiffness)
        sigma += change
        return self.stress_rounding(moves.real) * self.as_residual(squares)

    @cached_property
    def largest_stiffness(self) -> float:
        """k_max, the largest k(q)."""
        return self.grid.max(float(self.stiffness.max()))

    @cached_property
    def point_stiffness(self) -> float:
        """Stress at a point per displacement of this point alone: the mean of k over all q."""
        by_column = self.stiffness.reshape(-1, self.stiffness.shape[-1]).sum(axis=0)
        total = self.grid.total(float(np.sum(by_column * self.grid.multiplicity())))
        return total / self.grid.size

    def set_displacement(self, u: Field, gap: Field, touching: Mask) -> None:
        """u <- h in contact, else h + gap, where a point that can touch has a gap >= 0.

        `u` and `gap` may be the same array.
        """
        lowest = 0.0 if self.may_touch is None else np.where(self.may_touch, 0.0, -np.inf)
        np.maximum(gap, lowest, out=u)
        u[touching] = 0.0
        u += self.height

    def residual(self, u: Field, sigma: Field) -> float:
        """Natural residual: rms of min(g, sigma), divided by min(p*, 1).

        Zero exactly at the solution. All solvers stop by this residual.
        """
        fields = map(self.grid.as_rows, (self.obstacle, u, sigma))
        (total,) = self.grid.rows.sums(1, kernels.squared_violations, *fields)
        return self.as_residual(total)

    def as_residual(self, squares: float) -> float:
        """Natural residual from the sum of the squares of min(g, sigma)."""
        return sqrt(squares / self.grid.size) / min(self.pressure, 1.0)

    def stress_rounding(self, dtype: "np.dtype[Any]") -> float:
        """Estimated rms error of the stress by rounding, divided by the rms displacement.

        Rounding is white noise, and short waves dominate its stress: eps / 2 times k_max.
        """
        return 0.5 * float(np.finfo(dtype).eps) * self.largest_stiffness

    def rounding(self, field: Field) -> float:
        """Estimated contribution of the rounding of a displacement to the residual."""
        squares = sum(dot(field[rows], field[rows]) for rows in row_blocks(field))
        return self.stress_rounding(field.dtype) * self.as_residual(self.grid.total(squares))

    def mirrored(self) -> "Contact":
        """This contact, or with a free boundary the periodic contact of the mirrored map."""
        return self

    def coarsen(self, shape: Shape, *, is_sampled: bool = False) -> "Contact":
        """The same contact on a coarser grid.

        The heights are low-pass filtered, or those of every other point of the grid where half of
        them are asked for and `is_sampled` is true, which needs no transform.
        """
        grid = self.grid.coarser(shape)
        k = self.grid.cut(self.stiffness, grid)
        if is_sampled and self.grid.shape == tuple(2 * points for points in shape):
            height = np.ascontiguousarray(self.height[(slice(None, None, 2),) * grid.dimension])
        else:
            height = self.grid.resample(self.height, grid)
        return Contact(grid, height, k, self.pressure, self._coarse_mask(grid))

    def _coarse_mask(self, grid: Grid) -> Mask | None:
        """Points of a coarser grid with a known height on a part of their pixel."""
        if self.may_touch is None:
            return None
        return self.grid.average(self.may_touch.astype(np.float64), grid) > 0


@dataclass(frozen=True)
class Scene:
    """Surface and elastomer on a grid, independent of the pressure."""

    grid: Grid
    height: Field
    """(h - <h>) / h_std."""
    stiffness: Field
    """k h_std / Delta_sigma, shape `grid.spectral_shape`."""
    mean_height: float
    """<h> [m]."""
    h_std: float
    """Root-mean-square height [m]."""
    delta_sigma: float
    """Unit of pressure [Pa]: the rms stress in full contact (of the half-space, for a slab)."""
    shells: Shells
    """The spectrum of the resolved surface with its stiffness, in physical units."""
    may_touch: Mask | None = None
    """Points where the height is known; the others never touch. None where all are known."""
    contact_type: Callable[..., Contact] = Contact
    """Makes a contact of the scene from the first fields of `Contact`."""

    @property
    def has_voids(self) -> bool:
        """Whether some points never touch."""
        return self.may_touch is not None

    @property
    def highest(self) -> float:
        """Largest height that can touch [h_std]: the mean gap without load."""
        known = self.height if self.may_touch is None else self.height[self.may_touch]
        return self.grid.max(float(known.max(initial=-np.inf)))  # a process may have none

    @cached_property
    def texture(self) -> Texture:
        """Texture of the surface; computed once, by one transform."""
        return texture(self.grid, self.height)

    def in_metres(self, field: Field) -> Field:
        """A height or displacement in metres, from the level of the given surface."""
        return field * self.h_std + self.mean_height

    def contact(self, p_star: float) -> Contact:
        """The contact at reduced pressure p*. Raises InputError where that is out of range."""
        if not is_solved(p_star):
            low, high = PRESSURE_RANGE
            raise InputError(
                f"load: p* = {p_star:g} is out of range, {low:g} to {high:g}: p* = 1 is "
                f"{self.delta_sigma:.3g} Pa here; are moduli, heights and lengths in Pa and m?"
            )
        return self.contact_type(self.grid, self.height, self.stiffness, p_star, self.may_touch)
