"""Figs. 1 to 3: a ridge in one dimension, and a paraboloid on every body."""

from pathlib import Path

import numpy as np

from gfmd_cli.analysis.sheet import Sheet, log_scale
from gfmd_cli.physics import reference
from paper import kappa
from paper.claims import Claim
from paper.studies import Held, needs
from paper.tips import Tip, gap_fit, look_of, spread, stress_fit, tips

THIN = {"color": "black", "lw": 0.6, "zorder": 4}
DASHED = THIN | {"ls": (0, (5, 2))}
DISTANCE = r"distance from the axis  $r\,/\,a_c$"
SHOWN = 40  # symbols on a curve


@needs("fig01")
def fig01(held: Held, folder: Path) -> list[Claim]:
    """Displacement over one period of a ridge, beside that of a line force."""
    sheet = Sheet(r"position  $x\,/\,\lambda$", r"(displacement $-$ valley) / depth")
    rows = sorted(held.rows("fig01"), key=lambda row: row["n"])
    exponents, off, bend = [row["n"] for row in rows], [], []
    for row in rows:
        section = held.section("fig01", row)
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
        look = look_of(row["n"], exponents)
        sheet.points(look, x[every], shown[every], np.ones(shown[every].size, bool))
        sheet.line(sheet.axes, "line force", x, np.minimum(theory, 1.3), **THIN)
        outside = np.abs(x) > 1.5 * touched
        off.append(np.abs(shown - theory)[outside].max())
        near = np.abs(np.abs(x) - 0.5) < 0.03
        bend.append(2 * np.polyfit(np.abs(x[near]) - 0.5, shown[near], 2)[0])
    sheet.axes.set(xlim=(-0.5, 0.5), ylim=(-0.04, 1.12))
    sheet.write(folder / "fig01")
    told = ", ".join(f"{value:.1f}" for value in bend)
    return [
        Claim(
            "Fig. 1",
            "The profile of human skin on a periodic ridge is that of n = 2.",
            "The measured profile is not at hand; the solved profiles are compared with each other "
            "and with a line force.",
            "not decidable here",
            "fig01",
        ),
        Claim(
            "Sect. 2.1, Fig. 1",
            "Beside n = 2, the profile for n = 3 is too pointed near the minima and too blunt near "
            "the maxima; for n = 1 it is the other way round.",
            f"Curvature at the minimum over depth, times the period squared: {told} for "
            "n = 1, 2, 3 (a point contact on n = 2: exactly 8).",
            "agrees",
            "fig01",
        ),
        Claim(
            "Sect. 2.1",
            "With so small a contact the stiffness alone decides the profile outside.",
            "The shape of a line force is off by at most "
            + ", ".join(f"{100 * value:.2g} %" for value in off)
            + " of the depth for n = 1, 2, 3, beyond 1.5 contact half-widths (for "
            "n = 2 and 3 in units of its own depth: at n = 3 the flanks carry load too).",
            "agrees",
            "fig01",
        ),
        Claim(
            "Sect. 2.1",
            "The period of 2.5 mm is well below the O(10 µm) of the stratum corneum.",
            "2.5 mm is 250 times 10 µm: well above.",
            "disagrees",
        ),
    ]


def _shown(held: Held) -> list[Tip]:
    """One contact for each exponent of the paper."""
    return [tip for tip in tips(held, "fig02") if tip.n != 0.25]


@needs("fig02")
def fig02(held: Held, folder: Path) -> list[Claim]:
    """Stress over the distance from the axis, in units of its value there."""
    sheet = Sheet(DISTANCE, r"stress  $\sigma(r)\,/\,\sigma(0)$")
    shown = _shown(held)
    exponents = [tip.n for tip in shown]
    rho = np.linspace(0, 1, 600)[:-1]
    for tip in shown:
        a = gap_fit(tip)[0].value
        sigma = tip.sigma / (tip.force if tip.n == 4 else tip.sigma[0])
        if tip.n == 4:
            sigma = np.convolve(sigma, [0.25, 0.5, 0.25], "same")
            sigma[0] = 0.5 * (tip.sigma[0] + tip.sigma[1]) / tip.force
        inside = np.flatnonzero(tip.r < 1.1 * a)[:: max(1, int(a / tip.spacing / 25))]
        look = look_of(tip.n, exponents)
        sheet.points(look, tip.r[inside] / a, sigma[inside], np.ones(inside.size, bool))
        line = reference.hertz_profile(tip.n, rho, 1.0) if tip.n < 4 else np.ones_like(rho)
        sheet.line(sheet.axes, "exact", rho, line, **THIN)
    sheet.axes.set(xlim=(0, 1.1), ylim=(0, 3))
    sheet.write(folder / "fig02")
    return [_stress_claim(held), *_plate_claims(shown)]


def _stress_claim(held: Held) -> Claim:
    found = [(tip.n, stress_fit(tip)[1]) for tip in tips(held, "fig02") if tip.n not in (2, 4)]
    flat = [tip for tip in tips(held, "fig02") if tip.n == 2]
    told = ", ".join(f"{exponent} (n = {n:g})" for n, exponent in found)
    for tip in flat:
        inside = tip.sigma[tip.r < 0.9 * np.sqrt(tip.area / np.pi)]
        told += f"; n = 2 is flat to {100 * np.ptp(inside) / inside.mean():.1g} %"
    return Claim(
        "Eqs. (5), (6), Fig. 2",
        "σ = σ(0) √(1 − r²/a²)^(2μ) with μ = 2 − n, that is (1 − r²/a²)^(2−n).",
        f"The exponent of (1 − r²/a²) is 1 − n/2: {told}. The printed 2μ is to be read as μ.",
        "disagrees",
        "fig02",
    )


def _plate_claims(shown: list[Tip]) -> list[Claim]:
    claims = []
    for tip in (tip for tip in shown if tip.n == 4):
        a = gap_fit(tip)[0]
        inner = tip.sigma[tip.r < 0.6 * a.value] / tip.force
        inner = 0.5 * (inner[1:] + inner[:-1])
        mean, error = inner.mean(), inner.std() / np.sqrt(inner.size)
        line = 1 - np.pi * a.value**2
        claims.append(
            Claim(
                "Sect. 3, n = 4",
                "Stress is concentrated within the contact line; stress and displacement disappear "
                "for r < a.",
                f"The gap vanishes there, the stress does not: it is {mean:.2f} ± {error:.2f} p on "
                f"average (exactly p); the line carries the rest, {100 * line:.0f} % of the load "
                f"at a = {a.value:.3f} L. On a grid the line is a ragged ring of points, so that "
                f"the share of loaded points, π(a/L)² = {tip.area:.4f}, is too small "
                f"(gap opens at {np.pi * a.value**2:.4f}).",
                "agrees in part",
                "fig02",
            )
        )
    return claims


@needs("fig02")
def fig03(held: Held, folder: Path) -> list[Claim]:
    """Displacement over the distance from the axis, beside that of a point force in the cell."""
    sheet = Sheet(DISTANCE, r"displacement  $u\,/\,(a_c^2 / R_c)$")
    shown = _shown(held)
    exponents = [tip.n for tip in shown]
    near, low = [], []
    for tip in shown:
        a = gap_fit(tip)[0].value
        rho, unit, top = tip.r / a, a**2, tip.u[0]
        every = np.flatnonzero(rho < 5.2)[:: max(1, int(0.18 * a / tip.spacing))]
        u = (tip.u - top) / unit
        look = look_of(tip.n, exponents)
        sheet.points(look, rho[every], u[every], np.ones(every.size, bool))
        far = np.full(u.size, -0.5) if tip.n == 0 else (tip.point() - top) / unit
        far = far + (u - far)[-1]
        drawn = np.where(far < 0.3, far, np.nan)
        sheet.axes.plot(rho, drawn, **DASHED)
        near.append((tip.n, [abs(u - far)[np.searchsorted(rho, at)] for at in (1.2, 2.0)]))
        low.append(u[every].min())
    sheet.line(sheet.axes, "point force in the cell", np.ones(1), np.ones(1), **DASHED)
    rho = np.linspace(0, 3, 200)
    sheet.axes.plot(rho, -(rho**2) / 2, color="0.7", lw=2, zorder=1)
    sheet.line(sheet.axes, "indenter", np.ones(1), np.ones(1), color="0.7", lw=2)
    sheet.axes.set(xlim=(0, 5), ylim=(max(-5.0, 1.05 * min(low)), 0.2))
    sheet.write(folder / "fig03")
    told = ", ".join(f"{a:.2g}, {b:.2g} (n = {n:g})" for n, (a, b) in near)
    return [
        Claim(
            "Sect. 3, Fig. 3",
            "A point force mimics the true displacement up to the proximity of the contact.",
            f"Difference in a²/R at r = 1.2 a and 2 a, heights matched at the corner: {told}. For "
            "n ≤ 2 within the line width; for n = 3 and 4 the width of the contact still counts "
            "at a = 0.1 L.",
            "agrees in part",
            "fig03",
        ),
        *(_springs(tip) for tip in shown if tip.n == 0),
        *(_membrane(tip) for tip in shown if tip.n == 2),
        *(_harmonic(tip) for tip in shown if tip.n == 4),
    ]


def _springs(tip: Tip) -> Claim:
    outside = tip.u[tip.gap > 0]
    a = stress_fit(tip, 1.0)[0].value
    depth = (tip.u[0] - outside.mean()) / a**2
    flat = np.ptp(outside) / a**2
    return Claim(
        "Sect. 3.1.1",
        "n = 0: outside, the displacement is the height of the indenter at the contact line.",
        f"It is {depth:.5f} a²/R below the top (exactly 1/2) and constant to {flat:.0e} a²/R.",
        "agrees",
        "fig03",
    )


def _membrane(tip: Tip) -> Claim:
    """r_2 from the heights outside; what the cell adds to the logarithm, p r^2 / 4k, is known."""
    a = float(reference.hertz_radius(2, 1.0, 1 / tip.curvature, tip.force))
    m = (tip.r > 1.1 * a) & (tip.r < 2 * a)
    r = tip.r[m]
    images = tip.point()[m] / tip.force - reference.point_force(2, r)
    images -= reference.point_force_of_images(2)
    sag = 2 * np.pi * ((tip.u[0] - tip.u[m]) / tip.force + images)
    radius = spread((r * np.exp(-sag) / a).tolist())
    return Claim(
        "Sect. 3.1.4, Eq. (14)",
        "n = 2: u = (F/2πk) ln(r/r₂) with r₂ = √e a has the same slope at a as the indenter.",
        f"r₂ = ({radius}) a, that is a/√e = 0.6065 a, not 1.65 a. It is the height that fixes r₂; "
        "the slope does not depend on it.",
        "disagrees",
        "fig03",
    )


def _harmonic(tip: Tip) -> Claim:
    along = tip.r / np.sqrt(2)
    first = tip.force * 4 * np.cos(2 * np.pi * along) / (2 * np.pi) ** 4
    outside = tip.r > gap_fit(tip)[0].value
    depth = np.ptp(tip.u)
    exact = tip.point() - first
    off = np.ptp((tip.u - first)[outside]) / depth / 2
    return Claim(
        "Sect. 3.1.5",
        "n = 4: the leading Fourier summand is almost sufficient outside the contact.",
        f"Alone, it is off by ± {100 * off:.1f} % of the depth along the diagonal outside the "
        f"contact (± {100 * np.ptp(exact) / np.ptp(tip.point()) / 2:.1f} % for a point force, "
        "everywhere).",
        "agrees in part",
        "fig03",
    )


@needs("fig02")
def fig03b(held: Held, folder: Path) -> list[Claim]:
    """The gap just outside the contact, on logarithmic scales."""
    sheet = Sheet(r"distance from the edge  $(r - a_c)\,/\,a_c$", r"gap  $g\,/\,(a_c^2 / R_c)$")
    found = tips(held, "fig02")
    exponents = [tip.n for tip in found]
    fits = []
    for tip in found:
        a, beta = gap_fit(tip)
        fits.append((tip.n, beta))
        d, gap = tip.r / a.value - 1, tip.gap / a.value**2
        shown = np.flatnonzero((d > 2 * tip.spacing / a.value) & (d < 1))
        kept = shown[np.unique(np.geomspace(1, shown.size, 22).astype(int) - 1)]
        sheet.points(look_of(tip.n, exponents), d[kept], gap[kept], np.ones(kept.size, bool))
        x = np.geomspace(0.01, 1, 100)
        if tip.n < 4:
            exact = (1 + x) ** 2 / 2 - reference.hertz_sag(tip.n, 1.0, 1.0, 1 + x)
            sheet.line(sheet.axes, "exact, infinite plane", x, exact, **THIN)
    log_scale(sheet.axes, "x", 0.014, 0.8)
    log_scale(sheet.axes, "y", 1e-6, 1)
    sheet.write(folder / "fig03b")
    told = ", ".join(f"{beta} (n = {n:g})" for n, beta in fits)
    return [
        Claim(
            "Sect. 3",
            "Just outside the contact the gap grows as (r − a)^(1 + n/2).",
            f"Exponent, the radius being fitted too: {told}.",
            "agrees",
            "fig03b",
        ),
        Claim(
            "Sect. 6, item 4",
            "For n < 1 the slope of the displacement is discontinuous at the contact edge.",
            "The gap leaves with exponents above 1 for every n > 0 (n = 0.25 and 0.5 above), so "
            "that its slope starts from zero. Only at n = 0 does the slope jump; "
            "for 0 < n < 2 it is the curvature that diverges.",
            "disagrees",
            "fig03b",
        ),
    ]


FIGURES = (fig01, fig02, fig03, fig03b, *kappa.FIGURES)
