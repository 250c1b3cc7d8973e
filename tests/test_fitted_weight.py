"""The fitted weight of two contact areas against quadrature and its limits."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import erf

from gfmd_cli.analysis.compare import einstein_prediction, theory_of
from gfmd_cli.physics.gap_theories import FittedWeight
from gfmd_cli.physics.persson import Persson, Shells

VARIANCE, ENERGY = (1.0, 2.7), (1.0, 0.9)  # of two shells: heights 1 and 0.3, k = 1 and 3


def two_shells(n):
    shells = Shells(*np.array([[1, 2], [1, 0.3], ENERGY, VARIANCE, [0.3, 0.3], [1, 1]]))
    return FittedWeight(shells, np.full(2, n))


def exact_energy(p, n):
    """v of Eq. (29), areas of the bins by quadrature over the variance, Eq. (31)."""
    alpha, beta = 0.413 + 0.609 * n, 0.623 * np.exp(-n / 0.874)
    c = 0.921 - 0.304 * n + 0.144 * n * n
    s, v, low = erf(p / np.sqrt(2 * sum(VARIANCE))), 0.0, 0.0
    for variance, energy in zip(VARIANCE, ENERGY, strict=True):
        ends = low, low + variance
        a = quad(lambda x: erf(p / np.sqrt(2 * x)), *ends, epsrel=1e-11)[0] / variance
        v += 0.5 * a**alpha * s**beta * (c + (1 - c) * a * a) * energy
        low += variance
    return v


def exact_gap(p, n):
    """Eq. (28) by parts: no derivative of v is needed."""
    end = 20.0  # full contact
    inner = quad(lambda x: exact_energy(x, n) / x**2, p, end, limit=200, epsrel=1e-9)[0]
    return inner + exact_energy(end, n) / end - exact_energy(p, n) / p


@pytest.mark.parametrize("n", [0.0, 1.0, 2.5, 4.0])
def test_the_gap_agrees_with_quadrature(n):
    theory = two_shells(n)
    for p in (0.02, 0.3, 1.5):
        assert float(theory.mean_gap(p)) == pytest.approx(exact_gap(p, n), rel=1e-6)


@pytest.mark.parametrize("n", np.linspace(0, 4, 9))
def test_the_weight_rises_with_both_areas(n):
    theory = two_shells(n)
    a_s = np.linspace(0.01, 1, 100)[:, None]
    a_q = np.stack([np.sqrt(a_s), a_s], axis=-1)[:, 0]  # the area decreases with the scale
    by_q, by_s = theory.weight_slopes(a_q, a_s)
    assert np.all(by_q > 0)
    assert np.all(by_s > 0)
    p = np.geomspace(1e-6, 40, 200)
    assert np.all(np.diff(theory.mean_gap(p)) <= 0)
    assert float(theory.mean_gap(0.0)) == np.inf


def test_springs_have_nearly_their_closed_form():
    """The fit contains it."""
    height = np.full(400, 1 / 400)
    springs = Shells(np.arange(1.0, 401), height, height, height, np.full(400, 0.5), height)
    p_star = np.array([0.01, 0.03, 0.1, 0.3])
    gap = FittedWeight(springs, np.zeros(400)).mean_gap(p_star)
    assert gap == pytest.approx(einstein_prediction(p_star).u_g, rel=0.02)


def test_a_elastomer_without_one_exponent_takes_the_local_one():
    q = np.geomspace(1, 30, 40)
    k = q**2.5
    spectrum = Shells(q, q**-3.0, k * q**-3.0, k * k * q**-3.0, np.full(40, 0.3), q)
    local, one = theory_of("fitted", spectrum, np.nan), theory_of("fitted", spectrum, 2.5)
    p = np.array([0.01, 0.1, 1.0]) * local.delta_sigma
    assert local.mean_gap(p) == pytest.approx(one.mean_gap(p), rel=1e-6)
    beyond, end = (FittedWeight(spectrum, np.full(40, n)) for n in (5.0, 4.0))
    assert np.array_equal(beyond.mean_gap(p), end.mean_gap(p))
    assert type(theory_of("paper", spectrum, 2.5)) is Persson
