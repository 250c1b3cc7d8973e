"""White noise in the heights of a map, estimated from the differences of its points."""

from typing import NamedTuple

import numpy as np

from gfmd_cli.grid.arrays import Field
from gfmd_cli.maps.topography import Topography

RATIOS = (2, 3)  # of distances; a choice: gratings resemble noise at one of them only
TOLERANCE = 0.15  # relative, of white noise at these distances; roughness grows by 0.25 for H = 0.1
FAR = 4  # a quarter of a line is a distance at which longer waves are seen; a choice
MIN_GROWTH = 0.1  # relative, of the mean square at this distance; a choice: without longer waves
# the roughness itself is as short as the noise
MIN_COMMON = 0.5  # variance of the noise along one axis over that along the other; below, of lines
MIN_POINTS = 128  # per side: fewer, and profiles, have such differences by chance
MIN_PAIRS = 100  # of known differences, likewise
SAMPLED_LINES = 128  # of each axis, at least; all of smaller maps
MAX_EXCESS = 10  # larger ratios are not stated: the gradient without noise is uncertain; a choice
MIN_EXCESS = 1.1  # rms gradient over that without noise; sound maps have up to 1.06


class _Differences(NamedTuple):
    """Mean squares [m^2] along one axis of a map."""

    neighbours: float
    """Difference of neighbours, less that of a tilt."""
    noise: float
    """White noise of the heights; 0 if there is no sign of it."""


def noisy(topography: Topography, spacing: tuple[float, ...], scale: float) -> str:
    """A warning of white noise that is a large part of the gradient, "" without it.

    `spacing` is that of the map [m], `scale` the factor to metres. Roughness that is as short as
    the distance of the points, beside longer waves, looks the same. The limits are calibrated in
    docs/map_evidence.md.
    """
    heights = topography.with_gaps()
    if heights.ndim == 1 or min(heights.shape) < MIN_POINTS:
        return ""
    along = {"x": _differences(heights), "y": _differences(heights.T)}
    whole, left = (
        sum(
            (each.neighbours - share * each.noise) / step**2
            for each, step in zip(along.values(), reversed(spacing), strict=True)
        )
        for share in (0, 2)  # two points of a difference, each with its noise
    )
    if not whole > MIN_EXCESS**2 * left:
        return ""
    lines, across = sorted(along, key=lambda axis: along[axis].noise)
    noise = along[across].noise
    rms = f"{scale * np.sqrt(noise):.2g} m (rms)"
    what, remedy = f"white noise of {rms} in the heights", "average several scans"
    if along[lines].noise < MIN_COMMON * noise:
        what, remedy = f"random offsets of {rms} of the lines along {lines}", "align the lines"
    excess = np.sqrt(whole / left) if left > 0 else np.inf
    many = f"{excess:.2g}" if excess < MAX_EXCESS else f"more than {MAX_EXCESS}"
    return (
        f"{what}, or roughness that the map does not resolve: the rms gradient is {many} times "
        "that of the longer waves; if this is noise, the contact area at light load is too small "
        f"by up to this factor: {remedy}, or remove the shortest waves with a Gaussian filter (ISO "
        "16610-61), in another program"
    )


def _differences(lines: Field) -> _Differences:
    """Differences along the lines of a map, and their noise (the nugget of a variogram).

    The mean square of h(x + r) - 2 h(x) + h(x - r) is 6 V plus a multiple of r^(2 H) for a
    self-affine surface with white noise of the variance V (with first differences: Matheron 1963).
    Three distances r, each the same multiple of the one before, give V. The mean square grows less
    with r beyond a roll-off, and more below a cut-off: the result is then too small, or negative.
    """
    lines = lines[:: 1 + len(lines) // (2 * SAMPLED_LINES)]
    steps = np.diff(lines)
    neighbours = float(np.var(steps[np.isfinite(steps)])) if np.isfinite(steps).any() else np.nan
    first = _second(lines, 1)
    near = np.array([_second(lines, ratio) for ratio in RATIOS])
    if not (near > (1 - TOLERANCE) * first).all():  # a pattern of the map, or too few heights
        return _Differences(neighbours, 0.0)
    if (near < (1 + TOLERANCE) * first).all():
        has_waves = _second(lines, lines.shape[1] // FAR) > (1 + MIN_GROWTH) * first
        return _Differences(neighbours, first / 6 if has_waves else 0.0)
    rise = np.maximum(near - first, 0.0)
    rest = np.array([_second(lines, ratio**2) for ratio in RATIOS]) - near
    if not (rest > rise).all():
        return _Differences(neighbours, 0.0)
    return _Differences(neighbours, max(float((first - rise**2 / (rest - rise)).min()), 0.0) / 6)


def _second(lines: Field, distance: int) -> float:
    """Mean square of the second differences of points of a line at this distance."""
    middle = lines[:, distance:-distance]
    return _mean_square(lines[:, 2 * distance :] - 2 * middle + lines[:, : -2 * distance])


def _mean_square(differences: Field) -> float:
    """Mean square of the known differences if they are Gaussian, NaN if they are too few.

    From their mean absolute value, so that a few steps matter little.
    """
    known = np.abs(differences[np.isfinite(differences)])
    return float(np.pi / 2 * known.mean() ** 2) if known.size >= MIN_PAIRS else np.nan
