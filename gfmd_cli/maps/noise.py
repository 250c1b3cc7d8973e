"""White noise in the heights of a map, estimated from the differences of its points."""

import numpy as np

from gfmd_cli.grid.arrays import Field
from gfmd_cli.maps.gaussian_filter import MIN_SPACINGS, ROUNDED_UP, transmission
from gfmd_cli.maps.topography import Topography
from gfmd_cli.units import labelled

RATIOS = (2, 3)  # of distances; a choice: gratings resemble noise at one of them only
TOLERANCE = 0.15  # relative, of white noise at these distances; roughness grows by 0.25 for H = 0.1
FAR = 4  # second differences over 1 / FAR of a line show whether there are longer waves; a choice
MIN_GROWTH = 0.1
"""Relative growth of the mean square up to this distance; a choice. Without longer waves, the
roughness itself is as short as the noise."""
MIN_COMMON = 0.5  # variance of the noise along one axis over that along the other; below, of lines
MIN_POINTS = {1: 1024, 2: 64}  # per side, by dimension: fewer have such differences by chance
MIN_PAIRS = 100  # of known differences, likewise
SAMPLED_LINES = 128  # of each axis, at least; all of smaller maps
FILTERED_POINTS = {1: 2**18, 2: 512}
"""Per side of the part on which a filter is tried, by dimension; all of smaller maps."""
HALVINGS = 12  # of the interval of cut-offs; a choice: two digits of them are stated
MAX_EXCESS = 10  # larger ratios are not stated: the gradient without noise is uncertain; a choice
MIN_BEYOND = 1.25
"""Rms gradient over that of the waves that are resolved. A microscope damps shorter waves, but does
not remove them: up to 1.23 without noise, if their shortest length has 16 points or fewer and the
roll-off is four times as long or more (scripts/unresolved_roughness.py --leakage)."""
MIN_EXCESS = 1.1  # rms gradient over that without noise; sound maps have up to 1.06


def noisy(
    topography: Topography, spacing: tuple[float, ...], scale: float, cutoff: float = 0.0
) -> str:
    """A warning of white noise that is a large part of the gradient, "" without it.

    `spacing` is that of the map [m], `scale` the factor to metres, `cutoff` that of the S-filter
    [m]. Roughness that is as short as the distance of the points, beside longer waves, looks the
    same. The limits are calibrated in docs/map_evidence.md.
    """
    heights = topography.with_gaps()
    if min(heights.shape) < MIN_POINTS[heights.ndim]:
        return ""
    rows = np.atleast_2d(heights)
    noises, whole, left = {}, 0.0, 0.0
    # a profile has one spacing, and no lines along y
    for axis, all_lines, step in zip("xy", (rows, rows.T), reversed(spacing), strict=False):
        some = all_lines[:: 1 + len(all_lines) // (2 * SAMPLED_LINES)]
        steps, noises[axis] = np.diff(some), _noise(some)
        square = float(np.var(steps[np.isfinite(steps)])) if np.isfinite(steps).any() else np.nan
        whole += square / step**2
        left += (square - 2 * noises[axis]) / step**2  # each of the two points has its noise
    if not whole > MIN_EXCESS**2 * left:
        return ""
    gradient = _Gradient(heights, spacing)
    kept = gradient.kept(cutoff) if cutoff else 1.0
    if not whole * kept > MIN_EXCESS**2 * left:
        return ""
    lines, noise = min(noises, key=lambda axis: noises[axis]), max(noises.values())
    rms = f"{scale * np.sqrt(noise):.2g} m (rms)"
    excess = np.sqrt(whole * kept / left) if left > 0 else np.inf
    what, remedy = f"white noise of {rms} in the heights", "average several scans"
    if noises[lines] < MIN_COMMON * noise:
        what, remedy = f"random offsets of {rms} of the lines along {lines}", "align the lines"
    elif excess < MAX_EXCESS:
        shortest = ROUNDED_UP * gradient.cutoff(left / whole)
        remedy += f", or filter the map: surface.s_filter = {shortest:.2g} or more"
    many = f"{excess:.2g}" if excess < MAX_EXCESS else f"more than {MAX_EXCESS}"
    filtered = "after the S-filter " if cutoff else ""
    return (
        f"{what}, or roughness that the map does not resolve: the rms gradient {filtered}is {many} "
        "times that of the longer waves; if this is noise, the contact area at light load is too "
        f"small by up to this factor: {remedy}"
    )


def noise_beyond(
    topography: Topography, spacing: tuple[float, ...], period_limit: float, cutoff: float = 0.0
) -> str:
    """A warning of strong waves that the microscope does not resolve, "" without it.

    Parameters
    ----------
    topography : the map
    spacing : its spacing [m]
    period_limit : lateral period limit of the microscope [m], 0 if it is not known
    cutoff : cut-off wavelength of the S-filter [m]; 0 without it
    """
    if period_limit <= 2 * max(spacing):
        return ""
    gradient = _Gradient(topography.with_gaps(), spacing)
    excess = 1 / np.sqrt(1 - gradient.beyond(period_limit, cutoff))
    if not excess > MIN_BEYOND:
        return ""
    shortest = ROUNDED_UP * max(period_limit, MIN_SPACINGS * min(spacing))
    return (
        "waves shorter than surface.lateral_period_limit = "
        f"{labelled(period_limit, 'm')} increase the rms gradient by a factor of {excess:.2g}, "
        "more than those of a blurred map without noise: they are noise, or this length is too "
        "large. If they are noise, the contact area at light load is too small by up to this "
        f"factor: average several scans, or filter the map: surface.s_filter = {shortest:.2g} or "
        "more"
    )


class _Gradient:
    """Power spectrum of the differences of neighbours in the middle of a map, without their mean.

    Differences are zero where heights are missing.
    """

    def __init__(self, heights: Field, spacing: tuple[float, ...]) -> None:
        most = FILTERED_POINTS[heights.ndim]
        first = [max(0, points - most) // 2 for points in heights.shape]
        part = heights[tuple(slice(each, each + most) for each in first)]
        self.spacing, self.shape = spacing, tuple(points - 1 for points in part.shape)
        self.power = np.zeros(self.shape)
        for axis, step in enumerate(spacing):
            steps = np.diff(part, axis=axis)[tuple(slice(-n, None) for n in self.shape)] / step
            self.power += np.abs(np.fft.fftn(np.nan_to_num(steps))) ** 2
        self.power.flat[0] = 0.0

    def kept(self, cutoff: float) -> float:
        """Fraction of the mean square that the S-filter of this cut-off wavelength leaves."""
        power = self.power
        for points, step in zip(self.shape, self.spacing, strict=True):
            power = transmission(np.fft.fftfreq(points, step), cutoff) ** 2 @ power
        return float(power / (self.power.sum() or 1.0))

    def beyond(self, wavelength: float, cutoff: float) -> float:
        """Fraction of the mean square in shorter waves, where the S-filter has this cut-off."""
        power, squares = self.power, np.zeros(())
        for points, step in zip(self.shape, self.spacing, strict=True):
            frequency = np.fft.fftfreq(points, step)
            power = np.moveaxis(power, 0, -1) * transmission(frequency, cutoff) ** 2
            squares = squares[..., None] + frequency**2
        return float(power[squares * wavelength**2 > 1].sum() / (power.sum() or 1.0))

    def cutoff(self, share: float) -> float:
        """The shortest cut-off wavelength that leaves this share of the mean square, or less."""
        shortest = MIN_SPACINGS * min(self.spacing)
        longest = min(n * step for n, step in zip(self.shape, self.spacing, strict=True))
        for _ in range(HALVINGS):
            middle = np.sqrt(shortest * longest)
            if self.kept(middle) > share:
                shortest = middle
            else:
                longest = middle
        return float(longest)


def _noise(lines: Field) -> float:
    """Variance [m^2] of white noise along the lines of a map (the nugget of a variogram), or 0.

    The mean square of h(x + r) - 2 h(x) + h(x - r) is 6 V plus a multiple of r^(2 H) for a
    self-affine surface with white noise of the variance V (with first differences: Matheron 1963).
    Three distances r, each the same multiple of the one before, give V. The mean square grows less
    with r beyond a roll-off, and more below a cut-off: the result is then too small, or negative.
    """
    first = _second(lines, 1)
    near = np.array([_second(lines, ratio) for ratio in RATIOS])
    if not (near > (1 - TOLERANCE) * first).all():  # a pattern of the map, or too few heights
        return 0.0
    if (near < (1 + TOLERANCE) * first).all():
        has_waves = _second(lines, lines.shape[1] // FAR) > (1 + MIN_GROWTH) * first
        return first / 6 if has_waves else 0.0
    rise = np.maximum(near - first, 0.0)
    rest = np.array([_second(lines, ratio**2) for ratio in RATIOS]) - near
    if not (rest > rise).all():
        return 0.0
    return max(float((first - rise**2 / (rest - rise)).min()), 0.0) / 6


def _second(lines: Field, distance: int) -> float:
    """Mean square of the second differences of points of a line at this distance.

    From the mean absolute value, as of Gaussian ones, so that a few steps matter little. NaN if too
    few are known.
    """
    middle = lines[:, distance:-distance]
    differences = lines[:, 2 * distance :] - 2 * middle + lines[:, : -2 * distance]
    known = np.abs(differences[np.isfinite(differences)])
    return float(np.pi / 2 * known.mean() ** 2) if known.size >= MIN_PAIRS else np.nan
