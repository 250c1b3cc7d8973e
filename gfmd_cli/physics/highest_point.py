"""The highest point of a surface that is a Fourier series, which lies between grid points."""

import numpy as np
from scipy.optimize import minimize

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
            highest += _highest(lines, _waves(k_x, x)[0], count_x, (y, x))
    modes /= whole.size
    modes[:, 1 : (count_x + 1) // 2] *= 2.0  # with their opposites

    def depth(place: Field) -> tuple[float, Field]:
        """-h and its gradient; places and slopes are in points."""
        (e_y, slope_y), (e_x, slope_x) = _waves(k_y, place[0]), _waves(k_x, place[1])
        along_x = modes @ e_x
        slopes = slope_y @ along_x, e_y @ (modes @ slope_x)
        return -float((e_y @ along_x).real), -np.real(slopes)

    for place in _peaks(highest):
        bounds = [(x - 1.0, x + 1.0) for x in place]
        result = minimize(depth, place, jac=True, method="L-BFGS-B", bounds=bounds)
        best = max(best, -scale * float(result.fun))
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
    lines: Modes, along_x: Modes, count_x: int, shift: tuple[float, float]
) -> list[tuple[float, float, float]]:
    """The highest points of a grid that is shifted: their heights and places in points.

    `lines`: Fourier coefficients along x of each row, not yet shifted along x.
    """
    count = 16 * CANDIDATES
    heights, points = np.empty(0), np.empty(0, np.int64)
    for rows in row_blocks(lines):
        block = np.fft.irfft(lines[rows] * along_x, count_x).ravel()
        lowest = heights.min() if heights.size == count else -np.inf
        higher = np.flatnonzero(block > lowest)
        heights = np.append(heights, block[higher])
        points = np.append(points, higher + rows.start * count_x)
        if heights.size > count:
            kept = np.argpartition(heights, -count)[-count:]
            heights, points = heights[kept], points[kept]
    row, column = divmod(points, count_x)
    return list(zip(heights.tolist(), row + shift[0], column + shift[1], strict=True))


def _peaks(highest: list[tuple[float, float, float]]) -> list[tuple[float, float]]:
    """The highest places, none within a point of a higher one."""
    chosen: list[tuple[float, float]] = []
    for _, y, x in sorted(highest, reverse=True):
        if all(max(abs(y - a), abs(x - b)) > 1 for a, b in chosen):
            chosen.append((y, x))
        if len(chosen) == CANDIDATES:
            break
    return chosen
