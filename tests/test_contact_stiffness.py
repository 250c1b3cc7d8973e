"""Contact stiffness against differences of two contacts, closed forms and flat punches."""

import numpy as np
import pytest
from exact_solutions import hertz_radius

from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.elastomers import Power, Slab
from gfmd_cli.physics.indenters import LineParabola, Parabola
from gfmd_cli.physics.observables import contact_points, observe
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.contact_stiffness import contact_stiffness
from gfmd_cli.solvers.nested_grids import solve_contact

STEP = 1e-5  # of the pressure, for differences


def solved(scene, p_star, tolerance=1e-11):
    """The points that carry load, and the mean gap."""
    contact = scene.contact(p_star)
    solution = solve_contact(contact, Auto(tolerance=tolerance))
    assert solution.status == "converged"
    return contact_points(contact.height, solution.u, solution.sigma), observe(
        contact, solution.u, solution.sigma
    ).u_g


def by_difference(scene, p_star, tolerance):
    up, down = (solved(scene, p_star * (1 + step), tolerance)[1] for step in (STEP, -STEP))
    return -2 * STEP * p_star / (up - down)


@pytest.mark.parametrize("p_star", [0.03, 1.0])
@pytest.mark.parametrize(
    "elastomer", [*(Power(n=n) for n in (0, 0.5, 1, 1.5, 2, 3, 4)), Slab(thickness=0.02)], ids=str
)
def test_it_is_the_slope_of_pressure_over_mean_gap(elastomer, p_star):
    tolerance = 1e-10 if getattr(elastomer, "n", 0) == 4 else 1e-11
    scene = build_scene(SelfAffine(cutoff=0.04), elastomer, 64)
    touching, _ = solved(scene, p_star, tolerance)
    stiffness = contact_stiffness(scene.contact(p_star), touching)
    assert stiffness == pytest.approx(by_difference(scene, p_star, tolerance), rel=1e-5)


@pytest.mark.parametrize("n", [0.5, 1, 2, 3, 4])
def test_it_is_that_of_a_dense_solve(n):
    """1 / <w> with K as a matrix: K w = 1 on the free points, w = 0 on the contact."""
    scene = build_scene(SelfAffine(cutoff=0.1), Power(n=n), 24)
    contact = scene.contact(0.2)
    touching, _ = solved(scene, 0.2, 1e-6)
    units = np.eye(contact.grid.size).reshape(-1, *contact.grid.shape)
    matrix = [contact.apply_stiffness(unit, out=np.empty_like(unit)).ravel() for unit in units]
    free = ~touching.ravel()
    w = np.linalg.solve(np.array(matrix)[np.ix_(free, free)], np.ones(free.sum()))
    exact = contact.grid.size / w.sum()
    assert contact_stiffness(contact, touching) == pytest.approx(exact, rel=1e-8)


@pytest.mark.parametrize("points", [50, 96])
def test_it_is_so_on_grids_that_no_power_of_two_divides(points):
    scene = build_scene(SelfAffine(cutoff=0.05), Power(n=1), points)
    touching, _ = solved(scene, 0.2)
    stiffness = contact_stiffness(scene.contact(0.2), touching)
    assert stiffness == pytest.approx(by_difference(scene, 0.2, 1e-11), rel=1e-5)


def test_springs_have_it_in_closed_form():
    """K = k (1 - mean): of w = <w> + 1/k on the free points the mean gives k a / (1 - a)."""
    scene = build_scene(SelfAffine(cutoff=0.05), Power(n=0), 64)
    for p_star in (0.01, 0.3, 2.0):
        touching, _ = solved(scene, p_star)
        a_r = touching.mean()
        stiffness = contact_stiffness(scene.contact(p_star), touching)
        assert stiffness == pytest.approx(a_r / (1 - a_r), rel=1e-9)


def line_contact(n, width, points=4096):
    """k = q^n on a line of length 1, held over this width."""
    grid = Grid(points, 1)
    touching = np.arange(points) < round(width * points)
    return Contact(grid, np.zeros(points), grid.wavenumber() ** n, 1.0), touching


@pytest.mark.parametrize("width", [0.02, 0.3, 0.7, 0.95])
def test_strips_on_a_half_space_are_collinear_cracks(width):
    """k = E* q / 2: mean opening (2 / pi E*) ln sec(pi c) of periodic cracks of length 2 c = 1 - a.

    Tada, Paris & Irwin, The Stress Analysis of Cracks Handbook, periodic collinear cracks; for
    c << 1 it is pi c^2 / E*, the opening of one crack.
    """
    contact, touching = line_contact(1, width, 2**15)
    exact = -np.pi / np.log(np.sin(np.pi * width / 2))  # E* = 2
    assert contact_stiffness(contact, touching) == pytest.approx(exact, rel=2e-3)


@pytest.mark.parametrize("width", [0.1, 0.6])
def test_strings_and_beams_between_strips_sag_as_they_should(width):
    """T w'' = -1 and B w'''' = 1 over the length l = 1 - a: <w> = l^3 / 12 T, l^5 / 720 B."""
    for n, points, error in ((2, 4096, 1e-3), (4, 1024, 1e-2)):  # of first order in the spacing
        contact, touching = line_contact(n, width, points)
        span = 1 - (touching.sum() - 1) / touching.size  # from one point held to the other
        exact = 12 / span**3 if n == 2 else 720 / span**5
        assert contact_stiffness(contact, touching) == pytest.approx(exact, rel=error)


def test_a_line_scene_has_it_too():
    scene = build_scene(LineParabola(radius=1.0), Power(n=1), 1024)
    touching, _ = solved(scene, 0.1)
    stiffness = contact_stiffness(scene.contact(0.1), touching)
    assert stiffness == pytest.approx(by_difference(scene, 0.1, 1e-11), rel=1e-5)


def test_a_hertz_contact_is_as_stiff_as_a_flat_punch_of_its_radius():
    """dF/dd = 2 E* a, and the cells around: d is less by 3.900265 F / (pi E* L).

    That is the potential of a square lattice of charges, Bonsall & Maradudin, Phys. Rev. B 15, 1959
    (1977), as K^-1 of k = E* q / 2 is a potential 1 / (pi E* r).
    """
    scene = build_scene(Parabola(radius=1.0), Power(n=1), 512)  # E* = 2, L = 1
    unit = scene.delta_sigma / scene.h_std
    for force in (2e-4, 1.6e-3):
        touching, _ = solved(scene, force / scene.delta_sigma, 1e-9)
        stiffness = contact_stiffness(scene.contact(0.1), touching) * unit
        radius = float(hertz_radius(1, 1.0, 1.0, force))
        assert 1 / stiffness == pytest.approx(1 / (4 * radius) - 3.900265 / (2 * np.pi), rel=3e-3)


def test_full_contact_is_rigid_and_no_contact_has_no_stiffness():
    contact, touching = line_contact(1, 0.5, 64)
    assert contact_stiffness(contact, np.ones_like(touching)) == np.inf
    assert np.isnan(contact_stiffness(contact, np.zeros_like(touching)))
    touching[:] = True
    touching[5] = False
    assert 1 < contact_stiffness(contact, touching) < np.inf
