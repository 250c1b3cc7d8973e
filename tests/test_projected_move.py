"""The conjugation of a direction, against what defines it."""

import numpy as np
import pytest

from gfmd_cli.solvers.projected_move import conjugation


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("share", [0.3, 0.8, 1.0, 1.6])
def test_it_leads_to_the_lowest_energy_in_the_plane(seed, share):
    """After a move of this share of the best length, if z K z is what the factor assumes."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(6, 6))
    stiffness = root @ root.T + np.eye(6)
    old_force, d, z = rng.normal(size=(3, 6))
    d *= np.sign(old_force @ d)
    curvature = d @ stiffness @ d
    best = old_force @ d / curvature
    force = old_force - share * best * stiffness @ d
    z *= np.sign(z @ force)
    z *= z @ force / (best * z @ stiffness @ z)  # then the energy along z is lowest at `best`
    plane = np.array([z, d])
    along_z, along_d = np.linalg.solve(plane @ stiffness @ plane.T, plane @ force)
    turned = share * best * z @ stiffness @ d
    beta = conjugation(z @ force, turned, share * best, best, curvature)
    expected = along_d / along_z if along_z > 0 else 0.0
    assert beta == pytest.approx(max(0.0, expected), rel=1e-8, abs=1e-12)


def test_an_exact_move_gives_the_formula_of_hestenes_and_stiefel():
    assert conjugation(2.0, -0.6, 0.5, 0.5, 3.0) == pytest.approx(0.6 / (0.5 * 3.0))
    assert conjugation(2.0, 0.6, 0.5, 0.5, 3.0) == 0.0
