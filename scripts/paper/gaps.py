"""Figs. 9 to 11: the mean gap over pressure, and how well theory predicts it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gfmd_cli.analysis.compare import Curve
from gfmd_cli.analysis.curve_styles import MARKERS, CurveStyle, colours
from gfmd_cli.analysis.figures import LABELS, P_STAR
from gfmd_cli.analysis.plotting import ColumnFigure
from gfmd_cli.grid.arrays import Field
from paper.claims import Finding, Value
from paper.drawing import STYLES, dense, draw_points, finish, label
from paper.ensembles import Group, Mean, estimate, groups
from paper.studies import StoredStudies, needs

TAIL = 3e-4  # least gap of the logarithmic representation
LINEAR = (1.25, 1.75, 2.75)  # p* at which the slope of ln u_g is compared
STEP = 0.5  # of p* in Fig. 9b


def _gap_over_pressure(
    studies: StoredStudies, folder: Path, study: str, name: str, x_scale: str, y_scale: str
) -> list[Group]:
    """u_g over p* with theory, all exponents but n = 0."""
    ensembles = [group for group in groups(studies, study) if group.n > 0]
    plot, xs, ys, lines = ColumnFigure(P_STAR, LABELS["u_g"]), [], [], []
    for group in ensembles:
        p, u = group.p, group.best("u_g")
        shown = (u.value > TAIL) | (y_scale == "linear")
        draw_points(plot, STYLES[group.n], p[shown], u.value[shown], u.error[shown])
        line = np.union1d(dense(group.first), np.linspace(p.min(), p.max(), 200))
        lines.append((STYLES[group.n], line, group.first.predict(line).u_g))
        xs, ys = [*xs, p[shown]], [*ys, u.value[shown]]
    plot.theory(lines)
    finish(plot, folder, name, x_scale, y_scale, np.concatenate(xs), np.concatenate(ys))
    return ensembles


@dataclass(frozen=True)
class Errors:
    """Relative errors of theory, as a function of the mean u_g that it is compared with."""

    u: Mean
    of: Callable[[Field], Field]

    def value(self, statistic: Callable[[Field], float]) -> Value:
        """One number of them."""
        return estimate(lambda u: statistic(self.of(u)), self.u)


def _gap_errors(group: Group, highest: float, least: float = 0.0) -> Errors:
    """Relative errors of the theoretical u_g up to a pressure, where u_g is above a least value."""
    u = group.best("u_g")
    usable = (group.p <= highest * 1.0001) & (u.value > least)
    theory = group.theory.u_g[usable]
    return Errors(u.only(usable), lambda u: np.abs(theory / u - 1))


def _pressure_errors(group: Group) -> Errors:
    """Relative errors of the theoretical p at equal u_g, p* >= 1, where u_g is known."""
    p, u = group.p, group.best("u_g")
    heavy = (p >= 0.9999) & (u.value > TAIL) & (2 * u.error < 0.1 * u.value)
    return Errors(u.only(heavy), lambda u: np.abs(group.first.pressure_at_gap(u) / p[heavy] - 1))


@needs("fig06", "fig09b")
def fig09a(studies: StoredStudies, folder: Path) -> list[Finding]:
    """H = 0.8 over the logarithm of the pressure; errors of theory, at large pressures of Fig. 9b."""
    ensembles = _gap_over_pressure(studies, folder, "fig06", "fig09a", "log", "linear")
    gaps = {label(group.n): _gap_errors(group, 1.0) for group in ensembles}
    light = {label(group.n): _gap_errors(group, 0.5) for group in ensembles if group.n < 4}
    linear = {label(group.n): group for group in groups(studies, "fig09b") if group.n > 0}
    pressures = {name: _pressure_errors(group) for name, group in linear.items()}
    pressures = {name: errors for name, errors in pressures.items() if errors.u.value.size}
    largest = ", ".join(
        f"{100 * errors.value(np.max).value:.0f} % at {name}" for name, errors in gaps.items()
    )
    return [
        Finding(
            "accuracy",
            {
                "median error of u_g, p* ≤ 1": _cases(gaps, np.median),
                "median error of p, p* ≥ 1": _cases(pressures, np.median),
            },
            f"Continuum values of `fig06` (u_g) and `fig09b` (p). Largest errors of u_g: {largest}.",
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


def _cases(errors: dict[str, Errors], statistic: Callable[[Field], float]) -> dict[str, Value]:
    """One number of each set of errors."""
    return {name: error.value(statistic) for name, error in errors.items()}


@needs("fig09b")
def fig09b(studies: StoredStudies, folder: Path) -> list[Finding]:
    """Large pressures on a linear axis."""
    ensembles = _gap_over_pressure(studies, folder, "fig09b", "fig09b", "linear", "log")
    first, second, third = ({}, {}, {})
    for group in ensembles:
        slopes = [_decay(group, at) for at in LINEAR]
        first[label(group.n)] = _over(slopes[1], slopes[0], group)
        second[label(group.n)] = _over(slopes[2], slopes[0], group)
        third[group.n] = [slope(group.best("u_g").value) for slope in slopes]
    slopes_text = ", ".join(f"{slope:.2f}" for slope in third[1.0])
    at = ", ".join(f"{p:g}" for p in LINEAR)
    return [
        Finding(
            "exponential",
            {
                "d ln u_g/d p* at p* = 1.75 over that at 1.25": first,
                "d ln u_g/d p* at p* = 2.75 over that at 1.25": second,
            },
            f"n = 1: {slopes_text} at p* = {at}. Study `fig09b`. In theory the tail is Gaussian, "
            "and a finite surface has no gap beyond a finite pressure.",
        )
    ]


def _decay(group: Group, at: float) -> Callable[[Field], float]:
    """d ln u_g / d p* between the two pressures around one, as a function of u_g."""
    low, high = (int(np.argmin(np.abs(group.p - at - side * STEP / 2))) for side in (-1, 1))
    return lambda u: float(np.log(u[high] / u[low]) / (group.p[high] - group.p[low]))


def _over(above: Callable[[Field], float], below: Callable[[Field], float], group: Group) -> Value:
    """The ratio of two slopes."""
    return estimate(lambda u: above(u) / below(u), group.best("u_g"))


@needs("small_pressure")
def small_pressure(studies: StoredStudies, folder: Path) -> list[Finding]:
    """Small pressures: how much the gap falls from decade to decade."""
    plot, xs, ys, lines = ColumnFigure(P_STAR, LABELS["u_g"]), [], [], []
    ratios, limits, lower = {}, {}, []
    for group in groups(studies, "small_pressure"):
        n, p, u = group.n, group.p, group.column("u_g")
        draw_points(plot, STYLES[n], p, u.value, u.error)
        line = dense(group.first)
        lines.append((STYLES[n], line, group.first.predict(line).u_g))
        xs, ys = [*xs, p], [*ys, u.value]
        limits[n] = min(float(p.max()), _long_waves(group.first))
        if limits[n] >= 100 * p.min() * 0.999:
            ratios[label(n)] = estimate(_falls(p, limits[n]), u)
            steps = _decades(p, limits[n], u.value)
            if len(steps) > 2:
                below = ", ".join(f"{step:.2f}" for step in steps[2:] / steps[0])
                lower.append(f"{below} at {label(n)}")
    plot.theory(lines)
    finish(plot, folder, "small_pressure", "log", "linear", np.concatenate(xs), [0, 3.7])
    limits_text = ", ".join(f"{limit:.2g} at {label(n)}" for n, limit in limits.items())
    missing = ", ".join(label(n) for n in limits if label(n) not in ratios)
    left_out = (
        f" Less than two decades of the studied range are below this pressure, so that they are not judged: {missing}."
        if missing
        else ""
    )
    further = (
        f" In the decades below these two the fall over that of the first decade is {'; '.join(lower)}, "
        "because a finite surface has a highest point."
        if lower
        else ""
    )
    quantity = (
        "fall of u_g over one decade of p* over that of the decade above, below the pressure at which the "
        "long waves are in contact"
    )
    return [
        Finding(
            "quasi_logarithmic",
            {quantity: ratios},
            f"1 means a logarithm. The pressures, at which p is the rms stress of the waves up to 2 qᵣ, are "
            f"p* = {limits_text}: the range shrinks as n rises.{left_out}{further} "
            "Study `small_pressure`.",
        )
    ]


def _falls(p: Field, limit: float) -> Callable[[Field], float]:
    """Fall of u_g over the second decade below a pressure over that of the first one."""

    def of(u: Field) -> float:
        first, second = _decades(p, limit, u)[:2]
        return float(second / first)

    return of


def _decades(p: Field, limit: float, u: Field) -> Field:
    """Fall of u_g over each decade below a pressure."""
    count = int(np.log10(limit / p.min()) + 1e-3)
    ends = np.log(limit) - np.log(10) * np.arange(count + 1)
    return np.diff(np.interp(ends, np.log(p), u))


def _long_waves(curve: Curve) -> float:
    """Rms stress in full contact of the waves up to twice the roll-off, in Delta_sigma."""
    shells, row = curve.persson.shells, curve.rows[0]
    q_r = 2 * np.pi / (row["rolloff"] * row["length"])
    share = shells.variance[shells.q <= 2 * q_r].sum() / shells.variance.sum()
    return float(np.sqrt(share))


@needs("fig06", "fig10", "fig10b")
def fig10(studies: StoredStudies, folder: Path) -> list[Finding]:
    """H = 0.3."""
    _gap_over_pressure(studies, folder, "fig10b", "fig10b", "linear", "log")
    ensembles = _gap_over_pressure(studies, folder, "fig10", "fig10a", "log", "linear")
    return [_transfer(studies, "fig10", ensembles, "hurst", "H = 0.3 over H = 0.8")]


@needs("fig06", "cut_off")
def cut_off(studies: StoredStudies, folder: Path) -> list[Finding]:
    """A cut-off spectrum."""
    ensembles = _gap_over_pressure(studies, folder, "cut_off", "cut_off", "log", "linear")
    return [_transfer(studies, "cut_off", ensembles, "cut_off", "cut-off over roll-off")]


def _transfer(
    studies: StoredStudies, study: str, ensembles: list[Group], key: str, ratio: str
) -> Finding:
    """Errors of theory on other surfaces over those on the default ones, all exponents together."""
    default = {group.n: _gap_errors(group, 1.0) for group in groups(studies, "fig06")}
    first = [_gap_errors(group, 1.0) for group in ensembles]
    second = [default[group.n] for group in ensembles]
    means = [errors.u for errors in (*first, *second)]

    def over(statistic: Callable[[Field], float]) -> Value:
        def of(*u: Field) -> float:
            parts = [errors.of(u) for errors, u in zip((*first, *second), u, strict=True)]
            above, below = parts[: len(first)], parts[len(first) :]
            return statistic(np.concatenate(above)) / statistic(np.concatenate(below))

        return estimate(of, *means)

    each = ", ".join(
        f"{100 * errors.value(np.max).value:.0f} % at {label(group.n)}"
        for group, errors in zip(ensembles, first, strict=True)
    )
    return Finding(
        key,
        {
            f"{name} error of u_g over all n, {ratio}": over(of)
            for name, of in (("median", np.median), ("largest", np.max))
        },
        f"p* ≤ 1. Studies `{study}` and `fig06`. Largest errors: {each}.",
    )


@needs("spacing")
def spacing(studies: StoredStudies, folder: Path) -> list[Finding]:
    """Is u_g at two points per lambda_s good to a per cent?"""
    off = {}
    ensembles = groups(studies, "spacing")
    coarse, fine = (
        {group.n: group for group in ensembles if group.first.points == points}
        for points in (128, 1024)
    )
    for n, group in coarse.items():
        off[label(n)] = estimate(
            lambda u, limit: abs(u[0] / limit[0] - 1),
            group.column("u_g"), fine[n].continuum("u_g"),
        )  # fmt: skip
    return [
        Finding(
            "spacing",
            {"distance of u_g from the continuum": off},
            "p* = 0.1; u_g is too small on the grid for n ≥ 1. Study `spacing`.",
        )
    ]


@needs("fig11")
def fig11(studies: StoredStudies, folder: Path) -> list[Finding]:
    """Slabs of four thicknesses, and a half-space."""
    ensembles = sorted(
        groups(studies, "fig11"),
        key=lambda group: np.nan_to_num(group.first.rows[0]["thickness"], nan=np.inf),
    )
    x_label = P_STAR.replace("sigma", "sigma_\\mathrm{si}")
    plot, xs, ys, lines, off = ColumnFigure(x_label, LABELS["u_g"]), [], [], [], {}
    for i, (group, colour) in enumerate(zip(ensembles, colours(len(ensembles)), strict=True)):
        row = group.first.rows[0]
        t = row["thickness"] / row["rolloff"]
        name = f"t/λᵣ = {t:.2g}" if np.isfinite(t) else "half-space"
        style = CurveStyle(colour, MARKERS[i], name)
        p, u = group.p, group.best("u_g")
        draw_points(plot, style, p, u.value, u.error)
        line = dense(group.first)
        lines.append((style, line, group.first.predict(line).u_g))
        off[name] = _gap_errors(group, 1.0, TAIL)
        xs, ys = [*xs, p], [*ys, u.value]
    plot.theory(lines)
    highest = np.concatenate(ys).max()
    finish(plot, folder, "fig11", "log", "log", np.concatenate(xs), [2e-3, highest])
    return [
        Finding(
            "slab",
            {
                "largest error of u_g, p* ≤ 1 (semi-quantitative: 30 %)": _cases(off, np.max),
                "largest error of the slabs over that of the half-space": _largest_over(
                    [errors for name, errors in off.items() if name != "half-space"],
                    off["half-space"],
                ),
            },
            "Study `fig11`.",
        )
    ]


def _largest_over(above: list[Errors], below: Errors) -> Value:
    """The largest of some errors over that of others."""

    def of(last: Field, *u: Field) -> float:
        largest = max(errors.of(u).max() for errors, u in zip(above, u, strict=True))
        return float(largest / below.of(last).max())

    return estimate(of, below.u, *(errors.u for errors in above))


FIGURES = (fig09a, fig09b, small_pressure, fig10, cut_off, spacing, fig11)
