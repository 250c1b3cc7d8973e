"""Heights between the points of a map: which interpolation suits a map, and the monotone one.

A Fourier series is exact for a map whose waves all end below the highest of its grid. For any other
map it overshoots: a plateau gets ripples, and contact then takes place on the ripples.
"""

from collections.abc import Callable
from typing import Literal

import numpy as np
from scipy.fft import dctn

from gfmd_cli.grid.arrays import Field, Mask, Modes, row_blocks
from gfmd_cli.grid.modes import multiplicity

Interpolation = Literal["fourier", "monotone"]
"""How heights between the points of a map are obtained."""
PadMode = Literal["wrap", "symmetric"]
"""How heights go on beyond the border of a map: repeated, or mirrored; modes of `numpy.pad`."""

MAX_SHORT_WAVES = 2e-3
"""Fraction of the squared slope in the shortest waves up to which a map is band-limited. Measured:
1e-14 in single precision, 1e-3 after rounding to 8 bits; 3e-3 for peaks exp(h), 7e-3 for clipped
maps, 0.05 to 0.4 for scans, steps and white noise."""
MAX_TIES = 0.1
"""Fraction of neighbours of equal height up to which a map has no plateaus. Measured: 0.04 after
rounding to 8 bits; 0.2 where a quarter of the area is clipped, 0.5 for stripes."""
MAX_JUMPS = 0.2
"""Fraction of the squared differences of neighbours in isolated jumps, for a map without steps.
Measured (20,000 random surfaces with 2 to 4 points per shortest wave, H = 0.1 to 1): at most 0.18
on 8 x 8 to 10 x 10 points, 0.11 on 16 x 16, 0.05 on 32 x 32, 0.03 on 64 x 64 and more; bumps, caps,
peaks exp(h), scans and white noise at most 0.1; steps of 3 times the rms height of the roughness
0.05 to 0.65, of 5 times 0.3 to 0.9, of 10 times 0.86 or more."""
ISOLATED_RATIO = 4.0  # ratio of a jump to the differences around it; a choice
SHORT_WAVE = 0.9  # of the highest wavenumber of the grid: beyond, a wave is one of the shortest
CUBIC_MARGIN = 4  # points beyond the border of the cell that the slopes of the monotone cubics need


def suited_interpolation(heights: Field, *, mirrored: bool = False) -> Interpolation:
    """The interpolation that suits a periodic map: "fourier" only if it is band-limited.

    `mirrored`: whether the map is these heights mirrored at their borders, with twice the sides.

    A band-limited map has no waves in the corners of its spectrum, |q| above the highest
    wavenumber along one axis. Waves at the highest wavenumbers along the axes are allowed without
    plateaus only: a random surface sampled at two points per shortest wave has both properties.
    Both tests do not see a step along an axis of a rough map, so that jumps are counted as well.
    """
    pad_mode: PadMode = "symmetric" if mirrored else "wrap"
    if _jumps(heights, pad_mode) > MAX_JUMPS:  # a step along an axis has no waves in the corners
        return "monotone"
    corners, borders = _short_waves(np.atleast_2d(heights), pad_mode)  # a line has no corners
    is_short = borders > MAX_SHORT_WAVES and (
        heights.ndim == 1 or _ties(heights, pad_mode) > MAX_TIES
    )
    return "monotone" if is_short or corners > MAX_SHORT_WAVES else "fourier"


def _short_waves(heights: Field, pad_mode: PadMode) -> tuple[float, float]:
    """Fractions of the squared slope in the corners and along the borders of the spectrum."""
    rows, columns = heights.shape
    if pad_mode == "symmetric":  # modes of the mirrored map: of the cosine transform, and a phase
        modes: Field | Modes = dctn(heights - heights.mean())
        y, x = np.arange(rows)[:, None] / rows, np.arange(columns) / columns
        of_y, of_x = 1 + (y > 0), 1 + (x > 0)  # with the opposite waves
    else:
        modes = np.fft.rfft2(heights - heights.mean())
        y = np.fft.fftfreq(rows, 0.5)[:, None]  # relative to the highest wavenumber of the grid
        x = np.fft.rfftfreq(columns, 0.5)
        of_y, of_x = np.ones((rows, 1)), multiplicity(columns)
    sums = np.zeros(3)
    for block in row_blocks(modes):
        square = y[block] ** 2 + x**2
        slope = of_y[block] * of_x * np.abs(modes[block]) ** 2 * square
        is_short = np.maximum(np.abs(y[block]), x) > SHORT_WAVE
        sums += slope.sum(), slope[square > 1 + 1e-9].sum(), slope[is_short].sum()
    total = float(sums[0]) or 1.0
    return float(sums[1]) / total, float(sums[2]) / total


def _ties(heights: Field, pad_mode: PadMode) -> float:
    """Fraction of the pairs of neighbours with the same height."""
    around = np.pad(heights, ((1, 0), (1, 0)), mode=pad_mode)
    before = around[:-1, 1:], around[1:, :-1]
    return float(np.mean([np.mean(heights == others) for others in before]))


def _jumps(heights: Field, pad_mode: PadMode) -> float:
    """Fraction of the squared differences of neighbours in isolated jumps, on the worse axis.

    A jump is isolated where it is `ISOLATED_RATIO` times larger than the two differences before it
    and the two after it.
    """
    rows = np.atleast_2d(heights)
    return max(_jumps_along(lines, pad_mode) for lines in (rows, rows.T)[: heights.ndim])


def _jumps_along(lines: Field, pad_mode: PadMode) -> float:
    """See `_jumps`; along the last axis."""
    total = isolated = 0.0
    for block in row_blocks(lines):
        steps = np.abs(np.diff(np.pad(lines[block], ((0, 0), (3, 2)), mode=pad_mode)))
        around = [steps[:, shift : shift + lines.shape[1]] for shift in (0, 1, 3, 4)]
        own = steps[:, 2:-2]
        jumps = own[own > ISOLATED_RATIO * np.maximum.reduce(around)]
        total += float(np.sum(own**2))
        isolated += float(np.sum(jumps**2))
    return isolated / (total or 1.0)


def positions(old: int, new: int, centred: bool = False) -> Field:
    """Positions of the points of a finer grid, in points of the map along the same axis.

    By default both grids have the first point in common. The points that are `centred` lie in the
    middle of equal parts of the pixels of the map, which reach from -1/2 to `old` - 1/2: both grids
    then cover the same area, and a map that is mirrored at its borders remains so.
    """
    step = old / new
    return np.arange(new) * step + (0.5 * (step - 1) if centred else 0.0)


def at_centres(heights: Field, shape: tuple[int, ...]) -> Field:
    """A periodic map moved so that a grid of this shape with the same first point is centred.

    Exact where the map has no waves at the highest wavenumbers of its grid, as a mirrored map.
    """
    modes = np.fft.rfftn(heights)
    for axis, (old, new) in enumerate(zip(heights.shape, shape, strict=True)):
        last = axis == heights.ndim - 1
        q = 2 * np.pi * (np.fft.rfftfreq(old) if last else np.fft.fftfreq(old))
        phase = np.exp(1j * q * positions(old, new, centred=True)[0])
        modes *= phase.reshape([-1 if i == axis else 1 for i in range(heights.ndim)])
    return np.fft.irfftn(modes, heights.shape, axes=tuple(range(heights.ndim)))


def monotone(
    heights: Field, shape: tuple[int, ...], rows: slice = slice(None), *, centred: bool = False
) -> Field:
    """A periodic map or line on a finer grid of the same cell, without new maxima and minima.

    Monotone cubics (Fritsch and Butland 1984) along one axis and then along the other; the mean of
    both orders, so that no axis is preferred. Every height lies between those of the four points
    around it; plateaus remain plateaus.

    Parameters
    ----------
    heights : shape (rows, columns), or (points,) of a line
    shape : points of the finer grid along y and x
    rows : rows of the finer grid to compute
    centred : where the points of the finer grid lie, see `positions`
    """
    places = [positions(old, new, centred) for old, new in zip(heights.shape, shape, strict=True)]
    if heights.ndim == 1:
        return _along_axis(heights, places[0], 0)
    y, x = places
    x_first = _along_axis(_along_axis(heights, x, 1), y[rows], 0)
    y_first = _along_axis(_along_axis(heights, y[rows], 0), x, 1)
    return 0.5 * (x_first + y_first)


def nearest(mask: Mask, shape: tuple[int, ...], *, centred: bool = False) -> Mask:
    """A periodic mask on another grid of the same cell: that of the nearest point.

    Of two points that are equally near, that with the larger coordinate counts, so that a void
    keeps its area. A rule that treats both alike would widen or narrow it by half a spacing, but
    only on grids with an even multiple of the points: contact areas would jump from grid to grid.

    `centred` tells where the points of the other grid lie, see `positions`.
    """
    for axis, points in enumerate(shape):
        old = mask.shape[axis]
        beyond = old if centred else points  # half rounds up
        index = (2 * np.arange(points) * old + beyond) // (2 * points) % old
        mask = mask.take(index, axis)
    return mask


def _along_axis(heights: Field, position: Field, axis: int) -> Field:
    """Values at positions along an axis, in points, by a periodic monotone cubic."""
    margins = [(CUBIC_MARGIN, CUBIC_MARGIN) if i == axis else (0, 0) for i in range(heights.ndim)]
    wrapped = np.pad(heights, margins, mode="wrap")
    knots = np.arange(-CUBIC_MARGIN, heights.shape[axis] + CUBIC_MARGIN, dtype=np.float64)
    return monotone_cubic(knots, wrapped, axis)(position)


def monotone_cubic(x: Field, y: Field, axis: int = 0) -> Callable[[Field], Field]:
    """Monotone cubic (PCHIP) through points of rising x, along an axis of y."""
    from scipy.interpolate import PchipInterpolator  # half a second that most processes save

    return PchipInterpolator(x, y, axis=axis)
