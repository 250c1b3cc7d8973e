"""Sects. 3.1 to 3.3: far fields, contact radius under load, and the coefficient kappa_n."""

from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from gfmd_cli.analysis.sheet import Sheet
from gfmd_cli.physics import reference
from paper.claims import Claim
from paper.studies import Held, needs
from paper.tips import Tip, Value, look_of, spread, stress_fit, tips

CONJECTURE = (2 / 3) ** 2 * (8 * np.pi / 5) ** 0.25
PERSSON = np.sqrt(2 / np.pi)


def _radius(tip: Tip) -> float:
    """From the stress profile; for n = 2, where that is flat, from the area."""
    if tip.n == 2:
        return float(np.sqrt(tip.area / np.pi))
    return stress_fit(tip, 1 - tip.n / 2)[0].value


def _kappa_primes(found: list[Tip], cell: bool) -> list[tuple[Tip, float]]:
    """k a^(4-n) / (F R) of each contact, R that of the tip or what the cell makes of it."""
    return [
        (tip, _radius(tip) ** (4 - tip.n) / tip.force * (tip.curvature if cell else 1.0))
        for tip in found
    ]


def kappa_prime(found: list[Tip]) -> Value:
    """That of the best resolved contact, the cell taken off; error: what half the grid changes."""
    finest = max(tip.points for tip in found)
    grids = ([t for t in found if t.points == points] for points in (finest, finest // 2))
    best = [max(grid, key=lambda tip: tip.force) for grid in grids if grid]
    values = [value for _, value in _kappa_primes(best, cell=True)]
    return Value(values[0], abs(values[0] - values[-1]))


def _by_exponent(held: Held) -> dict[float, list[Tip]]:
    found: dict[float, list[Tip]] = {}
    for tip in tips(held, "kappa"):
        found.setdefault(tip.n, []).append(tip)
    return found


@needs("kappa")
def kappa(held: Held, folder: Path) -> list[Claim]:
    """kappa_n over n beside the closed form."""
    sheet = Sheet(r"exponent  $n$", r"coefficient  $\kappa_n$")
    groups = _by_exponent(held)
    primes = {n: kappa_prime(found) for n, found in groups.items()}
    shown = [n for n in primes if n < 3]
    x = np.linspace(0, 2.95, 200)
    exact = np.array([reference.kappa(n) for n in x])
    sheet.line(sheet.axes, "exact", x, exact, color="black", lw=0.8)
    sheet.line(
        sheet.axes, "Persson theory", x, np.full(x.size, PERSSON), color="0.5", ls=(0, (4, 2))
    )
    values = np.array(
        [primes[n].value * reference.kappa(n) / reference.kappa_prime(n) for n in shown]
    )
    look = look_of(0.0, [0.0])
    sheet.axes.plot(shown, values, "o", mfc="none", color=look.colour, zorder=4)
    sheet.legend["solved"] = sheet.axes.lines[-1]
    sheet.axes.set(xlim=(-0.05, 3), ylim=(0, 1.25))
    sheet.write(folder / "kappa")
    return [*_coefficients(primes), *_half(groups, primes), *_radius_law(groups), *_far(groups)]


def _coefficients(primes: dict[float, Value]) -> list[Claim]:
    told = ", ".join(
        f"{found} (n = {n:g}, exact {reference.kappa_prime(n):.6f})" for n, found in primes.items()
    )
    ratios = ", ".join(f"{reference.kappa(n) / PERSSON:.3f}" for n in (0.01, 0.25, 0.5, 0.75, 1))
    return [
        Claim(
            "Eq. (18)",
            "a_r = κ′ p R / (k a^(2−n)).",
            f"κ′ = k a^(4−n) / (F R) is {told}. These are the printed values only with "
            "a_r = π κ′ p R / (k a^(2−n)): Eq. (18) lacks π.",
            "disagrees",
            "kappa",
        ),
        Claim(
            "Sect. 3.3",
            "κ₀ = 2/√3 and κ₁ = 3π/(8√2).",
            "Both follow from κ_n = 2^(1−n) Γ(3−n/2) Γ(2−n/2) / [√(3−n) Γ(3−n)], which holds for "
            "every n < 3 and which the solved contacts confirm (the row above).",
            "agrees",
            "kappa",
        ),
        Claim(
            "Eq. (17)",
            "The coefficient of a³ = c F R / k₁ for n = 1 is 3/2.",
            f"It is κ′₁ = 3/8 with k₁ = E*/2, or 3/4 with E*{_one(primes)}.",
            "disagrees",
        ),
        Claim(
            "Sect. 4.1.2",
            "κ_P = √(2/π) = 0.798 is in reasonable agreement with κ_n for 0 < n < 1.",
            f"κ_n/κ_P = {ratios} at n = 0.01, 0.25, 0.5, 0.75, 1: 4 % off at n = 1, 45 % at n → 0.",
            "agrees in part",
            "kappa",
        ),
    ]


def _one(primes: dict[float, Value]) -> str:
    return f"; found {primes[1.0]}" if 1.0 in primes else ""


def _half(groups: dict[float, list[Tip]], primes: dict[float, Value]) -> list[Claim]:
    if 0.5 not in primes:
        return []
    found, exact = primes[0.5], reference.kappa_prime(0.5)
    off = abs(CONJECTURE - found.value) / max(found.error, 1e-12)
    raw = min(
        _kappa_primes(groups[0.5], cell=False), key=lambda pair: (-pair[0].points, pair[0].force)
    )
    told = off > 2.5 and abs(found.value - exact) < 2 * found.error
    return [
        Claim(
            "Sect. 3.3, κ₁/₂",
            "κ′ = 0.665(5) for n = 1/2 numerically; (2/3)² (8π/5)^(1/4) = 0.665480 is "
            "believed exact.",
            f"By the same procedure {raw[1]:.5f} at the smallest force on the finest grid, "
            f"and {found} on the best resolved contact, the cell taken off. Exact: {exact:.6f}; "
            "the conjecture lies 9.6e-5 above and "
            f"{off:.1f} errors from what is found"
            + (": not exact." if told else ", which the numbers alone do not settle."),
            "disagrees" if told else "agrees in part",
            "kappa",
        )
    ]


def _radius_law(groups: dict[float, list[Tip]]) -> list[Claim]:
    powers = []
    for n, found in groups.items():
        finest = [tip for tip in found if tip.points == max(t.points for t in found)]
        force = [tip.force / tip.curvature for tip in finest]
        if len(finest) > 2:
            slopes = np.diff(np.log(force)) / np.diff(np.log([_radius(tip) for tip in finest]))
            powers.append(f"{spread(slopes.tolist())} (n = {n:g})")
    ratios = [
        1 / (1 + reference.hertz_cell_curvature(3, 1.0, 8 * share)) for share in (0.12, 0.06, 0.01)
    ]
    return [
        Claim(
            "Eq. (17)",
            "a^(4−n) is proportional to F R / k.",
            "d ln F / d ln a, the cell corrected for: " + ", ".join(powers) + ".",
            "agrees",
        ),
        Claim(
            "Sect. 3",
            "At fixed load a_c has a limit for large L for n < 3, or even n ≤ 3; for n = 4 it "
            "grows with L.",
            "The cell changes a by O((a/L)^(4−n)), so there is a limit for every n < 4. For n = 3, "
            "a/a(L→∞) = " + ", ".join(f"{r:.3f}" for r in ratios) + " at a(L→∞) = 0.12, 0.06, "
            "0.01 L. For n = 4, F R/k has no length: a/L is fixed.",
            "agrees in part",
        ),
    ]


def _depths(found: list[Tip]) -> list[tuple[float, float]]:
    """Largest contact radius first: a / L and the height of the top above the corner, in a^2/R."""
    finest = [tip for tip in found if tip.points == max(t.points for t in found)]
    return [(_radius(t), (t.u[0] - t.u[-1]) / _radius(t) ** 2) for t in reversed(finest)]


def _far(groups: dict[float, list[Tip]]) -> list[Claim]:
    return [*_exponent(groups), *_amplitude(groups), *_depth_claims(groups), *_volume(groups)]


def _far_fit(tip: Tip, free: bool) -> tuple[float, float]:
    """Amplitude and exponent n' of a point force with second moment in the far field of a tip."""
    a = _radius(tip)
    m = tip.r > 6 * a  # the fourth moment adds (a / r)^4 / 12 or less
    part = Tip(tip.n, tip.points, tip.force, tip.area, tip.r[m], tip.sigma, tip.u[m], tip.gap)

    def off(t):
        n = t[1] if free else tip.n
        field = part.point(n) - a**2 / (3 - n / 2) / 4 * part.point(n - 2)
        gone = part.u - t[0] * field
        return (gone - gone.mean()) / np.ptp(part.u)

    found = least_squares(off, [1.0, tip.n], x_scale=[1, 0.1], xtol=1e-12).x
    return found[0], found[1]


def _far_enough(tip: Tip) -> bool:
    """Whether the contact is small against the cell and holds 20 points across."""
    return tip.area < 0.01 and tip.points**2 * tip.area > 400


def _exponent(groups: dict[float, list[Tip]]) -> list[Claim]:
    found = [tip for tip in groups.get(0.25, []) if _far_enough(tip)]
    if not found:
        return []
    power = spread([_far_fit(tip, free=True)[1] - 2 for tip in found])
    return [
        Claim(
            "Sect. 3.2 (ii)",
            "n = 1/4: u ∝ r^(−2.25) far away; u ∝ r^(n−2) only for n ≥ 1/2.",
            f"Beyond 6 a the solved field is that of r^({power}) and its images: the power is "
            "n − 2 for every 0 < n < 2. n = 0 is the limit of a vanishing prefactor.",
            "disagrees",
        )
    ]


def _amplitude(groups: dict[float, list[Tip]]) -> list[Claim]:
    claims = []
    if 0.5 in groups:
        exact = 2 * np.pi * float(reference.point_force(0.5, 1.0))
        values = [
            exact * _far_fit(t, free=False)[0] for t in groups[0.5] if t.points * _radius(t) > 40
        ]
        claims.append(
            Claim(
                "Eqs. (10b), (11)",
                "I(1/2) = 0.478(0); Eq. (10b) holds for n < 1/2.",
                f"{spread(values)} from the far field of the solved contacts; exactly 2^(1−n) "
                f"Γ(1−n/2)/Γ(n/2) = {exact:.6f}, for every 0 < n < 2; "
                "the printed range is a slip.",
                "agrees in part",
            )
        )
    depths = []
    for n in (0.25, 0.5, 1.0, 1.5):
        for tip in groups.get(n, [])[-1:]:
            level = tip.u[0] + tip.force * -reference.point_force_of_images(n)
            depths.append(f"{level * (2 - n) / _radius(tip) ** 2:.5f} (n = {n:g})")
    claims.append(
        Claim(
            "Sects. 3.1.3, 3.3",
            "n = 1: d = a²/R; for n < 2 the depth scales as a²/R.",
            "d (2 − n) R/a², the images taken off: " + ", ".join(depths) + "; exactly 1.",
            "agrees",
        )
    )
    return claims


def _depth_claims(groups: dict[float, list[Tip]]) -> list[Claim]:
    told = []
    for n, found in groups.items():
        values = ", ".join(f"{depth:.3f}" for _, depth in _depths(found))
        told.append(f"{values} (n = {n:g})")
    at = "0.1, 0.05, 0.025"
    bend = 2 * np.pi * abs(reference.point_force_of_images(1)) / 2
    return [
        Claim(
            "Sect. 3.2 (i)",
            "The depth at fixed force stays finite with L for n < 2, grows as ln L for n = 2 and "
            "algebraically for n > 2.",
            f"Top above corner in a²/R at a/L = {at}: "
            + "; ".join(told)
            + ". By the exact sums it is d − c (a/L)^(2−n): a limit, a logarithm, L^(n−2).",
            "agrees",
        ),
        Claim(
            "Sect. 3.2 (iii)",
            "For n > 2 the prefactor of the derivative of u depends on the period even for L ≫ a.",
            f"For n = 3 the exact sum gives u′ = −(F/2πk)(1 − {bend:.2f} r/L + …): at fixed r the "
            "period drops out, though slowly (2 % at r = L/100). It stays only at n = 4, as "
            "u′ ∝ r ln(r/L).",
            "agrees in part",
        ),
    ]


def _volume(groups: dict[float, list[Tip]]) -> list[Claim]:
    found = groups.get(0.25, [])
    finest = [tip for tip in found if tip.points == max(t.points for t in found)]
    if len(finest) < 2:
        return []
    radii = [_radius(tip) for tip in finest]
    volume = [-tip.u[-1] / a**4 for tip, a in zip(finest, radii, strict=True)]
    power = spread((-np.diff(np.log(volume)) / np.diff(np.log(radii))).tolist())
    return [
        Claim(
            "Sect. 3.2 (iv)",
            "The displaced volume stays finite for n below a critical 0.25 < n < 0.5.",
            f"At n = 0.25 the volume above the level of the corner grows as (L/a)^({power}), "
            "as L^n: it diverges for every n > 0.",
            "disagrees",
        )
    ]


FIGURES = (kappa,)
