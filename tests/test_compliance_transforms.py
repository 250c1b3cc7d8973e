"""Displacements of an elastomer by transforms: closed forms, other quadratures."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import gamma, j0, j1

from gfmd_cli.maps.interpolation import monotone_cubic
from gfmd_cli.physics.compliance_transforms import Compliance, separated
from gfmd_cli.physics.elastomers import HalfSpace, Layer, Power, Tabulated


def table_of(tmp_path, q, k):
    """A tabulated elastomer."""
    path = tmp_path / "k.txt"
    np.savetxt(path, np.column_stack([q, k]), fmt="%.17g")
    return Tabulated(path=path)


@pytest.mark.parametrize(("shape", "spacings"), [((40, 50), (0.02, 0.03)), ((70, 3), (0.1, 0.01))])
def test_table_of_the_half_space_has_the_displacements_of_love(tmp_path, shape, spacings):
    q = np.array([1.0, 3.0, 10.0, 200.0])
    compliance = table_of(tmp_path, q, 1.5 * q).free_compliance(shape, spacings)
    exact = HalfSpace(E_star=3.0).free_compliance(shape, spacings)
    assert compliance == pytest.approx(exact, rel=1e-8)


@pytest.mark.parametrize("n", [0.3, 1.7])
def test_table_of_a_power_law_has_its_displacements(tmp_path, n):
    q = np.array([1e-3, 1e5])
    compliance = table_of(tmp_path, q, q**n).free_compliance((30, 20), (0.1, 0.1))
    assert compliance == pytest.approx(Power(n=n).free_compliance((30, 20), (0.1, 0.1)), rel=2e-8)


def test_table_of_a_power_law_has_its_displacements_in_one_dimension(tmp_path):
    q = np.array([1.0, 10.0, 100.0])
    compliance = table_of(tmp_path, q, q**0.6).free_compliance((50,), (0.02,))
    assert compliance == pytest.approx(Power(n=0.6).free_compliance((50,), (0.02,)), rel=1e-8)


def test_table_of_a_layer_has_its_displacements(tmp_path):
    layer, q = Layer(thickness=0.3, base="sliding"), np.geomspace(0.01, 3000, 400)
    compliance = table_of(tmp_path, q, layer.stiffness(q)).free_compliance((24, 24), (0.05, 0.05))
    exact = layer.free_compliance((24, 24), (0.05, 0.05))
    assert compliance == pytest.approx(exact, abs=2e-7 * exact.max())  # the limit of the layer


def wide_table():
    """Rows of a stiffness whose exponent rises from 0.5 to 1.3."""
    q = np.array([1.0, 4.0, 16.0, 40.0])
    return q, np.sqrt(q) * (1 + q / 8) ** 0.8


@pytest.mark.parametrize("r", [0.02, 0.3, 2.0])
def test_transforms_are_those_of_another_quadrature(r):
    """The power law above the table by Weber's integral, the rest on the table's finite range.

    int_0^inf s^m J_v(s) ds = 2^m Gamma((1 + v + m)/2) / Gamma((1 + v - m)/2).
    """
    q, k = wide_table()
    x, y = np.log(q), np.log(k)
    low, high = (y[1] - y[0]) / (x[1] - x[0]), (y[-1] - y[-2]) / (x[-1] - x[-2])
    cubic = monotone_cubic(x, y)

    def stiffness(q):
        log_q = np.log(q)
        beyond = low * np.minimum(log_q - x[0], 0) + high * np.maximum(log_q - x[-1], 0)
        return np.exp(cubic(np.clip(log_q, x[0], x[-1])) + beyond)

    def transform(wave, order, power):
        def difference(s):
            return wave(s) * (1 / stiffness(s / r) - (s / r / q[-1]) ** -high / k[-1])

        ends = [0.0, *(q * r)]
        parts = [
            quad(difference, a, b, epsabs=1e-13, epsrel=1e-12, limit=400)[0]
            for a, b in pairwise(ends)
        ]
        m = power - high
        weber = 2**m * gamma((1 + order + m) / 2) / gamma((1 + order - m) / 2)
        return sum(parts) + weber * (r * q[-1]) ** high / k[-1]

    compliance = Compliance(stiffness, q, low)
    disc, point = compliance.transform("disc", r), compliance.transform("point", r)
    assert disc == pytest.approx(transform(j1, 1, 0) / (2 * np.pi), rel=1e-8)
    expected = transform(lambda s: s * j0(s), 0, 1) / (2 * np.pi * r**2)
    assert point == pytest.approx(expected, rel=1e-6)


def test_displacements_far_away_are_those_of_the_longest_waves(tmp_path):
    q, k = wide_table()
    low = np.log(k[1] / k[0]) / np.log(q[1] / q[0])
    compliance = table_of(tmp_path, q, k).free_compliance((2, 64), (20.0, 20.0))
    exact = Power(n=low, k_n=k[0] / q[0] ** low).free_compliance((2, 64), (20.0, 20.0))
    assert compliance[:, 32:] == pytest.approx(exact[:, 32:], rel=1e-3)


def test_knots_that_are_close_to_the_one_before_are_left_out():
    assert separated(np.array([1.0, 1.001, 2.0, 3.0, 3.001])).tolist() == [1.0, 2.0, 3.0, 3.001]
