"""Figure of Pr(sigma) in the continuum, as the paper's Figs. 7 and 13."""

from typing import Any

import numpy as np

from gfmd_cli.analysis.compare import Comparison
from gfmd_cli.analysis.distribution import Distribution, distributions
from gfmd_cli.analysis.edge_law import fit
from gfmd_cli.analysis.looks import Look, looks, order
from gfmd_cli.analysis.sheet import Sheet
from gfmd_cli.physics.observables import logarithmic_middles

TYPICAL_AREA = 0.1  # relative contact area of the paper's Fig. 7
NEAR = 1.5  # pressures that differ by a smaller factor are drawn side by side
MOST = 8  # contacts; more cannot be told apart
BEYOND = 2.5  # factor that the edge law is drawn beyond the window of its fit
LOWEST = 3e-3  # share of the highest density that is drawn at the least, and of the lowest known
STRESS, DENSITY = r"stress  $\sigma\,/\,\Delta\sigma$", r"$\mathrm{Pr}(\sigma)\;\Delta\sigma$"


def continuum_sheet(comparison: Comparison) -> Sheet | None:
    """Extrapolated Pr(sigma) with its errors, the grids behind it, theory and the law of the edge.

    One pressure: that of most contacts, then of a_r = TYPICAL_AREA. None where no contact has two
    grids.
    """
    chosen = _chosen([f for f in distributions(comparison) if np.isfinite(f.density).sum() > 2])
    if not chosen:
        return None
    pressures = [found.finest["p_star"] for found in chosen]
    low, high = min(pressures), max(pressures)
    between = f"{low:.3g}" if high < 1.001 * low else rf"{low:.3g}\;\mathrm{{to}}\;{high:.3g}"
    sheet = Sheet(rf"{STRESS}  at  $p^* = {between}$", DENSITY)
    told = looks([found.curve for found in chosen])
    spans = [_draw(sheet, found, look) for found, look in zip(chosen, told, strict=True)]
    ends = np.array(spans)
    sheet.scale("x", "log", ends[:, :2])
    sheet.scale("y", "log", ends[:, 2:])
    sigma = np.geomspace(*sheet.axes.get_xlim(), 400)
    sheet.theory(
        [
            (look, sigma, f.curve.stress_density(sigma, f.finest["p_star"]))
            for f, look in zip(chosen, told, strict=True)
        ],
    )
    for found, look in zip(chosen, told, strict=True):
        _edge_law(sheet, found, look)
    return sheet


def _chosen(held: list[Distribution]) -> list[Distribution]:
    """One distribution a scene, at about one pressure."""
    scenes: dict[str, list[Distribution]] = {}
    for found in sorted(held, key=lambda found: order(found.curve)):
        scenes.setdefault(found.scene, []).append(found)

    def near(p_star: float) -> list[Distribution]:
        ratios = [
            min(scene, key=lambda found: abs(np.log(found.finest["p_star"] / p_star)))
            for scene in scenes.values()
        ]
        return [f for f in ratios if 1 / NEAR < f.finest["p_star"] / p_star < NEAR]

    def distance(p_star: float) -> tuple[int, float]:
        areas = np.array([found.a_r for found in near(p_star)])
        return -areas.size, float(np.sum(np.abs(np.log(areas / TYPICAL_AREA))))

    pressures = sorted({found.finest["p_star"] for found in held})
    return near(min(pressures, key=distance))[:MOST] if pressures else []


def _draw(sheet: Sheet, found: Distribution, look: Look) -> tuple[float, float, float, float]:
    """Symbols with error bars over the faint lines of the grids; return the span of the symbols."""
    sigma = logarithmic_middles()
    for density in found.grids:
        sheet.axes.plot(
            sigma, np.where(density > 0, density, np.nan), color=look.colour, lw=0.4, alpha=0.45
        )
    known = np.isfinite(found.density) & np.isfinite(found.error)
    x, y, error = sigma[known], found.density[known], found.error[known]
    sheet.bars(look, x, y, np.array([y * -np.expm1(-error), y * np.expm1(error)]))  # of ln Pr
    sheet.points(look, x, y, np.full(x.size, True))
    seen = y > LOWEST * y.max()
    return float(x[seen].min()), float(x[seen].max()), float(y[seen].min()), float(y.max())


def _edge_law(sheet: Sheet, found: Distribution, look: Look) -> None:
    """The law of the edge through the bins nearest to it, dashed."""
    for name in ("small", "large"):
        law = fit(found, name)
        if law is None or not np.isfinite(law.theory):
            continue
        low, high = law.window
        span = (low / BEYOND, high) if name == "small" else (low, high * BEYOND)
        sigma = np.geomspace(*span, 50)
        style: dict[str, Any] = {"ls": (0, (4, 2)), "lw": 0.8, "zorder": 2.5}
        density = law.edge_prefactor * sigma**law.theory
        sheet.axes.plot(sigma, density, color=look.colour, **style)
        sheet.line(sheet.axes, "edge law", sigma[:0], density[:0], color="0.4", **style)
