"""Values that are constant on pixels, on other pixels of the same map."""

import numpy as np

from gfmd_cli.grid.arrays import Field, Mask


def average_pixels(values: Field, shape: tuple[int, ...]) -> Field:
    """Means over the pixels of another grid of the same map; values are constant on a pixel."""
    for axis, target in enumerate(shape):
        values = np.moveaxis(_average_rows(np.moveaxis(values, axis, 0), target), 0, axis)
    return np.ascontiguousarray(values)


def _average_rows(values: Field, target: int) -> Field:
    """Means over `target` rows of equal width instead of those of the array."""
    source = len(values)
    edges = np.arange(target + 1) * source  # in units of 1 / target of a row
    first = edges[:-1] // target
    out = np.zeros((target, *values.shape[1:]))
    for step in range(-(-source // target) + 1):
        row = first + step
        overlap = np.minimum(edges[1:], (row + 1) * target) - np.maximum(edges[:-1], row * target)
        weight = np.maximum(overlap, 0) / source
        weight = weight.reshape(-1, *[1] * (values.ndim - 1))
        out += weight * values[np.minimum(row, source - 1)]
    return out


def any_in_pixels(mask: Mask, shape: tuple[int, ...]) -> Mask:
    """Which pixels of another grid of the same map share a part of their area with the mask."""
    shared: Mask = average_pixels(mask.astype(np.float64), shape) > 0
    return shared
