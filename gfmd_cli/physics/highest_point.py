"""The highest point of a surface that is a Fourier series, which lies between grid points."""

import numpy as np
from scipy.optimize import minimize

from gfmd_cli.grid.arrays import Field

CANDIDATES = 8  # grid points from which a maximum is sought: the highest of different peaks


def highest_point(heights: Field) -> float:
    """Maximum of the Fourier series through heights on a periodic grid [the unit of the heights].

    Parameters
    ----------
    heights : shape (points along y, points along x), or (points along x,)
    """
    whole = heights.reshape(-1, heights.shape[-1])
    count_y, count_x = whole.shape
    modes = np.fft.rfft2(whole) / whole.size
    modes[:, 1 : (count_x + 1) // 2] *= 2.0  # with their opposites
    k_y, k_x = 2j * np.pi * np.fft.fftfreq(count_y), 2j * np.pi * np.fft.rfftfreq(count_x)

    def depth(place: Field) -> tuple[float, Field]:
        """-h and its gradient; places and slopes are in points."""
        e_y, e_x = np.exp(k_y * place[0]), np.exp(k_x * place[1])
        along_x = modes @ e_x
        slopes = (k_y * e_y) @ along_x, e_y @ (modes @ (k_x * e_x))
        return -float((e_y @ along_x).real), -np.real(slopes)

    best = float(whole.max())
    scale = float(np.ptp(whole)) or 1.0  # the tolerances of the search are absolute
    modes /= scale
    for place in _peaks(whole):
        bounds = [(x - 1.0, x + 1.0) for x in place]
        found = minimize(depth, place, jac=True, method="L-BFGS-B", bounds=bounds)
        best = max(best, -scale * float(found.fun))
    return best


def _peaks(heights: Field) -> list[tuple[int, ...]]:
    """The highest grid points, none the neighbour of a higher one."""
    count = min(16 * CANDIDATES, heights.size)
    highest = np.argpartition(heights.ravel(), -count)[-count:]
    ordered = highest[np.argsort(heights.ravel()[highest])[::-1]]
    chosen: list[tuple[int, ...]] = []
    for place in zip(*np.unravel_index(ordered, heights.shape), strict=True):
        if all(max(abs(a - b) for a, b in zip(place, other, strict=True)) > 1 for other in chosen):
            chosen.append(tuple(map(int, place)))
    return chosen[:CANDIDATES]
