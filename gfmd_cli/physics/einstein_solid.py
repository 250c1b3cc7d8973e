"""The Einstein solid (n = 0) on a surface with Gaussian heights, in closed form.

Equation numbers are those of the paper: Mueser, "Elastic contacts of randomly rough surfaces across
the spatial dimensions", Sect. 4.2. Every function but the first takes an array z = h_nc / h_std of
any shape, z = (mean height - level of the non-contact zone) / h_std; heights are positive towards
the elastomer, so that z rises with the pressure. Lengths are returned in units of h_std, stresses
in k_0 h_std, which is Delta_sigma.
"""

import numpy as np
from scipy.special import ndtr, pbdv

from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.persson import UNDERFLOW, ierfc

_MAX_HEIGHT_STEPS = 50  # a bound; at most 6 are taken for pressures from 1e-300 to 1e300
_LAST_STEP = 1e-8  # relative; the error left behind it is of the order of its square


def non_contact_height(p_star: Field | float) -> Field:
    """Height z = h_nc / h_std of the non-contact zone at reduced pressure p / (k_0 h_std) > 0.

    Paper Eq. (38), corrected: p = k_0 <u(h_nc)>, solved for h_nc by Newton steps on ln <u>. This is
    concave in z: wherever the first step starts, it ends at or below the root, and the next ones
    rise to it.
    """
    p = np.asarray(p_star, dtype=np.float64)
    z: Field = np.where(p < 1, -np.sqrt(-2 * np.log(np.minimum(p, 1.0))), p)
    for _ in range(_MAX_HEIGHT_STEPS):
        trial_pressure = pressure(z)
        step = np.log(p / trial_pressure) * trial_pressure / contact_area(z)
        z += step
        if np.all(np.abs(step) < _LAST_STEP * (1 + np.abs(z))):
            break
    return z


def contact_area(z: Field | float) -> Field:
    """Relative contact area a_r = [1 + erf(z / sqrt 2)] / 2. Paper Eq. (36a)."""
    return ndtr(np.asarray(z))


def pressure(z: Field | float) -> Field:
    """Pressure p / (k_0 h_std) = <u> / h_std. Paper Eqs. (36b) and (38), corrected: p = k_0 <u>."""
    return ierfc(-np.asarray(z) / np.sqrt(2)) / np.sqrt(2)


def mean_gap(z: Field | float) -> Field:
    """Mean gap u_g(h_nc) / h_std = <u(-h_nc)> / h_std. Paper Eq. (37)."""
    return pressure(-np.asarray(z))


def stress_deviation(z: Field | float) -> Field:
    """Standard deviation of the stress sigma_p / (k_0 h_std) = sqrt(<u^2> - <u>^2) / h_std.

    Paper Eqs. (36b) and (36c). For z > 0 the variance is written in small terms,
    a + z phi (1 - 2a) + z^2 a (1 - a) - phi^2 with phi the normal density and a = a_r. For z <= 0,
    where the terms of <u^2> cancel, this is by Abramowitz & Stegun, Eq. 7.2.13,
    <u^2> = sqrt(2 / pi) exp(-z^2 / 4) D_-3(-z) with the parabolic cylinder function D.
    """
    z = np.asarray(z, dtype=np.float64)
    above = np.clip(z, 0.0, UNDERFLOW)
    a, rest, phi = ndtr(above), ndtr(-above), np.exp(-0.5 * above**2) / np.sqrt(2 * np.pi)
    pressed = a + above * phi * (rest - a) + above**2 * a * rest - phi**2
    below = np.minimum(z, 0.0)
    x = np.minimum(-below / np.sqrt(2), UNDERFLOW)
    square = np.sqrt(2 / np.pi) * np.exp(-0.5 * x**2) * pbdv(-3, np.sqrt(2) * x)[0]
    return np.sqrt(np.where(z > 0, pressed, square - pressure(below) ** 2))
