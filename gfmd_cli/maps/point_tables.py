"""Tables of points (x, y, height) on a full grid, whose positions were rounded."""

from io import BytesIO
from typing import BinaryIO

import numpy as np

from gfmd_cli.grid.arrays import Field
from gfmd_cli.maps.text_tables import cells, columns, is_numeric, table_formats

MAX_DEVIATION = 0.05  # of positions, over their distance; a choice: 0.015 of 0.33, 0.67, 1.00
EXACT = 1e-6  # such a deviation of positions that stay as they are: that of six digits
SAME_POSITION = 0.0, 0.5
"""Gaps between equal positions, over the largest gap: of tables, and of stages that jitter."""


def on_even_grid(file: BinaryIO) -> BinaryIO:
    """Points of a full grid with rounded positions as points at equal distances.

    The reader of points takes the first distance along an axis as that of all. Any other file is
    returned as it is. Raises ValueError for the positions of a full grid that are not even.
    """
    is_points = columns(file) == 3 and "xyz" in table_formats(file)
    file.seek(0)
    if not is_points:
        return file
    lines = file.read().replace(b",", b" ").replace(b";", b" ").splitlines()
    file.seek(0)
    is_row = (is_numeric(line) and len(cells(line)) == 3 for line in lines)
    first = next(number for number, row in enumerate(is_row) if row)
    try:
        points = np.loadtxt(lines[first:], comments=None, ndmin=2)
    except ValueError:  # a mark of missing heights, or a number in words
        return file
    indices = _on_grid(points[:, :2])
    if indices is None:
        return file
    even, deviation = _even(points[:, :2], indices)
    if deviation.max() > MAX_DEVIATION:
        raise ValueError(
            f"the positions along {'xy'[int(deviation.argmax())]} are not evenly spaced: they "
            f"deviate by up to {deviation.max():.2g} of their distance, and rounding by at most "
            f"{MAX_DEVIATION:g}: resample the map"
        )
    if deviation.max() < EXACT:
        return file
    table = BytesIO()
    table.writelines(line + b"\n" for line in lines[:first])
    np.savetxt(table, np.column_stack([even, points[:, 2]]), fmt="%.17g")
    table.seek(0)
    return table


def _on_grid(positions: Field) -> Field | None:
    """The numbers of columns and rows of points, None where they are not those of a full grid."""
    for part in SAME_POSITION:
        indices = np.column_stack([_index(axis, part) for axis in positions.T])
        nx, ny = indices.max(axis=0) + 1
        if min(nx, ny) > 1 and nx * ny == len(indices) == len(np.unique(indices @ [1, nx])):
            return indices
    return None


def _index(positions: Field, part: float) -> Field:
    """The number of each position in increasing order, equal for positions less apart."""
    values, inverse = np.unique(positions, return_inverse=True)
    gaps = np.diff(values)
    return np.append(0, np.cumsum(gaps > part * gaps.max(initial=0.0)))[inverse]


def _even(positions: Field, indices: Field) -> tuple[Field, Field]:
    """The best even positions, from zero, and the largest deviation along each axis from them."""
    means = indices.mean(axis=0), positions.mean(axis=0)
    shifted = indices - means[0], positions - means[1]
    step = (shifted[0] * shifted[1]).sum(axis=0) / (shifted[0] ** 2).sum(axis=0)
    return step * indices, np.abs(shifted[1] - step * shifted[0]).max(axis=0) / step
