"""Bodies with singular edges, n = 3 and 4, from grid to grid: contact area and stress deviation."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.analysis.curve_styles import MARKERS, CurveStyle, colours
from gfmd_cli.analysis.figures import P_STAR
from gfmd_cli.analysis.plotting import ColumnFigure
from paper.claims import Finding, Value
from paper.drawing import STYLES, column, curves, draw_limits, draw_points, finish, slope, values
from paper.studies import Held, needs

LIGHTEST, POWER, PLATES = 0.02, 0.17, 0.1
"""p* from and to which the power at n = 3 is taken, and from which plates are."""
BARS = 0.5  # an error in units of a bar, which holds in 95 % of cases


@needs("light")
def light_area(held: Held, folder: Path) -> list[Finding]:
    """Contact area at n = 3 and 4: on the finest grid, and in the continuum."""
    plot, ys = ColumnFigure(P_STAR, r"relative contact area  $a_r$"), []
    rows = held.rows("light")
    grids = sorted({row["points"] for row in rows})
    for n in (3.0, 4.0):
        finest = _along(rows, n, grids[-1])
        p, (a, error) = column(finest, "p_star"), values(finest, "a_r")
        known = draw_limits(plot, STYLES[n], p, a, error)
        plot.axes.plot(p, column(finest, "a_r"), color=STYLES[n].colour, lw=0.6, ls=(0, (4, 2)))
        plot.legend[f"{STYLES[n].label}, on the grid"] = plot.axes.lines[-1]
        ys += [a[known], column(finest, "a_r")]
    curve = next(one for one in curves(held, "light") if one.points == grids[-1])
    plot.theory([(STYLES[1.0], p, curve.predict(p).a_r)])
    finish(plot, folder, "light_area", "log", "log", p, np.concatenate(ys))
    slopes = {f"{points}²": _power(_along(rows, 3.0, points)) for points in grids}
    return [
        Finding(
            "other_power",
            {f"d ln a_r/d ln p* in the continuum, p* ≤ {POWER - 0.01:g}": slopes},
            f"λᵣ/λₛ = 5; {_spacings(grids)} points per λₛ. Errors: half of the 95 % bars. The area on the "
            f"grid itself has the slope {_power(_along(rows, 3.0, grids[-1]), False)} on {grids[-1]}².",
        ),
        *_plates(rows, grids),
    ]


def _along(rows: list[dict[str, Any]], n: float, points: int) -> list[dict[str, Any]]:
    """The rows of one body and grid, pressures rising."""
    chosen = [row for row in rows if (row["n"], row["points"]) == (n, points)]
    return sorted(chosen, key=lambda row: row["p_star"])


def _power(rows: list[dict[str, Any]], in_continuum: bool = True) -> Value:
    """d ln a_r / d ln p* of light contacts."""
    rows = [row for row in rows if LIGHTEST <= row["p_star"] <= POWER]
    a, error = values(rows, "a_r")
    if not in_continuum:
        a, error = column(rows, "a_r"), np.full(len(rows), 1e-6)
    known = np.isfinite(a) & (a > error)
    if known.sum() < 2:
        return Value(np.nan, np.nan)
    p, a = np.log(column(rows, "p_star"))[known], a[known]
    return slope(p, np.log(a), np.maximum(BARS * error[known] / a, 1e-3))


def _spacings(grids: list[int]) -> str:
    """Points per lambda_s = L / 10 of the grids."""
    return ", ".join(f"{points / 10:.0f}" for points in grids)


def _plates(rows: list[dict[str, Any]], grids: list[int]) -> list[Finding]:
    """Whether plates have a contact area, and 10 % of it."""
    finest = [row for row in _along(rows, 4.0, grids[-1]) if np.isfinite(row["a_r_continuum"])]
    nearest = min(finest, key=lambda row: abs(np.log(max(row["a_r_continuum"], 1e-9) / 0.1)))
    bar = nearest["a_r_continuum_error"]
    heavy = [row["p_star"] for row in finest if row["p_star"] >= PLATES]
    ratios, told = {}, []
    for p in heavy:
        a = [row["a_r"] for g in grids for row in _along(rows, 4.0, g) if row["p_star"] == p]
        steps = [coarse - fine for coarse, fine in pairwise(a)]
        ratios[f"p* = {p:g}"] = Value(steps[-1] / steps[-2])
        told.append(f"{', '.join(f'{one:.4f}' for one in a)} at p* = {p:g}")
    areas = ", ".join(
        f"{Value(row['a_r_continuum'], row['a_r_continuum_error'])} at p* = {row['p_star']:g}"
        for row in finest
    )
    seconds = max(row["seconds"] for row in _along(rows, 4.0, grids[-1]))
    missed = sum(row["status"] != "converged" for row in rows if row["n"] == 4)
    quantity = (
        "change of a_r at a doubling of the grid over the change before (below 1 if there is a limit), "
        f"p* ≥ {PLATES:g}"
    )
    return [
        Finding(
            "plate_area",
            {
                "relative error of the continuum a_r that is nearest to 0.1": Value(
                    bar / nearest["a_r_continuum"]
                )
            },
            f"λᵣ/λₛ = 5, up to {_spacings(grids[-1:])} points per λₛ; continuum values with 95 % bars: "
            f"{areas}. {missed} contacts missed the residual of 1e-5; the slowest took {seconds:.0f} s.",
        ),
        Finding("plate_limit", {quantity: ratios}, f"a_r from grid to grid: {'; '.join(told)}."),
    ]


@needs("light", "fig06")
def light_deviation(held: Held, folder: Path) -> list[Finding]:
    """Stress deviation at n = 3 from grid to grid."""
    plot, ys = ColumnFigure(P_STAR, r"stress deviation  $\sigma_p\,/\,\Delta\sigma$"), []
    rows = held.rows("light", n=3.0)
    grids = sorted({row["points"] for row in rows})
    tones = colours(len(grids))
    for points, colour, marker in zip(grids, tones, MARKERS, strict=False):
        chosen = _along(rows, 3.0, points)
        style = CurveStyle(colour, marker, f"{points / 10:.0f} points per λₛ")
        ys.append(column(chosen, "sigma_p"))
        draw_points(plot, style, column(chosen, "p_star"), ys[-1])
    p = column(chosen, "p_star")
    curve = curves(held, "light")[0]
    line = np.geomspace(p[0], p[-1], 100)
    plot.theory([(STYLES[1.0], line, curve.predict(line).sigma_p)])
    finish(plot, folder, "light_deviation", "log", "linear", p, np.concatenate(ys))
    squares = {at: [row["sigma_p"] ** 2 for row in rows if row["p_star"] == at] for at in p[-3:]}
    steps = {f"p* = {at:g}": np.diff(sorted(square)) for at, square in squares.items()}
    told = "; ".join(f"{', '.join(f'{s:.3f}' for s in step)} at {p}" for p, step in steps.items())
    others = [curve for curve in curves(held, "fig06") if curve.n <= 2]
    return [
        Finding(
            "divergence",
            {
                "increments of σ_p² of two successive doublings, their ratio": {
                    p: Value(step[-1] / step[-2]) for p, step in steps.items()
                },
                "growth of σ_p² at the last doubling, in Δσ²": {
                    p: Value(step[-1]) for p, step in steps.items()
                },
            },
            f"Equal increments mean a logarithm; {_spacings(grids)} points per λₛ: {told}.",
        ),
        Finding(
            "rise",
            {
                "largest σ_p/Δσ over p* on the finest grid, n = 3": Value(
                    column(_along(rows, 3.0, grids[-1]), "sigma_p").max()
                ),
                "largest σ_p/Δσ over p*, n ≤ 2": {
                    STYLES[curve.n].label: Value(curve.column("sigma_p").max()) for curve in others
                },
            },
            "n = 3: λᵣ/λₛ = 5; n ≤ 2: default surface, on the grid. Full contact has exactly 1.",
        ),
    ]


FIGURES = (light_area, light_deviation)
