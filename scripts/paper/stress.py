"""Figs. 7, 8 and 13: the distribution of the stress and its deviation."""

from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.analysis.curve_styles import MARKERS, CurveStyle, colours
from gfmd_cli.analysis.distribution import distributions
from gfmd_cli.analysis.distribution_figure import DENSITY, STRESS
from gfmd_cli.analysis.edge_law import edge_exponent, fit_power_law
from gfmd_cli.analysis.figures import P_STAR
from gfmd_cli.analysis.plotting import ColumnFigure
from gfmd_cli.analysis.selection import grouped
from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.observables import LOGARITHMIC_EDGES, geometric_middles
from paper.claims import Finding, Value
from paper.drawing import STYLES, dense, draw_points, finish, label, slope
from paper.ensembles import Group, Mean, estimate, groups
from paper.studies import StoredStudies, needs

LOWEST = 0.02  # stress [Delta_sigma] that is drawn
TAIL = (4.0, 12.0)
"""Stresses [Delta_sigma] from the mean over the contact to the largest that the grid resolves."""


@needs("fig07", "edges")
def fig07(studies: StoredStudies, folder: Path) -> list[Finding]:
    """Pr(sigma) at 10 % contact on the finest grid; extrapolated where the grids allow."""
    plot, ys = ColumnFigure(STRESS, DENSITY), []
    stresses = [one for group in _by_elastomer(studies, "fig07").values() for one in group]
    middle = geometric_middles(LOGARITHMIC_EDGES)
    for one in stresses:
        style, fine = STYLES[one.curve.n], one.grid_densities[-1]
        plot.axes.plot(middle, np.where(fine > 0, fine, np.nan), color=style.colour, lw=0.7)
        draw_points(plot, style, *_known(one))
        resolved = (fine > 1e-2 * fine.max()) & (middle > LOWEST)
        ys.append(fine[resolved])
    sigma = np.geomspace(LOWEST, 6, 300)
    mean = float(np.mean([one.finest["p_star"] for one in stresses]))
    plot.theory([(STYLES[1.0], sigma, stresses[0].curve.stress_density(sigma, mean))])
    finish(plot, folder, "fig07", "log", "log", [LOWEST, 6.0], np.concatenate(ys))
    return _small_stress(studies)


def _small_stress(studies: StoredStudies) -> list[Finding]:
    """Exponents of Pr(sigma) at small stress, on a surface whose edges the grids resolve."""
    paper, cases, exponents = {0.5: 0.3, 1.0: 0.6}, [], {}
    for n, group in _by_elastomer(studies, "edges").items():
        law = fit_power_law(group[0], "small") if n in paper else None
        if law is None:
            continue
        exponents[n] = Value(law.exponent, law.error)
        cases.append(
            f"{label(n)}: {exponents[n]} for σ = {law.lowest:.2g} to {law.highest:.2g} Δσ, "
            f"{Value(law.limit, law.limit_error)} at the edge"
        )
    points = max(row["points"] * row["cutoff"] for row in studies.rows("edges"))
    law = "n/(2 − n), law of the contact edge, less the μ of the paper"
    half = "exponent in the lowest resolved half decade"
    rises = {}
    if len(exponents) == len(paper):
        steps = exponents[1.0].value - exponents[0.5].value
        error = float(np.hypot(exponents[1.0].error, exponents[0.5].error))
        rises = {f"{half}, n = 1 less n = 1/2": Value(steps, error)}
    return [
        Finding(
            "small_stress",
            {
                law: {label(n): Value(edge_exponent(n) - mu) for n, mu in paper.items()},
                **({f"{half}, n = 1/2": exponents[0.5]} if 0.5 in exponents else {}),
            },
            f"{'; '.join(cases)}. Study `edges`, up to {points:.0f} points per λₛ: finer surfaces "
            "are not resolved. [Law of the contact edge](stress_distribution.md#law-of-the-contact-edge).",
        ),
        Finding("small_stress_bulk", rises),
    ]


@needs("fig06")
def fig08(studies: StoredStudies, folder: Path) -> list[Finding]:
    """Stress deviation over pressure; at n = 3 a lower bound on this grid."""
    plot = ColumnFigure(P_STAR, r"stress deviation  $\sigma_p\,/\,\Delta\sigma$")
    xs, ys = [], []
    for group in groups(studies, "fig06"):
        if group.n > 3:
            continue
        deviation, style = group.best("sigma_p"), STYLES[group.n]
        if group.n == 3:
            name = f"n = 3, on {group.first.points}²"
            style = CurveStyle(style.colour, style.marker, name)
            deviation = group.column("sigma_p")
        draw_points(plot, style, group.p, deviation.value, deviation.error)
        xs, ys = [*xs, group.p], [*ys, deviation.value]
    line = dense(group.first)
    plot.theory([(STYLES[1.0], line, group.first.predict(line).sigma_p)])
    finish(plot, folder, "fig08", "log", "linear", np.concatenate(xs), np.concatenate(ys))
    return []


@needs("fig13")
def fig13(studies: StoredStudies, folder: Path) -> list[Finding]:
    """Pr(sigma) at n = 3 from grid to grid, and its tail."""
    plot = ColumnFigure(STRESS, DENSITY)
    (distribution,) = [one for group in _by_elastomer(studies, "fig13").values() for one in group]
    middle = geometric_middles(LOGARITHMIC_EDGES)
    tones = colours(len(distribution.points))
    tails = {}
    for i, (points, density) in enumerate(
        zip(distribution.points, distribution.grid_densities, strict=True)
    ):
        name = f"λₛ/Δa = {points * distribution.finest['cutoff']:.3g}"
        resolved = (density > 0) & (middle > 1e-2)
        draw_points(
            plot, CurveStyle(tones[i], MARKERS[i], name), middle[resolved], density[resolved]
        )
        resolved &= (middle > TAIL[0]) & (middle < TAIL[1])
        tails[name] = tail_exponent(middle[resolved], distribution.counts[:, i][:, resolved])
    sigma = np.geomspace(1e-2, 100, 300)
    theory = distribution.curve.stress_density(sigma, distribution.finest["p_star"])
    plot.theory([(STYLES[1.0], sigma, theory)])
    finish(plot, folder, "fig13", "log", "log", [0.02, 60], [1e-6, 1.0])
    coarser, finest = list(tails.values())[-2:]
    change = abs(finest.value - coarser.value)  # what the grid leaves open
    mean = mean_stress(middle, distribution.counts[:, -1])
    tails_text = ", ".join(f"{exponent} at {name}" for name, exponent in tails.items())
    factors = ", ".join(f"{factor}" for factor in increment_factors(groups(studies, "fig13")))
    return [
        Finding(
            "tail",
            {
                f"exponent for σ = {TAIL[0]:g} to {TAIL[1]:g} Δσ on the finest grid": Value(
                    finest.value, float(np.hypot(finest.error, change))
                ),
                "exponent of the law of the contact edge": Value(edge_exponent(3.0)),
            },
            f"Its error includes the change from the coarser grid: {tails_text}; p* = {distribution.finest['p_star']:g}. "
            f"The mean stress in contact is {mean:.2g} Δσ; [other windows](stress_distribution.md#tail-at-"
            f"large-stress). Study `fig13`. The ratio of successive increments of σ_p² is "
            f"{factors}; it would be 1 for σ^−3 and 1.15 for σ^−2.6.",
        )
    ]


def increment_factors(grids: list[Group]) -> list[Value]:
    """Increment of sigma_p^2 at a doubling of the grid over the one before, at the first pressure."""
    squares = [Mean(group.column("sigma_p").each ** 2) for group in grids]
    return [
        estimate(lambda a, b, c: float((c[0] - b[0]) / (b[0] - a[0])), *three)
        for three in zip(squares, squares[1:], squares[2:], strict=False)
    ]


def mean_stress(sigma: Field, counts: Field) -> float:
    """Mean of the stress over the points counted in the bins; shapes as of `tail_exponent`."""
    return float(counts.sum(axis=0) @ sigma / counts.sum())


def tail_exponent(sigma: Field, counts: Field) -> Value:
    """Exponent of Pr(sigma) in bins of equal relative width, by the points of each seed in them.

    sigma has the shape (bins,), counts (seeds, bins). Bins without points are left out.
    """

    def of(density: Field) -> float:
        positive = density > 0
        errors = 1 / np.sqrt(density[positive])  # relative, of the counted points
        return slope(
            np.log(sigma[positive]), np.log(density[positive] / sigma[positive]), errors
        ).value

    return estimate(of, Mean(counts))


def _by_elastomer(studies: StoredStudies, name: str) -> dict[float, list[Any]]:
    """The distributions of a study by exponent."""
    by_exponent = grouped(distributions(studies.comparison(name)), lambda one: one.curve.n)
    return dict(sorted(by_exponent.items()))


def _known(distribution: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bins whose density is known: stress, density, its error."""
    known = np.isfinite(distribution.density) & (distribution.error < 0.5)
    return (
        geometric_middles(LOGARITHMIC_EDGES)[known],
        distribution.density[known],
        (distribution.density * distribution.error)[known],
    )


FIGURES = (fig07, fig08, fig13)
