"""The Einstein solid (n = 0) on a surface with Gaussian heights, in closed form.

Equation numbers are those of the paper: Mueser, "Elastic contacts of randomly rough surfaces across
the spatial dimensions", Sect. 4.2. Every function but the first takes an array z = h_nc / h_std of
any shape, z = (mean height - level of the non-contact zone) / h_std; heights are positive towards
the elastomer, so that z rises with the pressure. Lengths are returned in units of h_std,
stresses in k_0 h_std (which is Delta_sigma), energies per area in k_0 h_std^2.
"""

import numpy as np
from scipy.special import erfc, ndtr, pbdv

from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.persson import UNDERFLOW, ierfc

_MAX_HEIGHT_STEPS = 50  # a bound; at most 6 are taken for pressures from 1e-300 to 1e300
_LAST_STEP = 1e-8  # relative; the error left behind it is of the order of its square


def non_contact_height(p_star: Field | float) -> Field:
    """Height z = h_nc / h_std of the non-contact zone at reduced pressure p / (k_0 h_std).

    Paper Eq. (38), corrected: p = k_0 <u(h_nc)>, solved for h_nc by Newton steps on ln <u>. This is
    concave in z: wherever the first step starts, it ends at or below the root, and the next ones
    rise to it. Minus infinity at p = 0.

    Raises ValueError for a negative pressure.
    """
    target = np.asarray(p_star, dtype=np.float64)
    if np.any(target < 0):
        raise ValueError(f"the pressure must not be negative, got {target.min()}")
    p = np.where(target > 0, target, 1.0)
    z: Field = np.where(p < 1, -np.sqrt(-2 * np.log(np.minimum(p, 1.0))), p)
    for _ in range(_MAX_HEIGHT_STEPS):
        trial_pressure = pressure(z)
        step = np.log(p / trial_pressure) * trial_pressure / contact_area(z)
        z += step
        if np.all(np.abs(step) < _LAST_STEP * (1 + np.abs(z))):
            break
    return np.where(target > 0, z, -np.inf)


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
    """Standard deviation of the stress sigma_p / (k_0 h_std) = sqrt(<u^2> - <u>^2) / h_std."""
    return np.sqrt(2 * elastic_energy(z))


def elastic_energy(z: Field | float) -> Field:
    """Elastic energy v = k_0 (<u^2> - <u>^2) / 2, without q = 0: the one with dv = -p du_g.

    Paper Eqs. (36b) and (36c). For z > 0 the variance is written in small terms,
    a + z phi (1 - 2a) + z^2 a (1 - a) - phi^2 with phi the normal density and a = a_r.
    """
    z = np.asarray(z, dtype=np.float64)
    above = np.clip(z, 0.0, UNDERFLOW)
    a, rest, phi = ndtr(above), ndtr(-above), np.exp(-0.5 * above**2) / np.sqrt(2 * np.pi)
    pressed = a + above * phi * (rest - a) + above**2 * a * rest - phi**2
    below = np.minimum(z, 0.0)
    light = 2 * elastic_energy_with_mean(below) - pressure(below) ** 2
    return 0.5 * np.where(z > 0, pressed, light)


def elastic_energy_with_mean(z: Field | float) -> Field:
    """Elastic energy v = k_0 <u^2> / 2 including the uniform displacement q = 0: dv = p dh_nc.

    Paper Eq. (36c).
    """
    x = -np.asarray(z, dtype=np.float64) / np.sqrt(2)
    pressed, light = np.minimum(x, 0.0), np.clip(x, 0.0, UNDERFLOW)
    bounded = np.maximum(pressed, -UNDERFLOW)
    closed = (0.5 + pressed**2) * erfc(pressed)
    closed -= bounded * np.exp(-(bounded**2)) / np.sqrt(np.pi)
    # for x > 0, where its terms cancel: Abramowitz & Stegun, Eq. 7.2.13, with D_-3(sqrt(2) x)
    product = np.sqrt(2 / np.pi) * np.exp(-0.5 * light**2) * pbdv(-3, np.sqrt(2) * light)[0]
    return 0.5 * np.where(x > 0, product, closed)
