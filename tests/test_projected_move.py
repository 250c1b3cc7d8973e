"""The direction and the projection of a move, against what defines them."""

import numpy as np
import pytest

from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.solvers.projected_move import conjugation, feasible, projected

GRID = Grid(8)  # on one process its sums are those of the values


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


@pytest.mark.parametrize("seed", range(20))
def test_the_projected_stress_is_the_nearest_of_its_sum(seed):
    """Towards every other admissible stress, the distance grows."""
    rng = np.random.default_rng(seed)
    stress, total = rng.normal(size=64), 10.0 ** rng.uniform(-3, 3)
    nearest = projected(GRID, stress, total)
    assert nearest.min() >= 0
    assert nearest.sum() == pytest.approx(total, rel=1e-12)
    others = total * rng.dirichlet(np.full(64, 0.1), size=100)
    assert np.all((others - nearest) @ (nearest - stress) >= -1e-12 * total * abs(stress).max())


def test_a_stress_of_this_sum_is_its_own_projection():
    stress = np.array([0.0, 1.0, 2.0, 0.0])
    assert np.array_equal(projected(GRID, stress, 3.0), stress)


def test_after_a_huge_move_the_largest_stress_takes_all():
    stress = np.array([1e30, -1e30, 2e30, 0.0])
    assert np.array_equal(projected(GRID, stress, 1e-8), [0.0, 0.0, 1e-8, 0.0])


def test_a_feasible_direction_has_no_mean_and_takes_no_stress_below_zero():
    rng = np.random.default_rng(1)
    direction, stress = rng.normal(size=64), np.maximum(rng.normal(size=64), 0.0)
    kept = feasible(GRID, direction, stress)
    assert kept.sum() == pytest.approx(0.0, abs=1e-13)
    leaving = (stress == 0) & (direction < direction.mean())
    assert leaving.any()
    assert not kept[leaving].any()
    assert kept[~leaving].all()
