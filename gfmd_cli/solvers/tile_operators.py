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
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammainc, gammaincc

from gfmd_cli.grid.arrays import Field
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.contact import Contact
from gfmd_cli.solvers.tiles import SIDE, Tiles, convolution_matrix

COARSENING = 4  # spacing of the grid of the smooth part, in grid points
DECAY = (
    3.0  # x^2 at the highest wavenumber of that grid. The error of C s, relative to its standard
)
# deviation, is then smallest, 7e-4 (default surface, 1024^2, n = 1, p* = 0.01)
ORDER = 4  # of the B-splines: cubic
LARGEST_X = 4.0  # Q is below 1e-6 of its largest value there
TABLE = 4096  # values of Q: the error of linear interpolation is below 1e-6
CELL = 48  # smallest number of points along a side of the cell on which kernels are computed

Indices: TypeAlias = NDArray[np.integer[Any]]

TileMap = Callable[[Field], Field]
"""Maps a field on tiles to another one."""


class TileOperators:
    """Compliance and stiffness of a contact on tiles of its grid."""

    def __init__(self, contact: Contact) -> None:
        self.grid = grid = contact.grid
        coarse = grid.coarser(tuple(points // COARSENING for points in grid.shape))
        self.coarse = replace(coarse, precision="single")
        alpha = np.pi / (2 * COARSENING * max(grid.spacings) * np.sqrt(DECAY))
        line = contact.line
        order = 0.5 * float(np.log2(line[2] / line[1]))  # a
        k, q = _stiffness_of_small_cell(contact)
        q[0, 0], k[0, 0] = 2 * np.pi / grid.length, line[1]  # P / k is constant at small q
        self.short_ranged = convolution_matrix(
            _near_values(gammainc(order, (q / (2 * alpha)) ** 2) / k)
        )
        k[0, 0] = 0.0
        self.stiffness = convolution_matrix(_near_values(k))
        x = np.linspace(0.0, LARGEST_X, TABLE)
        self.smooth = np.interp(self.coarse.wavenumber() / (2 * alpha), x, gammaincc(order, x * x))
        k = grid.cut(contact.stiffness, self.coarse)
        np.divide(self.smooth, k, out=self.smooth, where=k > 0)
        self.smooth[0, 0] = 0.0
        self.smooth /= _spline_spectrum(self.coarse) ** 2 * COARSENING**2
        self.weights = _weights()

    @property
    def transforms(self) -> float:
        """Transforms of one displacement, by their share of points."""
        return self.coarse.pair_count * self.coarse.size / self.grid.size

    def displacement(self, tiles: Tiles) -> TileMap:
        """The map s -> C s on these tiles, up to a rigid displacement."""
        nodes = self._nodes(tiles)
        values = self.coarse.padded[..., : self.coarse.points]
        rows, columns = np.unravel_index(nodes, self.coarse.shape)

        def map_pressure(s: Field) -> Field:
            loads = (s @ self.weights).ravel()
            density = np.bincount(nodes.ravel(), loads, minlength=self.coarse.size)
            values[...] = density.reshape(self.coarse.shape)
            self.coarse.filter_padded(self.smooth)
            w: Field = values[rows, columns] @ self.weights.T
            w += tiles.convolve(self.short_ranged, s, self.grid.rows.pool)
            return w

        return map_pressure

    def stress(self, tiles: Tiles) -> TileMap:
        """The map u -> K u on these tiles, with the kernel of K cut off at 8 points."""
        return lambda u: tiles.convolve(self.stiffness, u, self.grid.rows.pool)

    def _nodes(self, tiles: Tiles) -> Indices:
        """Numbers of the points of the coarse grid around each tile, shape (tiles, 25)."""
        down, right = self.coarse.shape
        nodes = _nodes_of_tile()
        i = (tiles.rows[:, None] * (SIDE // COARSENING) + nodes) % down
        j = (tiles.columns[:, None] * (SIDE // COARSENING) + nodes) % right
        return (i[:, :, None] * right + j[:, None, :]).reshape(tiles.count, -1)


def _nodes_of_tile() -> Indices:
    """Points of the coarse grid whose splines overlap a tile, along one axis from its corner."""
    return np.arange(SIDE // COARSENING + ORDER - 1) - (ORDER // 2 - 1)


def _weights() -> Field:
    """Values of the splines of the coarse grid at the points of a tile, shape (64, 25)."""
    distances = np.abs(np.arange(SIDE)[:, None] / COARSENING - _nodes_of_tile())
    line = (np.maximum(2 - distances, 0) ** 3 - 4 * np.maximum(1 - distances, 0) ** 3) / 6
    return np.einsum("ia,jb->ijab", line, line).reshape(SIDE * SIDE, -1)


def _spline_spectrum(grid: Grid) -> Field:
    """Fourier transform of the splines of a grid, shape `grid.spectral_shape`."""
    down, right = grid.shape
    y, x = np.fft.fftfreq(down), np.fft.rfftfreq(right)
    return np.sinc(y)[:, None] ** ORDER * np.sinc(x) ** ORDER


def _stiffness_of_small_cell(contact: Contact) -> tuple[Field, Field]:
    """k(q) and |q| of a smaller cell with the same spacings: every so many modes of the contact."""
    grid = contact.grid
    down, right = (
        max(step for step in range(1, max(points // CELL, 1) + 1) if points % step == 0)
        for points in grid.shape
    )
    x = np.arange(0, grid.points // 2 + 1, right)
    q = np.hypot(grid.mode_number_y()[::down, None], x) * (2 * np.pi / grid.length)
    return contact.stiffness[::down, ::right].copy(), q


def _near_values(symbol: Field) -> Field:
    """The kernel of a symbol at distances from -8 to 8 points along both axes."""
    kernel = np.fft.irfft2(symbol)
    return np.roll(kernel, (SIDE, SIDE), axis=(0, 1))[: 2 * SIDE + 1, : 2 * SIDE + 1]
