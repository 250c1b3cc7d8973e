"""Contacts with an exact solution: parabolas, waves, strings and beams.

Stiffness k(q) = k q^n; the profile is a crest of radius R or a wave of amplitude h_0, repeated with
period L. "Paper" is Mueser, "Elastic contacts of randomly rough surfaces across the spatial
dimensions". Scalars or arrays that broadcast go in and arrays come out; an exponent is one number.
"""

import numpy as np
from scipy.special import exp1, gamma, gammaincc, hyp2f1, rgamma, xlogy

from gfmd_cli.grid.arrays import Field

# --- Generalised Hertz contact: one paraboloid of radius R, small against the cell, 0 <= n < 4 ---
#
# With rho = r/a and nu = 1 - n/2, the Hankel transform of (1 - rho^2)^nu is
# 2^nu Gamma(nu+1) J_(nu+1)(q a) / (q a)^(nu+1); dividing by k q^n and going back is a
# Weber-Schafheitlin integral that is quadratic in r for r < a, which fixes the peak stress.


def kappa(n: float, m: float = 2.0) -> float:
    """Coefficient of a_r = kappa p / Delta_sigma_c for h = -r^m / (m R^(m-1)), n < m + 1.

    2^(1-n) Gamma(m) Gamma(2 - n/2) Gamma(m/2 + 2 - n/2) / [Gamma(m/2 + 1) Gamma(m + 1 - n)
    sqrt(m + 1 - n)], from `power_law_force` and the mean square of d^n h / dr^n over the contact,
    paper Eqs. (19) to (21). The value that the paper believes exact at n = 1/2 is 1e-4 off.
    """
    _require(n < m + 1, f"Delta_sigma_c is finite for n < m + 1, got n = {n}, m = {m}")
    slope = gamma(m) / (gamma(m + 1 - n) * np.sqrt(m + 1 - n))  # Delta_sigma_c, k = R = a = 1
    return float(np.pi * slope / power_law_force(n, m, 1.0, 1.0, 1.0))


def power_law_force(n: float, m: float, k: float, R: float, a: Field | float) -> Field:
    """Force that makes a contact of radius a with h = -r^m / (m R^(m-1)), a << L.

    F = pi 2^(n-1) Gamma(m/2 + 1) k a^(m+2-n) / [Gamma(2 - n/2) Gamma(m/2 + 2 - n/2) R^(m-1)], see
    docs/verification.md. For m > 0 and 0 <= n <= 2; for 2 < n < 4 the stress is compressive
    everywhere only for n - 2 < m <= 2.
    """
    valid = m > 0 and (0 <= n <= 2 or (n < 4 and n - 2 < m <= 2))
    _require(valid, f"no disc of contact for this exponent, got n = {n}, m = {m}")
    shape = gamma(m / 2 + 1) / (gamma(2 - n / 2) * gamma(m / 2 + 2 - n / 2))
    return np.asarray(np.pi * 2 ** (n - 1) * shape * k * a ** (m + 2 - n) / R ** (m - 1))


def power_law_depth(n: float, m: float, R: float, a: Field | float) -> Field:
    """Indentation Gamma(m/2 + 1) Gamma(1 - n/2) a^m / [Gamma(m/2 + 1 - n/2) m R^(m-1)], n < 2."""
    _require(0 <= n < 2, f"the depth is finite for 0 <= n < 2, got n = {n}")
    shape = gamma(m / 2 + 1) * gamma(1 - n / 2) / gamma(m / 2 + 1 - n / 2)
    return np.asarray(shape * a**m / (m * R ** (m - 1)))


def kappa_prime(n: float) -> float:
    """Coefficient of a^(4-n) = kappa' F R / k, 2^(1-n) Gamma(3 - n/2) Gamma(2 - n/2) / pi.

    Paper Eq. (18), corrected: a_r = pi kappa' p R / (k a^(2-n)) for the printed values of kappa'.
    """
    _require(0 <= n < 4, f"a paraboloid makes a Hertz contact for 0 <= n < 4, got n = {n}")
    return float(2 ** (1 - n) * gamma(3 - n / 2) * gamma(2 - n / 2) / np.pi)


def hertz_radius(n: float, k: float, R: float, force: Field | float) -> Field:
    """Contact radius a under a force. Paper Eq. (17) with kappa'."""
    return np.asarray(kappa_prime(n) * force * R / k) ** (1 / (4 - n))


def hertz_force(n: float, k: float, R: float, a: Field | float) -> Field:
    """Force that makes a contact of radius a: F = k a^(4-n) / (kappa' R)."""
    return np.asarray(k * a ** (4 - n) / (kappa_prime(n) * R))


def hertz_peak_stress(n: float, k: float, R: float, a: Field | float) -> Field:
    """Stress in the centre, sigma_0 = 2^(n-1) k a^(2-n) / [R Gamma(2 - n/2)^2], 0 <= n < 4."""
    return np.asarray((2 - n / 2) * hertz_force(n, k, R, a) / (np.pi * np.square(a)))


def hertz_depth(n: float, R: float, a: Field | float) -> Field:
    """Indentation a^2 / [(2 - n) R] against the flat far away, n < 2 (beyond, it grows with L)."""
    _require(0 <= n < 2, f"the depth is finite for 0 <= n < 2, got n = {n}")
    return np.asarray(np.square(a) / ((2 - n) * R))


def hertz_sag(n: float, R: float, a: float, r: Field | float) -> Field:
    """Distance of the surface at r below the top of the indenter, 0 <= n < 4, a << L.

    r^2 / 2R inside. Outside a^2 / [(2-n) R] less the displacement of the force times
    2F1(1 - n/2, 1 - n/2; 3 - n/2; a^2/r^2) (Weber-Schafheitlin); for n = 2 (a^2/R) [ln(r/a) + 1/2],
    which is paper Eq. (14) with r_2 = a / sqrt(e) (printed: sqrt(e) a).
    """
    r = np.abs(np.asarray(r, dtype=float))
    far = np.maximum(r, a)
    if n == 2:
        outside = a**2 / R * (np.log(far / a) + 0.5)
    else:
        spread = hyp2f1(1 - n / 2, 1 - n / 2, 3 - n / 2, np.square(a / far))
        pushed = hertz_force(n, 1.0, R, a) * point_force(n, far) * spread
        outside = a**2 / ((2 - n) * R) - pushed
    return np.where(r > a, outside, np.square(r) / (2 * R))


def hertz_cell_curvature(n: float, k: float, force: float, L: float = 1.0) -> float:
    """Curvature that the periodic images add to the curvature 1/R of the tip, 0 <= n < 4.

    Half the Laplacian of their displacement at the contact; with 1/R + this for 1/R the formulas
    here hold in a square cell up to relative terms of (a/L)^(6-n).
    """
    _require(0 <= n < 4, f"a paraboloid makes a Hertz contact for 0 <= n < 4, got n = {n}")
    return -0.5 * force / k * point_force_of_images(n - 2, L) if n else 0.0


def hertz_profile(n: float, r: Field, a: float) -> Field:
    """Stress in units of its peak, (1 - r^2/a^2)^(1 - n/2) for r < a, else 0; points and lines.

    Paper Eqs. (5) and (6), corrected: the exponent is mu / 2 with mu = 2 - n (printed: mu).
    """
    inside = np.abs(r) < a
    return np.where(inside, np.where(inside, 1 - np.square(r / a), 1.0) ** (1 - n / 2), 0.0)


# --- Point forces: K u = F delta - p with k(0) = 0; displacements are in units of F / k ----------
#
# Ewald's splitting: q^-n is the integral of t^(n/2-1) exp(-q^2 t) / Gamma(n/2) over t > 0. Beyond
# t = L^2 / 4 pi it is summed over wave vectors, before over images, and both fall as exp(-pi m^2).

IMAGES = 4  # on each side; the first that is left out has exp(-pi 3.5^2) = 2e-17


def point_force(n: float, r: Field | float) -> Field:
    """Displacement I_n / (2 pi r^(2-n)) in an infinite plane. Paper Eqs. (10) to (14).

    I_n = 2^(1-n) Gamma(1 - n/2) / Gamma(n/2) for 0 < n < 2 (printed: n < 1/2), and up to a constant
    for 2 < n < 4; for n = 2 it is -ln(r) / 2 pi.
    """
    if n == 2:
        return np.asarray(-np.log(r) / (2 * np.pi))
    return gamma(1 - n / 2) * rgamma(n / 2) / (2**n * np.pi) * np.asarray(r) ** (n - 2)


def periodic_point_force(n: float, *place: Field | float, L: float = 1.0) -> Field:
    """Displacement of one force a cell, sum of e^(iqx) / (q^n L^d) over q != 0, -2 < n <= 4.

    In d = 1 (line force, place = x) or d = 2 (x, y) dimensions; its mean is zero; infinite at the
    force for n <= d. Paper Eq. (10a) as the sum that it is in a cell. 1e-13 is lost where n is
    within 0.01 of d, 0 or 2 without being it. The Laplacian of n is that of n - 2 with minus.
    """
    own, others = _image_terms(n, place, L)
    return _ewald(n, place, L, own + others)


def point_force_of_images(n: float, L: float = 1.0) -> float:
    """Displacement by the images of a point force at its own place, -2 < n < 4, square cell.

    The periodic displacement less that in an infinite plane, `point_force`.
    """
    place = (np.zeros(()), np.zeros(()))
    _, others = _image_terms(n, place, L)
    regular = np.log(L**2 / np.pi) - np.euler_gamma if n == 2 else 2 / (n - 2)
    return float(_ewald(n, place, L, others + regular))


def _image_terms(n: float, place: tuple[Field | float, ...], L: float) -> tuple[Field, Field]:
    """E_p(pi |x - R|^2 / L^2) of the nearest image R and the sum of those of the others."""
    d = len(place)
    shape = np.broadcast_shapes(*(np.shape(x) for x in place))
    own: Field = np.zeros(shape)
    others: Field = np.zeros(shape)
    for image in np.ndindex(*(2 * IMAGES + 1,) * d):
        distance = sum(
            np.square(np.asarray(x) / L - np.round(np.asarray(x) / L) - m + IMAGES)
            for x, m in zip(place, image, strict=True)
        )
        term = _exponential_integral(1 + (n - d) / 2, np.pi * np.asarray(distance))
        if image == (IMAGES,) * d:
            own = term
        else:
            others = others + term
    return own, others


def _ewald(n: float, place: tuple[Field | float, ...], L: float, images: Field) -> Field:
    """The sum over wave vectors and that over images, each of its share of q^-n."""
    d, eta = len(place), L**2 / (4 * np.pi)
    _require(-2 < n <= 4, f"sums of q^-n are implemented for -2 < n <= 4, got n = {n}")
    waves = np.zeros(np.shape(images))
    for wave in np.ndindex(*(2 * IMAGES + 1,) * d):
        m = np.array(wave) - IMAGES
        if np.any(m):
            share = _exponential_integral(1 - n / 2, np.pi * (m @ m))
            phase = sum(2 * np.pi * i * np.asarray(x) / L for i, x in zip(m, place, strict=True))
            waves = waves + share * np.cos(phase)
    # in units of eta^(n/2) / L^d, for (4 pi eta)^(d/2) = L^d
    summed = rgamma(n / 2) * (images + waves) - rgamma(n / 2 + 1)
    return np.asarray(eta ** (n / 2) / L**d * summed)


def _exponential_integral(p: float, x: Field | float) -> Field:
    """E_p(x), the integral of exp(-x t) / t^p over t > 1, for real p and x >= 0."""
    x = np.asarray(x, dtype=float)
    if p > 1:  # [8.19.12] of the Digital Library of Mathematical Functions
        inner = _exponential_integral(p - 1, np.where(x > 0, x, 1.0))
        return np.asarray((np.exp(-x) - x * inner) / (p - 1))
    if p == 1:
        return np.asarray(exp1(x))
    with np.errstate(divide="ignore"):  # infinite at x = 0
        return np.asarray(gamma(1 - p) * gammaincc(1 - p, x) * x ** (p - 1))


# --- Line contact: a ridge of radius R, contact half-width a -------------------------------------


def line_load(n: float, k: float, R: float, a: Field | float) -> Field:
    """Load per length P = sigma_0 a sqrt(pi) Gamma(2 - n/2) / Gamma(5/2 - n/2), 0 <= n < 3."""
    shape = np.sqrt(np.pi) * gamma(2 - n / 2) / gamma(2.5 - n / 2)
    return np.asarray(shape * a * line_peak_stress(n, k, R, a))


def line_half_width(n: float, k: float, R: float, load: Field | float) -> Field:
    """Half-width a of the contact under a load per length, 0 <= n < 3: P grows as a^(3-n)."""
    return np.asarray(load / line_load(n, k, R, 1.0)) ** (1 / (3 - n))


def line_peak_stress(n: float, k: float, R: float, a: Field | float) -> Field:
    """sigma_0 = 2^(n-1) Gamma(3/2) k a^(2-n) / [R Gamma(2 - n/2) Gamma((3-n)/2)], 0 <= n < 3."""
    _require(0 <= n < 3, f"a ridge makes a Hertz contact for 0 <= n < 3, got n = {n}")
    shape = 2 ** (n - 1) * gamma(1.5) / (gamma(2 - n / 2) * gamma((3 - n) / 2))
    return np.asarray(shape * k * a ** (2 - n) / R)


# --- n = 1 on waves; p_bar is the pressure over that of full contact -----------------------------


def westergaard_pressure(a_r: Field | float) -> Field:
    """p_bar = sin^2(pi a_r / 2) on h_0 cos(q x), p = p_bar k(q) h_0 (Westergaard 1939)."""
    return np.square(np.sin(np.pi / 2 * np.asarray(a_r)))


def westergaard_area(p_bar: Field | float) -> Field:
    """a_r = (2/pi) arcsin(sqrt(p_bar)), the inverse of `westergaard_pressure`."""
    return 2 / np.pi * np.arcsin(np.sqrt(p_bar))


def westergaard_gap(p_bar: Field | float) -> Field:
    """Mean gap u_g / h_0 = 1 - p_bar + p_bar ln(p_bar)."""
    return np.asarray(1 - p_bar + xlogy(p_bar, p_bar))


def westergaard_energy(p_bar: Field | float) -> Field:
    """Elastic energy per area v / (k(q) h_0^2) = p_bar^2 / 4 - p_bar^2 ln(p_bar) / 2."""
    return np.asarray(np.square(p_bar) / 4 - xlogy(np.square(p_bar), p_bar) / 2)


def square_wave_area_light(p_bar: Field | float) -> Field:
    """a_r = pi (3 p_bar / 8 pi)^(2/3) on cos + cos for p_bar -> 0 (Johnson et al. 1985)."""
    return np.pi * (3 / (8 * np.pi) * np.asarray(p_bar)) ** (2 / 3)


def square_wave_area_heavy(p_bar: Field | float) -> Field:
    """1 - a_r = (3 / 2 pi) (1 - p_bar) on cos + cos for p_bar -> 1 (Johnson et al. 1985)."""
    return 1 - 3 / (2 * np.pi) * (1 - np.asarray(p_bar))


# --- n = 2, tension tau: in contact sigma = p - tau Laplacian(h), outside Laplacian(u) = p / tau -


def membrane_area(p: Field | float, tau: float, R: float) -> Field:
    """a_r = p / (p + 2 tau / R): membrane on one paraboloid in any periodic 2-D cell."""
    return np.asarray(p / (p + 2 * tau / R))


def string_area(p: Field | float, tau: float, R: float) -> Field:
    """a_r = p / (p + tau / R): string on a parabola with period L (1-D)."""
    return np.asarray(p / (p + tau / R))


def string_gap(p: Field | float, tau: float, R: float, L: float) -> Field:
    """Mean gap u_g = L^2 (1 - a_r)^2 / (24 R) of a string on a parabola (1-D)."""
    return np.asarray(np.square(L * (1 - string_area(p, tau, R))) / (24 * R))


def string_wave_pressure(a_r: Field | float) -> Field:
    """p / (tau h_0 q^2) = sin(pi a_r) / [pi (1 - a_r)]: string on h_0 cos(q x)."""
    return np.asarray(np.sinc(1 - np.asarray(a_r)))  # sinc(x) = sin(pi x) / (pi x)


# --- n = 4, bending stiffness B: a beam on a parabola with period L (1-D) ------------------------


def beam_line_pressure(B: float, R: float, L: float) -> float:
    """p_c = 12 B / (R L^2): below, the beam touches only the crests; above, it lies on them."""
    return 12 * B / (R * L**2)


def beam_free_half_length(p: Field | float, B: float, R: float, L: float) -> Field:
    """Half-length l of the free span: L/2 below p_c, (3 B L / 2 p R)^(1/3) above.

    Solves B u'''' = -p with the gap, its slope and its curvature zero where the span begins.
    """
    p_c = beam_line_pressure(B, R, L)
    return np.asarray(0.5 * L * np.cbrt(p_c / np.maximum(p, p_c)))


def beam_area(p: Field | float, B: float, R: float, L: float) -> Field:
    """a_r = 1 - 2 l / L of a beam on a parabola; zero below p_c.

    The stress is p inside and a line force p l at each edge of the contact.
    """
    return 1 - 2 * beam_free_half_length(p, B, R, L) / L


def beam_gap(p: Field | float, B: float, R: float, L: float) -> Field:
    """Mean gap: l^2 / 6R - p l^4 / 45B below p_c (with l = L/2), p l^5 / (15 B L) above."""
    length = beam_free_half_length(p, B, R, L)
    touching = length**2 / (6 * R) - p * length**4 / (45 * B)
    wrapped = p * length**5 / (15 * B * L)
    return np.where(p < beam_line_pressure(B, R, L), touching, wrapped)


def _require(fulfilled: bool, message: str) -> None:
    if not fulfilled:
        raise ValueError(message)
