"""Blunt peaks of a map, where the tip of the microscope or stylus was blunter than the surface.

A scan is the dilation of the surface by the tip: peaks that are sharper than the tip get its
curvature 1 / R, and the valleys between them are sharper than that.
"""

from typing import NamedTuple

import numpy as np

from gfmd_cli.grid.arrays import Field
from gfmd_cli.maps.gaussian_filter import ROUNDED_UP
from gfmd_cli.maps.topography import Topography
from gfmd_cli.units import labelled

MAX_CURVATURE = 0.5
"""Curvature of peaks over that of the tip, beyond which the tip has blunted them (Sanner et al.,
Appl. Surf. Sci. Adv. 7, 100190 (2022); there of the sharpest peak, here of a quantile)."""
SHARP, SHARPER = 0.99, 0.999
"""Quantiles of the curvature of all points. Their ratio is 1.33 if it is normally distributed."""
MAX_RATIO = 1.15  # of these two, if a tip has blunted the peaks; calibrated: scripts/tip_radius.py
MIN_VALLEYS = 1.5  # curvature of valleys over that of peaks, likewise; 1 for Gaussian surfaces
DISTANCES = (1, 2, 3, 4, 6, 8)  # points, at which a tip is looked for; noise hides it at the first
MIN_POINTS = 64  # per side of a map; smaller ones have such curvatures by chance
MAX_SHARPEST = 3.0  # curvature of peaks over that of the tip; a choice: 1 without noise
GROWTH = 1.25  # of the distances at which a map is compared with a tip
MAX_DISTANCE = 0.25  # the largest of them, over the shorter side
FILTERED_LENGTHS = 2
"""Cut-off wavelength of the S-filter over the length of blunt structures: filtered map and filtered
surface then have the same contact area within 4 % on average (docs/map_evidence.md)."""
MAX_SAMPLE = 2**18  # heights of a map that are used along each axis


class _Profiles(NamedTuple):
    """Lines of a map along one axis."""

    heights: Field
    """[m], shape (lines, points), NaN where missing."""
    slopes: Field
    """Slopes across the lines, of the same shape."""
    spacing: float
    """Distance of the points of a line [m]."""


def blunted(
    topography: Topography,
    spacing: tuple[float, ...],
    scale: float,
    radius: float | None = None,
    *,
    cutoff: float = 0.0,
    flipped: bool = False,
) -> str:
    """A warning that a tip has blunted the peaks of a map, "" without it.

    Without a radius, only a map gives it in which many peaks have one curvature that almost none
    exceeds. There is none if the S-filter removes what depends on the tip.

    Parameters
    ----------
    topography : the map
    spacing : its spacing [m]
    scale : factor from its heights to metres
    radius : of the tip [m]; None if it is not known
    cutoff : cut-off wavelength of the S-filter [m]; 0 without it
    flipped : whether the heights were turned upside down after the scan
    """
    axes = _profiles(topography, -scale if flipped else scale, spacing)
    if radius is not None:
        what = f"the tip (surface.tip_radius = {labelled(radius, 'm')}) has"
        sharpest = radius * max(_curvatures(profiles, 1)[1] for profiles in axes)
        if sharpest > MAX_SHARPEST:
            return (
                f"the peaks of the map are up to {sharpest:.2g} times as sharp as a tip of the "
                f"radius surface.tip_radius = {radius:g} m can record: noise, or is the radius "
                "wrong?"
            )
    else:
        curvature = _curvature_of_tip(axes)
        if not curvature > 0:
            return ""
        radius = 1 / curvature
        what = (
            f"almost no peak of the scan is sharper than a sphere of the radius {radius:.2g} m, "
            "but the valleys are, as if scanned by a tip of about this radius. Then the tip has"
        )
    distance = _distance_of_blunt_peaks(axes, MAX_CURVATURE / radius)
    length = 2 * distance * min(spacing)
    if distance == 1 or cutoff >= FILTERED_LENGTHS * length:
        return ""
    shape = topography.heights.shape
    shortest = f"{ROUNDED_UP * FILTERED_LENGTHS * length:.2g}"
    remedy = (
        f"With surface.s_filter = {shortest} or more the contact hardly depends on the tip, but is "
        "that of a smoother surface"
    )
    if float(shortest) > min(n * step for n, step in zip(shape, spacing, strict=True)):
        remedy = "The map is too small for an S-filter against that"
    return (
        f"{what} blunted structures shorter than about {length:.2g} m: the contact area at light "
        f"load is too large, in tests by a factor of 1.1 to 3.5. {remedy}"
    )


def _profiles(topography: Topography, scale: float, spacing: tuple[float, ...]) -> list[_Profiles]:
    """Lines of a map along each axis, of a large map a sample of them."""
    heights = topography.with_gaps()
    if heights.ndim == 1:
        return [_Profiles(scale * heights[None], np.zeros((1, heights.size)), spacing[0])]
    axes, step, (dy, dx) = [], 1 + heights.size // MAX_SAMPLE, spacing
    for lines, across, own in ((heights.T, dx, dy), (heights, dy, dx)):
        last, middle, following = lines[:-2:step], lines[1:-1:step], lines[2::step]
        slopes = scale * (following - last) / (2 * across)
        axes.append(_Profiles(scale * middle, slopes, own))
    return axes


def _curvature_of_tip(axes: list[_Profiles]) -> float:
    """The curvature that many peaks of a map have along both axes, and almost none exceeds [1/m].

    It is that at the shortest distance of points at which this is so; 0 if there is none.
    """
    if len(axes) == 1 or min(profiles.heights.shape[1] for profiles in axes) < MIN_POINTS:
        return 0.0
    for distance in DISTANCES:
        found = [_curvatures(profiles, distance) for profiles in axes]
        if all(
            0 < sharper < MAX_RATIO * sharp and valleys > MIN_VALLEYS * sharper
            for sharp, sharper, valleys in found
        ):
            return float(np.mean([sharper for _, sharper, _ in found]))
    return 0.0


def _distance_of_blunt_peaks(axes: list[_Profiles], curvature: float) -> int:
    """The shortest distance at which peaks have at most this curvature [1/m].

    In points of the axis with the smaller spacing. The longest distance that is compared, if peaks
    are sharper at all of them. The curvature is that along the axis with the sharper peaks.
    """
    smallest = min(profiles.spacing for profiles in axes)
    steps = [profiles.spacing / smallest for profiles in axes]
    side = min(p.heights.shape[1] * step for p, step in zip(axes, steps, strict=True))
    distance, longest = 1, max(1, int(MAX_DISTANCE * side))
    while distance < longest:
        points = [max(1, round(distance / step)) for step in steps]
        if not max(sharper for _, sharper, _ in map(_curvatures, axes, points)) > curvature:
            break
        distance = min(max(distance + 1, round(GROWTH * distance)), longest)
    return distance


def _curvatures(profiles: _Profiles, distance: int) -> tuple[float, float, float]:
    """Quantiles of the curvature along an axis [1/m]: two of peaks, one of valleys.

    -h_xx / [(1 + h_x^2) (1 + h_x^2 + h_y^2)^(1/2)], the normal curvature along x, which is 1 / R
    everywhere on a sphere. h_x and h_xx are differences of heights at a distance in points, h_y is
    that of the next lines. -inf if no such heights are known.
    """
    heights, inner = profiles.heights, slice(distance, -distance)
    last, following = heights[:, : -2 * distance], heights[:, 2 * distance :]
    length = distance * profiles.spacing
    along, across = (following - last) / (2 * length), profiles.slopes[:, inner]
    second = (2 * heights[:, inner] - following - last) / length**2
    curvature = second / ((1 + along**2) * np.sqrt(1 + along**2 + across**2))
    known = curvature[np.isfinite(curvature)]
    if not known.size:
        return -np.inf, -np.inf, -np.inf
    sharp, sharper, valleys = np.quantile(known, (SHARP, SHARPER, 1 - SHARPER))
    return float(sharp), float(sharper), float(-valleys)
