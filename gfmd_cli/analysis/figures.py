"""Figures of a comparison, each as wide as a printed column: symbols simulation, lines theory.

Symbols are the points of a curve, or the means over seeds with a confidence band.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path
from typing import Self

import numpy as np

from gfmd_cli.analysis.compare import Comparison, best_of_all, einstein_prediction
from gfmd_cli.analysis.curve_styles import CurveStyle, StyledCurve, seed_groups, with_styles
from gfmd_cli.analysis.distribution_figure import continuum_figure, distribution_figures
from gfmd_cli.analysis.ensemble import by_load, residual_of, spread_of
from gfmd_cli.analysis.plotting import DASHED, THEORY, ColumnFigure, styled, write_all
from gfmd_cli.analysis.wording import contact_title, grid_size, in_si, with_unit
from gfmd_cli.grid.arrays import Field
from gfmd_cli.status import Status, worst
from gfmd_cli.study.column import Row
from gfmd_cli.units import count, scaled

LOWEST = 1e-3  # of a mean: lower end of its band on a logarithmic axis
MAX_BAR = 0.5  # of its value; the limits of an axis hold error bars up to this length
WIDE = 20  # a ratio that varies by more is drawn on a log scale
ROUNDING = 1e-9  # relative difference of equal values that were computed on different grids
P_STAR = r"reduced pressure  $p^* = p\,/\,\Delta\sigma$"
LABELS = {
    "a_r": r"relative contact area  $a_r$",
    "sigma_p": r"stress deviation  $\sigma_p\,/\,\Delta\sigma$",
    "u_g": r"mean gap  $u_g\,/\,h_\mathrm{std}$",
}
RATIO = r"$a_r\,/\,a_r$(Persson)"


@dataclass(frozen=True)
class Panel:
    """A quantity over the reduced pressure."""

    name: str
    column: str
    meaning: str
    """What the figure shows, as its caption."""
    x_scale: str = "log"
    y_scale: str = "linear"
    ratio: bool = False


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


@dataclass(frozen=True)
class Series:
    """A quantity over the pressure, of one curve or as the mean over seeds."""

    style: CurveStyle
    x: Field
    y: Field
    error: Field
    """Estimated error, of several seeds the mean of their errors; NaN where it is unknown."""
    half_width: Field
    """Half width of the 95 % confidence interval of the mean over seeds; NaN of a single seed."""
    statuses: Sequence[Status]
    details: Sequence[str]
    """Load, status and parameters of each point, a text of some lines."""
    theory: Field
    """Theory at `StyledCurve.p_star`, the mean over seeds."""

    @classmethod
    def of(cls, panel: Panel, items: list[StyledCurve]) -> Self:
        """The series of curves that differ in their seed only: what its scale can show."""
        loads = by_load(record for item in items for record in item.curve.records)
        loads.sort(key=lambda seeds: float(np.mean([record["p_star"] for record in seeds])))
        points = np.array([_point(panel, seeds) for seeds in loads])
        visible = np.isfinite(points[:, 1]) & ((points[:, 1] > 0) | (panel.y_scale == "linear"))
        shown = list(compress(loads, visible))
        statuses = [worst(record["status"] for record in seeds) for seeds in shown]
        style = items[0].style
        if len(items) > 1:
            sizes = [len(seeds) for seeds in loads]  # they differ in an unfinished study
            few = f"{min(sizes)} to " if min(sizes) < max(sizes) else ""
            style = replace(style, label=f"{style.label}, {few}{count(max(sizes), 'seed')}")
        theory = np.mean([getattr(item.theory, panel.column) for item in items], axis=0)
        x, y, error, half_width = points[visible].T
        return cls(style, x, y, error, half_width, statuses, list(map(_details, shown)), theory)

    def draw(self, plot: ColumnFigure, *, line: bool) -> None:
        """Draw points with error bars, the band of several seeds, and a line on request."""
        if line:
            plot.unnamed_line((self.style.label,), self.x, self.y, color=self.style.colour, lw=0.6)
        plot.points(
            self.style, self.x, self.y, self.statuses, error=self.error, details=self.details
        )
        known = np.isfinite(self.half_width)
        if np.any(known):
            x, y, wide = self.x[known], self.y[known], self.half_width[known]
            plot.band(self.style, x, np.maximum(y - wide, LOWEST * y), y + wide)


def _point(panel: Panel, records: list[Row]) -> tuple[float, float, float, float]:
    """p*, value, error, half width of the confidence interval."""
    name = panel.column
    units = np.array([r[f"{name}_persson"] if panel.ratio else 1.0 for r in records])
    values, errors = np.transpose(best_of_all(records, name)) / units
    half_width = np.nan
    if len(records) > 1:
        half_width = spread_of(values, errors, residual_of(records)).half_width
    p_star = np.mean([record["p_star"] for record in records])
    return float(p_star), float(values.mean()), float(np.abs(errors).mean()), half_width


def _details(rows: list[Row]) -> str:
    """Load, status and parameters of a point, a line each."""
    first = rows[0]
    pressure = float(np.mean([row["pressure"] for row in rows]))
    lines = [
        *([f"pressure {with_unit(pressure, 'Pa')}"] if in_si(first, "Pa") else []),
        contact_title(first, of_seeds=len(rows) > 1),
        f"{grid_size(rows)}, solver {first['solver']}",
    ]
    if len(rows) > 1:
        statuses = sorted({str(row["status"]) for row in rows})
        return "\n".join([*lines, f"mean of {len(rows)} seeds: {', '.join(statuses)}"])
    residual, tolerance = first["residual"], first["tolerance"]
    return "\n".join([*lines, f"{first['status']}: residual {residual:.1e} of {tolerance:.1e}"])


def draw_all(comparison: Comparison, folder: Path) -> list[Path]:
    """Draw every figure that the study has data for, as PDF and PNG; return their paths.

    Raises SpaceError where the folder cannot be written.
    """
    with styled():
        return write_all(study_figures(comparison, with_styles(comparison)), folder)


def study_figures(comparison: Comparison, items: list[StyledCurve]) -> dict[str, ColumnFigure]:
    """Every figure that the study has data for, by name; to be called inside `styled`."""
    figures = {panel.name: _over_pressure(panel, items) for panel in PANELS}
    figures |= distribution_figures(items)
    figures["stress_distribution_continuum"] = continuum_figure(comparison)
    return {name: plot for name, plot in figures.items() if plot is not None}


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
    source = items[0].curve.persson.mean_gap_source if panel.column == "u_g" else ""
    plot.theory(lines, f"theory by {source}" if source else THEORY)
    if panel.column == "u_g" and any(item.curve.n == 0 and item.curve.has_theory for item in items):
        exact = einstein_prediction(p_star).u_g
        plot.line("n = 0, Gaussian", p_star, exact, color="black", **DASHED)
    x = np.concatenate([series.x for series in drawn])
    plot.scale("x", panel.x_scale, x)
    _add_pascals(plot, items, float(x.max()))
    ys = [each.y + width for each in drawn for width in (0, np.nan_to_num(each.half_width))]
    for each in drawn:
        bars = np.minimum(np.nan_to_num(each.error), MAX_BAR * each.y)
        ys += [each.y - bars, each.y + bars]
    if panel.y_scale == "linear":
        low, high = plot.axes.get_xlim()
        ys += [y[(p_star >= low) & (p_star <= high)] for *_, y in lines]
    y = np.concatenate(ys)
    y = y[np.isfinite(y)]
    wide = panel.ratio and y.max() > WIDE * y.min() > 0
    plot.scale("y", "log" if wide else panel.y_scale, y, zero=not panel.ratio)
    return plot


def _add_pascals(plot: ColumnFigure, items: list[StyledCurve], largest: float) -> None:
    """Add an axis in Pa, if that means something and all curves have one Delta_sigma."""
    rows = [row for item in items for row in item.curve.rows]
    units = [float(row["delta_sigma"]) for row in rows]
    is_one = np.allclose(units, units[0], rtol=ROUNDING, atol=0)
    if is_one and all(in_si(row, "Pa") for row in rows):
        divisor, unit = scaled(largest * units[0], "Pa")
        plot.second_x(f"pressure  $p$ ({unit})", units[0] / divisor)
