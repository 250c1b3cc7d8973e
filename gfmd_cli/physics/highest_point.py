"""The highest point of a surface that is a Fourier series, which lies between grid points."""

from collections.abc import Callable, Iterable

import numpy as np
import scipy
from scipy.fft import dctn, idct

from gfmd_cli.grid.arrays import Field, Modes, row_blocks

CANDIDATES = 8  # points from which a maximum is sought: the highest of different peaks
SUBDIVISION = 4  # of the spacing along each axis for these points: with two grid points per wave,
# the grid points next to the highest peak can be lower than those of many others


def highest_point(heights: Field) -> float:
    """Maximum of the Fourier series through heights on a periodic grid [the unit of the heights].

    Parameters
    ----------
    heights : shape (points along y, points along x), or (points along x,)
    """
    whole = heights.reshape(-1, heights.shape[-1])
    count_y, count_x = whole.shape
    modes = np.fft.rfft2(whole)
    k_y, k_x = 2j * np.pi * np.fft.fftfreq(count_y), 2j * np.pi * np.fft.rfftfreq(count_x)
    best = float(whole.max())
    scale = float(np.ptp(whole)) or 1.0  # the tolerances of the search are absolute
    modes /= scale
    highest: list[tuple[float, float, float]] = []
    parts = np.arange(SUBDIVISION) / SUBDIVISION
    for y in parts if count_y > 1 else [0.0]:
        lines = np.fft.ifft(modes * _waves(k_y, y)[0][:, None], axis=0)
        for x in parts:
            along_x = _waves(k_x, x)[0]
            blocks = (np.fft.irfft(lines[rows] * along_x, count_x) for rows in row_blocks(lines))
            heights, points = _highest(blocks, 16 * CANDIDATES)
            row, column = divmod(points, count_x)
            highest += zip(heights.tolist(), row + y, column + x, strict=True)
    modes /= whole.size
    modes[:, 1 : (count_x + 1) // 2] *= 2.0  # with their opposites

    def depth(place: Field) -> tuple[float, Field]:
        """-h and its gradient; places and slopes are in points."""
        (e_y, slope_y), (e_x, slope_x) = _waves(k_y, place[0]), _waves(k_x, place[1])
        along_x = modes @ e_x
        slopes = slope_y @ along_x, e_y @ (modes @ slope_x)
        return -float((e_y @ along_x).real), -np.real(slopes)

    return max(best, scale * _refined(depth, highest))


def highest_point_of_mirrored(heights: Field) -> float:
    """Maximum of the Fourier series through a map, or a line, that is mirrored at its borders.

    The series is one of cosines, by the discrete cosine transform (type 2) of the map.

    Parameters
    ----------
    heights : a quarter of the mirrored map, or half of the line, as for `highest_point`
    """
    whole = heights.reshape(-1, heights.shape[-1])
    count_y, count_x = whole.shape
    best = float(whole.max())
    scale = float(np.ptp(whole)) or 1.0
    modes = dctn(whole)
    modes /= 4 * scale * whole.size
    modes[1:] *= 2.0
    modes[:, 1:] *= 2.0
    k_y, k_x = np.pi * np.arange(count_y) / count_y, np.pi * np.arange(count_x) / count_x
    lines = _finer(modes, SUBDIVISION if count_y > 1 else 1, 0)
    blocks = (_finer(lines[rows], SUBDIVISION, 1) for rows in row_blocks(lines))
    values, points = _highest(blocks, 16 * CANDIDATES * SUBDIVISION**2)
    row, column = divmod(points, SUBDIVISION * count_x)
    y, x = (row + 0.5) * (count_y / len(lines)) - 0.5, (column + 0.5) / SUBDIVISION - 0.5

    def depth(place: Field) -> tuple[float, Field]:
        """-h and its gradient; places and slopes are in points, the first point is 0."""
        angle_y, angle_x = k_y * (place[0] + 0.5), k_x * (place[1] + 0.5)
        along_x, cos_y = modes @ np.cos(angle_x), np.cos(angle_y)
        slopes = (k_y * np.sin(angle_y)) @ along_x, cos_y @ (modes @ (k_x * np.sin(angle_x)))
        return -float(cos_y @ along_x), np.array(slopes)

    return max(best, scale * _refined(depth, list(zip(values.tolist(), y, x, strict=True))))


def _finer(modes: Field, factor: int, axis: int) -> Field:
    """Sums of cosines along an axis, at the middles of `factor` equal parts of each pixel."""
    points = factor * modes.shape[axis]
    amplitudes = points * modes
    amplitudes[(slice(None),) * axis + (slice(1),)] *= 2.0
    values: Field = idct(amplitudes, n=points, axis=axis)
    return values


def _refined(
    depth: Callable[[Field], tuple[float, Field]], highest: list[tuple[float, float, float]]
) -> float:
    """The largest height h near these points; `depth` returns -h and its gradient."""
    best = -np.inf
    for place in _peaks(highest):
        bounds = [(x - 1.0, x + 1.0) for x in place]
        result = scipy.optimize.minimize(depth, place, jac=True, method="L-BFGS-B", bounds=bounds)
        best = max(best, -float(result.fun))
    return best


def _waves(k: Modes, place: float) -> tuple[Modes, Modes]:
    """exp(k x) at a place, and its derivative by x.

    The Nyquist wave is half a wave of +q and half one of -q, as where a grid is refined.
    """
    wave = np.exp(k * place)
    slope = k * wave
    is_nyquist = np.abs(k.imag) == np.pi
    for values in (wave, slope):
        np.copyto(values, values.real, where=is_nyquist)
    return wave, slope


def _highest(
    blocks: Iterable[Field], count: int
) -> tuple[Field, np.ndarray[tuple[int], np.dtype[np.int64]]]:
    """The highest points of a field in blocks of rows: heights, and indices of the flat field."""
    heights, points, first = np.empty(0), np.empty(0, np.int64), 0
    for block in blocks:
        lowest = heights.min() if heights.size == count else -np.inf
        higher = np.flatnonzero(block > lowest)
        heights = np.append(heights, block.ravel()[higher])
        points = np.append(points, higher + first)
        first += block.size
        if heights.size > count:
            kept = np.argpartition(heights, -count)[-count:]
            heights, points = heights[kept], points[kept]
    return heights, points


def _peaks(highest: list[tuple[float, float, float]]) -> list[tuple[float, float]]:
    """The highest places, none within a point of a higher one."""
    chosen: list[tuple[float, float]] = []
    for _, y, x in sorted(highest, reverse=True):
        if all(max(abs(y - a), abs(x - b)) > 1 for a, b in chosen):
            chosen.append((y, x))
        if len(chosen) == CANDIDATES:
            break
    return chosen
