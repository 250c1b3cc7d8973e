"""Line contacts of slabs and layers against dense solutions, k(q) by integration of elasticity."""

import numpy as np
import pytest
from scipy.optimize import nnls
from test_elastomers import layered_stiffness

from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.elastomers import Layer, Slab
from gfmd_cli.physics.free_contact import FreeCompliance, FreeContact
from gfmd_cli.physics.scenes import reduce_scene
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import solve_contact

POINTS, POISSON = 64, 0.4


def rough_heights():
    """A random profile with a standard deviation of 1 % of the cell."""
    m = np.arange(POINTS // 2 + 1)
    amplitude = (1 + (m / 3) ** 2) ** -0.65 * ((m > 0) & (m < 20))
    phases = np.random.default_rng(7).random(m.size)
    h = np.fft.irfft(amplitude * np.exp(2j * np.pi * phases), POINTS)
    return 0.01 * h / h.std()


def elastomer(back, thickness):
    E_star = 1 / (1 - POISSON**2)  # E = 1
    if back == "stress":
        return Slab(thickness=thickness, E_star=E_star)
    return Layer(thickness=thickness, E_star=E_star, poisson=POISSON, base=back)


def least_squares(compliance, load):
    """s >= 0 that minimises <s C s> / 2 - <s load>, and C s - load, by Lawson and Hanson."""
    root = np.linalg.cholesky(compliance).T
    stress, _ = nnls(root, np.linalg.solve(root.T, load))
    return stress, compliance @ stress - load


@pytest.mark.parametrize("p_star", [0.03, 0.5])
@pytest.mark.parametrize("thickness", [0.01, 0.05, 0.3])
@pytest.mark.parametrize("back", ["stress", "bonded", "sliding"])
def test_periodic_line_contact_is_that_of_a_dense_solution(back, thickness, p_star):
    h = rough_heights()
    scene = reduce_scene(Grid(POINTS, dimension=1), h.copy(), elastomer(back, thickness))
    contact = scene.contact(p_star)
    solution = solve_contact(contact, Auto(tolerance=1e-11))
    q = 2 * np.pi * np.arange(1, POINTS // 2 + 1)
    k = np.array([float(layered_stiffness(x, thickness, POISSON, back)) for x in q])
    column = np.fft.irfft(np.append(1 / k[0], 1 / k), POINTS)  # any finite 1/k(0): a level
    compliance = column[np.subtract.outer(np.arange(POINTS), np.arange(POINTS))]
    stress = solution.sigma * scene.delta_sigma
    touching = solution.u == contact.obstacle
    level = np.mean((h - compliance @ stress)[touching])
    exact, gap = least_squares(compliance, h - level)
    assert exact.mean() == pytest.approx(p_star * scene.delta_sigma, rel=1e-8)
    assert stress == pytest.approx(exact, abs=1e-8 * exact.max())
    gap_of_solution = (solution.u - contact.height) * scene.h_std
    assert gap_of_solution == pytest.approx(np.maximum(gap, 0), abs=1e-8 * scene.h_std)


@pytest.mark.parametrize("pressure", [0.005, 0.05])
@pytest.mark.parametrize("thickness", [0.01, 0.05, 0.3])
@pytest.mark.parametrize("back", ["bonded", "sliding"])
def test_free_line_contact_of_a_layer_is_that_of_a_dense_solution(back, thickness, pressure):
    """With the compliance that `test_free_compliance` compares with sums over all waves."""
    layer, h, grid = elastomer(back, thickness), rough_heights(), Grid(POINTS, 1, 1.0)
    compliance = FreeCompliance(layer, grid, 1.0)
    contact = FreeContact(grid, h - h.mean(), np.empty(0), pressure, compliance=compliance)
    solution = solve_contact(contact, Auto(tolerance=1e-11))
    kernel = layer.free_compliance(grid.shape, grid.spacings)
    compliance = kernel[np.abs(np.subtract.outer(np.arange(POINTS), np.arange(POINTS)))]
    level = contact.reference_level(solution.u, solution.sigma)
    exact, gap = least_squares(compliance, contact.height - level)
    assert exact.mean() == pytest.approx(pressure, rel=1e-8)
    assert solution.sigma == pytest.approx(exact, abs=1e-8 * exact.max())
    assert solution.u - contact.height == pytest.approx(np.maximum(gap, 0), abs=1e-9)
