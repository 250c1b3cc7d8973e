"""Figures of a comparison, each as wide as a printed column: symbols simulation, lines theory."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gfmd_cli.analysis.compare import Comparison, Curve, Prediction, Row, einstein_prediction
from gfmd_cli.analysis.distribution import bin_counts
from gfmd_cli.analysis.distribution_figure import (
    DENSITY,
    NEAR,
    STRESS,
    TYPICAL_AREA,
    continuum_sheet,
)
from gfmd_cli.analysis.looks import Look, colours, looks, order
from gfmd_cli.analysis.sheet import THEORY, Sheet, styled
from gfmd_cli.physics.fields import Field
from gfmd_cli.study.layout import BINS, PR_LINEAR, PR_LOGARITHMIC

PRESSURES = 5  # that the distribution of one body is drawn at
WIDE = 20  # a ratio that varies by more is drawn on a log scale
FEW = 10  # grid points; a bin with fewer is noise of 30 % and more
P_STAR = r"reduced pressure  $p^* = p\,/\,\Delta\sigma$"


@dataclass(frozen=True)
class View:
    """A quantity over the reduced pressure."""

    name: str
    column: str
    label: str
    x_scale: str = "log"
    y_scale: str = "linear"
    ratio: bool = False


AREA, GAP = r"relative contact area  $a_r$", r"mean gap  $u_g\,/\,h_\mathrm{std}$"
VIEWS = (
    View("contact_area", "a_r", AREA, y_scale="log"),
    View("contact_area_ratio", "a_r", r"$a_r\,/\,a_r$(Persson)", ratio=True),
    View("stress_deviation", "sigma_p", r"stress deviation  $\sigma_p\,/\,\Delta\sigma$"),
    View("mean_gap_log", "u_g", GAP),
    View("mean_gap_tail", "u_g", GAP, x_scale="linear", y_scale="log"),
)


@dataclass(frozen=True)
class Item:
    """A curve with its look, and its theory over pressures close enough for a line."""

    curve: Curve
    look: Look
    p_star: Field
    theory: Prediction


def draw_all(comparison: Comparison, folder: Path) -> list[Path]:
    """Draw every figure that the study has data for, as PDF and PNG; return their paths.

    Raises SpaceError where the folder cannot be written.
    """
    with styled():
        drawn = sheets(comparison, items_of(comparison))
        return [path for name, sheet in drawn.items() for path in sheet.write(folder / name)]


def sheets(comparison: Comparison, items: list[Item]) -> dict[str, Sheet]:
    """Every figure that the study has data for, by name; to be called inside `styled`."""
    drawn = {view.name: _over_pressure(view, items) for view in VIEWS}
    drawn["stress_distribution"] = _distribution(items)
    drawn["stress_distribution_pressures"] = _distribution_pressures(items)
    drawn["stress_distribution_continuum"] = continuum_sheet(comparison)
    return {name: sheet for name, sheet in drawn.items() if sheet is not None}


def items_of(comparison: Comparison) -> list[Item]:
    """The curves of a study in the order and look of its figures."""
    curves = sorted(comparison.curves, key=order)
    pressures = np.concatenate([curve.column("p_star") for curve in curves])
    low, high = pressures.min() / 3, pressures.max() * 3
    low = min(low, high / 1000)  # near the left end of a linear axis
    p_star = np.union1d(np.geomspace(low, high, 200), np.linspace(low, high, 100))
    return [
        Item(curve, look, p_star, curve.predict(p_star))
        for curve, look in zip(curves, looks(curves), strict=True)
    ]


def _over_pressure(view: View, items: list[Item]) -> Sheet | None:
    """One quantity of all curves over the pressure, beside theory; None without data."""
    sheet = Sheet(P_STAR, view.label)
    drawn, xs, ys = [], [], []
    for item in items:
        curve, look = item.curve, item.look
        x, (y, error) = curve.column("p_star"), curve.best(view.column)
        unit = getattr(curve.prediction, view.column) if view.ratio else np.ones_like(y)
        y, error = y / unit, np.abs(error) / unit
        kept = np.isfinite(y) & ((y > 0) | (view.y_scale == "linear"))
        if not np.any(kept):
            continue
        converged = np.array([row["status"] == "converged" for row in curve.rows])
        if view.ratio:
            sheet.axes.plot(x[kept], y[kept], color=look.colour, lw=0.6)
        barred = kept & np.isfinite(error)
        if np.any(barred):
            sheet.bars(look, x[barred], y[barred], error[barred])
        sheet.points(look, x[kept], y[kept], converged[kept])
        drawn.append(item)
        xs.append(x[kept])
        ys.append(y[kept])
    if not drawn:
        return None
    p_star = drawn[0].p_star
    lines = [(item.look, p_star, getattr(item.theory, view.column)) for item in drawn]
    if view.ratio:
        lines = [(drawn[0].look, p_star, np.ones_like(p_star))]
    sheet.theory(lines)
    if view.column == "u_g" and any(item.curve.n == 0 for item in drawn):
        exact, dashes = einstein_prediction(p_star).u_g, (0, (4, 2))
        sheet.line(
            sheet.axes,
            "n = 0, Gaussian",
            p_star,
            exact,
            color="black",
            ls=dashes,
            lw=0.8,
            zorder=2.5,
        )
    sheet.scale("x", view.x_scale, np.concatenate(xs))
    if view.y_scale == "linear":
        low, high = sheet.axes.get_xlim()
        ys += [y[(p_star >= low) & (p_star <= high)] for *_, y in lines]
    y = np.concatenate(ys)
    wide = view.ratio and y.max() > WIDE * y.min() > 0
    sheet.scale("y", "log" if wide else view.y_scale, y, zero=not view.ratio)
    return sheet


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
    """The curves at one pressure: that of most curves, then of a_r = TYPICAL_AREA."""
    held = [(item, _with_density(item.curve, PR_LOGARITHMIC)) for item in items]
    held = [(item, rows) for item, rows in held if rows]
    if not held:
        return []

    def chosen(p_star: float) -> list[tuple[Item, Row]]:
        pairs = [
            (item, min(rows, key=lambda row: abs(np.log(row["p_star"] / p_star))))
            for item, rows in held
        ]
        return [(i, row) for i, row in pairs if 1 / NEAR < row["p_star"] / p_star < NEAR]

    def distance(p_star: float) -> tuple[int, float]:
        areas = np.array([row["a_r"] for _, row in chosen(p_star)])
        return -areas.size, float(np.sum(np.abs(np.log(areas / TYPICAL_AREA))))

    best = chosen(min(sorted({row["p_star"] for _, rows in held for row in rows}), key=distance))
    return [Density(item, row, *_bins(row, PR_LOGARITHMIC)) for item, row in best]


def _distribution(items: list[Item]) -> Sheet | None:
    """Pr(sigma) of the curves at one pressure."""
    best = _side_by_side(items)
    if not best:
        return None
    low, high = (end(found.row["p_star"] for found in best) for end in (min, max))
    between = f"{low:.3g}" if high < 1.001 * low else rf"{low:.3g}\;\mathrm{{to}}\;{high:.3g}"
    sheet = Sheet(rf"{STRESS}  at  $p^* = {between}$", DENSITY)
    for place, found in enumerate(best):
        look, x, y = found.item.look, found.sigma, found.density
        sheet.axes.plot(x, y, color=look.colour, lw=0.7)
        converged = np.full(x.size, found.row["status"] == "converged")
        sheet.points(look, x, y, converged, every=(place % 3, 3) if len(best) > 1 else 1)
    sheet.scale("x", "log", np.concatenate([found.sigma for found in best]))
    sheet.scale("y", "log", np.concatenate([found.density for found in best]))
    sigma = np.geomspace(*sheet.axes.get_xlim(), 400)
    sheet.theory([(found.item.look, sigma, found.theory(sigma)) for found in best])
    return sheet


def _at_pressures(items: list[Item]) -> list[Density]:
    """The curve nearest to n = 1 at a few pressures."""
    held = [(item, _with_density(item.curve, PR_LINEAR)) for item in items]
    held = [(item, rows) for item, rows in held if len(rows) > 1]
    if not held:
        return []
    item, rows = min(held, key=lambda pair: np.nan_to_num(abs(pair[0].curve.n - 1), nan=9.0))
    places = np.unique(np.linspace(0, len(rows) - 1, PRESSURES).round().astype(int))
    return [Density(item, rows[place], *_bins(rows[place], PR_LINEAR)) for place in places]


def _distribution_pressures(items: list[Item]) -> Sheet | None:
    """Pr(sigma) of one curve at a few pressures, over the stress itself."""
    shown = _at_pressures(items)
    if not shown:
        return None
    sheet = Sheet(f"{STRESS}  for  {shown[0].item.look.label[:24]}", DENSITY)
    for found, colour in zip(shown, colours(len(shown)), strict=True):
        label = f"p* = {found.row['p_star']:.3g}"
        sheet.line(sheet.axes, label, found.sigma, found.density, color=colour, lw=1.6)
    sheet.scale("x", "linear", np.concatenate([found.sigma for found in shown]))
    sheet.scale("y", "log", np.concatenate([found.density for found in shown]))
    sigma = np.linspace(0.0, sheet.axes.get_xlim()[1], 400)
    for found in shown:
        sheet.line(sheet.axes, THEORY, sigma, found.theory(sigma), color="black", lw=0.6, zorder=3)
    return sheet


def _with_density(curve: Curve, name: str) -> list[Row]:
    """The rows that have enough of Pr(sigma) for a line."""
    return [row for row in curve.rows if name in row and _bins(row, name)[0].size > 2]


def _bins(row: Row, name: str) -> tuple[Field, Field]:
    """Pr(sigma) Delta_sigma over sigma / Delta_sigma, bins with fewer than FEW points left out."""
    kept = bin_counts(row, name) > FEW - 0.5
    return BINS[name].middles()[kept], np.nan_to_num(row[name])[kept]
