"""Pictures of height maps with scale bar and colour bar, profiles of lines, and spectra."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from gfmd_cli.analysis.curve_styles import literal
from gfmd_cli.analysis.plotting import HEIGHT, WIDTH, LegendFigure, shades
from gfmd_cli.analysis.surface_summary import SurfaceSummary
from gfmd_cli.grid.arrays import Field
from gfmd_cli.maps.pictures import Picture
from gfmd_cli.physics.surface_spectrum import Spectrum
from gfmd_cli.units import scaled

HEIGHTS, HOLES, HIGHEST = "cividis", "0.85", "#fee838"
"""Colours of the heights, of missing ones and of those above the scale."""
BEYOND = 0.5  # percent of the heights above and below the colour bar: single points are outliers
BAR = 0.35  # of the width of a picture, the longest scale bar
LINE = "#0077bb"


def height_figure(picture: Picture) -> LegendFigure:
    """One picture, as wide as a printed column."""
    figure = LegendFigure(WIDTH, _height(picture))
    draw_heights(figure.figure.add_subplot(), picture)
    return figure


def summary_figure(summaries: Sequence[SurfaceSummary], names: Sequence[str]) -> LegendFigure:
    """A row for each surface: as measured, as prepared, and the power spectrum."""
    pictures = [_pictures(summary) for summary in summaries]
    heights = [max(map(_height, shown)) for shown in pictures]
    figure = LegendFigure(3 * WIDTH, sum(heights))
    axes = figure.figure.subplots(len(summaries), 3, squeeze=False, height_ratios=heights)
    for row, summary, name, shown in zip(axes, summaries, names, pictures, strict=True):
        titles = ("as measured", "as prepared") if len(shown) == 2 else ("surface",)
        for place, picture, title in zip(row, shown, titles, strict=False):
            draw_heights(place, picture)
            place.set_title(literal(f"{name}: {title}"), fontsize="medium")
        if len(shown) == 1:
            row[1].set_axis_off()
        _draw_spectrum(row[2], summary.spectrum, summary.scene.grid.dimension)
    return figure


def _pictures(summary: SurfaceSummary) -> list[Picture]:
    pictures = list(summary.surface.pictures().values())
    scene = summary.scene
    return pictures or [Picture(scene.in_metres(scene.height), scene.grid.sides)]


def _height(picture: Picture) -> float:
    """Height of a picture with its colour bar and scale bar [inches]."""
    if picture.heights.ndim == 1:
        return HEIGHT
    aspect = picture.sides[0] / picture.sides[1]
    return float(WIDTH * min(max(0.72 * aspect + 0.13, 0.3), 2.0))


def draw_heights(axes: Any, picture: Picture) -> None:
    """Draw a map with colour bar and scale bar, or a profile over its position."""
    heights = picture.heights - np.nanmean(picture.heights)
    low, high = (float(end) for end in np.nanpercentile(heights, (BEYOND, 100 - BEYOND)))
    divisor, unit = scaled(max(high - low, 1e-3 * float(np.nanmax(np.abs(heights)))), "m")
    heights /= divisor
    if heights.ndim == 1:
        _draw_profile(axes, heights, picture.sides[0], unit)
        return
    side_y, side_x = picture.sides
    image = axes.imshow(
        heights,
        origin="lower",
        extent=(0.0, side_x, 0.0, side_y),
        interpolation="none",
        cmap=shades(HEIGHTS, 0.0, HOLES, HIGHEST),
        vmin=low / divisor,
        vmax=high / divisor,
    )
    axes.set(xticks=[], yticks=[])
    bar = axes.figure.colorbar(image, ax=axes, shrink=0.92, pad=0.03, extend="both")
    bar.set_label(f"height ({unit})")
    _draw_scale_bar(axes, side_x)


def _draw_profile(axes: Any, heights: Field, side: float, unit: str) -> None:
    divisor, length_unit = scaled(side, "m")
    position = np.arange(heights.size) * (side / heights.size / divisor)
    axes.plot(position, heights, color=LINE, lw=0.7)
    axes.set(xlabel=f"position ({length_unit})", ylabel=f"height ({unit})")
    axes.set_xlim(position[0], position[-1])


def _draw_scale_bar(axes: Any, side: float) -> None:
    """A bar of 1, 2 or 5 times a power of ten below the left corner of the picture."""
    longest = BAR * side * (1 + 1e-9)
    power = 10.0 ** np.floor(np.log10(longest))
    length = power * max(digit for digit in (1, 2, 5) if digit * power <= longest)
    divisor, unit = scaled(length, "m")
    end, below = length / side, axes.transAxes
    axes.plot([0, end], [-0.05] * 2, color="black", lw=2.0, clip_on=False, transform=below)
    axes.text(end + 0.03, -0.05, f"{length / divisor:.3g} {unit}", transform=below, va="center")


def spectrum_labels(dimension: int) -> tuple[str, str]:
    """Labels of the axes q and C(q)."""
    return r"wavenumber  $q$ (m$^{-1}$)", rf"$C(q)$ (m$^{2 + dimension}$)"


def _draw_spectrum(axes: Any, spectrum: Spectrum, dimension: int) -> None:
    """C(q) with the fit."""
    axes.loglog(spectrum.q, spectrum.density, ".", ms=3, color="0.4")
    fitted = spectrum.fitted > 0
    axes.loglog(spectrum.q[fitted], spectrum.fitted[fitted], color=LINE)
    x, y = spectrum_labels(dimension)
    axes.set(xlabel=x, ylabel=y)
