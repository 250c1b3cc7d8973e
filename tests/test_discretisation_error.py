"""Error bars and continuum values: sequences of known limit, exact contacts, verdicts."""

from dataclasses import replace
from math import isnan

import exact_solutions as reference
import numpy as np
import pytest

from gfmd_cli.physics.contact import build_scene
from gfmd_cli.physics.discretisation_error import (
    AREA_EXCESS,
    MAX_AREA_EXPONENT,
    RoughnessScales,
    estimate,
    exponent_spread,
    local_exponent,
    roughness_scales,
)
from gfmd_cli.physics.elastomers import HalfSpace, Membrane, Power, Slab
from gfmd_cli.physics.error_estimates import Level
from gfmd_cli.physics.indenters import Parabola, Wave
from gfmd_cli.physics.observables import QUANTITIES, observe
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import solve_contact

ROUGH = RoughnessScales(waves=20.0, curvature=2e3)
GRIDS = (64, 128, 256)


def sequence(n, grids=GRIDS, area=0.2, stress=0.5, gap=0.3, line=10.0):
    """Levels that converge to the given values with the orders that are assumed."""
    return [
        Level(
            points=points,
            a_r=area + AREA_EXCESS * n * line / points,
            sigma_p=stress - 0.4 * points ** -min(2.0, 3 - n),
            u_g=gap + 50 * points**-3.5,
            perimeter=line,
        )
        for points in grids
    ]


@pytest.mark.parametrize("n", [0.0, 0.5, 1.0, 2.0, 2.5, 3.5])
@pytest.mark.parametrize("grids", [GRIDS[-1:], GRIDS[-2:], GRIDS])
def test_the_area_of_a_regular_sequence_is_recovered(n, grids):
    made = estimate(sequence(n, grids), n, ROUGH)["a_r"]
    assert made.continuum == pytest.approx(0.2, rel=1e-12)
    assert made.error >= AREA_EXCESS * n * 10 / 256
    assert made.verdict == "regular"


@pytest.mark.parametrize("n", [1.0, 1.5, 2.0, 2.5])
def test_the_stress_of_a_regular_sequence_is_recovered(n):
    levels = sequence(n)
    made = estimate(levels, n, ROUGH)["sigma_p"]
    assert made.continuum == pytest.approx(0.5, rel=1e-12)
    assert made.error >= 0.5 - levels[-1].sigma_p
    assert made.continuum_error < made.error


def test_the_gap_is_its_own_best_guess():
    levels = sequence(1.0)
    made = estimate(levels, 1.0, ROUGH)["u_g"]
    assert made.continuum == levels[-1].u_g
    assert made.error == made.continuum_error >= levels[-1].u_g - 0.3


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("sign", [-1, 1])
def test_a_jump_that_no_order_explains_widens_the_bar(quantity, sign):
    levels = sequence(1.0)
    jump = sign * 0.1
    moved = replace(levels[1], **{quantity: getattr(levels[1], quantity) + jump})
    calm = estimate(levels, 1.0, ROUGH)[quantity]
    made = estimate([levels[0], moved, levels[2]], 1.0, ROUGH)[quantity]
    assert made.continuum_error > calm.continuum_error
    assert made.error >= abs(jump) / 10


@pytest.mark.parametrize("rough", [ROUGH, None])
def test_the_order_of_the_levels_does_not_matter(rough):
    levels = sequence(1.5)
    assert estimate(levels[::-1], 1.5, rough) == estimate(levels, 1.5, rough)


@pytest.mark.parametrize("n", [0.0, 1.0, 2.0])
def test_a_finer_grid_has_smaller_bars(n):
    coarse, fine = (estimate(sequence(n, (points,)), n, ROUGH) for points in (64, 256))
    for quantity in QUANTITIES:
        assert 0 < fine[quantity].error < coarse[quantity].error


@pytest.mark.parametrize(("n", "verdict"), [(2.5, "regular"), (2.75, "slow"), (3, "diverges")])
def test_the_stress_says_where_it_has_no_limit(n, verdict):
    made = estimate(sequence(min(n, 2.9)), n, ROUGH)["sigma_p"]
    assert made.verdict == verdict
    assert isnan(made.error) == isnan(made.continuum) == (verdict != "regular")


def test_the_area_of_a_plate_on_a_single_indenter_is_a_bound():
    for level in sequence(0.0), [Level(64, 0.01, 2.0, 0.1, 2.5)]:
        made = estimate(level, 4.0)["a_r"]
        assert made.verdict == "bound"
        assert made.error == min(level[-1].a_r, level[-1].line)
        assert isnan(made.continuum)
        assert isnan(made.continuum_error)


def test_the_area_of_a_plate_is_unknown_from_one_grid():
    made = estimate([Level(64, 0.01, 2.0, 0.1, 2.5)], 4.0, ROUGH)["a_r"]
    assert made.verdict == "unknown"
    assert isnan(made.error)
    assert estimate(sequence(3.5), MAX_AREA_EXPONENT, ROUGH)["a_r"].verdict == "regular"


@pytest.mark.parametrize("count", [17, 400])
def test_lone_points_of_a_plate_have_no_area(count):
    """A fixed number of loaded points, each with four neighbours without load."""
    levels = [Level(N, count / N**2, 2.0, 0.1, 4 * count / N) for N in (128, 256)]
    made = estimate(levels, 4.0, ROUGH)["a_r"]
    assert made.continuum <= made.continuum_error
    assert made.continuum_error < 2 * levels[-1].a_r


@pytest.mark.parametrize("excess", [0.33, 0.4, 0.6])
def test_the_area_inside_of_a_ragged_line_is_within_the_bar(excess):
    """An excess of first order: a share of the points on a line of fixed length, as measured in
    broad contacts (least, median, largest)."""
    levels = [Level(N, 0.2 + excess * 10 / N, 2.0, 0.1, 10.0) for N in (128, 256)]
    made = estimate(levels, 4.0, ROUGH)["a_r"]
    assert abs(made.continuum - 0.2) <= made.continuum_error
    assert abs(levels[-1].a_r - 0.2) <= made.error


def test_full_contact_is_exact():
    for n in (0.0, 1.0, 4.0):
        for made in estimate([Level(64, 1.0, 1.0, 0.0, 0.0)], n, ROUGH).values():
            assert (made.error, made.continuum_error, made.verdict) == (0.0, 0.0, "exact")


def test_no_contact_is_unknown():
    for made in estimate([Level(64, 0.0, 0.0, 1.0, 0.0)], 1.0, ROUGH).values():
        assert isnan(made.error)
        assert made.verdict == "unknown"


def test_a_single_body_on_one_grid_is_unknown():
    made = estimate(sequence(1.0, (64,)), 1.0)
    assert made["a_r"].verdict == "regular"
    for quantity in ("sigma_p", "u_g"):
        assert made[quantity].verdict == "unknown"
        assert isnan(made[quantity].error)


@pytest.mark.parametrize("n", [0.5, 1.0, 2.0, 3.0])
def test_estimates_stay_in_range(n):
    """Single points in contact, and a single gap."""
    coarse = Level(32, 0.5, 0.1, 1e-3, 4.0)
    for a_r, perimeter in ((1 / 64**2, 4 / 64), (1 - 1 / 64**2, 4 / 64)):
        fine = Level(64, a_r, 0.1, 1e-3, perimeter)
        for levels, rough in (([fine], None), ([coarse, fine], None), ([coarse, fine], ROUGH)):
            if rough is not None and n > 2.5:
                continue
            made = estimate(levels, n, rough)["a_r"]
            assert 0 <= made.continuum <= 1
            assert 0 < made.continuum_error <= 1


IRREGULAR = (
    replace(ROUGH, anisotropy=3.0),
    replace(ROUGH, band_limited=False),
)


@pytest.mark.parametrize("n", [0.0, 1.0, 2.0, 3.0])
@pytest.mark.parametrize("rough", IRREGULAR)
def test_an_irregular_surface_on_one_grid_is_unknown(rough, n):
    for name, made in estimate(sequence(min(n, 2.9), (64,)), n, rough).items():
        assert isnan(made.error)
        assert isnan(made.continuum)
        assert made.verdict == ("diverges" if (name, n) == ("sigma_p", 3.0) else "unknown")


@pytest.mark.parametrize("rough", IRREGULAR)
def test_an_irregular_surface_on_two_grids_has_bars_of_its_own(rough):
    """Wider than those of isotropic roughness, and at least as wide as the change."""
    levels = sequence(1.0)
    made, calm = (estimate(levels, 1.0, surface) for surface in (rough, ROUGH))
    for name in QUANTITIES:
        change = getattr(levels[-1], name) - getattr(levels[-2], name)
        assert made[name].verdict == "regular"
        assert made[name].error > 0.8 * abs(change)
        assert made[name].continuum_error > calm[name].continuum_error
    assert made["a_r"].continuum == pytest.approx(2 * levels[-1].a_r - levels[-2].a_r)


@pytest.mark.parametrize(("n", "known"), [(1.0, 3), (1.5, 2), (2.5, 2), (2.75, 1), (3.25, 0)])
def test_an_irregular_surface_is_unknown_where_no_bars_were_calibrated(n, known):
    made = estimate(sequence(min(n, 2.9)), n, IRREGULAR[0])
    assert sum(each.verdict == "regular" for each in made.values()) == known


def test_the_area_on_oblong_pixels_has_the_bars_of_an_irregular_surface():
    """Its excess is that of square pixels only where they are nearly square."""
    for aspect, verdict in ((1.05, "regular"), (2.0, "unknown")):
        rough = replace(ROUGH, aspect=aspect)
        made = estimate(sequence(1.0, (64,)), 1.0, rough)
        assert made["a_r"].verdict == verdict
        assert made["u_g"] == estimate(sequence(1.0, (64,)), 1.0, ROUGH)["u_g"]
    made = estimate(sequence(1.0), 1.0, rough)["a_r"]
    assert made == estimate(sequence(1.0), 1.0, IRREGULAR[0])["a_r"]


def test_few_contact_spots_on_one_grid_are_unknown():
    """Nine circles of the same size against eleven: area pi r^2, perimeter 8 r each."""
    for spots, verdict in ((9, "unknown"), (11, "regular")):
        r = 0.05
        level = Level(256, spots * np.pi * r**2, 0.5, 0.3, spots * 8 * r)
        assert level.spots == pytest.approx(spots)
        for made in estimate([level], 1.0, ROUGH).values():
            assert made.verdict == verdict


def test_an_exponent_that_changes_widens_the_area():
    """By the excess of that change of exponent."""
    level = sequence(2.0, (128,))
    calm, made = (estimate(level, 2.0, ROUGH, spread)["a_r"] for spread in (0.0, 0.5))
    extra = AREA_EXCESS * 0.5 * level[0].line
    assert made.continuum_error == pytest.approx(np.hypot(calm.continuum_error, extra))
    slab = Slab(thickness=0.05)
    assert exponent_spread(slab, 32, 1.0) > 0.1
    assert exponent_spread(Power(n=2), 32, 1.0) < 1e-9


def measured(surface, elastomer, pressure, points):
    """Level of a contact at a pressure in Pa, in the units Pa and m."""
    scene = build_scene(surface, elastomer, points)
    contact = scene.contact(pressure / scene.delta_sigma)
    solution = solve_contact(contact, Auto(tolerance=1e-8))
    seen = observe(contact, solution.u, solution.sigma)
    stress, gap = seen.sigma_p * scene.delta_sigma, seen.u_g * scene.h_std
    return Level(points, seen.a_r, stress, gap, seen.perimeter)


@pytest.mark.parametrize("pressure", [0.05, 0.3, 1.0, 4.0])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_the_area_of_a_membrane_on_a_paraboloid(pressure, count):
    levels = [measured(Parabola(), Membrane(), pressure, points) for points in (32, 64, 128)]
    exact = float(reference.membrane_area(pressure, 1.0, 1.0))
    made = estimate(levels[-count:], 2.0)["a_r"]
    assert abs(made.continuum - exact) <= made.continuum_error
    assert abs(levels[-1].a_r - exact) <= made.error
    assert abs(made.continuum - exact) < 0.5 * abs(levels[-1].a_r - exact)


@pytest.mark.parametrize("p_bar", [0.05, 0.2, 0.5, 0.9])
def test_westergaards_wave(p_bar):
    levels = [measured(Wave(), Power(n=1), p_bar * 2 * np.pi, points) for points in (64, 128, 256)]
    made = estimate(levels, 1.0)
    for quantity, exact in (
        ("a_r", reference.westergaard_area(p_bar)),
        ("u_g", reference.westergaard_gap(p_bar)),
    ):
        assert abs(getattr(levels[-1], quantity) - exact) <= made[quantity].error
        assert abs(made[quantity].continuum - exact) <= made[quantity].continuum_error


@pytest.mark.parametrize("points", [64, 100, 256, 2048])
def test_the_local_exponent_of_a_half_space_is_exactly_1(points):
    """Below 1 the stress deviation is not extrapolated; a rounding error must not decide that."""
    assert local_exponent(HalfSpace(E_star=2e9), points, 1e-5) == 1.0
    assert local_exponent(Power(n=1), points, 1.0) == 1.0


@pytest.mark.parametrize("n", [0.0, 0.7, 1.0, 4.0])
def test_the_exponent_of_a_power_is_its_own(n):
    assert local_exponent(Power(n=n), 128, 2.0) == pytest.approx(n, abs=1e-12)


def test_a_slab_is_a_plate_on_coarse_grids_and_a_half_space_on_fine_ones():
    slab = Slab(thickness=1e-3)
    exponents = [local_exponent(slab, points, 3.0) for points in (16, 512, 16384)]
    assert exponents[0] == pytest.approx(4.0, abs=0.05)
    assert exponents == sorted(exponents, reverse=True)
    assert exponents[-1] == pytest.approx(1.0, abs=1e-6)


def test_the_scales_of_waves_of_one_length():
    """All waves between L/10 and L/9.9: ten to a side, q h_std everywhere; no unit matters."""
    for length, h_std in ((1.0, 1.0), (1e-5, 1e-9)):
        surface = SelfAffine(
            spectrum="cutoff", rolloff=1 / 9.9, cutoff=0.1, length=length, h_std=h_std
        )
        found = roughness_scales(build_scene(surface, Power(n=1), 64).shells, length)
        assert found.waves == pytest.approx(10, rel=0.01)
        assert found.curvature == pytest.approx((2 * np.pi * found.waves) ** 2, rel=1e-3)
    found = roughness_scales(build_scene(Wave(), Power(n=1), 64).shells, 1.0)
    assert found.waves == pytest.approx(1, rel=1e-12)
    assert found.curvature == pytest.approx(4 * np.pi**2, rel=1e-12)


def test_a_rough_surface_on_nested_grids():
    """Bars of the coarse grids hold the values of a grid eight times finer."""
    surface = SelfAffine(cutoff=1 / 16, seed=5)
    scene = build_scene(surface, Power(n=1), 64)
    levels = [measured(surface, Power(n=1), 10.0, points) for points in (32, 64, 512)]
    levels = [replace(level, u_g=level.u_g / scene.h_std) for level in levels]
    made = estimate(levels[:2], 1.0, roughness_scales(scene.shells, 1.0))
    for quantity in QUANTITIES:
        value, exact = getattr(levels[1], quantity), getattr(levels[2], quantity)
        assert abs(value - exact) <= made[quantity].error
