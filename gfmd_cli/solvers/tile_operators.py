"""The elastic operators on tiles, at a cost in proportion to the number of tiles.

A pressure s causes the displacement C s with C = F^-1 1/k(q) F. On tiles it is evaluated as the sum
of a short-ranged and a smooth part, like the potential of charges in the method of Ewald, Ann.
Phys. 369, 253 (1921):

    1 / k(q) = P(a, x^2) / k(q) + Q(a, x^2) / k(q),    x = q / (2 alpha),    k ~ q^(2 a) at small q.

P and Q = 1 - P are the regularised incomplete gamma functions. P / k is smooth at q = 0, so that
its kernel decays like a Gaussian; it is summed directly over a tile and the eight around it. Q / k
decays like a Gaussian; it is evaluated by transforms on a grid with a quarter of the points along
each axis, with pressures and displacements interpolated by B-splines (Essmann et al., J. Chem.
Phys. 103, 8577, 1995). For k ~ q, P = erf x and the kernel of P / k is erfc(alpha r) / r.

With a free boundary k ~ q^n, and both parts are known in real space: the smooth one from
`free_compliance.smooth_part`, the short-ranged one as the rest of the displacement by a pixel.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache, partial
from itertools import pairwise
from math import prod
from typing import Any, ClassVar

import numpy as np
from scipy.special import gammainc, gammaincc

from gfmd_cli.grid.arrays import Field, Integers
from gfmd_cli.grid.convolution import PaddedTransform, padded_shape
from gfmd_cli.grid.fft_grid import Grid, Shape
from gfmd_cli.grid.shared_transforms import side_by_side
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.free_compliance import smooth_part
from gfmd_cli.physics.free_contact import FreeContact
from gfmd_cli.solvers.local_kernels import convolve
from gfmd_cli.solvers.tiles import SIDE, Tiles

COARSENING = 4  # spacing of the grid of the smooth part, in grid points
DECAY_EXPONENT = 3.0
"""x^2 at the highest wavenumber of that grid (Q ~ exp(-x^2)). The error of C s, relative to its
standard deviation, is then smallest, 7e-4 (default surface, 1024^2, n = 1, p* = 0.01)."""
SPLINE_ORDER = 4  # of the B-splines: cubic
LARGEST_X = 4.0  # Q is below 1e-6 of its largest value there
TABLE_SIZE = 4096  # values of Q: the error of linear interpolation is below 1e-6
TILES_PER_CHUNK = 256  # tiles that a thread convolves at a time
MIN_CELL_POINTS = 48  # per side of the cell on which kernels are computed; a choice

TileMap = Callable[[Field], Field]
"""Maps a field on tiles to another one."""


class TileOperators:
    """Compliance and stiffness on tiles of a grid; a subclass provides what the boundary changes.

    Parameters
    ----------
    short_ranged, stiffness : kernels of P / k and of k, as for `convolution`
    transform, symbol : transform of the grid of the smooth part, and its symbol Q / k
    """

    first_node: ClassVar[int] = 0
    """Number of the point of the coarse grid at the first point of the grid."""

    def __init__(
        self,
        grid: Grid,
        short_ranged: Field,
        stiffness: Field,
        transform: PaddedTransform,
        symbol: Field,
    ) -> None:
        self.grid, self.transform = grid, transform
        self.short_ranged, self.stiffness = short_ranged, stiffness
        y, x = (np.arange(points // 2 + 1) / points for points in transform.padded)
        self.symbol = (symbol / _spline_spectrum(y, x) ** 2).astype(np.float32)
        self.weights = _weights().astype(np.float32)
        self.transforms = prod(transform.padded) / grid.size
        """Transforms of one displacement, in units of transforms of the whole grid."""

    def displacement(self, tiles: Tiles) -> TileMap:
        """The map s -> C s on these tiles, up to a rigid displacement."""
        nodes, values = self._nodes(tiles), np.empty(self.transform.shape, np.float32)
        rows, columns = np.unravel_index(nodes, values.shape)
        near = convolution(self.short_ranged, tiles, self.grid.rows.pool)

        def map_pressure(s: Field) -> Field:
            s = s.astype(np.float32)
            loads: Any = np.bincount(nodes.ravel(), (s @ self.weights).ravel(), values.size)
            self.transform.apply(self.symbol, loads, out=values)
            w: Field = values[rows, columns] @ self.weights.T
            w += near(s)
            return w

        return map_pressure

    def stress(self, tiles: Tiles) -> TileMap:
        """The map u -> K u on these tiles, with the kernel of K cut off at 8 points."""
        return convolution(self.stiffness, tiles, self.grid.rows.pool)

    def _nodes(self, tiles: Tiles) -> Integers:
        """Numbers of the points of the coarse grid around each tile, shape (tiles, 25)."""
        down, right = self.transform.shape
        nodes = _nodes_of_tile() + self.first_node
        i = (tiles.rows[:, None] * (SIDE // COARSENING) + nodes) % down
        j = (tiles.columns[:, None] * (SIDE // COARSENING) + nodes) % right
        return (i[:, :, None] * right + j[:, None, :]).reshape(tiles.count, -1)


class PeriodicOperators(TileOperators):
    """The operators of a periodic cell."""

    def __init__(self, contact: Contact) -> None:
        grid, k_along_x, alpha = contact.grid, contact.k_along_x, _alpha(contact.grid)
        order = 0.5 * float(np.log2(k_along_x[2] / k_along_x[1]))  # a
        k, q = _stiffness_of_small_cell(contact)
        stiffness = _near_values(k)
        q[0, 0], k[0, 0] = 2 * np.pi / grid.length, k_along_x[1]  # P / k is constant at small q
        short_ranged = _near_values(gammainc(order, (q / (2 * alpha)) ** 2) / k)
        shape = tuple(points // COARSENING for points in grid.shape)
        coarse, half = grid.coarser(shape), slice(shape[0] // 2 + 1)  # q_y >= 0
        symbol: Field = np.interp(coarse.wavenumber(half) / (2 * alpha), *_table_of_q(order))
        k = grid.cut(contact.stiffness, coarse)[half] * COARSENING**2
        np.divide(symbol, k, out=symbol, where=k > 0)
        symbol[0, 0] = 0.0
        transform = PaddedTransform(shape, shape, "single", len(coarse.rows.parts))
        super().__init__(grid, short_ranged, stiffness, transform, symbol)


class FreeOperators(TileOperators):
    """The operators of an elastomer of stiffness k_n q^n that extends beyond the map."""

    first_node: ClassVar[int] = SPLINE_ORDER // 2 - 1  # splines beyond the border overlap tiles

    def __init__(self, contact: FreeContact) -> None:
        grid, compliance, near = contact.grid, contact.compliance, (SIDE + 1, SIDE + 1)
        pixel = compliance.elastomer.free_compliance(near, grid.spacings) * compliance.unit
        short_ranged = pixel - _smooth_part(contact, near, 1)
        sides = [MIN_CELL_POINTS * spacing for spacing in grid.spacings]
        cell = Grid(MIN_CELL_POINTS, points_y=MIN_CELL_POINTS, length=sides[1], length_y=sides[0])
        k = compliance.elastomer.stiffness(cell.wavenumber(), grid.length) / compliance.unit
        shape = tuple(points // COARSENING + SPLINE_ORDER - 1 for points in grid.shape)
        padded = padded_shape(shape)
        transform = PaddedTransform(shape, padded, "single", len(grid.rows.parts))
        symbol = transform.symbol_of(_smooth_part(contact, shape, COARSENING))
        super().__init__(grid, short_ranged, _near_values(k), transform, symbol)


def convolution(kernel: Field, tiles: Tiles, pool: ThreadPoolExecutor | None) -> TileMap:
    """The convolution of values on tiles with a kernel, in single precision.

    The kernel is even along both axes, and given at distances from 0 to 8 points, shape (9, 9).
    """
    quadrant = kernel.astype(np.float32)
    quadrant[0] /= 2
    quadrant[:, 0] /= 2
    padded = np.zeros((tiles.count + 1, SIDE * SIDE), np.float32)  # unused tiles are the last one
    chunks = list(pairwise([*range(0, tiles.count, TILES_PER_CHUNK), tiles.count]))

    def apply(values: Field) -> Field:
        padded[:-1] = values
        out = np.empty(values.shape, np.float32)
        arrays = (padded, tiles.neighbours, quadrant, out)
        side_by_side(pool, [partial(convolve, *arrays, *chunk) for chunk in chunks])
        return out

    return apply


@lru_cache(maxsize=1)
def _table_of_q(order: float) -> tuple[Field, Field]:
    """x and Q(a, x^2), for the orders a of all grids of a contact."""
    x = np.linspace(0.0, LARGEST_X, TABLE_SIZE)
    return x, gammaincc(order, x * x)


def _alpha(grid: Grid) -> float:
    """The inverse range of the short-ranged part [1/m]."""
    return float(np.pi / (2 * COARSENING * max(grid.spacings) * np.sqrt(DECAY_EXPONENT)))


def _smooth_part(contact: FreeContact, shape: Shape, step: int) -> Field:
    """The smooth part of the displacement by unit pressure on a pixel, at every so many points."""
    grid, elastomer = contact.grid, contact.compliance.elastomer
    assert elastomer.exponent is not None
    y, x = (step * h * np.arange(m) for m, h in zip(shape, grid.spacings, strict=True))
    kernel = smooth_part(elastomer.exponent, _alpha(grid), np.hypot(y[:, None], x))
    k_n = float(elastomer.stiffness(np.ones(1))[0])
    return kernel * (contact.compliance.unit / k_n * float(np.prod(grid.spacings)))


def _nodes_of_tile() -> Integers:
    """Points of the coarse grid whose splines overlap a tile, along one axis from its corner."""
    return np.arange(SIDE // COARSENING + SPLINE_ORDER - 1) - (SPLINE_ORDER // 2 - 1)


def _weights() -> Field:
    """Values of the splines of the coarse grid at the points of a tile, shape (64, 25)."""
    distances = np.abs(np.arange(SIDE)[:, None] / COARSENING - _nodes_of_tile())
    line = (np.maximum(2 - distances, 0) ** 3 - 4 * np.maximum(1 - distances, 0) ** 3) / 6
    return np.einsum("ia,jb->ijab", line, line).reshape(SIDE * SIDE, -1)


def _spline_spectrum(y: Field, x: Field) -> Field:
    """Fourier transform of the splines of a grid, at waves with so many periods per spacing."""
    return np.sinc(y)[:, None] ** SPLINE_ORDER * np.sinc(x) ** SPLINE_ORDER


def _stiffness_of_small_cell(contact: Contact) -> tuple[Field, Field]:
    """k(q) and |q| of a smaller cell with the same spacings: every so many modes of the contact."""
    grid = contact.grid
    down, right = (
        max(step for step in range(1, max(points // MIN_CELL_POINTS, 1) + 1) if points % step == 0)
        for points in grid.shape
    )
    x = np.arange(0, grid.points // 2 + 1, right)
    q = np.hypot(grid.mode_number_y()[::down, None], x) * (2 * np.pi / grid.length)
    return contact.stiffness[::down, ::right].copy(), q


def _near_values(symbol: Field) -> Field:
    """The kernel of a symbol at distances from 0 to 8 points along both axes."""
    return np.fft.irfft2(symbol)[: SIDE + 1, : SIDE + 1]
