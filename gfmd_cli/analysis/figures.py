"""Figures of a comparison, each as wide as a printed column: symbols simulation, lines theory."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from gfmd_cli.analysis.compare import Comparison, Row, einstein_prediction
from gfmd_cli.analysis.curve_styles import colours, curve_styles, order
from gfmd_cli.analysis.distribution import bin_counts
from gfmd_cli.analysis.distribution_figure import (
    DENSITY,
    STRESS,
    continuum_figure,
)
from gfmd_cli.analysis.ensemble import by_load
from gfmd_cli.analysis.plotting import THEORY, ColumnFigure, styled
from gfmd_cli.analysis.selection import at_one_pressure, evenly, pressure_label
from gfmd_cli.analysis.series import Item, Series, View, seed_groups
from gfmd_cli.analysis.units import in_si
from gfmd_cli.grid.arrays import Field
from gfmd_cli.status import Status
from gfmd_cli.study.columns import BINS, PR_LINEAR, PR_LOGARITHMIC
from gfmd_cli.units import scaled

PRESSURES = 5  # at which the distribution of one elastomer is drawn
WIDE = 20  # a ratio that varies by more is drawn on a log scale
ROUNDING = 1e-9  # relative difference of equal values that were computed on different grids
FEW = 10  # grid points; a bin with fewer is noise of 30 % and more
P_STAR = r"reduced pressure  $p^* = p\,/\,\Delta\sigma$"


AREA, GAP = r"relative contact area  $a_r$", r"mean gap  $u_g\,/\,h_\mathrm{std}$"
VIEWS = (
    View("contact_area", "a_r", AREA, y_scale="log"),
    View("contact_area_ratio", "a_r", r"$a_r\,/\,a_r$(Persson)", ratio=True),
    View("stress_deviation", "sigma_p", r"stress deviation  $\sigma_p\,/\,\Delta\sigma$"),
    View("mean_gap_log", "u_g", GAP),
    View("mean_gap_tail", "u_g", GAP, x_scale="linear", y_scale="log"),
)


def draw_all(comparison: Comparison, folder: Path) -> list[Path]:
    """Draw every figure that the study has data for, as PDF and PNG; return their paths.

    Raises SpaceError where the folder cannot be written.
    """
    with styled():
        drawn = study_figures(comparison, items_of(comparison))
        return [path for name, plot in drawn.items() for path in plot.write(folder / name)]


def study_figures(comparison: Comparison, items: list[Item]) -> dict[str, ColumnFigure]:
    """Every figure that the study has data for, by name; to be called inside `styled`."""
    drawn = {view.name: _over_pressure(view, items) for view in VIEWS}
    drawn["stress_distribution"] = _distribution(items)
    drawn["stress_distribution_pressures"] = _distribution_pressures(items)
    drawn["stress_distribution_continuum"] = continuum_figure(comparison)
    return {name: plot for name, plot in drawn.items() if plot is not None}


def items_of(comparison: Comparison) -> list[Item]:
    """The curves of a study in the order and style of its figures."""
    curves = sorted(comparison.curves, key=order)
    pressures = np.concatenate([curve.column("p_star") for curve in curves])
    low, high = pressures.min() / 3, pressures.max() * 3
    low = min(low, high / 1000)  # near the left end of a linear axis
    p_star = np.union1d(np.geomspace(low, high, 200), np.linspace(low, high, 100))
    return [
        Item(curve, style, p_star, curve.predict(p_star))
        for curve, style in zip(curves, curve_styles(curves), strict=True)
    ]


def _over_pressure(view: View, items: list[Item]) -> ColumnFigure | None:
    """One quantity of all curves over the pressure, beside theory; None without data."""
    plot = ColumnFigure(P_STAR, view.label)
    drawn = []
    for series in map(partial(Series.of, view), seed_groups(items)):
        kept = np.isfinite(series.y) & ((series.y > 0) | (view.y_scale == "linear"))
        if np.any(kept):
            drawn.append(series.only(kept))
            drawn[-1].draw(plot, line=view.ratio)
    if not drawn:
        return None
    p_star = items[0].p_star
    lines = [(series.style, p_star, series.theory) for series in drawn]
    if view.ratio:
        lines = [(drawn[0].style, p_star, np.ones_like(p_star))]
    plot.theory(lines)
    xs, ys = [series.x for series in drawn], [series.extent() for series in drawn]
    if view.column == "u_g" and any(item.curve.n == 0 and item.curve.has_theory for item in items):
        exact, dashes = einstein_prediction(p_star).u_g, (0, (4, 2))
        plot.line(
            plot.axes,
            "n = 0, Gaussian",
            p_star,
            exact,
            color="black",
            ls=dashes,
            lw=0.8,
            zorder=2.5,
        )
    plot.scale("x", view.x_scale, np.concatenate(xs))
    _add_pascals(plot, items, float(np.concatenate(xs).max()))
    if view.y_scale == "linear":
        low, high = plot.axes.get_xlim()
        ys += [y[(p_star >= low) & (p_star <= high)] for *_, y in lines]
    y = np.concatenate(ys)
    y = y[np.isfinite(y)]
    wide = view.ratio and y.max() > WIDE * y.min() > 0
    plot.scale("y", "log" if wide else view.y_scale, y, zero=not view.ratio)
    return plot


def _add_pascals(plot: ColumnFigure, items: list[Item], largest: float) -> None:
    """Add an axis in Pa, if the study has SI units and one Delta_sigma for all curves."""
    rows = [row for item in items for row in item.curve.rows]
    units = [float(row["delta_sigma"]) for row in rows]
    if all(map(in_si, rows)) and np.allclose(units, units[0], rtol=ROUNDING, atol=0):
        divisor, unit = scaled(largest * units[0], "Pa")
        plot.second_x(f"pressure  $p$ ({unit})", units[0] / divisor)


@dataclass(frozen=True)
class Density:
    """Pr(sigma) of one contact as it is drawn, all in units of Delta_sigma."""

    item: Item
    row: Row
    sigma: Field
    density: Field
    """Of bins with enough points."""

    def theory(self, sigma: Field) -> Field:
        """Persson theory. Paper Eq. (24)."""
        return self.item.curve.stress_density(sigma, self.row["p_star"])


def densities(items: list[Item]) -> dict[str, list[Density]]:
    """What the figures of Pr(sigma) show, by their names."""
    return {
        "stress_distribution": _side_by_side(items),
        "stress_distribution_pressures": _at_pressures(items),
    }


def _side_by_side(items: list[Item]) -> list[Density]:
    """The curves at about one pressure."""
    groups = [
        [(group[0], row) for row in _with_density(group, PR_LOGARITHMIC)]
        for group in seed_groups(items)
    ]
    pairs = at_one_pressure(
        [group for group in groups if group], lambda pair: (pair[1]["p_star"], pair[1]["a_r"])
    )
    return [Density(item, row, *_bins(row, PR_LOGARITHMIC)) for item, row in pairs]


def _distribution(items: list[Item]) -> ColumnFigure | None:
    """Pr(sigma) of the curves at one pressure."""
    best = _side_by_side(items)
    if not best:
        return None
    label = pressure_label([found.row["p_star"] for found in best])
    plot = ColumnFigure(f"{STRESS}  at  {label}", DENSITY)
    for place, found in enumerate(best):
        style, x, y = found.item.style, found.sigma, found.density
        plot.unnamed_line((style.label,), x, y, color=style.colour, lw=0.7)
        converged = np.full(x.size, found.row["status"] == Status.CONVERGED)
        plot.points(style, x, y, converged, every=(place % 3, 3) if len(best) > 1 else 1)
    plot.scale("x", "log", np.concatenate([found.sigma for found in best]))
    plot.scale("y", "log", np.concatenate([found.density for found in best]))
    sigma = np.geomspace(*plot.axes.get_xlim(), 400)
    plot.theory([(found.item.style, sigma, found.theory(sigma)) for found in best])
    return plot


def _at_pressures(items: list[Item]) -> list[Density]:
    """The curve nearest to n = 1 at a few pressures."""
    pairs = [(group[0], _with_density(group, PR_LINEAR)) for group in seed_groups(items)]
    pairs = [(item, rows) for item, rows in pairs if len(rows) > 1]
    if not pairs:
        return []
    item, rows = min(pairs, key=lambda pair: np.nan_to_num(abs(pair[0].curve.n - 1), nan=9.0))
    return [Density(item, row, *_bins(row, PR_LINEAR)) for row in evenly(rows, PRESSURES)]


def _distribution_pressures(items: list[Item]) -> ColumnFigure | None:
    """Pr(sigma) of one curve at a few pressures, over the stress itself."""
    shown = _at_pressures(items)
    if not shown:
        return None
    plot = ColumnFigure(f"{STRESS}  for  {shown[0].item.style.label[:24]}", DENSITY)
    for found, colour in zip(shown, colours(len(shown)), strict=True):
        label = f"p* = {found.row['p_star']:.3g}"
        plot.line(plot.axes, label, found.sigma, found.density, color=colour, lw=1.6)
    plot.scale("x", "linear", np.concatenate([found.sigma for found in shown]))
    plot.scale("y", "log", np.concatenate([found.density for found in shown]))
    sigma = np.linspace(0.0, plot.axes.get_xlim()[1], 400)
    for found in shown:
        if found.item.curve.has_theory:
            density = found.theory(sigma)
            plot.line(plot.axes, THEORY, sigma, density, color="black", lw=0.6, zorder=3)
    return plot


def _with_density(items: list[Item], name: str) -> list[Row]:
    """The rows that have enough of Pr(sigma) for a line; of several seeds with the mean of all."""
    rows = []
    for seeds in by_load(row for item in items for row in item.curve.rows):
        stored = [row for row in seeds if name in row and _bins(row, name)[0].size > 2]
        if stored:
            rows.append(stored[0] | {name: np.mean([row[name] for row in stored], axis=0)})
    return rows


def _bins(row: Row, name: str) -> tuple[Field, Field]:
    """Pr(sigma) Delta_sigma over sigma / Delta_sigma, bins with fewer than FEW points left out."""
    kept = bin_counts(row, name) > FEW - 0.5
    return BINS[name].middles()[kept], np.nan_to_num(row[name])[kept]
