"""Figure of Pr(sigma) in the continuum, as the paper's Figs. 7 and 13."""

from typing import Any

import numpy as np

from gfmd_cli.analysis.compare import Comparison
from gfmd_cli.analysis.curve_styles import CurveStyle, curve_styles, order
from gfmd_cli.analysis.distribution import StressDistribution, distributions
from gfmd_cli.analysis.edge_law import fit
from gfmd_cli.analysis.plotting import ColumnFigure
from gfmd_cli.analysis.selection import at_one_pressure, grouped, pressure_label
from gfmd_cli.physics.observables import logarithmic_middles

MOST = 8  # contacts; more cannot be told apart
BEYOND = 2.5  # factor that the edge law is drawn beyond the window of its fit
LOWEST = 3e-3  # share of the highest density that is drawn at the least, and of the lowest known
EDGE_LAW = "edge law"
STRESS, DENSITY = r"stress  $\sigma\,/\,\Delta\sigma$", r"$\mathrm{Pr}(\sigma)\;\Delta\sigma$"


def continuum_figure(comparison: Comparison) -> ColumnFigure | None:
    """Extrapolated Pr(sigma) with its errors, the grids behind it, theory and the law of the edge.

    The pressure is that of `at_one_pressure`. None where no contact has two grids.
    """
    chosen = _chosen([f for f in distributions(comparison) if np.isfinite(f.density).sum() > 2])
    if not chosen:
        return None
    label = pressure_label([found.finest["p_star"] for found in chosen])
    plot = ColumnFigure(f"{STRESS}  at  {label}", DENSITY)
    styles = curve_styles([found.curve for found in chosen])
    spans = [_draw(plot, found, style) for found, style in zip(chosen, styles, strict=True)]
    ends = np.array(spans)
    plot.scale("x", "log", ends[:, :2])
    plot.scale("y", "log", ends[:, 2:])
    sigma = np.geomspace(*plot.axes.get_xlim(), 400)
    plot.theory(
        [
            (style, sigma, f.curve.stress_density(sigma, f.finest["p_star"]))
            for f, style in zip(chosen, styles, strict=True)
        ],
    )
    for found, style in zip(chosen, styles, strict=True):
        _edge_law(plot, found, style)
    return plot


def _chosen(found: list[StressDistribution]) -> list[StressDistribution]:
    """One distribution of each scene, at about one pressure."""
    ordered = sorted(found, key=lambda each: order(each.curve))
    scenes = list(grouped(ordered, lambda each: each.scene).values())
    return at_one_pressure(scenes, lambda each: (each.finest["p_star"], each.a_r))[:MOST]


def _draw(
    plot: ColumnFigure, found: StressDistribution, style: CurveStyle
) -> tuple[float, float, float, float]:
    """Symbols with error bars over the faint lines of the grids; return the span of the symbols."""
    sigma = logarithmic_middles()
    for density in found.grids:
        faint = {"color": style.colour, "lw": 0.4, "alpha": 0.45}
        plot.unnamed_line((style.label,), sigma, density, **faint)
    known = np.isfinite(found.density) & np.isfinite(found.error)
    x, y, error = sigma[known], found.density[known], found.error[known]
    bars = np.array([y * -np.expm1(-error), y * np.expm1(error)])  # of ln Pr
    plot.points(style, x, y, np.full(x.size, True), error=bars)
    seen = y > LOWEST * y.max()
    return float(x[seen].min()), float(x[seen].max()), float(y[seen].min()), float(y.max())


def _edge_law(plot: ColumnFigure, found: StressDistribution, style: CurveStyle) -> None:
    """The law of the edge through the bins nearest to it, dashed."""
    for name in ("small", "large"):
        law = fit(found, name)
        if law is None or not np.isfinite(law.theory):
            continue
        low, high = law.lowest, law.highest
        span = (low / BEYOND, high) if name == "small" else (low, high * BEYOND)
        sigma = np.geomspace(*span, 50)
        dashed: dict[str, Any] = {"ls": (0, (4, 2)), "lw": 0.8, "zorder": 2.5}
        density = law.edge_prefactor * sigma**law.theory
        plot.unnamed_line((style.label, EDGE_LAW), sigma, density, color=style.colour, **dashed)
        plot.line(plot.axes, EDGE_LAW, sigma[:0], density[:0], color="0.4", **dashed)
