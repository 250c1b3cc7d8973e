"""Height and slope parameters of measured maps (ISO 25178-2) and profiles (ISO 21920-2).

Heights are relative to their mean; missing heights are left out. Slopes are those of the
triangles between neighbouring points: each square of four known points is divided along both
diagonals, so that no direction is preferred.
"""

from collections.abc import Iterable
from functools import reduce
from itertools import product
from math import inf

import numpy as np

from gfmd_cli.grid.arrays import Field, MaskedField, row_blocks

CORRELATION_LEVEL = 0.2  # at the autocorrelation length: default of ISO 25178-2
MAP_NAMES = ("Sq", "Sa", "Ssk", "Sku", "Sz", "Sdq", "Sdr", "Sal")
PROFILE_NAMES = ("Pq", "Pa", "Psk", "Pku", "Pt", "Pdq", "Pdr", "Pal")
MIN_OVERLAP = 0.25  # of the map and its shifted copy; a choice: fewer points give no average


def roughness_parameters(
    heights: MaskedField, spacing: tuple[float, ...]
) -> dict[str, float | None]:
    """Parameters of a levelled map, S..., or of a profile, P..., by their names in the standards.

    Sq, Pq : root-mean-square height [m]
    Sa, Pa : mean absolute height [m]
    Ssk, Psk : third moment of the heights / Sq^3
    Sku, Pku : fourth moment of the heights / Sq^4; 3 for Gaussian heights
    Sz, Pt : distance of highest peak and deepest pit [m]
    Sdq, Pdq : root-mean-square gradient
    Sdr, Pdr : additional area of the surface / its projected area; of a profile, additional length
    Sal, Pal : shortest distance at which the autocorrelation decays to 0.2 [m]; None where it does
        not

    Parameters
    ----------
    heights : levelled heights [m], shape (rows, columns) or (points,), masked where missing
    spacing : distance of the points along each axis [m]
    """
    known = heights.compressed()
    z = known - known.mean()
    rms = float(np.sqrt(np.mean(z**2)))
    relative = z / (rms or np.nan)
    square = relative**2
    values = (
        rms,
        float(np.mean(np.abs(z))),
        float(np.mean(square * relative)),  # powers of 3 and 4 are slow
        float(np.mean(square**2)),
        float(np.ptp(z)),
        *_slopes(heights, spacing),
        _correlation_length(heights, spacing),
    )
    return dict(zip(MAP_NAMES if heights.ndim == 2 else PROFILE_NAMES, values, strict=True))


def _slopes(heights: MaskedField, spacing: tuple[float, ...]) -> tuple[float, float]:
    """Rms gradient and additional area of the triangles between neighbouring points.

    NaN where no square of points is known.
    """
    z = np.ma.filled(heights, np.nan)
    number, sums = 0, np.zeros(2)
    for block in row_blocks(z[1:]):
        rows = z[block.start : block.stop + 1]
        steps = [np.diff(rows, axis=axis) / step for axis, step in enumerate(spacing)]
        if z.ndim == 1:
            squares = [steps[0] ** 2]
        else:  # the triangle at each corner of a square has two of its edges
            sides = slice(None, -1), slice(1, None)
            squares = [steps[0][:, x] ** 2 + steps[1][y] ** 2 for y, x in product(sides, repeat=2)]
        known = np.isfinite(sum(squares))
        for square in squares:
            some = square[known]  # sqrt(1 + s) - 1 = s / (sqrt(1 + s) + 1) without cancellation
            sums += some.sum(), (some / (np.sqrt(1 + some) + 1)).sum()
            number += some.size
    if not number:
        return np.nan, np.nan
    square, area = sums / number
    return float(np.sqrt(square)), float(area)


def _correlation_length(heights: MaskedField, spacing: tuple[float, ...]) -> float | None:
    """Shortest distance of points with an autocorrelation of at most `CORRELATION_LEVEL`."""
    correlation = autocorrelation(heights)
    distance = distances(correlation.shape, spacing)
    low = correlation <= CORRELATION_LEVEL  # false where unknown
    return float(np.min(distance, initial=inf, where=low)) if low.any() else None


def distances(shape: tuple[int, ...], spacing: Iterable[float]) -> Field:
    """Length of every shift of a periodic array [unit of the spacing], in the order of an FFT."""
    square = np.zeros(())
    for points, step in zip(shape, spacing, strict=True):
        shift = np.minimum(np.arange(points), points - np.arange(points)) * step
        square = np.add.outer(square, shift**2)
    return np.sqrt(square, out=square)


def autocorrelation(heights: MaskedField) -> Field:
    """Autocorrelation over its value at zero shift, mean over the known pairs of points.

    A map is not continued periodically: pairs exist where the map and its shifted copy overlap.
    NaN where fewer than `MIN_OVERLAP` of the points do, and if all heights are equal.

    Returns an array of twice the shape, indexed by the shift as the output of an FFT.
    """
    known = ~np.ma.getmaskarray(heights)
    lowest = heights.min()
    mean = heights.mean() if lowest < heights.max() else lowest  # the mean of equal ones is rounded
    z = np.where(known, np.ma.filled(heights, 0.0) - mean, 0.0)
    shape, axes = [2 * points for points in z.shape], tuple(range(z.ndim))

    def pairs(values: Field) -> Field:
        modes = np.fft.rfftn(values, shape, axes)
        for rows in row_blocks(modes):
            modes[rows] *= modes[rows].conj()
        return np.fft.irfftn(modes, shape, axes)

    if known.all():
        overlaps = (np.abs(points - np.arange(2.0 * points)) for points in z.shape)
        count = reduce(np.multiply.outer, overlaps)
    else:
        count = np.rint(pairs(known.astype(np.float64)))
    few = count < MIN_OVERLAP * np.count_nonzero(known)
    means = pairs(z)
    with np.errstate(invalid="ignore", divide="ignore"):
        means /= count
        means[few] = np.nan
        means /= means.flat[0]
    return means
