"""The highest point of a surface that is a Fourier series, which lies between grid points."""

from itertools import product

import numpy as np
from scipy.optimize import minimize

from gfmd_cli.grid.arrays import Field, Modes

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
    highest = []
    parts = np.arange(SUBDIVISION) / SUBDIVISION
    for y, x in product(parts if count_y > 1 else [0.0], parts):
        (along_y, _), (along_x, _) = _waves(k_y, y), _waves(k_x, x)
        moved = np.fft.irfft2(modes * along_y[:, None] * along_x, whole.shape)
        highest += _highest(moved, (y, x))
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


def _highest(heights: Field, shift: tuple[float, float]) -> list[tuple[float, float, float]]:
    """The highest points of a grid that is shifted: their heights and places in points."""
    count = min(16 * CANDIDATES, heights.size)
    points = np.argpartition(heights.ravel(), -count)[-count:]
    places = np.unravel_index(points, heights.shape)
    along_y, along_x = (place + by for place, by in zip(places, shift, strict=True))
    return list(zip(heights.ravel()[points].tolist(), along_y, along_x, strict=True))


def _peaks(highest: list[tuple[float, float, float]]) -> list[tuple[float, float]]:
    """The highest places, none within a point of a higher one."""
    chosen: list[tuple[float, float]] = []
    for _, y, x in sorted(highest, reverse=True):
        if all(max(abs(y - a), abs(x - b)) > 1 for a, b in chosen):
            chosen.append((y, x))
        if len(chosen) == CANDIDATES:
            break
    return chosen
