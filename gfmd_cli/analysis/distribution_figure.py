"""Figures of Pr(sigma), on the grids and in the continuum, as the paper's Figs. 7 and 13."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from textwrap import wrap

import numpy as np

from gfmd_cli.analysis.compare import Comparison
from gfmd_cli.analysis.curve_styles import (
    CurveStyle,
    StyledCurve,
    colours,
    curve_styles,
    literal,
    order,
    seed_groups,
)  # fmt: skip
from gfmd_cli.analysis.distribution import (
    StressDistribution,
    bin_counts,
    distributions,
    has_histogram,
)
from gfmd_cli.analysis.edge_law import fit_power_law
from gfmd_cli.analysis.ensemble import by_load
from gfmd_cli.analysis.plotting import DASHED, THEORY, ColumnFigure
from gfmd_cli.analysis.selection import T, evenly, grouped
from gfmd_cli.analysis.tables import curve_title
from gfmd_cli.grid.arrays import Field
from gfmd_cli.status import worst
from gfmd_cli.study.column import Row
from gfmd_cli.study.columns import HISTOGRAMS_BY_NAME, PR_LINEAR, PR_LOGARITHMIC

TYPICAL_AREA = 0.1  # relative contact area of the paper's Fig. 7
NEAR = 1.5  # pressures that differ by a smaller factor are shown side by side
PRESSURES = 5  # at which the distribution of one elastomer is drawn
MIN_COUNT = 10  # grid points; a bin with fewer is noise of 30 % and more
EXTENSION = 2.5  # factor that the edge law is drawn beyond the window of its fit
MIN_DENSITY = 3e-3  # lowest density that is drawn, as a share of the highest
LINE, MAX_LINES = 38, 4  # characters of a line of the name of a curve below the axis, and lines
EDGE_LAW = "edge law"
STRESS, DENSITY = r"stress  $\sigma\,/\,\Delta\sigma$", r"$\mathrm{Pr}(\sigma)\;\Delta\sigma$"


@dataclass(frozen=True)
class Density:
    """Pr(sigma) of one contact as it is drawn, all in units of Delta_sigma."""

    item: StyledCurve
    row: Row
    """Row of the contact; of several seeds, that of one, with mean density and pressure, and with
    the worst status of all."""
    seeds: int
    """Number of seeds of which this is the mean."""
    sigma: Field
    density: Field
    """Pr(sigma) in the bins with enough points."""

    @property
    def remark(self) -> str:
        """What the contact, or one of several seeds, has missed; empty if all are converged."""
        missed = self.row["status"].shortfall
        return f", {missed}" if missed else ""

    def theory(self, sigma: Field) -> Field:
        """Persson theory. Paper Eq. (24)."""
        return self.item.curve.stress_density(sigma, self.row["p_star"])


def densities(items: list[StyledCurve]) -> dict[str, list[Density]]:
    """What the figures of Pr(sigma) show, by their names: curves, or pressures, side by side.

    The curves are shown at about one pressure, the pressures of the curve nearest to n = 1.
    """
    groups = _densities(items, PR_LOGARITHMIC)
    side_by_side = at_one_pressure(groups, lambda each: (each.row["p_star"], each.row["a_r"]))
    several = [group for group in _densities(items, PR_LINEAR) if len(group) > 1]
    several.sort(key=lambda group: np.nan_to_num(abs(group[0].item.curve.n - 1), nan=9.0))
    return {
        "stress_distribution": side_by_side,
        "stress_distribution_pressures": evenly(several[0], PRESSURES) if several else [],
    }


def at_one_pressure(
    groups: Sequence[Sequence[T]], load: Callable[[T], tuple[float, float]]
) -> list[T]:
    """One contact of each group at about one pressure, of the groups that have it.

    The pressure is that of most groups; among several, that at which the contact areas are nearest
    to TYPICAL_AREA. `load` gives p* and a_r of a contact.
    """

    def near(p_star: float) -> list[T]:
        nearest = [
            min(group, key=lambda contact: abs(np.log(load(contact)[0] / p_star)))
            for group in groups
        ]
        return [contact for contact in nearest if 1 / NEAR < load(contact)[0] / p_star < NEAR]

    def rank(p_star: float) -> tuple[int, float]:
        areas = np.array([load(contact)[1] for contact in near(p_star)])
        return -areas.size, float(np.sum(np.abs(np.log(areas / TYPICAL_AREA))))

    pressures = sorted({load(contact)[0] for group in groups for contact in group})
    return near(min(pressures, key=rank)) if pressures else []


def _densities(items: list[StyledCurve], name: str) -> list[list[Density]]:
    """The contacts of each curve that have enough bins for a line; of seeds the mean of all."""
    groups = []
    for group in seed_groups(items):
        loads = by_load(row for item in group for row in item.curve.rows)
        stored = ([row for row in seeds if has_histogram(row, name)] for seeds in loads)
        shown = [mean_density(group[0], rows, name) for rows in stored if rows]
        groups.append([density for density in shown if density.sigma.size > 2])
    return [group for group in groups if group]


def mean_density(item: StyledCurve, rows: list[Row], name: str) -> Density:
    """Pr(sigma) of one seed or the mean of several, in bins of MIN_COUNT points or more."""
    row = rows[0] | {"status": worst(row["status"] for row in rows)}
    row |= {key: np.mean([row[key] for row in rows], axis=0) for key in (name, "p_star")}
    frequent = bin_counts(row, name) > MIN_COUNT - 0.5
    return Density(
        item, row, len(rows), HISTOGRAMS_BY_NAME[name].middles()[frequent], row[name][frequent]
    )


def distribution_figures(items: list[StyledCurve]) -> dict[str, ColumnFigure | None]:
    """The figures of `densities`; None without data."""
    shown = densities(items)
    figures = {"stress_distribution": _side_by_side, "stress_distribution_pressures": _pressures}
    return {name: draw(shown[name]) if shown[name] else None for name, draw in figures.items()}


def _side_by_side(shown: list[Density]) -> ColumnFigure:
    """Pr(sigma) of the curves at one pressure."""
    plot = _at_pressure([stress.row["p_star"] for stress in shown])
    for place, stress in enumerate(shown):
        style, x, y = stress.item.style, stress.sigma, stress.density
        plot.unnamed_line((style.label,), x, y, color=style.colour, lw=0.7)
        statuses = [stress.row["status"]] * x.size
        plot.points(style, x, y, statuses, every=(place % 3, 3) if len(shown) > 1 else 1)
    _scale(plot, "log", shown)
    sigma = np.geomspace(*plot.axes.get_xlim(), 400)
    plot.theory([(stress.item.style, sigma, stress.theory(sigma)) for stress in shown])
    return plot


def _at_pressure(p_stars: list[float]) -> ColumnFigure:
    """A figure with the reduced pressure, or its range, in the label of its axis."""
    low, high = min(p_stars), max(p_stars)
    between = f"{low:.3g}" if high < 1.001 * low else rf"{low:.3g}\;\mathrm{{to}}\;{high:.3g}"
    return ColumnFigure(f"{STRESS}  at  $p^* = {between}$", DENSITY)


def _pressures(shown: list[Density]) -> ColumnFigure:
    """Pr(sigma) of one curve at a few pressures."""
    title = curve_title(shown[0].item.curve, of_seeds=shown[0].seeds > 1)
    lines = wrap(
        literal(title), LINE, max_lines=MAX_LINES, placeholder="\u2026", break_on_hyphens=False
    )
    plot = ColumnFigure("\n".join([STRESS, *lines]), DENSITY)
    for stress, colour in zip(shown, colours(len(shown)), strict=True):
        label = f"p* = {stress.row['p_star']:.3g}{stress.remark}"
        plot.line(label, stress.sigma, stress.density, color=colour, lw=1.6)
    _scale(plot, "linear", shown)
    sigma = np.linspace(0.0, plot.axes.get_xlim()[1], 400)
    for stress in shown:
        if stress.item.curve.has_theory:
            density = stress.theory(sigma)
            plot.line(THEORY, sigma, density, color="black", lw=0.6, zorder=3)
    return plot


def _scale(plot: ColumnFigure, x_scale: str, shown: list[Density]) -> None:
    plot.scale("x", x_scale, np.concatenate([stress.sigma for stress in shown]))
    plot.scale("y", "log", np.concatenate([stress.density for stress in shown]))


def continuum_figure(comparison: Comparison) -> ColumnFigure | None:
    """Extrapolated Pr(sigma) with its errors, the grids behind it, theory and the law of the edge.

    The pressure is that of `at_one_pressure`. None where no contact has two grids.
    """
    stresses = _chosen([f for f in distributions(comparison) if np.isfinite(f.density).sum() > 2])
    if not stresses:
        return None
    plot = _at_pressure([stress.finest["p_star"] for stress in stresses])
    styles = curve_styles([stress.curve for stress in stresses])
    pairs = list(zip(stresses, styles, strict=True))
    ends = np.array([_draw(plot, stress, style) for stress, style in pairs])
    plot.scale("x", "log", ends[:, :2])
    plot.scale("y", "log", ends[:, 2:])
    sigma = np.geomspace(*plot.axes.get_xlim(), 400)
    plot.theory(
        [(style, sigma, f.curve.stress_density(sigma, f.finest["p_star"])) for f, style in pairs],
    )
    for stress, style in pairs:
        _edge_law(plot, stress, style)
    return plot


def _chosen(stresses: list[StressDistribution]) -> list[StressDistribution]:
    """One distribution of each elastomer on each surface, at about one pressure."""
    ordered = sorted(stresses, key=lambda each: order(each.curve))
    by_title = list(grouped(ordered, lambda each: each.title).values())
    return at_one_pressure(by_title, lambda each: (each.finest["p_star"], each.a_r))


def _draw(
    plot: ColumnFigure, stress: StressDistribution, style: CurveStyle
) -> tuple[float, float, float, float]:
    """Symbols with error bars over the faint lines of the grids; return the span of the symbols."""
    sigma = HISTOGRAMS_BY_NAME[PR_LOGARITHMIC].middles()
    for density in np.where(stress.grid_densities > 0, stress.grid_densities, np.nan):
        faint = {"color": style.colour, "lw": 0.4, "alpha": 0.45}
        plot.unnamed_line((style.label,), sigma, density, **faint)
    known = np.isfinite(stress.density) & np.isfinite(stress.error)
    x, y, error = sigma[known], stress.density[known], stress.error[known]
    bars = np.array([y * -np.expm1(-error), y * np.expm1(error)])  # of ln Pr
    plot.points(style, x, y, [stress.finest["status"]] * x.size, error=bars)
    visible = y > MIN_DENSITY * y.max()
    return float(x[visible].min()), float(x[visible].max()), float(y[visible].min()), float(y.max())


def _edge_law(plot: ColumnFigure, stress: StressDistribution, style: CurveStyle) -> None:
    """The law of the edge through the bins nearest to it, dashed."""
    for name in ("small", "large"):
        law = fit_power_law(stress, name)
        if law is None or not np.isfinite(law.theory):
            continue
        low, high = law.lowest, law.highest
        span = (low / EXTENSION, high) if name == "small" else (low, high * EXTENSION)
        sigma = np.geomspace(*span, 50)
        density = law.edge_prefactor * sigma**law.theory
        plot.unnamed_line((style.label, EDGE_LAW), sigma, density, color=style.colour, **DASHED)
        plot.line(EDGE_LAW, sigma[:0], density[:0], color="0.4", **DASHED)
