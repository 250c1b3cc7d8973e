"""Pr(sigma) in the continuum and its power laws, against distributions that are known."""

import numpy as np
import pytest
from exact_solutions import hertz_force, hertz_profile
from specs import power_spec

from gfmd_cli.analysis.compare import Curve, compare
from gfmd_cli.analysis.distribution import (
    PATCH_SCATTER,
    StressDistribution,
    distributions,
    extrapolate,
)
from gfmd_cli.analysis.distribution_figure import continuum_figure, mean_density
from gfmd_cli.analysis.edge_law import edge_exponent, fit_power_law, straight_line
from gfmd_cli.analysis.tables import power_laws
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.indenters import Parabola
from gfmd_cli.physics.observables import LOGARITHMIC_EDGES, contact_points, observe
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import solve_contact
from gfmd_cli.spec.parse import read_spec
from gfmd_cli.status import Status
from gfmd_cli.study.reading import read_rows
from gfmd_cli.study.run import RunOptions, run_study

EDGES = LOGARITHMIC_EDGES
MIDDLE, WIDTH = np.sqrt(EDGES[1:] * EDGES[:-1]), np.diff(EDGES)
SPEC = power_spec(n=1, points=[64, 128, 256], p_star=0.1)


@pytest.fixture
def study(tmp_path):
    def study(*overrides):
        path = tmp_path / "spec.toml"
        path.write_text(SPEC)
        spec, _ = read_spec(path, overrides)
        run_study(spec, SPEC, tmp_path / "study.h5", lambda _: None, RunOptions(jobs=1))
        return tmp_path / "study.h5"

    return study


def hertz_density(n, sigma, peak, a_r):
    """Pr(sigma) of paraboloids with one peak stress: the edge law at all stresses of the contact.

    From sigma = peak (1 - r^2/a^2)^(1 - n/2), paper Eqs. (5) and (6), corrected.
    """
    reached = sigma < peak if n < 2 else sigma > peak
    density = 2 * a_r / (abs(2 - n) * peak) * (sigma / peak) ** edge_exponent(n)
    return np.where(reached, density, 0.0)


def hertz_row(n, points, radius, shift=(0.0, 0.0), contacts=1):
    """Exact stress of a Hertz contact, read on a grid; mean stress of the contact 1."""
    along = np.arange(points) / points - 0.5
    r = np.hypot(*np.meshgrid(along - shift[0], along - shift[1]))
    inside = r < radius
    peak = 2 - n / 2
    counts, _ = np.histogram(peak * hertz_profile(n, r, radius)[inside], EDGES)
    return row(
        n, points, contacts * counts, contacts * inside.mean(), 8 * radius * contacts, seed=-1
    )


def row(n, points, counts, a_r, perimeter, seed=0):
    return {
        "elastomer": f"power n={n:g}", "surface": "made", "n": n, "points": points, "seed": seed,
        "p_star": a_r, "delta_sigma": 1.0, "a_r": a_r, "perimeter": perimeter,
        "pr_sigma_log": counts / (WIDTH * points**2), "thickness": np.nan,
        "points_y": points, "dimension": 2, "length": 1.0, "length_y": 1.0,
    }  # fmt: skip


def distribution(*seeds):
    return StressDistribution(Curve(list(seeds[0]), None), [list(rows) for rows in seeds])


@pytest.mark.parametrize(("n", "exponent"), [(0, 0), (0.5, 1 / 3), (1, 1), (1.5, 3), (3, -3)])
def test_the_edge_has_the_law_of_hertz(n, exponent):
    assert edge_exponent(n) == pytest.approx(exponent)
    assert np.isnan(edge_exponent(2))
    s = np.array([1e-4, 1e-6])  # distance from the edge in radii
    sigma = (1 - (1 - s) ** 2) ** (1 - n / 2)
    if n:
        local = np.diff(np.log(hertz_density(n, sigma, 1.0, 0.1))) / np.diff(np.log(sigma))
        assert local == pytest.approx(exponent, abs=1e-9)


def test_the_prefactors_are_those_of_the_density_and_not_of_its_means_over_bins():
    n, power = 0.5, edge_exponent(0.5) + 1
    shares = np.where(MIDDLE < 3, 3.0 * np.diff(EDGES**power) / power, 0.0)
    rows = [row(n, points, shares * points**2, 0.3, 1e5) for points in (2**16, 2**17, 2**18)]
    fitted = fit_power_law(distribution(rows), "small")
    assert (fitted.prefactor, fitted.edge_prefactor) == pytest.approx((3.0, 3.0), rel=1e-6)


@pytest.mark.parametrize("n", [0.0, 0.5, 1.0, 1.5, 2.5, 3.0])
def test_the_density_of_hertz_is_that_of_the_points_of_its_profile(n):
    histogram = hertz_row(n, 2048, 0.3)["pr_sigma_log"]
    fine = np.geomspace(EDGES[:-1], EDGES[1:], 41)
    exact = hertz_density(n, fine, 2 - n / 2, np.pi * 0.09)
    mean = np.trapezoid(exact, fine, axis=0) / WIDTH
    whole = np.all(exact > 0, axis=0) & (mean * WIDTH * 2048**2 > 5000)
    assert whole.sum() > 4
    np.testing.assert_allclose(histogram[whole], mean[whole], rtol=0.04)


@pytest.mark.parametrize(
    ("n", "law"), [(0.5, "small"), (1.0, "small"), (2.5, "large"), (3.0, "large")]
)
def test_the_exponent_of_hertz_is_found_within_its_error(n, law):
    rows = [hertz_row(n, points, 0.3) for points in (512, 1024, 2048)]
    fitted = fit_power_law(distribution(rows), law)
    assert fitted.theory == edge_exponent(n)
    assert abs(fitted.exponent - fitted.theory) < 2 * fitted.error
    exact = hertz_density(n, 1.0, 2 - n / 2, np.pi * 0.09) if n < 2 else None
    if exact:
        assert fitted.edge_prefactor == pytest.approx(float(exact), rel=0.1)


def test_seeds_without_histogram_are_left_out(study):
    study("surface.seed=0")
    path = study("surface.seed=1", "output.histogram=false")
    (merged,) = distributions(compare(path))
    assert len(merged.seeds) == 1
    shares = (merged.grid_densities * WIDTH).sum(axis=1)
    np.testing.assert_allclose(shares, [row["a_r"] for row in merged.seeds[0]], rtol=1e-12)


def test_a_mean_density_holds_all_seeds_and_marks_one_that_has_not_converged():
    """A seed with few points in contact belongs to the mean, too."""
    rows = [
        row(1, 64, np.full(MIDDLE.size, count), 0.1, 1.0, seed) | {"status": status}
        for seed, (count, status) in enumerate(
            [(60.0, Status.CONVERGED), (0.0, Status.CONVERGED), (60.0, Status.MAX_STEPS)]
        )
    ]
    density = mean_density(None, rows[:2], "pr_sigma_log")
    assert (density.seeds, density.remark) == (2, "")
    np.testing.assert_allclose(density.density * WIDTH * 64**2, 30.0)
    assert mean_density(None, rows, "pr_sigma_log").remark == ", tolerance not reached"
    rows[2]["status"] = Status.ACCURACY_NOT_REACHED
    assert mean_density(None, rows, "pr_sigma_log").remark == ", accuracy not reached"


def test_first_order_errors_of_a_grid_are_taken_off():
    exact = 1e-3 * MIDDLE**0.5
    cells = [256**2, 512**2, 1024**2]
    factors = np.array([1.2, 1.1, 1.05])[:, None]
    counts = 1e6 * exact * WIDTH * np.array(cells)[:, None] * factors
    limit = extrapolate(counts, [1e6 * cell for cell in cells])
    inner = slice(5, 95)
    error = np.exp(limit.log_density - np.log(exact))[inner] - 1
    assert np.all(np.abs(error) < 0.003)
    assert np.all(np.abs(error) < np.abs(limit.discretisation[inner]))


def test_irregular_changes_are_not_extrapolated():
    cells = [64**2, 128**2, 256**2]
    counts = 1e9 * np.ones(100) * np.array([1.0, 0.9, 1.0])[:, None] * np.array(cells)[:, None]
    limit = extrapolate(counts, cells)
    np.testing.assert_allclose(limit.log_density, np.log(1e9 / WIDTH))
    assert np.all(np.abs(limit.discretisation) > 0.1)


def test_counting_errors_are_the_scatter_of_independent_counts():
    draw = np.random.default_rng(3)
    cells, counts = [64**2, 128**2], np.array([[1000.0], [4000.0]]) * np.ones(100)
    limits = [extrapolate(draw.poisson(counts).astype(float), cells) for _ in range(200)]
    scatter = np.std([limit.log_density[5:95] for limit in limits], axis=0)
    ratios = scatter**2 / np.mean([limit.counting[5:95] ** 2 for limit in limits], axis=0)
    assert ratios.mean() == pytest.approx(1.0, abs=0.08)  # 1.2 without the covariance


@pytest.mark.parametrize("slope", [0.0, -4.0])
def test_sampling_errors_are_the_scatter_of_patches_of_different_stress(slope):
    """The number of patches is that of a Poisson process; the logarithm of a stress is normal."""
    draw, mean = np.random.default_rng(6), 50
    numbers = draw.poisson(mean, 20_000)
    weights = np.exp(slope * PATCH_SCATTER * draw.standard_normal(numbers.sum()))
    sums = np.bincount(np.repeat(np.arange(numbers.size), numbers), weights)
    counts = 1e6 * (MIDDLE / MIDDLE[50]) ** slope
    contact = row(1, 64, counts, 0.1, np.sqrt(mean * 64 * 0.1 / np.pi))
    sampling = distribution([contact, contact]).sampling
    assert sampling[50] == pytest.approx(np.std(sums) / np.mean(sums), rel=0.05)


def test_a_bin_that_changes_too_much_is_not_resolved():
    limit = extrapolate(np.array([100 * np.ones(100), 200 * np.ones(100)]), [64**2, 128**2])
    assert np.all(np.isnan(limit.log_density))  # by ln 2


def test_errors_of_a_slope_hold_as_often_as_they_say():
    draw = np.random.default_rng(4)
    x, own, shared = np.log(MIDDLE[40:47]), np.linspace(0.2, 0.02, 7), np.linspace(0.1, 0, 7)
    hits = 0
    for _ in range(1000):
        y = 1.5 * x - 2 + own * draw.normal(size=7) + shared * draw.normal()
        line = straight_line(x, y, own, shared)
        hits += abs(line.slope - 1.5) < line.error
    assert 640 < hits < 840  # 683, and more where the misfit widens it


def test_errors_of_an_exponent_hold_over_noisy_samples():
    draw = np.random.default_rng(7)
    points, hits, tries = (256, 512, 1024), [], 150
    for _ in range(tries):
        seeds = []
        for seed in range(3):
            strength, tilt = np.exp(0.1 * draw.normal()), 0.15 * draw.normal()
            rows = []
            for size in points:
                density = np.where(MIDDLE < 1, 0.5 * strength * MIDDLE ** (1 + tilt), 0)
                counts = draw.poisson(density * WIDTH * size**2)
                rows.append(row(1.0, size, counts, 0.1, 12.0, seed))
            seeds.append(rows)
        fitted = fit_power_law(distribution(*seeds), "small")
        hits.append(
            (abs(fitted.exponent - 1) < fitted.error, abs(fitted.limit - 1) < fitted.limit_error)
        )
    narrow, limit = np.mean(hits, axis=0)
    assert 0.6 < narrow < 0.99
    assert 0.6 < limit < 0.99


def test_bins_next_to_the_edge_are_not_resolved():
    stresses = distribution([hertz_row(1.0, points, 0.3) for points in (128, 256)])
    lowest = MIDDLE[np.flatnonzero(np.isfinite(stresses.density))[0]]
    distance = 0.3 * (1 - np.sqrt(1 - (lowest / 1.5) ** 2))
    assert 0.7 < distance * 256 < 1.5


def test_a_study_of_two_grids_has_a_distribution_and_of_one_grid_none(study):
    stresses = distributions(compare(study()))
    assert [part.points for part in stresses] == [[64, 128, 256]]
    assert len(stresses[0].seeds) == 1
    assert stresses[0].counts[0, -1].sum() == pytest.approx(stresses[0].a_r * 256**2, abs=30)


def test_one_grid_has_no_distribution_table_nor_figure(study):
    path = study("grid.points=64")
    assert power_laws(compare(path)).as_text() == ""
    assert continuum_figure(compare(path)) is None


def test_grids_that_are_not_nested_are_not_compared(study):
    assert distributions(compare(study("grid.points=[64, 96]"))) == []


def test_a_grid_that_missed_its_accuracy_is_extrapolated_from_too(study):
    """Its stress is solved to the tolerance."""
    study("grid.points=64")
    path = study('grid.points="auto"', "accuracy={contact_area=1e-4, max_points=128}")
    assert {row["status"] for row in read_rows(path)} == {"converged", "accuracy_not_reached"}
    (stress,) = distributions(compare(path))
    assert stress.points == [64, 128]


def test_without_a_histogram_there_is_nothing_to_extrapolate(study):
    assert distributions(compare(study("output.histogram=false"))) == []


def test_elastomers_whose_unit_of_stress_depends_on_the_grid_are_not_compared(study):
    path = study('surface={kind="parabola"}', "load={p_star=1e-2}")
    assert distributions(compare(path)) == []


def test_seeds_are_averaged_with_their_spread(study):
    path = study("surface.seed=[0, 1, 2]")
    (stresses,) = distributions(compare(path))
    assert len(stresses.seeds) == 3
    assert "seed" not in stresses.title
    table = power_laws(compare(path)).as_text()
    assert "n / (2 - n)" in table
    assert "power n=1 on self-affine cutoff=0.1" in table
    assert stresses.points == [64, 128, 256]
    known = np.isfinite(stresses.density)
    assert known.sum() > 3
    assert np.isfinite(stresses.error[known]).all()
    plot = continuum_figure(compare(path))
    assert "Persson theory" in plot.legend
    plot.figure.draw_without_rendering()


def test_the_figure_in_the_continuum_shows_all_curves(study):
    exponents = [0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.2, 1.3]
    path = study(f"elastomer.n={exponents}")
    assert len(continuum_figure(compare(path)).curves) == 9


def test_line_scenes_and_slabs_are_taken(study):
    path = study('surface={kind="wave"}', "elastomer={kind='slab', thickness=0.1}")
    (stresses,) = distributions(compare(path))
    assert stresses.point_counts == [64, 128, 256]
    assert power_laws(compare(path)).records


def test_a_solved_paraboloid_has_the_exponent_and_the_amplitude_of_hertz():
    n, radius, rows = 1.0, 0.15, []
    force = float(hertz_force(n, 1.0, 1.0, radius))
    for points in (256, 512, 1024):
        scene = build_scene(Parabola(), Power(n=n), points)
        contact = scene.contact(force / scene.delta_sigma)
        solution = solve_contact(contact, Auto())
        sigma = contact.stress(solution.u, solution.sigma)
        observables = observe(contact, solution.u, sigma)
        loaded = sigma[contact_points(contact.height, solution.u, sigma)] * scene.delta_sigma
        counts, _ = np.histogram(loaded * np.pi * radius**2 / force, EDGES)  # mean stress 1
        rows.append(row(n, points, counts, observables.a_r, observables.perimeter, seed=-1))
    fitted = fit_power_law(distribution(rows), "small")
    assert fitted.error < 0.2
    assert abs(fitted.exponent - fitted.theory) < 2 * fitted.error
    exact = float(hertz_density(n, 1.0, 1.5, np.pi * radius**2))
    assert fitted.edge_prefactor == pytest.approx(exact, rel=0.1)


def test_grids_of_other_pixels_are_other_contacts(study):
    sweep = "grid={points=[32, 64], points_y=[32, 64]}", "surface.cutoff=0.1"
    merged = distributions(compare(study(*sweep, "surface.length_y=1.0")))
    sizes = [[(row["points"], row["points_y"]) for row in seeds] for [seeds] in
             (stress.seeds for stress in merged)]  # fmt: skip
    assert sizes == [[(32, 32), (64, 64)]]
