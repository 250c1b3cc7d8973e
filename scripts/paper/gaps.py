"""Figs. 9 to 11: the mean gap over pressure, and how well theory predicts it."""

from pathlib import Path

import numpy as np

from gfmd_cli.analysis.compare import Curve
from gfmd_cli.analysis.curve_styles import MARKERS, CurveStyle, colours
from gfmd_cli.analysis.figures import GAP, P_STAR
from gfmd_cli.analysis.plotting import ColumnFigure
from paper.claims import Finding, Value
from paper.drawing import STYLES, curves, dense, draw_points, finish, label
from paper.studies import Held, needs

TAIL = 3e-4  # least gap of the logarithmic representation
LINEAR = (1.25, 1.75, 2.75)  # p* at which the slope of ln u_g is compared
STEP = 0.5  # of p* in Fig. 9b
DEFAULT_WIDTH = 0.1953125  # lambda_r / L of the slabs


def _gap_over_pressure(
    held: Held, folder: Path, study: str, name: str, x_scale: str, y_scale: str
) -> list[Curve]:
    """u_g over p* with theory, all exponents but n = 0."""
    found = [curve for curve in curves(held, study) if curve.n > 0]
    plot, xs, ys, lines = ColumnFigure(P_STAR, GAP), [], [], []
    for curve in found:
        p, (u, error) = curve.column("p_star"), curve.best("u_g")
        shown = (u > TAIL) | (y_scale == "linear")
        draw_points(plot, STYLES[curve.n], p[shown], u[shown], error[shown])
        line = np.union1d(dense(curve), np.linspace(p.min(), p.max(), 200))
        lines.append((STYLES[curve.n], line, curve.predict(line).u_g))
        xs, ys = [*xs, p[shown]], [*ys, u[shown]]
    plot.theory(lines)
    finish(plot, folder, name, x_scale, y_scale, np.concatenate(xs), np.concatenate(ys))
    return found


def _gap_errors(curve: Curve, highest: float) -> np.ndarray:
    """Relative errors of the theoretical u_g up to a pressure."""
    u, _ = curve.best("u_g")
    kept = curve.column("p_star") <= highest * 1.0001
    return np.abs(curve.prediction.u_g[kept] / u[kept] - 1)


def _pressure_errors(curve: Curve) -> np.ndarray:
    """Relative errors of the theoretical p at equal u_g, p* >= 1, where u_g is known."""
    p, (u, error) = curve.column("p_star"), curve.best("u_g")
    heavy = (p >= 0.9999) & (u > TAIL) & (error < 0.1 * u)
    return np.abs(curve.pressure_at_gap(u[heavy]) / p[heavy] - 1)


@needs("fig06")
def fig09a(held: Held, folder: Path) -> list[Finding]:
    """H = 0.8 over the logarithm of the pressure."""
    found = _gap_over_pressure(held, folder, "fig06", "fig09a", "log", "linear")
    gaps = {label(curve.n): _gap_errors(curve, 1.0) for curve in found}
    light = {label(curve.n): _gap_errors(curve, 0.5) for curve in found if curve.n < 4}
    pressures = {label(curve.n): _pressure_errors(curve) for curve in found}
    pressures = {name: errors for name, errors in pressures.items() if errors.size}
    largest = ", ".join(f"{100 * errors.max():.0f} % at {name}" for name, errors in gaps.items())
    return [
        Finding(
            "accuracy",
            {
                "median error of u_g, p* ≤ 1": _cases(gaps, np.median),
                "median error of p, p* ≥ 1": _cases(pressures, np.median),
            },
            f"Continuum values of one realisation. Largest errors of u_g: {largest}.",
        ),
        Finding(
            "twenty_percent",
            {
                "largest error of u_g, p* ≤ 0.5": _cases(light, np.max),
                "largest error of p, p* ≥ 1": _cases(
                    {name: pressures[name] for name in light if name in pressures}, np.max
                ),
            },
        ),
    ]


def _cases(errors: dict[str, np.ndarray], statistic) -> dict[str, Value]:
    """One number of each set of errors."""
    return {name: Value(float(statistic(found))) for name, found in errors.items()}


@needs("fig09b")
def fig09b(held: Held, folder: Path) -> list[Finding]:
    """Large pressures on a linear axis."""
    found = _gap_over_pressure(held, folder, "fig09b", "fig09b", "linear", "log")
    first, second, third = ({}, {}, {})
    for curve in found:
        slopes = [_decay(curve, at) for at in LINEAR]
        first[label(curve.n)] = Value(slopes[1] / slopes[0])
        second[label(curve.n)] = Value(slopes[2] / slopes[0])
        third[curve.n] = slopes
    told = ", ".join(f"{slope:.2f}" for slope in third[1.0])
    at = ", ".join(f"{p:g}" for p in LINEAR)
    return [
        Finding(
            "exponential",
            {
                "d ln u_g/d p* at p* = 1.75 over that at 1.25": first,
                "d ln u_g/d p* at p* = 2.75 over that at 1.25": second,
            },
            f"n = 1: {told} at p* = {at}. λᵣ/λₛ = 25, one realisation. In theory the tail is Gaussian, "
            "and a finite surface has no gap beyond a finite pressure.",
        )
    ]


def _decay(curve: Curve, at: float) -> float:
    """d ln u_g / d p* between the two pressures around one."""
    p, u = curve.column("p_star"), curve.column("u_g")
    low, high = (int(np.argmin(np.abs(p - at - side * STEP / 2))) for side in (-1, 1))
    return float(np.log(u[high] / u[low]) / (p[high] - p[low]))


@needs("small_pressure")
def small_pressure(held: Held, folder: Path) -> list[Finding]:
    """Small pressures: how much the gap falls from decade to decade."""
    plot, xs, ys, lines, ratios, limits = ColumnFigure(P_STAR, GAP), [], [], [], {}, {}
    found = held.comparison("small_pressure").curves
    for n in sorted({curve.n for curve in found}):
        group = [curve for curve in found if curve.n == n]
        p, u = group[0].column("p_star"), np.mean([curve.column("u_g") for curve in group], axis=0)
        draw_points(plot, STYLES[n], p, u)
        line = dense(group[0])
        lines.append((STYLES[n], line, group[0].predict(line).u_g))
        xs, ys = [*xs, p], [*ys, u]
        limit = min(float(p.max()), _long_waves(group[0]))
        high, middle, low = (
            np.interp(np.log(limit) - k * np.log(10), np.log(p), u) for k in (0, 1, 2)
        )
        if limit >= 100 * p.min() * 0.999:
            ratios[label(n)] = Value(float((low - middle) / (middle - high)))
        limits[n] = limit
    plot.theory(lines)
    finish(plot, folder, "small_pressure", "log", "linear", np.concatenate(xs), [0, 3.7])
    told = ", ".join(f"{limit:.2g} at {label(n)}" for n, limit in limits.items())
    quantity = (
        "fall of u_g over one decade of p* over that of the decade above, below the pressure at which the "
        "long waves are in contact"
    )
    return [
        Finding(
            "quasi_logarithmic",
            {quantity: ratios},
            f"1 means a logarithm. The pressures, at which p is the rms stress of the waves up to 2 qᵣ, are "
            f"p* = {told}: the range shrinks as n rises. L = 4 λᵣ, λᵣ/λₛ = 16, "
            f"{len(found) // len(limits)} seeds.",
        )
    ]


def _long_waves(curve: Curve) -> float:
    """Rms stress in full contact of the waves up to twice the roll-off, in Delta_sigma."""
    shells = curve.persson.shells
    share = shells.variance[shells.q <= 2 * 2 * np.pi * 4].sum() / shells.variance.sum()
    return float(np.sqrt(share))


@needs("fig06", "fig10")
def fig10(held: Held, folder: Path) -> list[Finding]:
    """H = 0.3."""
    _gap_over_pressure(held, folder, "fig10", "fig10b", "linear", "log")
    found = _gap_over_pressure(held, folder, "fig10", "fig10a", "log", "linear")
    return [_transfer(held, found, "hurst", "H = 0.3 over H = 0.8")]


@needs("fig06", "cut_off")
def cut_off(held: Held, folder: Path) -> list[Finding]:
    """A cut-off spectrum."""
    found = _gap_over_pressure(held, folder, "cut_off", "cut_off", "log", "linear")
    return [_transfer(held, found, "cut_off", "cut-off over roll-off")]


def _transfer(held: Held, found: list[Curve], key: str, ratio: str) -> Finding:
    """Errors of theory on another surface over those on the default one."""
    default = {curve.n: _gap_errors(curve, 1.0) for curve in curves(held, "fig06")}
    pairs = [(_gap_errors(curve, 1.0), default[curve.n]) for curve in found]
    each = ", ".join(f"{100 * _gap_errors(c, 1.0).max():.0f} % at {label(c.n)}" for c in found)
    return Finding(
        key,
        {
            f"{name} error of u_g over all n, {ratio}": _ratio(pairs, of)
            for name, of in (("median", np.median), ("largest", np.max))
        },
        f"p* ≤ 1, one realisation each; errors: jackknife over n. Largest errors: {each}.",
    )


def _ratio(pairs: list[tuple[np.ndarray, np.ndarray]], of) -> Value:
    """A statistic of all first errors over that of all second ones, jackknife over the pairs."""

    def over(chosen: list[tuple[np.ndarray, np.ndarray]]) -> float:
        first, second = (np.concatenate(part) for part in zip(*chosen, strict=True))
        return float(of(first) / of(second))

    without = [over(pairs[:i] + pairs[i + 1 :]) for i in range(len(pairs))]
    return Value(over(pairs), float(np.sqrt((len(pairs) - 1) * np.var(without))))


@needs("spacing")
def spacing(held: Held, folder: Path) -> list[Finding]:
    """Is u_g at two points per lambda_s good to a per cent?"""
    off = {}
    fine = {row["n"]: row for row in held.rows("spacing", points=1024)}
    for row in held.rows("spacing", points=128):
        found, bar = (fine[row["n"]][f"u_g_continuum{kind}"] for kind in ("", "_error"))
        off[label(row["n"])] = Value(abs(row["u_g"] / found - 1), 0.5 * bar / found)
    return [
        Finding(
            "spacing",
            {"distance of u_g from the continuum": off},
            "λₛ/Δa = 2.56, λᵣ/λₛ = 25, p* = 0.1; u_g is too small on the grid for n ≥ 1.",
        )
    ]


@needs("fig11")
def fig11(held: Held, folder: Path) -> list[Finding]:
    """Slabs of four thicknesses, and a half-space."""
    found = sorted(
        held.comparison("fig11").curves,
        key=lambda curve: np.nan_to_num(curve.rows[0]["thickness"], nan=np.inf),
    )
    x_label = P_STAR.replace("sigma", "sigma_\\mathrm{si}")
    plot, xs, ys, lines, off = ColumnFigure(x_label, GAP), [], [], [], {}
    for i, (curve, colour) in enumerate(zip(found, colours(len(found)), strict=True)):
        t = curve.rows[0]["thickness"] / DEFAULT_WIDTH
        name = f"t/λᵣ = {t:.2g}" if np.isfinite(t) else "half-space"
        style = CurveStyle(colour, MARKERS[i], name)
        p, (u, error) = curve.column("p_star"), curve.best("u_g")
        draw_points(plot, style, p, u, error)
        line = dense(curve)
        lines.append((style, line, curve.predict(line).u_g))
        kept = (p <= 1.001) & (u > TAIL)
        off[name] = Value(float(np.abs(curve.prediction.u_g[kept] / u[kept] - 1).max()))
        xs, ys = [*xs, p], [*ys, u]
    plot.theory(lines)
    highest = np.concatenate(ys).max()
    finish(plot, folder, "fig11", "log", "log", np.concatenate(xs), [2e-3, highest])
    slabs = max(value.value for name, value in off.items() if name != "half-space")
    return [
        Finding(
            "slab",
            {
                "largest error of u_g, p* ≤ 1 (semi-quantitative: 30 %)": off,
                "largest error of the slabs over that of the half-space": Value(
                    slabs / off["half-space"].value
                ),
            },
            "One realisation. Eq. 42 as printed gives γ₄ for qt → 0 and γ₁ for qt → ∞, which is correct; "
            "the conclusions interchange the two limits.",
        )
    ]


FIGURES = (fig09a, fig09b, small_pressure, fig10, cut_off, spacing, fig11)
