"""Tiles of 8 x 8 grid points: fields that are kept only where the contact can be."""

from concurrent.futures import ThreadPoolExecutor
from itertools import product
from typing import Any

import numpy as np

from gfmd_cli.grid.arrays import Field, Mask

SIDE = 8  # points per side of a tile
CHUNK = 256  # tiles of a matrix product: its operands stay in the cache


class Tiles:
    """Some tiles of a grid; a field on them has the shape (tiles, 64)."""

    def __init__(self, used: Mask, *, is_periodic: bool = True) -> None:
        """`used` has one value per tile of the grid, shape (points_y / 8, points / 8).

        On a periodic grid the first tiles of a row or column are next to the last ones.
        """
        self.used, self.is_periodic = used, is_periodic
        self.rows, self.columns = np.nonzero(used)
        self.count = len(self.rows)
        number = np.full(used.shape, self.count)  # unused tiles share the number of an empty one
        number[used] = np.arange(self.count)
        if is_periodic:
            number = np.pad(number, 1, "wrap")
        else:
            number = np.pad(number, 1, constant_values=self.count)
        self.neighbours = np.stack(
            [number[self.rows + i, self.columns + j] for i, j in product((0, 1, 2), repeat=2)],
            axis=1,
        )
        """Numbers of the tile and the eight around it, shape (tiles, 9)."""

    def take(self, field: Any) -> Any:
        """The values of a field or mask of the grid on the tiles."""
        return _blocks(field)[self.used].reshape(self.count, SIDE * SIDE)

    def put(self, values: Field, field: Field) -> None:
        """Overwrite a field of the grid by values on the tiles, and by zero elsewhere."""
        field[...] = 0.0
        self.overwrite(values, field)

    def overwrite(self, values: Field, field: Field) -> None:
        """Overwrite a field of the grid on the tiles."""
        _blocks(field)[self.used] = values.reshape(self.count, SIDE, SIDE)

    def convolve(self, matrix: Field, values: Field, pool: ThreadPoolExecutor | None) -> Field:
        """The convolution of values on the tiles with the kernel of `convolution_matrix`."""
        padded = np.zeros((self.count + 1, SIDE * SIDE), dtype=matrix.dtype)
        padded[:-1] = values
        out = np.empty(values.shape, dtype=matrix.dtype)

        def multiply(start: int) -> None:
            chunk = slice(start, start + CHUNK)
            window = padded[self.neighbours[chunk]].reshape(-1, len(matrix))
            np.matmul(window, matrix, out=out[chunk])

        starts = range(0, self.count, CHUNK)
        list(map(multiply, starts) if pool is None else pool.map(multiply, starts))
        return out


def convolution_matrix(kernel: Field) -> Field:
    """The matrix of a convolution, from the values on 3 x 3 tiles to those on the middle one.

    `kernel` holds the values at distances from -8 to 8 points along both axes, shape (17, 17). The
    matrix has the shape (576, 64) and is in single precision.
    """
    matrix = np.zeros((9, SIDE, SIDE, SIDE, SIDE), dtype=np.float32)
    point = np.arange(SIDE)
    for tile, shift in enumerate(product((-1, 0, 1), repeat=2)):
        i, j = (point - (SIDE * along + point[:, None]) for along in shift)
        near = (np.abs(i) <= SIDE)[:, None, :, None] & (np.abs(j) <= SIDE)[None, :, None, :]
        i, j = (np.clip(distance, -SIDE, SIDE) + SIDE for distance in (i, j))
        matrix[tile] = np.where(near, kernel[i[:, None, :, None], j[None, :, None, :]], 0.0)
    return matrix.reshape(9 * SIDE * SIDE, SIDE * SIDE)


def _blocks(field: Any) -> Any:
    """A view of a field of the grid, with axes (tile row, tile column, row, column in the tile)."""
    down, right = field.shape
    return field.reshape(down // SIDE, SIDE, right // SIDE, SIDE).swapaxes(1, 2)
