"""Delta_sigma over the contact against derivatives, sorted heights and paraboloids."""

import json
from itertools import product

import numpy as np
import pytest
from exact_solutions import kappa
from specs import power_spec

from gfmd_cli.analysis.compare import einstein_prediction
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.elastomers import HalfSpace, Power
from gfmd_cli.physics.indenters import LineParabola, Parabola, Punch, Ridge
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.physics.true_contact import Bearing, bearing, contact_area, contact_stress

POINTS, R = 128, 1.0
KAPPA = np.sqrt(2 / np.pi)  # a_r Delta_sigma / p of Persson theory at small p


def rough(n, seed=0):
    return build_scene(SelfAffine(cutoff=0.05, seed=seed), Power(n=n), 64).contact(0.1)


def radius(points=POINTS):
    """Distance from the summit of a parabola."""
    x = (np.arange(points) - points // 2) / points
    return np.hypot(x[:, None], x)


@pytest.mark.parametrize("n", [0, 0.5, 1, 2.5, 4])
def test_over_the_whole_surface_both_measures_are_delta_sigma(n):
    contact = rough(n)
    stress = contact_stress(contact, np.full(contact.grid.shape, True))
    assert stress.deviation == pytest.approx(1, rel=1e-12)
    assert stress.quadrature == pytest.approx(1, rel=1e-12)


def test_on_a_line_they_are_delta_sigma_but_for_the_highest_wave():
    contact = build_scene(LineParabola(radius=R), Power(n=0.5), 256).contact(0.1)
    stress = contact_stress(contact, np.full(contact.grid.shape, True))
    assert stress.deviation == pytest.approx(1, rel=1e-12)
    assert stress.quadrature == pytest.approx(1, rel=1e-4)


def test_for_a_half_space_the_quadrature_is_the_slope():
    grid = Grid(32)
    x, y = (2 * np.pi * np.arange(32) / 32)[None, :], (2 * np.pi * np.arange(32) / 32)[:, None]
    height = np.cos(3 * x + 0.3) + 0.5 * np.sin(2 * y - x) + np.cos(5 * y) * np.ones_like(x)
    slope = (
        -3 * np.sin(3 * x + 0.3) - 0.5 * np.cos(2 * y - x),
        np.cos(2 * y - x) - 5 * np.sin(5 * y),
    )
    square = (2 * np.pi) ** 2 * (slope[0] ** 2 + slope[1] ** 2)
    touching = np.random.default_rng(0).random(grid.shape) < 0.1
    stress = contact_stress(Contact(grid, height, grid.wavenumber(), 1.0), touching)
    assert stress.quadrature == pytest.approx(np.sqrt(square[touching].mean()), rel=1e-12)


def test_for_springs_the_deviation_is_that_of_the_heights():
    contact = rough(0)
    touching = contact.height > 1.0
    stress = contact_stress(contact, touching)
    assert stress.deviation == pytest.approx(contact.height[touching].std(), rel=1e-12)


def test_without_contact_there_is_none():
    contact = rough(1)
    stress = contact_stress(contact, np.full(contact.grid.shape, False))
    assert np.isnan(stress.deviation)
    assert np.isnan(stress.quadrature)


@pytest.mark.parametrize("count", [1, 9, 10])
def test_few_points_have_no_deviation(count):
    """Over one point it is zero, for which the theory gives full contact at any load."""
    contact = rough(1)
    touching = np.full(contact.grid.shape, False)
    touching.flat[:count] = True
    stress = contact_stress(contact, touching)
    assert np.isnan(stress.deviation) == (count < 10)
    assert stress.quadrature > 0


def test_a_paraboloid_on_a_half_space_has_the_quadrature_of_the_paper():
    """Eq. (21) at n = 1: k a / (sqrt(2) R); 0.833 against Persson's 0.798 by Eq. (19)."""
    scene = build_scene(Parabola(radius=R), Power(n=1), POINTS)
    a, r = 0.2, radius()
    stress = contact_stress(scene.contact(0.1), r < a)
    disc = np.sqrt(np.mean(r[r < a] ** 2)) / R
    assert disc == pytest.approx(a / np.sqrt(2) / R, rel=0.01)
    assert stress.quadrature * scene.delta_sigma == pytest.approx(disc, rel=0.02)
    assert kappa(1) / KAPPA == pytest.approx(1.044, abs=1e-3)


def test_a_paraboloid_on_a_membrane_has_no_deviation_at_all():
    """K h = 2 tension / R everywhere on it: no theory of a variance can work there."""
    scene = build_scene(Parabola(radius=R), Power(n=2), POINTS)
    stress = contact_stress(scene.contact(0.1), radius() < 0.2)
    assert stress.deviation * scene.delta_sigma < 0.05 * 2 / R


def test_the_deviation_over_the_highest_points_is_that_of_a_sort():
    contact = rough(1)
    order = np.argsort(-contact.height.ravel())
    stress = contact.apply_stiffness(contact.height, contact.grid.empty()).ravel()[order]
    curve = bearing(contact)
    assert np.all(np.diff(curve.area) > 0)
    for share, deviation in list(zip(curve.area, curve.deviation, strict=True))[::100]:
        count = round(share * stress.size)
        assert share == pytest.approx(count / stress.size, rel=1e-12)
        assert deviation == pytest.approx(stress[:count].std(), rel=1e-9)


def test_rounding_does_not_part_equal_heights():
    grid = Grid(32)
    levels = np.random.default_rng(0).integers(4, size=grid.shape) / 3  # on the edges of bins
    noise = 1e-15 * np.random.default_rng(1).standard_normal(grid.shape)
    exact, rounded = (
        bearing(Contact(grid, height, grid.wavenumber(), 1.0))
        for height in (levels, levels + noise)
    )
    assert exact.area.tolist() == [np.mean(levels > level) for level in (0.9, 0.5, 0.2)]
    assert rounded.area.tolist() == exact.area.tolist()


def test_springs_on_a_paraboloid_carry_what_the_closed_form_says():
    """Exactly p = k a_r^2 / (4 pi R); over the disc s has k a^2 / (2 R sqrt(12)).

    With a_r = sqrt(2/pi) p / Delta_sigma_c the area is (sqrt(2/pi) sqrt(12) / 2)^(1/2) too large.
    """
    scene = build_scene(Parabola(radius=R), Power(n=0), 256)
    exact = 0.02
    p_star = exact**2 / (4 * np.pi * R) / scene.delta_sigma
    delta_sigma_c = bearing(scene.contact(p_star)).delta_sigma_c(p_star)
    predicted = float(contact_area(delta_sigma_c, p_star))
    assert predicted / exact == pytest.approx(np.sqrt(np.sqrt(2 / np.pi) * np.sqrt(3)), rel=0.01)


def test_a_deviation_that_is_delta_sigma_gives_back_persson_theory():
    whole = Bearing(np.linspace(0.01, 0.99, 50), np.ones(50))
    p_star = np.geomspace(1e-4, 4.0, 20)
    areas = contact_area(whole.delta_sigma_c(p_star), p_star)
    assert areas == pytest.approx(contact_area(1.0, p_star), rel=1e-14)


def test_a_bearing_without_a_known_share_has_no_deviation():
    scene = build_scene(Ridge(width=0.05), HalfSpace(), 64)
    assert np.isnan(bearing(scene.contact(0.01)).delta_sigma_c(0.01))


@pytest.mark.parametrize("points", [32, 64, 250, 512])
def test_the_face_of_a_punch_on_springs_has_no_deviation(points):
    """sigma_h = k_0 (h - <h>) is the same at all its points, up to rounding."""
    scene = build_scene(Punch(radius=0.2), Power(n=0), points)
    assert np.isnan(bearing(scene.contact(0.1)).delta_sigma_c(0.1))


def test_the_area_obeys_its_own_equation():
    contact = rough(0.5)
    curve = bearing(contact)
    for p_star in (0.03, 0.1, 0.5, 1.0):
        a_r = float(contact_area(curve.delta_sigma_c(p_star), p_star))
        assert a_r == pytest.approx(
            float(contact_area(np.interp(a_r, curve.area, curve.deviation), p_star)), rel=1e-3
        )


def test_where_the_load_falls_with_the_area_the_least_area_counts():
    falls = Bearing(np.array([0.1, 0.2, 0.3, 0.4]), np.array([1.0, 0.1, 0.1, 1.0]))
    p = np.sqrt(2) * 0.12566134685507402  # erfinv(0.1)
    assert float(falls.delta_sigma_c(p)) == pytest.approx(1.0)


SPEC = power_spec(
    n=[0, 1],
    points=32,
    p_star=[0.1, 1.0],
    more="""\
[output]
histogram = false
""",
)


@pytest.fixture
def records(output_of, tmp_path):
    """Records and text that `analyze` prints of SPEC with overrides."""

    def records(*overrides):
        spec, study = tmp_path / "spec.toml", tmp_path / "s.h5"
        spec.write_text(SPEC)
        options = [word for override in overrides for word in ("--set", override)]
        output_of("run", spec, "-o", study, "-q", "-j", "1", *options)
        return json.loads(output_of("analyze", study, "--json")), output_of("analyze", study)

    return records


def test_analyze_tells_of_it_where_it_was_asked_for(records):
    rows, text = records("output.true_contact=true")
    assert "Delta_sigma over the contact" in text
    assert text.count("deviation_bearing") == 2
    for n, p_star in product((0, 1), (0.1, 1.0)):
        (record,) = [r for r in rows if r["n"] == n and r["p_star"] == p_star]
        for name in ("deviation_c", "quadrature_c", "deviation_bearing"):
            predicted = record[f"a_r_persson_{name}"]
            assert predicted == pytest.approx(float(contact_area(record[name], p_star)), rel=1e-12)
            assert f" {predicted:#.4g} " in text
        if n == 0 and p_star == 1.0:  # springs touch the highest points
            assert record["deviation_bearing"] == pytest.approx(record["deviation_c"], rel=0.1)


def test_single_indenters_have_it_without_a_theory(records):
    rows, text = records("output.true_contact=true", "surface={kind='parabola'}")
    assert "Persson" not in text
    assert f" {rows[0]['deviation_c']:#.4g} " in text
    assert not any("a_r_persson_deviation_c" in record for record in rows)


def test_analyze_says_nothing_of_it_where_it_was_not(records):
    rows, text = records()
    assert "over the contact" not in text
    assert not any("a_r_persson_deviation_c" in record for record in rows)


def test_analyze_takes_another_theory_for_the_mean_gap_alone(records, output_of, tmp_path):
    paper, _ = records()
    output = output_of("analyze", tmp_path / "s.h5", "--json", "--theory", "coarse-grained")
    for before, after in zip(paper, json.loads(output), strict=True):
        assert after["a_r_persson"] == before["a_r_persson"]
        if before["n"] == 0 and before["p_star"] <= 1:
            exact = float(einstein_prediction(before["p_star"]).u_g)
            assert after["u_g_persson"] == pytest.approx(exact, rel=1e-3)
    output = output_of("analyze", tmp_path / "s.h5", "--json", "--theory", "fitted")
    for before, after in zip(paper, json.loads(output), strict=True):
        assert after["a_r_persson"] == before["a_r_persson"]
        assert after["u_g_persson"] == pytest.approx(before["u_g_persson"], rel=0.2)
        assert after["u_g_persson"] != before["u_g_persson"]
    assert ", mean gap by a fitted weight." in output_of(
        "analyze", tmp_path / "s.h5", "--theory", "fitted"
    )
