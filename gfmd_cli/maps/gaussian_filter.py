"""The areal Gaussian low-pass filter of ISO 16610-61, for maps and profiles."""

import numpy as np

from gfmd_cli.grid.arrays import Field, row_blocks
from gfmd_cli.grid.plans import fast_length

MIN_SPACINGS = 3
"""Fewest spacings of the map in a cut-off wavelength: ISO 25178-3 for optical instruments."""
ROUNDED_UP = 1.05  # two digits of this multiple of a cut-off are no less than the cut-off
REACH = 1.6
"""Largest distance with a weight, in cut-off wavelengths; beyond, weights are below rounding."""


def gaussian_filter(
    heights: Field, spacing: tuple[float, ...], cutoff: float, *, periodic: bool
) -> Field:
    """Heights without the waves that are much shorter than a cut-off wavelength.

    The weights exp(-pi r^2 / (alpha cutoff)^2) with alpha = sqrt(ln 2 / pi) (ISO 16610-21 and -61)
    leave the fraction `transmission` of a wave. A periodic map is multiplied by it in Fourier
    space. In a map with borders a straight line is fitted to the heights around each point with
    these weights, along x and then along y; its value there is the new height. Far from the
    borders this is the weighted mean; at the borders it keeps planes (the moments 0 and 1 of the
    weights, ISO 16610-28). A sum over points is not the integral: a wave of the cut-off wavelength
    keeps 0.5019 of its amplitude if the cut-off is 4 spacings, 0.560 if it is 3.

    Parameters
    ----------
    heights : shape (rows, columns) or (points,)
    spacing : distance of the points along each axis [m]
    cutoff : cut-off wavelength, the nesting index of the standards [m], `MIN_SPACINGS` of the
        smallest spacing or more
    periodic : whether the map is repeated
    """
    filtered = heights
    for step in reversed(spacing):  # each pass filters the last axis and turns the map
        filtered = (_repeated if periodic else _with_ends)(filtered, step, cutoff).T
    return np.ascontiguousarray(filtered)


def transmission(frequency: Field, cutoff: float) -> Field:
    """Fraction of its amplitude that a wave keeps, 2^-(cutoff / wavelength)^2.

    `frequency` is 1 / wavelength along one axis; the fractions of both axes are multiplied.
    """
    return np.exp2(-((cutoff * frequency) ** 2))


def _repeated(lines: Field, step: float, cutoff: float) -> Field:
    """Periodic lines, filtered along the last axis in Fourier space."""
    points = lines.shape[-1]
    kept = transmission(np.fft.rfftfreq(points, step), cutoff)
    return np.fft.irfft(kept * np.fft.rfft(lines), points)


def _with_ends(lines: Field, step: float, cutoff: float) -> Field:
    """Lines with ends, filtered along the last axis by weighted linear regression.

    The sums of the regression are correlations of the lines with the weights, here by transforms of
    lines with zeros behind their ends.
    """
    points = lines.shape[-1]
    reach = min(int(REACH * cutoff / step), points - 1)
    if not reach:
        return lines  # no neighbour has a weight
    distance = np.arange(-reach, reach + 1)
    weight = np.exp(-((np.pi * step * distance / cutoff) ** 2) / np.log(2))
    length = fast_length(points + reach)
    moments = np.zeros((3, length))
    moments[:, distance] = weight * distance ** np.arange(3)[:, None]
    transfer = np.fft.rfft(moments).conj()
    ones = np.fft.rfft(np.ones(points), length)
    total, first, second = np.fft.irfft(transfer * ones, length)[:, :points]
    rows = np.atleast_2d(lines)
    filtered = np.empty_like(rows)
    for block in row_blocks(rows):
        modes = np.fft.rfft(rows[block], length)
        mean, tilt = (np.fft.irfft(modes * each, length)[:, :points] for each in transfer[:2])
        filtered[block] = (second * mean - first * tilt) / (second * total - first**2)
    return filtered.reshape(lines.shape)
