"""Pictures of surfaces: heights on few pixels, for figures and reports."""

from dataclasses import dataclass

import numpy as np

from gfmd_cli.grid.arrays import Field, Mask

MAP_PIXELS = 192  # along the longer side of a picture: half a page wide, more cannot be seen
LINE_PIXELS = 2048  # of a line profile


@dataclass(frozen=True)
class Picture:
    """Heights of a map or a profile, with the extent that they cover."""

    heights: Field
    """Heights [m], shape (rows, columns) or (points,), NaN where missing."""
    sides: tuple[float, ...]
    """Extent along each axis [m]."""


def block_sums(values: Field, step: int) -> Field:
    """Sums over blocks of `step` points along every axis, smaller ones at the end."""
    for axis, points in enumerate(values.shape):
        values = np.add.reduceat(values, np.arange(0, points, step), axis)
    return values


def picture(heights: Field, sides: tuple[float, ...], missing: Mask | None = None) -> Picture:
    """A picture whose pixels are means over the known heights of some points."""
    pixels = MAP_PIXELS if heights.ndim == 2 else LINE_PIXELS
    step = -(-max(heights.shape) // pixels)
    known = np.ones(heights.shape, bool) if missing is None else ~missing
    count = block_sums(known.astype(np.float64), step)
    total = block_sums(np.where(known, heights, 0.0), step)
    return Picture(np.divide(total, count, out=np.full_like(total, np.nan), where=count > 0), sides)
