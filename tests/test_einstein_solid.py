"""The Einstein solid against high-precision arithmetic, quadrature and its energy balance."""

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import trapezoid

from gfmd_cli.physics import einstein_solid

Z = (-36.0, -15.0, -4.3, -4.2, -1.0, 0.0, 0.7, 3.0, 8.0, 36.0)


def moments(z):
    """Paper Eqs. (34) and (35): <u^0>, <u>, <u^2> at h_nc = z and <u> at -z, in 60 digits."""
    with mp.workdps(60):
        density = mp.npdf(z)
        area, rest = mp.ncdf(z), mp.ncdf(-z)
        return area, density + z * area, z * density + (z * z + 1) * area, density - z * rest


@pytest.mark.parametrize("z", Z)
def test_every_observable_keeps_its_digits_in_both_tails(z):
    with mp.workdps(60):
        area, u, u2, gap = moments(mp.mpf(z))
        variance = u2 - u * u
        expected = [float(x) for x in (area, u, gap, mp.sqrt(variance))]
    obtained = [
        einstein_solid.contact_area(z),
        einstein_solid.pressure(z),
        einstein_solid.mean_gap(z),
        einstein_solid.stress_deviation(z),
    ]
    assert obtained == pytest.approx(expected, rel=5e-13, abs=0)


@pytest.mark.parametrize("z", [-2.5, -0.5, 1.0])
def test_the_moments_are_integrals_over_the_gaussian_heights(z):
    node, weight = np.polynomial.legendre.leggauss(60)
    u = 0.5 * (12 + z) * (1 + node)  # heights from -12 to z
    weight = weight * 0.5 * (12 + z) * np.exp(-0.5 * (z - u) ** 2) / np.sqrt(2 * np.pi)
    assert einstein_solid.contact_area(z) == pytest.approx(weight.sum(), rel=1e-12)
    assert einstein_solid.pressure(z) == pytest.approx(weight @ u, rel=1e-12)
    square = einstein_solid.stress_deviation(z) ** 2 + einstein_solid.pressure(z) ** 2
    assert square == pytest.approx(weight @ u**2, rel=1e-12)


def test_the_height_is_found_for_every_pressure():
    p = np.concatenate([[1e-300, 1e-100, 1e100, 1e300], np.geomspace(1e-12, 1e3, 61)])
    assert einstein_solid.pressure(einstein_solid.non_contact_height(p)) == pytest.approx(
        p, rel=1e-12, abs=0
    )


def test_one_pressure_gives_one_height():
    assert einstein_solid.non_contact_height(1 / np.sqrt(2 * np.pi)) == pytest.approx(0, abs=1e-15)


def test_the_variance_of_the_stress_balances_the_work_on_the_gap():
    """The elastic energy v = sigma_p^2 / 2, without q = 0, has dv = -p du_g."""
    z, step = -1.0, 1e-5
    rise = 2 * step

    def slope(f):
        return float(f(z + step) - f(z - step)) / rise

    work = -float(einstein_solid.pressure(z)) * slope(einstein_solid.mean_gap)
    assert work == pytest.approx(0.07009703, rel=1e-7)
    energy_slope = slope(lambda z: 0.5 * einstein_solid.stress_deviation(z) ** 2)
    assert energy_slope == pytest.approx(work, rel=1e-8)


def test_the_gap_integrates_over_pressure_to_the_energy_of_full_contact():
    z = np.linspace(-14, 14, 2801)
    gap_dp = einstein_solid.mean_gap(z) * einstein_solid.contact_area(z)  # dp / dz = a_r
    assert trapezoid(gap_dp, z) == pytest.approx(0.5, rel=1e-10)
