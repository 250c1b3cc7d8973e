"""Tiles of 8 x 8 grid points: fields that are kept only where the contact can be."""

from itertools import product
from typing import Any

import numpy as np

from gfmd_cli.grid.arrays import Field, Mask
from gfmd_cli.grid.shared_transforms import BLOCK_ROWS

SIDE = BLOCK_ROWS  # points per side of a tile


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

    @property
    def blocks(self) -> list[int]:
        """Numbers of the rows of tiles that are used, for `Grid.filter_padded`."""
        return [int(row) for row in np.flatnonzero(self.used.any(axis=1))]

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


def _blocks(field: Any) -> Any:
    """A view of a field of the grid, with axes (tile row, tile column, row, column in the tile)."""
    down, right = field.shape
    return field.reshape(down // SIDE, SIDE, right // SIDE, SIDE).swapaxes(1, 2)
