"""Errors of contacts with a free boundary: bounds on a grid, bars from two grids, auto grids."""

from functools import cache

import numpy as np
import pytest
from free_contacts import ELASTOMERS, compliance_matrix, oblong_contact
from scipy.special import beta

from gfmd_cli.errors import InputError
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.discretisation_error import estimate
from gfmd_cli.physics.elastomers import HalfSpace, Power
from gfmd_cli.physics.error_bounds import error_bounds
from gfmd_cli.physics.error_estimates import GridValues
from gfmd_cli.physics.free_contact import SCENES
from gfmd_cli.physics.observables import border_contact, observe
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import solve_contact

SPEC = """\
[surface]
kind = "parabola"
radius = 2.0
[elastomer]
kind = "half-space"
E_star = 3.0
[grid]
points = "auto"
boundary = "free"
[load]
pressure = 0.02
[accuracy]
contact_area = 0.1
"""
MAIN_OBSERVABLES = ("a_r", "sigma_p", "u_g")


def map_spec(tmp_path, heights, n, pressure):
    """A spec of a map that ends at its borders, on two grids."""
    np.save(tmp_path / "h.npy", heights)
    points = 2 * heights.shape[-1]
    return f"""\
[surface]
kind = "file"
path = "h.npy"
periodic = false
[elastomer]
kind = "power"
n = {n}
[grid]
points = {points}
[load]
pressure = {pressure}
[accuracy]
mean_gap = 0.1
"""


# --- bounds on a grid -----------------------------------------------------------------------------


@cache
def solved_to(tolerance, elastomer, pressure, void):
    """A contact, its solution and its observables."""
    contact = oblong_contact(elastomer, pressure, void=void)
    solution = solve_contact(contact, Auto(tolerance=tolerance, nested=False))
    return contact, solution, observe(contact, solution.u, solution.sigma)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-4])
@pytest.mark.parametrize("pressure", [0.01, 0.3])
@pytest.mark.parametrize("void", [False, True])
@pytest.mark.parametrize("elastomer", ELASTOMERS, ids=lambda elastomer: elastomer.label)
def test_the_bounds_hold_the_distance_to_the_solution(elastomer, void, pressure, tolerance):
    *_, exact = solved_to(1e-11, elastomer, pressure, void)
    contact, approximate, inexact = solved_to(tolerance, elastomer, pressure, void)
    bounds = error_bounds(contact, approximate.u, approximate.sigma)
    rounding = 1e-9
    assert abs(inexact.u_g - exact.u_g) <= bounds.u_g + rounding
    assert abs(inexact.sigma_p - exact.sigma_p) <= bounds.sigma_p + rounding

    def energy(observables):  # E(s) = <s C s>/2 - <s h>, with the work <s h> - <s C s>
        return -observables.energy - (observables.work - 2 * observables.energy)

    assert energy(inexact) - energy(exact) <= bounds.duality_gap + rounding
    assert bounds.sigma_p < {1e-2: 1.0, 1e-4: 0.1}[tolerance] * np.std(approximate.sigma)
    assert bounds.duality_gap < {1e-2: 2e-2, 1e-4: 2e-4}[tolerance]


@pytest.mark.parametrize("n", [0.5, 1, 1.5])
def test_the_uncertain_points_hold_the_error_of_the_area(n):
    """As for a periodic boundary, within three points."""
    contact = SCENES["free"](SelfAffine(cutoff=0.1), Power(n=n), 64).contact(1.0)
    exact, approximate = (
        solve_contact(contact, Auto(tolerance=tolerance, nested=False))
        for tolerance in (1e-10, 1e-2)
    )
    bounds = error_bounds(contact, approximate.u, approximate.sigma)
    areas = [observe(contact, each.u, each.sigma).a_r for each in (exact, approximate)]
    assert 0.3 < areas[0] < 0.9
    assert abs(areas[1] - areas[0]) <= bounds.a_r + 3 / contact.grid.size < 0.1


def test_a_bad_solution_gets_wide_bounds():
    contact = oblong_contact(HalfSpace(), 0.1)
    exact = solve_contact(contact, Auto(tolerance=1e-9))
    flat = np.full(contact.grid.shape, contact.pressure)
    u = contact.grid.empty()
    contact.recompute(u, flat)
    bounds = error_bounds(contact, u, flat)
    assert bounds.sigma_p >= float(np.std(exact.sigma)) > 0.1
    assert bounds.u_g >= abs(float(np.mean(u - exact.u)))


@pytest.mark.parametrize("elastomer", ELASTOMERS, ids=lambda elastomer: elastomer.label)
def test_the_lower_limit_of_the_compliance_is_below_all_its_eigenvalues(elastomer):
    compliance = oblong_contact(elastomer, 0.1).compliance
    eigenvalues = np.linalg.eigvalsh(compliance_matrix(elastomer, compliance.grid))
    assert 0 < compliance.smallest_compliance <= eigenvalues[0] * (1 + 1e-9)


# --- the continuum --------------------------------------------------------------------------------


def test_a_paraboloid_has_the_area_and_stress_of_hertz_within_the_bars(rows_of):
    """a^3 = 3 F R / 4 E*; the stress p_0 sqrt(1 - r^2/a^2) has <sigma^2> = pi a^2 p_0^2 / 2."""
    (row,) = rows_of()
    load, radius, modulus = 0.02, 2.0, 3.0
    a = (3 * load * radius / (4 * modulus)) ** (1 / 3)
    highest = 2 * modulus * a / (np.pi * radius)
    deviation = (np.pi * a**2 * highest**2 / 2 - load**2) ** 0.5 / row["delta_sigma"]
    assert (row["status"], row["boundary"]) == ("converged", "free")
    assert row["a_r_continuum_error"] <= 0.1 * row["a_r_continuum"]
    for suffix, error in (("", "_error"), ("_continuum", "_continuum_error")):
        assert abs(row[f"a_r{suffix}"] - np.pi * a**2) <= row[f"a_r{error}"]
        assert abs(row[f"sigma_p{suffix}"] - deviation) <= row[f"sigma_p{error}"]
    assert 0 < row["u_g_error"] < 0.1 * row["u_g"]
    assert row["u_g_algebraic"] <= row["u_g_bound"] < 0.01


@pytest.mark.parametrize("n", [0.25, 0.5, 0.75])
def test_the_stress_of_a_punch_is_within_the_bar(rows_of, tmp_path, n):
    """Under a high load a profile is a flat punch: sigma ~ (1 - x^2/a^2)^(-n/2)."""
    heights = np.random.default_rng(3).standard_normal(64)
    (row,) = rows_of(text=map_spec(tmp_path, heights, n, 1e6))
    mean = beta(0.5, 1 - n / 2) / 2
    deviation = (beta(0.5, 1 - n) / 2 / mean**2 - 1) ** 0.5 * row["p_star"]
    assert (row["a_r"], row["a_r_verdict"], row["u_g_verdict"]) == (1, "regular", "regular")
    assert abs(row["sigma_p"] - deviation) <= row["sigma_p_error"] < row["sigma_p"]
    assert abs(row["sigma_p"] - deviation) > 10 * row["sigma_p_algebraic"]


@pytest.mark.parametrize(("n", "verdict"), [(0.5, "regular"), (0.9, "slow"), (1, "diverges")])
def test_contact_at_the_border_has_a_singular_stress(n, verdict):
    fine, coarse = (
        GridValues(points, 0.3, 1.0 - 1 / points, 0.5 + 1 / points, 8.0, border=0.1)
        for points in (128, 64)
    )
    estimates = estimate([fine, coarse], n)
    assert estimates["sigma_p"].verdict == verdict
    assert {estimates[name].verdict for name in ("a_r", "u_g")} == {"regular"}


def test_contact_away_from_the_border_has_bars_from_two_grids_only():
    levels = [GridValues(points, 0.3, 1.0, 0.5, 8.0, border=0.0) for points in (64, 128)]
    for name, value in estimate(levels, 1.5).items():
        assert value.verdict == "regular", name
        assert 0 < value.error < 0.3
    assert {value.verdict for value in estimate(levels[:1], 1.5).values()} == {"unknown"}


def test_the_border_is_the_outermost_points():
    mask = np.zeros((4, 5), dtype=bool)
    mask[1:3, 1:4] = True
    grid = Grid(5, points_y=4)
    assert border_contact(grid, mask) == 0.0
    mask[0] = True
    assert border_contact(grid, mask) == 5 / 14
    assert border_contact(Grid(3, 1), np.array([False, True, True])) == 0.5


# --- runs -----------------------------------------------------------------------------------------


def test_an_interrupted_auto_grid_goes_on_bit_for_bit(goes_on_bit_for_bit):
    row, reports = goes_on_bit_for_bit("accuracy.contact_area=0.05")
    assert reports > 30
    assert row["points"] > 100


def test_a_map_gets_bars_on_its_second_grid(rows_of, tmp_path):
    heights = np.random.default_rng(1).standard_normal((64, 64))
    text = map_spec(tmp_path, heights, 0.5, 1.0)
    (row,) = rows_of(text=text)
    (one,) = rows_of("grid.points=64", text=text, name="one.h5")
    assert (row["boundary"], row["points"]) == ("free", 128)
    for name in MAIN_OBSERVABLES:
        assert (row[f"{name}_verdict"], one[f"{name}_verdict"]) == ("regular", "unknown")
        assert 0 < row[f"{name}_error"] < 1


def test_reduced_pressures_of_a_cell_that_is_no_map_are_refused(rows_of):
    text = SPEC.replace('kind = "parabola"\nradius = 2.0', 'kind = "self-affine"\ncutoff = 0.1')
    with pytest.raises(InputError, match=r"load\.p_star: 0\.1 given.*give load\.pressure"):
        rows_of(text=text.replace("pressure = 0.02", "p_star = 0.1"))
