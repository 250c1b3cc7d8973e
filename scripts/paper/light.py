"""Elastomers with singular edges, n = 3 and 4, from grid to grid: contact area and stress deviation."""

from pathlib import Path

import numpy as np

from gfmd_cli.analysis.curve_styles import MARKERS, CurveStyle, colours
from gfmd_cli.analysis.figures import P_STAR
from gfmd_cli.analysis.plotting import ColumnFigure
from paper.claims import SIGMAS, Finding, Value
from paper.drawing import STYLES, dense, draw_limits, draw_points, finish
from paper.ensembles import Group, Mean, estimate, groups, power
from paper.studies import StoredStudies, needs

LIGHTEST, HEAVIEST, PLATES = 0.02, 0.16, 0.1
"""p* from and to which the power at n = 3 is taken, and from which plates are."""


@needs("light")
def light_area(studies: StoredStudies, folder: Path) -> list[Finding]:
    """Contact area at n = 3 and 4: on the finest grid, and in the continuum."""
    plot, ys = ColumnFigure(P_STAR, r"relative contact area  $a_r$"), []
    ensembles = groups(studies, "light")
    for group in (_finest(ensembles, n) for n in (3.0, 4.0)):
        p, a, own = group.p, group.continuum("a_r"), group.column("a_r").value
        style = STYLES[group.n]
        known = draw_limits(plot, style, p, a.value, a.error)
        plot.axes.plot(p, own, color=style.colour, lw=0.6, ls=(0, (4, 2)))
        plot.legend[f"{style.label}, on the grid"] = plot.axes.lines[-1]
        ys += [a.value[known], own]
    line = dense(group.first)
    plot.theory([(STYLES[1.0], line, group.first.predict(line).a_r)])
    finish(plot, folder, "light_area", "log", "log", p, np.concatenate(ys))
    slopes = {
        f"{group.first.points}²": _power(group, group.continuum("a_r"))
        for group in _grids(ensembles, 3.0)
    }
    finest = _finest(ensembles, 3.0)
    return [
        Finding(
            "other_power",
            {f"d ln a_r/d ln p* in the continuum, p* ≤ {HEAVIEST:g}": slopes},
            f"Study `light`, {_spacings(_grids(ensembles, 3.0))} points per λₛ. The area on the grid "
            f"itself has the slope {_power(finest, finest.column('a_r'))} on {finest.first.points}².",
        ),
        *_plates(studies, _grids(ensembles, 4.0)),
    ]


def _grids(ensembles: list[Group], n: float) -> list[Group]:
    """The contacts of one elastomer, grids rising."""
    return [group for group in ensembles if group.n == n]


def _finest(ensembles: list[Group], n: float) -> Group:
    return _grids(ensembles, n)[-1]


def _power(group: Group, a: Mean) -> Value:
    """d ln a_r / d ln p* of light contacts."""
    known = (group.p > 0.999 * LIGHTEST) & (group.p < 1.001 * HEAVIEST)
    known &= np.isfinite(a.value) & (a.value > SIGMAS * a.error)
    if known.sum() < 2:
        return Value(np.nan, np.nan)
    return power(group.p[known], a.only(known))


def _spacings(grids: list[Group]) -> str:
    """Points per lambda_s of the grids."""
    return ", ".join(f"{group.first.points * group.first.rows[0]['cutoff']:.0f}" for group in grids)


def _plates(studies: StoredStudies, grids: list[Group]) -> list[Finding]:
    """Whether plates have a contact area, and 10 % of it."""
    finest = grids[-1]
    p, a = finest.p, finest.continuum("a_r")
    known = np.isfinite(a.value)
    p, a = p[known], a.only(known)
    nearest = int(np.abs(np.log(np.maximum(a.value, 1e-9) / 0.1)).argmin())
    heavy = np.flatnonzero(finest.p >= PLATES)
    areas = [group.column("a_r") for group in grids]
    ratios = {
        f"p* = {finest.p[at]:g}": estimate(
            lambda *each, at=at: (each[-2][at] - each[-1][at]) / (each[-3][at] - each[-2][at]),
            *areas,
        )
        for at in heavy
    }
    steps = "; ".join(
        f"{', '.join(f'{each.value[at]:.4f}' for each in areas)} at p* = {finest.p[at]:g}"
        for at in heavy
    )
    cases = ", ".join(
        f"{Value(*pair)} at p* = {at:g}" for *pair, at in zip(a.value, a.error, p, strict=True)
    )
    rows = [row for group in grids for curve in group.curves for row in curve.rows]
    missed = sum(row["status"] != "converged" for row in rows)
    quantity = (
        "change of a_r at a doubling of the grid over the change before (below 1 if there is a limit), "
        f"p* ≥ {PLATES:g}"
    )
    return [
        Finding(
            "plate_area",
            {
                "relative error of the continuum a_r that is nearest to 0.1": Value(
                    SIGMAS * a.error[nearest] / a.value[nearest]
                )
            },
            f"Two standard errors. Study `light`, up to {_spacings(grids[-1:])} points per λₛ; "
            f"continuum values: {cases}. {missed} contacts missed the residual of 1e-5; the slowest took "
            f"{max(row['seconds'] for row in rows):.0f} s.",
        ),
        Finding(
            "plate_limit",
            {quantity: ratios},
            f"a_r from grid to grid: {steps}. On 2048² (`configs/paper/light.toml`, seeds 0 and 1) the next ratios are 0.41, 0.34 and "
            "0.45 at p* = 0.3, 0.5 and 1.",
        ),
    ]


@needs("light", "fig06")
def light_deviation(studies: StoredStudies, folder: Path) -> list[Finding]:
    """Stress deviation at n = 3 from grid to grid."""
    plot, ys = ColumnFigure(P_STAR, r"stress deviation  $\sigma_p\,/\,\Delta\sigma$"), []
    grids = _grids(groups(studies, "light"), 3.0)
    for group, colour, marker in zip(grids, colours(len(grids)), MARKERS, strict=False):
        style = CurveStyle(colour, marker, f"{_spacings([group])} points per λₛ")
        deviation = group.column("sigma_p")
        ys.append(deviation.value)
        draw_points(plot, style, group.p, deviation.value, deviation.error)
    p, finest = group.p, group
    line = dense(group.first)
    plot.theory([(STYLES[1.0], line, group.first.predict(line).sigma_p)])
    finish(plot, folder, "light_deviation", "log", "linear", p, np.concatenate(ys))
    squares = [Mean(group.column("sigma_p").each ** 2) for group in grids]
    steps = {f"p* = {at:g}": np.flatnonzero(p == at)[0] for at in p[-3:]}
    cases = "; ".join(
        f"{', '.join(f'{step:.3f}' for step in np.diff([each.value[i] for each in squares]))} at {at}"
        for at, i in steps.items()
    )
    others = [group for group in groups(studies, "fig06") if group.n <= 2]
    return [
        Finding(
            "divergence",
            {
                "increments of σ_p² of two successive doublings, their ratio": {
                    at: estimate(
                        lambda *each, i=i: (
                            (each[-1][i] - each[-2][i]) / (each[-2][i] - each[-3][i])
                        ),
                        *squares,
                    )
                    for at, i in steps.items()
                },
                "growth of σ_p² at the last doubling, in Δσ²": {
                    at: estimate(lambda *each, i=i: each[-1][i] - each[-2][i], *squares)
                    for at, i in steps.items()
                },
            },
            f"Equal increments mean a logarithm; {_spacings(grids)} points per λₛ: {cases}. "
            "Study `light`. On 2048² (`configs/paper/light.toml`, 102 points per λₛ, seeds 0 to 3) the next ratios, "
            "at p* = 0.3, 0.5 and 1, are 1.03 ± 0.02, 1.03 ± 0.01 and 1.00 ± 0.01.",
        ),
        Finding(
            "rise",
            {
                "largest σ_p/Δσ over p* on the finest grid, n = 3": estimate(
                    np.max, finest.column("sigma_p")
                ),
                "largest σ_p/Δσ over p*, n ≤ 2": {
                    STYLES[group.n].label: estimate(np.max, group.column("sigma_p"))
                    for group in others
                },
            },
            "n = 3: λᵣ/λₛ = 5; n ≤ 2: the surfaces of Fig. 6, on the grid. Full contact has exactly 1. "
            "n = 4 is not judged; on 512² (seeds 0 to 2) σ_p is 1.8 at p* = 0.3, so that it rises as well.",
        ),
    ]


FIGURES = (light_area, light_deviation)
