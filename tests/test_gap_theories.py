"""The mean gap by coarse-graining against closed forms, convolutions and simulations."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import trapezoid

from gfmd_cli import solve
from gfmd_cli.analysis.compare import einstein_prediction
from gfmd_cli.physics import einstein_solid
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.gap_theories import CoarseGrained
from gfmd_cli.physics.persson import Shells
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine

P_STAR = np.array([1e-7, 1e-4, 0.01, 0.1, 0.3, 1.0])


def waves(stiffness, height):
    """Shells of given stiffness [k] and squared height, q rising."""
    k, c = np.array(stiffness, dtype=float), np.array(height, dtype=float)
    return Shells(
        np.arange(1.0, k.size + 1), c, k * c, k * k * c, np.full(k.size, 0.5), np.ones_like(k)
    )


def surface(n, seed=0):
    spectrum = SelfAffine(hurst=0.8, rolloff=0.25, cutoff=1 / 16, spectrum="rolloff", seed=seed)
    return build_scene(spectrum, Power(n=n), 64).shells


@pytest.mark.parametrize("shells", [1, 7, 300])
def test_springs_have_the_closed_form_whatever_their_shells(shells):
    theory = CoarseGrained(waves(np.ones(shells), np.arange(1.0, shells + 1)))
    unit = theory.delta_sigma  # = h_std at k = 1
    exact = einstein_prediction(P_STAR)
    assert theory.mean_gap(P_STAR * unit) / unit == pytest.approx(exact.u_g, rel=5e-4)
    assert theory.mean_gap(3 * unit) / unit == pytest.approx(
        float(einstein_prediction(3.0).u_g), rel=5e-3
    )


def test_two_scales_are_two_averages_over_gaussian_heights():
    """Each average over heights with springs in series, by quadrature on an even lattice."""
    short, long = (9.0, 0.4**2), (1.0, 1.0)  # k and squared height
    z = np.linspace(-45, 9, 54001)
    pressure = short[0] * 0.4 * einstein_solid.pressure(-z / 0.4)
    gap = z + pressure / short[0]
    bare = gap - pressure / long[0]  # rises with the gap: less and less pressed
    even = np.linspace(bare[0], bare[-1], 40001)
    law = np.interp(even, bare, pressure)
    spread = np.linspace(-8, 8, 1601)
    weight = np.exp(-0.5 * spread**2)
    weight /= weight.sum()
    at = np.linspace(-2.0, 4.0, 25)
    averaged = np.array([weight @ np.interp(one + spread, even, law) for one in at])
    expected = at + averaged / long[0]
    theory = CoarseGrained(waves([long[0], short[0]], [long[1], short[1]]))
    assert theory.mean_gap(averaged) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("n", [0.5, 1, 2, 4])
def test_the_gap_does_the_work_of_full_contact(n):
    shells = surface(n)
    theory = CoarseGrained(shells)
    p = np.append(0.0, np.geomspace(1e-8, 8, 20001)) * theory.delta_sigma
    gap = theory.mean_gap(p[1:])
    work = gap[0] * p[1] + trapezoid(gap, p[1:])
    full = 0.5 * shells.energy.sum()
    assert work == pytest.approx(full, rel=1e-3)
    assert np.all(np.diff(gap) <= 0)


def test_units_of_height_and_stiffness_drop_out():
    shells = surface(1)
    other = replace(
        shells,
        height=1e-12 * shells.height,
        energy=3e-2 * shells.energy,
        variance=9e8 * shells.variance,
    )  # heights in micrometres, k in 3e10 Pa / m
    one, two = CoarseGrained(shells), CoarseGrained(other)
    gaps = one.mean_gap(P_STAR * one.delta_sigma), two.mean_gap(P_STAR * two.delta_sigma)
    assert gaps[1] == pytest.approx(1e-6 * gaps[0], rel=1e-6)


def test_ends_and_shapes():
    theory = CoarseGrained(surface(2))
    p = np.array([[0.0, 1e-12], [1e-3, 20.0]]) * theory.delta_sigma
    (none, light), (some, heavy) = theory.mean_gap(p)
    assert none == np.inf
    assert some < light < np.inf
    assert heavy == 0
    assert float(theory.pressure_at_gap(some)) == pytest.approx(p[1, 0], rel=1e-4)


def test_the_gap_of_a_half_space_is_that_of_simulations():
    """Mean of eight surfaces: two standard errors are 2 %."""
    p_star, keys = 0.1, {"hurst": 0.8, "rolloff": 0.125, "cutoff": 0.03125}
    logs = []
    for seed in range(8):
        spec = {
            "surface": keys | {"kind": "self-affine", "seed": seed},
            "elastomer": {"kind": "power", "n": 1},
            "grid": {"points": 128},
            "load": {"p_star": p_star},
        }
        logs.append(np.log(solve(spec).u_g))
    shells = build_scene(SelfAffine(**keys, spectrum="rolloff", seed=0), Power(n=1), 128).shells
    theory = CoarseGrained(shells)
    gap = theory.mean_gap(p_star * theory.delta_sigma) / np.sqrt(shells.height.sum())
    assert np.log(gap) == pytest.approx(np.mean(logs), abs=0.02)
