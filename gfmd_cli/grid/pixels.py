"""Values that are constant on pixels, on other pixels of the same map."""

import numpy as np

from gfmd_cli.grid.arrays import Field
from gfmd_cli.grid.transposition import Span


def average_along_x(values: Field, target: int) -> Field:
    """Means over `target` columns of equal width instead of those of the array."""
    columns = np.moveaxis(values, -1, 0)
    averaged = average_rows(columns, (0, target), len(columns), target)
    return np.ascontiguousarray(np.moveaxis(averaged, 0, -1))


def covered_rows(span: Span, source: int, target: int) -> Span:
    """The rows, of `source` in all, on which the rows `span` of `target` in all lie."""
    first, last = span
    return first * source // target, -(-last * source // target)


def average_rows(values: Field, span: Span, source: int, target: int) -> Field:
    """Means over the rows `span` of `target` rows of equal width; `values` are `covered_rows`."""
    start, stop = covered_rows(span, source, target)
    edges = np.arange(span[0], span[1] + 1) * source  # in units of 1 / target of a row
    first = edges[:-1] // target
    out = np.zeros((span[1] - span[0], *values.shape[1:]))
    for step in range(-(-source // target) + 1):
        row = first + step
        overlap = np.minimum(edges[1:], (row + 1) * target) - np.maximum(edges[:-1], row * target)
        weight = np.maximum(overlap, 0) / source
        weight = weight.reshape(-1, *[1] * (values.ndim - 1))
        out += weight * values[np.minimum(row, stop - 1) - start]
    return out
