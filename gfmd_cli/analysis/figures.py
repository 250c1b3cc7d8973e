"""Figures of a comparison, each as wide as a printed column: symbols simulation, lines theory."""

from pathlib import Path

import numpy as np

from gfmd_cli.analysis.compare import Comparison, einstein_prediction
from gfmd_cli.analysis.curve_styles import curve_styles, order
from gfmd_cli.analysis.distribution_figure import continuum_figure, distribution_figures
from gfmd_cli.analysis.plotting import DASHED, ColumnFigure, styled
from gfmd_cli.analysis.series import Panel, Series, StyledCurve, seed_groups
from gfmd_cli.analysis.wording import in_si
from gfmd_cli.files.atomic import make_folder
from gfmd_cli.units import scaled

WIDE = 20  # a ratio that varies by more is drawn on a log scale
ROUNDING = 1e-9  # relative difference of equal values that were computed on different grids
P_STAR = r"reduced pressure  $p^* = p\,/\,\Delta\sigma$"
LABELS = {
    "a_r": r"relative contact area  $a_r$",
    "sigma_p": r"stress deviation  $\sigma_p\,/\,\Delta\sigma$",
    "u_g": r"mean gap  $u_g\,/\,h_\mathrm{std}$",
}
RATIO = r"$a_r\,/\,a_r$(Persson)"
PANELS = (
    Panel("contact_area", "a_r", "Relative contact area over reduced pressure", y_scale="log"),
    Panel("contact_area_ratio", "a_r", "Contact area over that of Persson theory", ratio=True),
    Panel("stress_deviation", "sigma_p", "Standard deviation of the stress over reduced pressure"),
    Panel("mean_gap_log", "u_g", "Mean gap over the logarithm of the reduced pressure"),
    Panel(
        "mean_gap_tail",
        "u_g",
        "Logarithm of the mean gap over the reduced pressure",
        "linear",
        "log",
    ),
)
"""The figures over the pressure."""


def draw_all(comparison: Comparison, folder: Path) -> list[Path]:
    """Draw every figure that the study has data for, as PDF and PNG; return their paths.

    Raises SpaceError where the folder cannot be written.
    """
    make_folder(folder)
    with styled():
        drawn = study_figures(comparison, with_styles(comparison))
        return [path for name, plot in drawn.items() for path in plot.write(folder / name)]


def study_figures(comparison: Comparison, items: list[StyledCurve]) -> dict[str, ColumnFigure]:
    """Every figure that the study has data for, by name; to be called inside `styled`."""
    figures = {panel.name: _over_pressure(panel, items) for panel in PANELS}
    figures |= distribution_figures(items)
    figures["stress_distribution_continuum"] = continuum_figure(comparison)
    return {name: plot for name, plot in figures.items() if plot is not None}


def with_styles(comparison: Comparison) -> list[StyledCurve]:
    """The curves of a study in the order and style of its figures."""
    curves = sorted(comparison.curves, key=order)
    pressures = np.concatenate([curve.column("p_star") for curve in curves])
    low, high = pressures.min() / 3, pressures.max() * 3
    low = min(low, high / 1000)  # near the left end of a linear axis
    p_star = np.union1d(np.geomspace(low, high, 200), np.linspace(low, high, 100))
    return [
        StyledCurve(curve, style, p_star, curve.predict(p_star))
        for curve, style in zip(curves, curve_styles(curves), strict=True)
    ]


def _over_pressure(panel: Panel, items: list[StyledCurve]) -> ColumnFigure | None:
    """One quantity of all curves over the pressure, beside theory; None without data."""
    drawn = [Series.of(panel, group) for group in seed_groups(items)]
    drawn = [series for series in drawn if series.x.size]
    if not drawn:
        return None
    plot = ColumnFigure(P_STAR, RATIO if panel.ratio else LABELS[panel.column])
    for series in drawn:
        series.draw(plot, line=panel.ratio)
    p_star = items[0].p_star
    lines = [(series.style, p_star, series.theory) for series in drawn]
    if panel.ratio:
        lines = [(drawn[0].style, p_star, np.ones_like(p_star))]
    plot.theory(lines)
    if panel.column == "u_g" and any(item.curve.n == 0 and item.curve.has_theory for item in items):
        exact = einstein_prediction(p_star).u_g
        plot.line("n = 0, Gaussian", p_star, exact, color="black", **DASHED)
    x = np.concatenate([series.x for series in drawn])
    plot.scale("x", panel.x_scale, x)
    _add_pascals(plot, items, float(x.max()))
    ys = [series.extent() for series in drawn]
    if panel.y_scale == "linear":
        low, high = plot.axes.get_xlim()
        ys += [y[(p_star >= low) & (p_star <= high)] for *_, y in lines]
    y = np.concatenate(ys)
    y = y[np.isfinite(y)]
    wide = panel.ratio and y.max() > WIDE * y.min() > 0
    plot.scale("y", "log" if wide else panel.y_scale, y, zero=not panel.ratio)
    return plot


def _add_pascals(plot: ColumnFigure, items: list[StyledCurve], largest: float) -> None:
    """Add an axis in Pa, if the study has SI units and one Delta_sigma for all curves."""
    rows = [row for item in items for row in item.curve.rows]
    units = [float(row["delta_sigma"]) for row in rows]
    if all(map(in_si, rows)) and np.allclose(units, units[0], rtol=ROUNDING, atol=0):
        divisor, unit = scaled(largest * units[0], "Pa")
        plot.second_x(f"pressure  $p$ ({unit})", units[0] / divisor)
