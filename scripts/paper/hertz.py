"""Figs. 1 to 3: a ridge in one dimension, and a paraboloid on every elastomer."""

from pathlib import Path

import exact_solutions as reference
import numpy as np

from gfmd_cli.analysis.plotting import ColumnFigure, log_scale
from paper import kappa
from paper.claims import Finding, Value, by_exponent
from paper.studies import StoredStudies, needs
from paper.tips import Tip, gap_fit, spread, stress_fit, style_of, tips

THIN = {"color": "black", "lw": 0.6, "zorder": 4}
DASHED = THIN | {"ls": (0, (5, 2))}
DISTANCE = r"distance from the axis  $r\,/\,a_c$"
SHOWN = 40  # symbols on a curve


@needs("fig01")
def fig01(studies: StoredStudies, folder: Path) -> list[Finding]:
    """Displacement over one period of a ridge, beside that of a line force."""
    plot = ColumnFigure(r"position  $x\,/\,\lambda$", r"(displacement $-$ valley) / depth")
    rows = sorted(studies.rows("fig01"), key=lambda row: row["n"])
    exponents, off, bend, width = [row["n"] for row in rows], {}, {}, {}
    for row in rows:
        section = studies.section("fig01", row)
        points, u = row["points"], section["u"]
        x = np.arange(points) / points - 0.5
        mean = row["mean_height"] + row["mean_gap"]
        touched = np.abs(x[section["sigma"] > 1e-3 * section["sigma"].max()]).max()
        with np.errstate(invalid="ignore"):
            line = row["pressure"] * reference.periodic_point_force(row["n"], x)
        valley, depth = u.min(), np.ptp(u)
        shown = (u - valley) / depth
        theory = (line + mean - valley) / depth
        if row["n"] > 1:  # finite at the force: in units of its own depth
            theory = (line - line.min()) / np.ptp(line)
        every = slice(points // SHOWN // 2, None, points // SHOWN)
        style = style_of(row["n"], exponents)
        plot.points(style, x[every], shown[every])
        plot.line("line force", x, np.minimum(theory, 1.3), **THIN)
        outside = np.abs(x) > 1.5 * touched
        off[f"n = {row['n']:g}"] = Value(np.abs(shown - theory)[outside].max())
        near = np.abs(np.abs(x) - 0.5) < 0.03
        bend[row["n"]] = 2 * np.polyfit(np.abs(x[near]) - 0.5, shown[near], 2)[0]
        width[row["n"]] = np.mean(shown > 0.75)
    plot.axes.set(xlim=(-0.5, 0.5), ylim=(-0.04, 1.12))
    plot.write(folder / "fig01")
    bends = ", ".join(f"{value:.1f}" for value in bend.values())
    period, thickness = 2500.0, 10.0  # µm, both as the paper gives them
    return [
        Finding("skin", {}, "The measured profile is not available."),
        Finding(
            "pointed",
            {
                "curvature at the minimum in depths per period², n = 3 over n = 2": Value(
                    bend[3] / bend[2]
                ),
                "the same, n = 1 over n = 2": Value(bend[1] / bend[2]),
                "width of the maximum at 3/4 of the depth, n = 3 over n = 2": Value(
                    width[3] / width[2]
                ),
                "the same width, n = 1 over n = 2": Value(width[1] / width[2]),
            },
            f"Curvatures: {bends} for n = 1, 2, 3 (a point contact on n = 2: exactly 8).",
        ),
        Finding(
            "stiffness_alone",
            {"largest difference from a line force beyond 1.5 contact half-widths, in depths": off},
            "For n = 2 and 3 in units of its own depth, because at n = 3 the flanks carry load as well.",
        ),
        Finding(
            "stratum",
            {
                "larger of both lengths over the smaller": Value(
                    max(period, thickness) / min(period, thickness)
                ),
                "period over thickness": Value(period / thickness),
            },
            'It should read "well above".',
        ),
    ]


def _shown(studies: StoredStudies) -> list[Tip]:
    """One contact for each exponent of the paper."""
    return [tip for tip in tips(studies, "fig02") if tip.n != 0.25]


@needs("fig02")
def fig02(studies: StoredStudies, folder: Path) -> list[Finding]:
    """Stress over the distance from the axis, in units of its value there."""
    plot = ColumnFigure(DISTANCE, r"stress  $\sigma(r)\,/\,\sigma(0)$")
    shown = _shown(studies)
    exponents = [tip.n for tip in shown]
    rho = np.linspace(0, 1, 600)[:-1]
    for tip in shown:
        a = gap_fit(tip)[0].value
        sigma = tip.sigma
        if tip.n == 4:  # the solution alternates from point to point along the diagonal
            sigma = np.convolve(np.r_[sigma[1], sigma], [0.25, 0.5, 0.25], "same")[1:]
        sigma = sigma / sigma[0]
        inside = np.flatnonzero(tip.r < 1.1 * a)[:: max(1, int(a / tip.spacing / 25))]
        style = style_of(tip.n, exponents)
        plot.points(style, tip.r[inside] / a, sigma[inside])
        line = reference.hertz_profile(tip.n, rho, 1.0) if tip.n < 4 else np.ones_like(rho)
        plot.line("exact", rho, line, **THIN)
    plot.axes.set(xlim=(0, 1.1), ylim=(0, 3))
    plot.write(folder / "fig02")
    return [_stress_law(studies), *_plate_stress(shown)]


def _stress_law(studies: StoredStudies) -> Finding:
    fits = {tip.n: stress_fit(tip)[1] for tip in tips(studies, "fig02") if tip.n not in (2, 4)}

    half = by_exponent({n: fit.times(1 / (1 - n / 2)) for n, fit in fits.items()})
    whole = by_exponent({n: fit.times(1 / (2 - n)) for n, fit in fits.items()})
    return Finding(
        "profile",
        {"exponent of 1 − r²/a² over μ/2": half, "the same exponent over μ": whole},
        "Errors: half the spread over windows of the fit. The printed 2μ should be μ.",
    )


def _plate_stress(shown: list[Tip]) -> list[Finding]:
    findings = []
    for tip in (tip for tip in shown if tip.n == 4):
        a = gap_fit(tip)[0]
        inner = tip.sigma[tip.r < 0.6 * a.value] / tip.force
        inner = 0.5 * (inner[1:] + inner[:-1])
        gap = tip.gap[tip.r < 0.9 * a.value].max() / a.value**2
        findings.append(
            Finding(
                "plate_stress",
                {
                    "share of the load on the line": Value(1 - np.pi * a.value**2),
                    "largest gap for r < 0.9 a, in a²/R": Value(gap),
                    "mean stress for r < 0.6 a over the pressure": Value(
                        inner.mean(), inner.std() / np.sqrt(inner.size)
                    ),
                },
                f"Inside, σ = p exactly; a = {a.value:.3f} L. On a grid the line is a ragged ring of "
                f"points: the share of loaded points is {tip.area:.4f}, the gap opens at "
                f"π(a/L)² = {np.pi * a.value**2:.4f}.",
            )
        )
    return findings


@needs("fig02")
def fig03(studies: StoredStudies, folder: Path) -> list[Finding]:
    """Displacement over the distance from the axis, beside that of a point force in the cell."""
    plot = ColumnFigure(DISTANCE, r"displacement  $u\,/\,(a_c^2 / R_c)$")
    shown = _shown(studies)
    exponents = [tip.n for tip in shown]
    near, low = {}, []
    for tip in shown:
        a = gap_fit(tip)[0].value
        rho, unit, top = tip.r / a, a**2, tip.u[0]
        every = np.flatnonzero(rho < 5.2)[:: max(1, int(0.18 * a / tip.spacing))]
        u = (tip.u - top) / unit
        style = style_of(tip.n, exponents)
        plot.points(style, rho[every], u[every])
        far = np.full(u.size, -0.5) if tip.n == 0 else (tip.point() - top) / unit
        far = far + (u - far)[-1]
        drawn = np.where(far < 0.3, far, np.nan)
        plot.axes.plot(rho, drawn, **DASHED)
        near[f"n = {tip.n:g}"] = Value(abs(u - far)[np.searchsorted(rho, 2.0)])
        low.append(u[every].min())
    plot.line("point force in the cell", np.ones(1), np.ones(1), **DASHED)
    rho = np.linspace(0, 3, 200)
    plot.axes.plot(rho, -(rho**2) / 2, color="0.7", lw=2, zorder=1)
    plot.line("indenter", np.ones(1), np.ones(1), color="0.7", lw=2)
    plot.axes.set(xlim=(0, 5), ylim=(max(-5.0, 1.05 * min(low)), 0.2))
    plot.write(folder / "fig03")
    quantity = "difference at r = 2 a in a²/R, heights matched at the corner of the cell"
    return [
        Finding("point_force", {quantity: near}, "At a = 0.1 L."),
        *(_springs(tip) for tip in shown if tip.n == 0),
        *(_membrane(tip) for tip in shown if tip.n == 2),
        *(_harmonic(tip) for tip in shown if tip.n == 4),
    ]


def _springs(tip: Tip) -> Finding:
    outside = tip.u[tip.gap > 0]
    a = stress_fit(tip, 1.0)[0].value
    depth = (tip.u[0] - outside.mean()) / a**2
    flat = np.ptp(outside) / a**2
    return Finding(
        "springs",
        {
            "depth below the top in a²/2R": Value(2 * depth),
            "its variation outside, in a²/R": Value(flat),
        },
    )


def _membrane(tip: Tip) -> Finding:
    """r_2 from the heights outside; what the cell adds to the logarithm, p r^2 / 4k, is known."""
    a = float(reference.hertz_radius(2, 1.0, 1 / tip.curvature, tip.force))
    m = (tip.r > 1.1 * a) & (tip.r < 2 * a)
    r = tip.r[m]
    images = tip.point()[m] / tip.force - reference.point_force(2, r)
    images -= reference.point_force_of_images(2)
    sag = 2 * np.pi * ((tip.u[0] - tip.u[m]) / tip.force + images)
    radius = spread((r * np.exp(-sag) / a).tolist())
    return Finding(
        "membrane",
        {
            "variation of the fitted r₂ for r = 1.1 a to 2 a, in a": Value(2 * radius.error),
            "r₂/a over √e": radius.times(1 / np.sqrt(np.e)),
        },
        f"r₂ = ({radius}) a, that is a/√e = 0.6065 a. The height at a determines r₂ (printed: the slope, "
        "which does not depend on it).",
    )


def _harmonic(tip: Tip) -> Finding:
    along = tip.r / np.sqrt(2)
    first = tip.force * 4 * np.cos(2 * np.pi * along) / (2 * np.pi) ** 4
    outside = tip.r > gap_fit(tip)[0].value
    depth = np.ptp(tip.u)
    exact = tip.point() - first
    rest = (tip.u - first)[outside] / depth
    return Finding(
        "leading_wave",
        {"rms deviation of this term outside the contact, in depths": Value(rest.std())},
        f"Along the diagonal; the largest is ± {100 * np.ptp(rest) / 2:.1f} % (± "
        f"{100 * np.ptp(exact) / np.ptp(tip.point()) / 2:.1f} % for a point force, everywhere).",
    )


@needs("fig02")
def fig03b(studies: StoredStudies, folder: Path) -> list[Finding]:
    """The gap just outside the contact, on logarithmic scales."""
    plot = ColumnFigure(
        r"distance from the edge  $(r - a_c)\,/\,a_c$", r"gap  $g\,/\,(a_c^2 / R_c)$"
    )
    contacts = tips(studies, "fig02")
    exponents = [tip.n for tip in contacts]
    fits = []
    for tip in contacts:
        a, beta = gap_fit(tip)
        fits.append((tip.n, beta))
        d, gap = tip.r / a.value - 1, tip.gap / a.value**2
        shown = np.flatnonzero((d > 2 * tip.spacing / a.value) & (d < 1))
        sample = shown[np.unique(np.geomspace(1, shown.size, 22).astype(int) - 1)]
        plot.points(style_of(tip.n, exponents), d[sample], gap[sample])
        x = np.geomspace(0.01, 1, 100)
        if tip.n < 4:
            exact = (1 + x) ** 2 / 2 - reference.hertz_sag(tip.n, 1.0, 1.0, 1 + x)
            plot.line("exact, infinite plane", x, exact, **THIN)
    log_scale(plot.axes, "x", 0.014, 0.8)
    log_scale(plot.axes, "y", 1e-6, 1)
    plot.write(folder / "fig03b")
    law = by_exponent({n: beta.times(1 / (1 + n / 2)) for n, beta in fits})
    below = by_exponent({n: beta for n, beta in fits if n < 1})
    return [
        Finding(
            "gap_law", {"fitted exponent over 1 + n/2": law}, "With the radius fitted as well."
        ),
        Finding(
            "slope_jump",
            {"exponent of the gap (1: a jump of the slope)": below},
            "For 0 < n < 2 the slope is continuous and the curvature diverges; the slope jumps only at "
            "n = 0.",
        ),
    ]


FIGURES = (fig01, fig02, fig03, fig03b, *kappa.FIGURES)
