"""Error bars and continuum values: sequences of known limit, exact contacts, verdicts."""

from dataclasses import replace
from math import inf, isnan, pi
from types import SimpleNamespace

import exact_solutions as reference
import numpy as np
import pytest
from scipy.integrate import quad

from gfmd_cli import rows, run, solve
from gfmd_cli.physics.discretisation_error import (
    AREA_EXCESS,
    LINE_EXCESS,
    LINE_GAP,
    MAX_AREA_EXPONENT,
    ExcessExponent,
    IndenterTip,
    RoughnessScales,
    estimate,
    excess_exponent,
    has_step,
    local_exponent,
    roughness_scales,
)
from gfmd_cli.physics.elastomers import HalfSpace, Layer, Membrane, Power, Slab, Tabulated
from gfmd_cli.physics.error_estimates import CONTINUUM_FACTOR, FLOOR, GridValues
from gfmd_cli.physics.indenters import LineParabola, Parabola, Ridge, Wave
from gfmd_cli.physics.observables import MAIN_OBSERVABLES, observe
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import solve_contact
from gfmd_cli.study.refinement import has_coarser_grid, scales_of

pytestmark = pytest.mark.usefixtures("estimated_plans")
ROUGH = RoughnessScales(waves=20.0, curvature=2e3)
GRIDS = (64, 128, 256)


def sequence(n, grids=GRIDS, area=0.2, stress=0.5, gap=0.3, line=10.0):
    """Levels that converge to the given values with the orders that are assumed."""
    return [
        GridValues(
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
    area = estimate(sequence(n, grids), n, ROUGH)["a_r"]
    assert area.continuum == pytest.approx(0.2, rel=1e-12)
    assert area.error >= AREA_EXCESS * n * 10 / 256
    assert area.verdict == "regular"


@pytest.mark.parametrize("n", [1.0, 1.5, 2.0, 2.5])
def test_the_stress_of_a_regular_sequence_is_recovered(n):
    levels = sequence(n)
    stress = estimate(levels, n, ROUGH)["sigma_p"]
    assert stress.continuum == pytest.approx(0.5, rel=1e-12)
    assert stress.error >= 0.5 - levels[-1].sigma_p
    assert stress.continuum_error < stress.error


def test_the_gap_is_its_own_best_guess():
    levels = sequence(1.0)
    gap = estimate(levels, 1.0, ROUGH)["u_g"]
    assert gap.continuum == levels[-1].u_g
    assert gap.error == gap.continuum_error >= levels[-1].u_g - 0.3


@pytest.mark.parametrize("quantity", MAIN_OBSERVABLES)
@pytest.mark.parametrize("sign", [-1, 1])
def test_a_jump_that_no_order_explains_widens_the_bar(quantity, sign):
    levels = sequence(1.0)
    jump = sign * 0.1
    moved = replace(levels[1], **{quantity: getattr(levels[1], quantity) + jump})
    calm = estimate(levels, 1.0, ROUGH)[quantity]
    value = estimate([levels[0], moved, levels[2]], 1.0, ROUGH)[quantity]
    assert value.continuum_error > calm.continuum_error
    assert value.error >= abs(jump) / 10


@pytest.mark.parametrize("rough", [ROUGH, None])
def test_the_order_of_the_levels_does_not_matter(rough):
    levels = sequence(1.5)
    assert estimate(levels[::-1], 1.5, rough) == estimate(levels, 1.5, rough)


@pytest.mark.parametrize("n", [0.0, 1.0, 2.0])
def test_a_finer_grid_has_smaller_bars(n):
    coarse, fine, finest = (estimate(sequence(n, (m,)), n, ROUGH) for m in (64, 1024, 2048))
    for quantity in MAIN_OBSERVABLES:
        assert 0 < finest[quantity].error < fine[quantity].error < coarse[quantity].error
    ratio = fine["sigma_p"].error / finest["sigma_p"].error
    assert ratio == pytest.approx(2 ** min(2.0, 3 - n), rel=0.03)


@pytest.mark.parametrize(("n", "verdict"), [(2.5, "regular"), (2.75, "slow"), (3, "diverges")])
def test_the_stress_says_where_it_has_no_limit(n, verdict):
    stress = estimate(sequence(min(n, 2.9)), n, ROUGH)["sigma_p"]
    assert stress.verdict == verdict
    assert isnan(stress.error) == isnan(stress.continuum) == (verdict != "regular")


def test_the_area_of_a_plate_on_a_single_indenter_is_a_bound():
    for level in sequence(0.0), [GridValues(64, 0.01, 2.0, 0.1, 2.5)]:
        area = estimate(level, 4.0)["a_r"]
        assert area.verdict == "bound"
        assert area.error == min(level[-1].a_r, level[-1].switches_per_point)
        assert isnan(area.continuum)
        assert isnan(area.continuum_error)


def test_the_area_of_a_plate_is_unknown_from_one_grid():
    area = estimate([GridValues(64, 0.01, 2.0, 0.1, 2.5)], 4.0, ROUGH)["a_r"]
    assert area.verdict == "unknown"
    assert isnan(area.error)
    assert estimate(sequence(3.5), MAX_AREA_EXPONENT, ROUGH)["a_r"].verdict == "regular"


@pytest.mark.parametrize("count", [17, 400])
def test_lone_points_of_a_plate_have_no_area(count):
    """A fixed number of loaded points, each with four neighbours without load."""
    levels = [GridValues(N, count / N**2, 2.0, 0.1, 4 * count / N) for N in (128, 256)]
    area = estimate(levels, 4.0, ROUGH)["a_r"]
    assert area.continuum <= area.continuum_error
    assert area.continuum_error < 2 * levels[-1].a_r


@pytest.mark.parametrize("excess", [0.33, 0.4, 0.6])
def test_the_area_inside_of_a_ragged_line_is_within_the_bar(excess):
    """An excess of first order: a share of the points on a line of fixed length, as measured in
    broad contacts (least, median, largest)."""
    levels = [GridValues(N, 0.2 + excess * 10 / N, 2.0, 0.1, 10.0) for N in (128, 256)]
    area = estimate(levels, 4.0, ROUGH)["a_r"]
    assert abs(area.continuum - 0.2) <= area.continuum_error
    assert abs(levels[-1].a_r - 0.2) <= area.error


def test_full_contact_is_exact():
    for n in (0.0, 1.0, 4.0):
        for value in estimate([GridValues(64, 1.0, 1.0, 0.0, 0.0)], n, ROUGH).values():
            assert (value.error, value.continuum_error, value.verdict) == (0.0, 0.0, "exact")


def test_full_contact_is_not_exact_where_finer_grids_contain_shorter_waves():
    """Two grids give the change of the stress; a single indenter has kinks, and gaps at them."""
    coarse, fine = (GridValues(points, 1.0, 1 - 1 / points, 0.0, 0.0) for points in (64, 128))
    map_scales = replace(ROUGH, band_limited=False)
    for levels, verdict in (([fine], "unknown"), ([coarse, fine], "regular")):
        for value in estimate(levels, 1.0, map_scales, same_waves=False).values():
            assert value.verdict == verdict
    stress = estimate([coarse, fine], 1.0, map_scales, same_waves=False)["sigma_p"]
    assert stress.error >= fine.sigma_p - coarse.sigma_p
    for value in estimate([coarse, fine], 1.0, same_waves=False).values():
        assert value.verdict == "unknown"
    fine, coarse = replace(fine, border=0.0), replace(coarse, border=0.0)
    assert estimate([fine], 1.0, same_waves=False)["a_r"].verdict == "unknown"
    assert estimate([fine], 1.0, same_waves=True)["a_r"].verdict == "exact"


@pytest.mark.parametrize(("n", "verdict"), [(0.5, "regular"), (0.9, "slow"), (1.0, "diverges")])
def test_the_stress_at_a_step_is_that_of_a_punch(n, verdict):
    levels = sequence(n)
    assert estimate(levels, n, stepped=True)["sigma_p"].verdict == verdict
    assert estimate(levels, n, stepped=True)["a_r"] == estimate(levels, n)["a_r"]


@pytest.mark.parametrize("border", [None, 0.0])
def test_without_contact_nothing_is_known_at_steps_either(border):
    levels = [GridValues(points, 0.0, 0.0, 1.0, 0.0, border=border) for points in (64, 128)]
    for value in estimate(levels, 0.5, stepped=True).values():
        assert value.verdict == "unknown"


def test_full_contact_on_a_coarse_grid_leaves_a_bar_where_finer_grids_have_gaps(tmp_path):
    """Between the points of 24^2 the stress is tensile; far above that pressure it is not."""
    spec = {
        "surface": {"kind": "self-affine", "cutoff": 0.1},
        "elastomer": {"kind": "half-space"},
        "grid": {"points": [24, 256]},
        "load": {"p_star": [2.9, 6.0]},
        "accuracy": {"mean_gap": 0.5},
    }
    coarse, above, fine, _ = rows(run(spec, tmp_path / "full.h5"))
    assert coarse["a_r"] == 1
    assert coarse["a_r_verdict"] == "regular"
    for name in MAIN_OBSERVABLES:
        exact, value = (row[f"{name}_continuum"] for row in (fine, coarse))
        assert 0 < abs(value - exact) <= coarse[f"{name}_continuum_error"]
        assert above[f"{name}_verdict"] == "exact"
        assert above[f"{name}_continuum_error"] == pytest.approx(0, abs=1e-4)


@pytest.mark.parametrize("ratio", [4, 17])
def test_full_contact_on_oblong_pixels_has_narrow_bars_that_hold(tmp_path, ratio):
    """A map stretched along x, at the pressure at which its own points are just all in contact."""
    points = 24
    heights = 1e-3 * build_scene(SelfAffine(cutoff=0.1), HalfSpace(), points).height
    np.save(tmp_path / "map.npy", heights)
    q = 2 * pi * np.fft.fftfreq(points, 1 / points)
    stress = np.fft.ifft2(np.hypot(q, ratio * q[:, None]) * np.fft.fft2(heights)).real
    surface = {"kind": "file", "path": str(tmp_path / "map.npy"), "interpolation": "fourier"}
    spec = {
        "surface": surface | {"length": 1.0, "length_y": 1 / ratio},
        "elastomer": {"kind": "half-space"},
        "grid": {"points": [points, 4 * points]},
        "load": {"p_star": float(-1.002 * stress.min() / stress.std())},
        "accuracy": {"mean_gap": 0.5},
    }
    coarse, fine = rows(run(spec, tmp_path / "full.h5"))
    assert coarse["a_r"] == 1 > fine["a_r"]
    for name in MAIN_OBSERVABLES:
        assert abs(coarse[name] - fine[name]) <= coarse[f"{name}_error"] < 0.1


def test_errors_do_not_average_out_over_the_copies_of_a_mirrored_map(tmp_path):
    """A quarter of the edge points of the cell are independent: the bar is at least twice as wide
    as their random error would be."""
    surface = SelfAffine(cutoff=1 / 24, rolloff=0.25)
    heights = build_scene(surface, HalfSpace(), 96).height[:64, :64]
    np.save(tmp_path / "map.npy", 1e-3 * heights)
    spec = {
        "surface": {"kind": "file", "path": str(tmp_path / "map.npy"), "length": 1.0}
        | {"periodic": False, "edges": "mirror", "interpolation": "fourier"},
        "elastomer": {"kind": "half-space"},
        "grid": {"points": 64},
        "load": {"pressure": 1e-3},
        "accuracy": {"mean_gap": 0.5},
    }
    (row,) = rows(run(spec, tmp_path / "mirrored.h5"))
    random_error = 0.55 * np.sqrt(row["perimeter"] / row["points"]) / row["points"]
    assert row["a_r_verdict"] == "regular"
    assert row["a_r_continuum_error"] > 2 * random_error


def test_laws_of_random_surfaces_leave_out_copies_plateaus_and_the_gap_of_high_peaks():
    levels = sequence(1.0)
    by_law = estimate(levels[-1:], 1.0, ROUGH), estimate(levels, 1.0, ROUGH)

    def estimates(**scales):
        rough = replace(ROUGH, **scales)
        return estimate(levels[-1:], 1.0, rough), estimate(levels, 1.0, rough)

    copies, plateau, peaks = estimates(repetitions=6), estimates(plateau=0.12), estimates(highest=6)
    assert copies == estimates(anisotropy=3)
    assert {each.verdict for each in (copies[0] | plateau[0]).values()} == {"unknown"}
    assert plateau[1] == by_law[1]
    for grids in (0, 1):
        assert peaks[grids] == by_law[grids] | {"u_g": copies[grids]["u_g"]}
        assert peaks[grids] != by_law[grids]


def test_the_share_of_a_plateau_is_counted():
    surface = SelfAffine(cutoff=0.1)
    scene = build_scene(surface, HalfSpace(), 64)
    cut = replace(scene, height=np.minimum(scene.height, 1.0))
    assert scales_of(scene, True).plateau < 0.05
    assert scales_of(cut, True).plateau == np.mean(cut.height > 0.6)
    assert scales_of(cut, True).plateau > 0.15


@pytest.mark.parametrize("width", [1 / 12, 1 / 16])
def test_bars_hold_for_a_lattice_of_equal_bumps(tmp_path, width):
    """Their errors do not average out; the lattice is shifted by a part of the spacing."""
    x = (np.arange(128) + 0.3) / 32
    bump = sum(np.exp(-(((x + 0.5) % 1 - 0.5 + k) ** 2) / (2 * width**2)) for k in (-1, 0, 1))
    np.save(tmp_path / "map.npy", 0.01 * np.outer(bump, bump))
    spec = {
        "surface": {"kind": "file", "path": str(tmp_path / "map.npy"), "length": 1.0}
        | {"periodic": True, "interpolation": "fourier"},
        "elastomer": {"kind": "half-space"},
        "grid": {"points": [128, 256, 1024]},
        "load": {"pressure": [0.002, 0.008]},
        "accuracy": {"mean_gap": 0.5},
    }
    found = rows(run(spec, tmp_path / "bumps.h5"))
    for load in spec["load"]["pressure"]:
        one, two, reference = (row for row in found if row["load_value"] == load)
        for name in MAIN_OBSERVABLES:
            assert one[f"{name}_verdict"] == "unknown"
            error = two[f"{name}_continuum"] - reference[f"{name}_continuum"]
            assert 0 < abs(error) < two[f"{name}_continuum_error"]


def test_full_contact_is_not_exact_with_two_points_per_wave(tmp_path):
    """The waves of the highest wavenumber are then another part of themselves on finer grids."""
    spec = {
        "surface": {"kind": "self-affine", "cutoff": 0.1},
        "elastomer": {"kind": "half-space"},
        "grid": {"points": [20, 24, 48]},
        "load": {"pressure": 200.0},
        "accuracy": {"mean_gap": 0.5},
    }
    two_points, resolved, fine = rows(run(spec, tmp_path / "full.h5"))
    assert two_points["a_r"] == 1
    assert abs(two_points["delta_sigma"] / fine["delta_sigma"] - 1) > 1e-4
    assert resolved["delta_sigma"] == pytest.approx(fine["delta_sigma"], rel=1e-12)
    for name in MAIN_OBSERVABLES:
        verdicts = [row[f"{name}_verdict"] for row in (two_points, resolved, fine)]
        assert verdicts == ["unknown", "exact", "exact"]


RIDGE, CONE = IndenterTip(1.0, dimension=1), IndenterTip(1.0)


@pytest.mark.parametrize(
    ("tip", "n", "verdict"),
    [
        (RIDGE, 1.0, "regular"), (RIDGE, 1.3, "slow"), (RIDGE, 1.5, "diverges"),
        (CONE, 1.75, "regular"), (CONE, 1.9, "slow"), (CONE, 2.0, "diverges"),
        (IndenterTip(2.0), 2.5, "regular"),
    ],
)  # fmt: skip
def test_the_stress_of_a_sharp_tip_has_its_own_limit(tip, n, verdict):
    """<sigma^2> around a tip -r^m, with the stress r^(m - n)."""
    assert estimate(sequence(n), n, tip=tip)["sigma_p"].verdict == verdict
    free = [replace(level, border=0.0) for level in sequence(n)]
    if n < 2:
        assert estimate(free, n, tip=tip)["sigma_p"].verdict == verdict


def test_contact_at_the_border_diverges_at_a_sharp_tip_too():
    levels = [replace(level, border=0.2) for level in sequence(1.9)]
    assert estimate(levels, 1.9, tip=CONE)["sigma_p"].verdict == "diverges"


def test_the_area_of_a_ridge_is_unknown_where_its_stress_rings():
    assert estimate(sequence(1.75), 1.75, tip=RIDGE)["a_r"].verdict == "regular"
    assert estimate(sequence(2.0), 2.0, tip=RIDGE)["a_r"].verdict == "unknown"
    assert estimate(sequence(2.0), 2.0, tip=CONE)["a_r"].verdict == "regular"


def test_one_contact_point_has_no_stress():
    levels = [GridValues(N, 1 / N, N**0.5, 0.1, 2.0) for N in (64, 128)]
    assert estimate(levels, 1.5)["sigma_p"].verdict == "unknown"


def test_a_contact_of_one_point_is_refined_until_it_is_resolved():
    spec = {
        "surface": {"kind": "line-parabola"},
        "elastomer": {"kind": "half-space"},
        "grid": {"points": "auto"},
        "load": {"pressure": 1e-5},
        "accuracy": {"stress_deviation": 0.2},
    }
    result = solve(spec)
    assert result.status == "converged"
    assert result.columns["sigma_p_verdict"] == "regular"
    assert result.pressure.max() == pytest.approx((1e-5 / pi) ** 0.5, rel=0.05)


@pytest.mark.parametrize("n", [0.0, 1.0, 2.0])
def test_a_change_that_is_small_by_accident_leaves_a_bar(n):
    """As the edge of a contact falls between the points of two grids alike."""
    levels = [GridValues(N, 0.9, 0.5, 0.01, 2.0) for N in (64, 128)]
    smooth, sharp = (estimate(levels, n, tip=tip) for tip in (IndenterTip(), RIDGE))
    assert smooth["sigma_p"].error > 0
    assert smooth["u_g"].error == pytest.approx(5 * 0.01 / (128 * 0.1) ** 2)
    assert sharp["u_g"].error == pytest.approx(20 * 0.01 / (128 * 0.1) ** 2)


@pytest.mark.parametrize("tip", [IndenterTip(2.0), IndenterTip(1.0)], ids=str)
def test_the_bars_of_a_turned_cell_are_those_of_the_cell(tip):
    """A cell of 4:1 whose contact leaves a gap at its border, with L along either side."""
    levels = [GridValues(N, 0.9, 0.5, 0.01, 2.0, area=0.25) for N in (128, 256)]
    turned = [
        replace(level, points=level.points / 4, perimeter=level.perimeter / 4, area=4.0)
        for level in levels
    ]
    assert estimate(turned, 1.0, tip=tip) == estimate(levels, 1.0, tip=tip)


@pytest.mark.parametrize("shape", [Ridge(), Ridge(width=0.3), LineParabola()])
@pytest.mark.parametrize("n", [0.0, 0.5, 1.0, 1.5, 2.0])
def test_bars_of_line_contacts_hold(shape, n):
    pressures = 3 ** (n - 1) * np.geomspace(0.005, 1.5, 6)
    elastomer, measured = Power(n=n), {}
    for points in (64, 128, 2048):
        scene = build_scene(shape, elastomer, points)
        for p in pressures:
            contact = scene.contact(p / scene.delta_sigma)
            solution = solve_contact(contact, Auto(tolerance=1e-7))
            o = observe(contact, solution.u, solution.sigma)
            measured[points, p] = GridValues(
                points, o.a_r, o.sigma_p * scene.delta_sigma, o.u_g * scene.h_std, o.perimeter
            )
    held = {"sigma_p": [], "u_g": []}
    for p in pressures:
        levels = [measured[points, p] for points in (64, 128)]
        values = estimate(levels, n, tip=IndenterTip(shape.tip_exponent, dimension=1))
        for name, of_shape in held.items():
            estimated, exact = values[name], getattr(measured[2048, p], name)
            if estimated.verdict == "regular" and measured[2048, p].a_r < 1:
                of_shape.append(abs(estimated.continuum - exact) <= estimated.continuum_error)
    assert len(held["u_g"]) >= 3
    assert all(held["u_g"])
    if shape.tip_exponent == 1 and n > 1:
        assert held["sigma_p"] == []  # no bar of the stress
    else:
        assert len(held["sigma_p"]) >= 3
        assert np.mean(held["sigma_p"]) > 0.8


def test_the_area_of_a_kinked_profile_is_extrapolated_from_the_change_alone():
    levels = sequence(1.0, grids=(64, 128), line=2.0)
    kinked = RoughnessScales(waves=20.0, curvature=2e3, band_limited=False)
    plane, line = (estimate(levels, 1.0, kinked, tip=IndenterTip(2.0, d))["a_r"] for d in (2, 1))
    assert line.continuum == 2 * levels[-1].a_r - levels[-2].a_r
    assert line.continuum_error > plane.continuum_error


def test_no_contact_is_unknown():
    for value in estimate([GridValues(64, 0.0, 0.0, 1.0, 0.0)], 1.0, ROUGH).values():
        assert isnan(value.error)
        assert value.verdict == "unknown"


def test_a_single_indenter_on_one_grid_is_unknown():
    values = estimate(sequence(1.0, (64,)), 1.0)
    assert values["a_r"].verdict == "regular"
    for quantity in ("sigma_p", "u_g"):
        assert values[quantity].verdict == "unknown"
        assert isnan(values[quantity].error)


@pytest.mark.parametrize("n", [0.5, 1.0, 2.0, 3.0])
def test_estimates_stay_in_range(n):
    """Single points in contact, and a single gap."""
    coarse = GridValues(32, 0.5, 0.1, 1e-3, 4.0)
    for a_r, perimeter in ((1 / 64**2, 4 / 64), (1 - 1 / 64**2, 4 / 64)):
        fine = GridValues(64, a_r, 0.1, 1e-3, perimeter)
        for levels, rough in (([fine], None), ([coarse, fine], None), ([coarse, fine], ROUGH)):
            if rough is not None and n > 2.5:
                continue
            area = estimate(levels, n, rough)["a_r"]
            assert 0 <= area.continuum <= 1
            assert 0 < area.continuum_error <= 1


IRREGULAR = (
    replace(ROUGH, anisotropy=3.0),
    replace(ROUGH, band_limited=False),
)


@pytest.mark.parametrize("n", [0.0, 1.0, 2.0, 3.0])
@pytest.mark.parametrize("rough", IRREGULAR)
def test_an_irregular_surface_on_one_grid_is_unknown(rough, n):
    for name, value in estimate(sequence(min(n, 2.9), (64,)), n, rough).items():
        assert isnan(value.error)
        assert isnan(value.continuum)
        assert value.verdict == ("diverges" if (name, n) == ("sigma_p", 3.0) else "unknown")


@pytest.mark.parametrize("rough", IRREGULAR)
def test_an_irregular_surface_on_two_grids_has_bars_of_its_own(rough):
    """Wider than those of isotropic roughness, and at least as wide as the change."""
    levels = sequence(1.0)
    irregular, calm = (estimate(levels, 1.0, surface) for surface in (rough, ROUGH))
    for name in MAIN_OBSERVABLES:
        change = getattr(levels[-1], name) - getattr(levels[-2], name)
        assert irregular[name].verdict == "regular"
        assert irregular[name].error > 0.8 * abs(change)
        assert irregular[name].continuum_error > calm[name].continuum_error
    assert irregular["a_r"].continuum == pytest.approx(0.2, rel=1e-12)


@pytest.mark.parametrize(("n", "known"), [(1.0, 3), (1.5, 2), (2.5, 2), (2.75, 1), (3.25, 0)])
def test_an_irregular_surface_is_unknown_where_no_bars_were_calibrated(n, known):
    values = estimate(sequence(min(n, 2.9)), n, IRREGULAR[0])
    assert sum(each.verdict == "regular" for each in values.values()) == known


def test_the_area_on_oblong_pixels_has_the_bars_of_an_irregular_surface():
    """Its excess is that of square pixels only where they are nearly square."""
    for aspect, verdict in ((1.05, "regular"), (2.0, "unknown")):
        rough = replace(ROUGH, aspect=aspect)
        area = estimate(sequence(1.0, (64,)), 1.0, rough)
        assert area["a_r"].verdict == verdict
        assert area["u_g"] == estimate(sequence(1.0, (64,)), 1.0, ROUGH)["u_g"]
    area = estimate(sequence(1.0), 1.0, rough)["a_r"]
    kinked = replace(ROUGH, band_limited=False)
    assert area == estimate(sequence(1.0), 1.0, kinked)["a_r"]


@pytest.mark.parametrize("n", [0.0, 0.5, 1.0, 2.0])
@pytest.mark.parametrize(
    ("rough", "border"),
    [
        (replace(ROUGH, anisotropy=6.0), None),
        (replace(ROUGH, independent_waves=8.0), None),
        (ROUGH, 0.0),
        (ROUGH, 0.2),
    ],
)
def test_other_smooth_surfaces_have_the_excess_of_isotropic_ones(n, rough, border):
    """From two grids: anisotropic ones, those of few waves, and with a free boundary."""
    levels = [replace(level, border=border) for level in sequence(n)]
    area, calm = estimate(levels, n, rough)["a_r"], estimate(sequence(n), n, ROUGH)["a_r"]
    assert area.continuum == pytest.approx(0.2, rel=1e-12)
    assert area.continuum_error > calm.continuum_error
    assert isnan(estimate(levels[-1:], n, rough)["a_r"].error)
    # the excess of straight edges along the rows: that of a line contact
    xi = levels[-1].switches_per_point
    assert area.continuum_error > 0.3 * (LINE_EXCESS - AREA_EXCESS) * n * xi


@pytest.mark.parametrize(("n", "verdict"), [(2.0, "regular"), (2.25, "unknown")])
def test_the_area_of_a_kinked_surface_is_unknown_where_no_bars_were_calibrated(n, verdict):
    kinked = replace(ROUGH, band_limited=False)
    assert estimate(sequence(n), n, kinked)["a_r"].verdict == verdict
    assert estimate(sequence(n), n, IRREGULAR[0])["a_r"].verdict == "regular"


@pytest.mark.parametrize("border", [None, 0.0])
def test_steep_flat_tops_widen_the_error_of_the_stress(border):
    """For n > 0.5: the stress at their edges still grows from grid to grid."""
    flat, other = (replace(ROUGH, band_limited=False, plateau=share) for share in (0.3, 0.05))
    for n, widens in ((0.5, False), (1.0, True)):
        levels = [replace(level, border=border) for level in sequence(n)]
        of_flat, of_other = (estimate(levels, n, each)["sigma_p"] for each in (flat, other))
        assert (of_flat.error > 1.5 * of_other.error) is widens
        assert of_flat.error >= of_other.error > 0
    assert estimate(levels, n, flat)["u_g"] == estimate(levels, n, other)["u_g"]


def test_ribbons_along_an_axis_have_bars_from_the_change_alone():
    levels = sequence(1.0)
    ribbed, calm = (
        estimate(levels, 1.0, replace(ROUGH, anisotropy=ratio))["a_r"] for ratio in (9.0, 3.0)
    )
    assert ribbed.continuum == pytest.approx(2 * levels[-1].a_r - levels[-2].a_r)
    assert ribbed.continuum_error > 2 * calm.continuum_error


@pytest.mark.parametrize("boundary", ["periodic", "free"])
@pytest.mark.parametrize("n", [0.5, 1.0, 1.75])
def test_the_area_of_a_stretched_map_agrees_with_a_finer_grid(n, boundary, tmp_path):
    draw = np.random.default_rng(5)
    m = np.fft.fftfreq(32, 1 / 32)
    radius = np.hypot(3 * m[:, None], m)
    amplitude = np.where((radius > 0) & (radius < 12), (1 + radius**2) ** -0.9, 0.0)
    np.save(
        tmp_path / "map.npy",
        1e-3 * np.fft.ifft2(np.fft.fft2(draw.normal(size=(32, 32))) * amplitude).real,
    )
    spec = {
        "surface": {"kind": "file", "path": str(tmp_path / "map.npy"), "length": 1.0},
        "elastomer": {"kind": "power", "n": n},
        "grid": {"points": [128, 256, 512], "boundary": boundary},
        "load": {"p_star": [0.05, 0.3]},
        "accuracy": {"mean_gap": 0.1},
    }
    spec["surface"] |= {"periodic": boundary == "periodic", "interpolation": "fourier"}
    run(spec, tmp_path / "study.h5")
    by_load = {}
    for row in sorted(rows(tmp_path / "study.h5"), key=lambda row: row["points"]):
        by_load.setdefault(row["load_value"], []).append(row)
    for coarse, fine, finest in by_load.values():
        exact = 2 * finest["a_r"] - fine["a_r"]  # first order in the spacing, whatever the factor
        assert abs(coarse["a_r_continuum"] - exact) <= coarse["a_r_continuum_error"]
        assert abs(coarse["a_r"] - exact) <= coarse["a_r_error"]
        # narrower than the smallest bar from the change between two grids alone
        by_change = CONTINUUM_FACTOR * FLOOR["a_r"] * coarse["perimeter"] / 128
        assert coarse["a_r_continuum_error"] < by_change


def test_few_contact_patches_on_one_grid_are_unknown():
    """Nine circles of the same size against eleven: area pi r^2, perimeter 8 r each."""
    for patches, verdict in ((9, "unknown"), (11, "regular")):
        r = 0.05
        level = GridValues(256, patches * np.pi * r**2, 0.5, 0.3, patches * 8 * r)
        assert level.patches == pytest.approx(patches)
        for value in estimate([level], 1.0, ROUGH).values():
            assert value.verdict == verdict


def test_an_uncertain_exponent_widens_the_error_of_the_area():
    level = sequence(2.0, (128,))
    certain, uncertain = (
        estimate(level, 1.0, ROUGH, ExcessExponent(2.0, uncertainty))["a_r"]
        for uncertainty in (0.0, 0.5)
    )
    extra = AREA_EXCESS * 0.5 * level[0].switches_per_point
    assert uncertain.continuum == certain.continuum
    assert uncertain.continuum_error == pytest.approx(np.hypot(certain.continuum_error, extra))


@pytest.mark.parametrize("elastomer", [Slab(thickness=0.05), Layer(thickness=0.02, base="sliding")])
def test_the_excess_of_the_area_is_a_sum_over_all_finer_grids(elastomer):
    """From each grid to the next the excess falls by 0.104 n xi / 2, with the exponent n there."""
    length, x = 1.0, 1.0
    exponents = [local_exponent(elastomer, 32 * 2**k, length) for k in range(30)]
    excess = sum(n * x / 2**k / 2 for k, n in enumerate(exponents))
    value, uncertainty = excess_exponent(elastomer, 32, length)
    assert value == pytest.approx(excess, abs=2e-3)
    assert uncertainty > 0.1


def test_the_excess_of_a_power_law_has_its_exponent():
    assert excess_exponent(Power(n=2), 32, 1.0) == (2.0, pytest.approx(0.0, abs=1e-12))


def test_a_table_that_ends_steeply_beyond_the_grid_has_no_area_in_the_continuum(tmp_path):
    """Its k(q) overflows within a few octaves; the area in the continuum was 0."""
    path = tmp_path / "steep.txt"
    np.savetxt(path, [[1, 1], [300, 300], [300.1, 360]])
    assert excess_exponent(Tabulated(path=path), 64, 1.0).value == inf
    spec = {
        "surface": {"kind": "self-affine", "cutoff": 0.125},
        "elastomer": {"kind": "table", "path": str(path)},
        "grid": {"points": 64},
        "load": {"p_star": 0.1},
        "accuracy": {"contact_area": 0.5},
    }
    row = solve(spec).columns
    assert row["a_r_verdict"] == "unknown"
    assert isnan(row["a_r_continuum"])


def measured(surface, elastomer, pressure, points):
    """Values of a contact at a pressure in Pa, in the units Pa and m."""
    scene = build_scene(surface, elastomer, points)
    contact = scene.contact(pressure / scene.delta_sigma)
    solution = solve_contact(contact, Auto(tolerance=1e-8))
    observables = observe(contact, solution.u, solution.sigma)
    stress, gap = observables.sigma_p * scene.delta_sigma, observables.u_g * scene.h_std
    return GridValues(points, observables.a_r, stress, gap, observables.perimeter)


@pytest.mark.parametrize("pressure", [0.05, 0.3, 1.0, 4.0])
@pytest.mark.parametrize("count", [1, 2, 3])
def test_the_area_of_a_membrane_on_a_paraboloid(pressure, count):
    levels = [measured(Parabola(), Membrane(), pressure, points) for points in (32, 64, 128)]
    exact = float(reference.membrane_area(pressure, 1.0, 1.0))
    area = estimate(levels[-count:], 2.0)["a_r"]
    assert abs(area.continuum - exact) <= area.continuum_error
    assert abs(levels[-1].a_r - exact) <= area.error
    assert abs(area.continuum - exact) < 0.5 * abs(levels[-1].a_r - exact)


@pytest.mark.parametrize("p_bar", [0.05, 0.2, 0.5, 0.9])
def test_westergaards_wave(p_bar):
    levels = [measured(Wave(), Power(n=1), p_bar * 2 * np.pi, points) for points in (64, 128, 256)]
    values = estimate(levels, 1.0)
    for quantity, exact in (
        ("a_r", reference.westergaard_area(p_bar)),
        ("u_g", reference.westergaard_gap(p_bar)),
    ):
        assert abs(getattr(levels[-1], quantity) - exact) <= values[quantity].error
        assert abs(values[quantity].continuum - exact) <= values[quantity].continuum_error


def test_the_excess_of_a_line_contact_is_that_of_the_wiener_hopf_equation():
    def integrand(phi):
        half = phi / 2
        return np.log(half / np.sin(half)) / np.sin(half) ** 2

    integral, _ = quad(integrand, 1e-4, pi)  # 1/6 below
    assert pytest.approx(0.25 - (integral + 1e-4 / 6) / (4 * pi), abs=1e-5) == LINE_EXCESS


@pytest.mark.parametrize(
    ("n", "pressure"),
    [
        (1.0, lambda a: 2 * pi * np.sin(pi * a / 2) ** 2),  # Westergaard
        (2.0, lambda a: (2 * pi) ** 2 * reference.string_wave_pressure(a)),
    ],
)
def test_the_excess_of_exact_line_contacts(n, pressure):
    """Mean over contacts whose edges are everywhere between two points; the error is uniform."""
    points = 256
    areas = 0.3 + 2 * np.arange(100) * 0.29 / points
    lines = [measured(Wave(), Power(n=n), float(pressure(a)), points) for a in areas]
    excess = np.array([line.a_r for line in lines]) - areas
    assert excess.mean() == pytest.approx(LINE_EXCESS * n * 2 / points, rel=0.1)
    assert excess.std() * points / 2 == pytest.approx(12**-0.5, rel=0.1)


def random_line(seed, copies=1):
    """A periodic profile of 14 waves, equal parts side by side."""
    m = np.arange(33)
    amplitude = (1 + (m / 4.0) ** 2) ** -0.65 * ((m > 0) & (m <= 14))
    phases = np.random.default_rng(seed).uniform(0, 2 * pi, m.size)
    return np.tile(np.fft.irfft(amplitude * np.exp(1j * phases), 64), copies)


@pytest.mark.parametrize("n", [1.0, 2.0])
def test_bars_of_line_profiles_hold(n):
    held = []
    for seed in range(8):
        for p_star in (0.05, 0.3, 1.0):
            spec = {
                "surface": {"interpolation": "fourier"},
                "elastomer": {"kind": "power", "n": n},
                "load": {"p_star": p_star},
            }
            coarse = {"grid": {"points": 256}, "accuracy": {"mean_gap": 0.5}}
            exact = solve(spec | {"grid": {"points": 4096}}, heights=random_line(seed))
            columns = solve(spec | coarse, heights=random_line(seed)).columns
            for name in ("a_r", "u_g"):
                error = columns[f"{name}_continuum_error"]
                held.append(abs(columns[f"{name}_continuum"] - exact.columns[name]) <= error)
    assert np.mean(held) > 0.9


def test_equal_parts_of_a_line_profile_have_the_same_errors():
    spec = {
        "surface": {"interpolation": "fourier"},
        "elastomer": {"kind": "power", "n": 1},
        "load": {"p_star": 0.3},
        "accuracy": {"mean_gap": 0.5},
    }
    one, four = (
        solve(spec | {"grid": {"points": 128 * k}}, heights=random_line(0, k)).columns
        for k in (1, 4)
    )
    assert four["perimeter"] == 4 * one["perimeter"]
    for name in ("a_r_continuum", "a_r_continuum_error", "u_g_error"):
        assert four[name] == pytest.approx(one[name], rel=1e-3)


@pytest.mark.parametrize("border", [None, 0.0])
def test_the_gaps_of_a_line_profile_have_an_error_where_grids_agree_by_chance(border):
    levels = [GridValues(N, 0.9, 0.5, 0.01, 4.0, border=border) for N in (64, 128)]
    line = RoughnessScales(waves=20.0, curvature=2e3, anisotropy=inf)
    gap = estimate(levels, 1.0, line if border is None else None, tip=IndenterTip(2.0, 1))["u_g"]
    assert gap.error == pytest.approx(LINE_GAP * 0.01 / 6.4**2 / 2**0.5, rel=0.01)  # two gaps


def test_a_profile_with_plateaus_does_not_follow_the_law_of_the_excess():
    levels = sequence(1.0, grids=(64, 128), line=2.0)
    flat = RoughnessScales(waves=20.0, curvature=2e3, anisotropy=inf, plateau=0.2)
    area = estimate(levels, 1.0, flat, tip=IndenterTip(2.0, 1))["a_r"]
    assert area.continuum == pytest.approx(2 * levels[1].a_r - levels[0].a_r)


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
        case = roughness_scales(build_scene(surface, Power(n=1), 64).shells, length)
        assert case.waves == pytest.approx(10, rel=0.01)
        assert case.curvature == pytest.approx((2 * np.pi * case.waves) ** 2, rel=1e-3)
    case = roughness_scales(build_scene(Wave(), Power(n=1), 64).shells, 1.0)
    assert case.waves == pytest.approx(1, rel=1e-12)
    assert case.curvature == pytest.approx(4 * np.pi**2, rel=1e-12)


def test_a_rough_surface_on_nested_grids():
    """Bars of the coarse grids hold the values of a grid eight times finer."""
    surface = SelfAffine(cutoff=1 / 16, seed=5)
    scene = build_scene(surface, Power(n=1), 64)
    levels = [measured(surface, Power(n=1), 10.0, points) for points in (32, 64, 512)]
    levels = [replace(level, u_g=level.u_g / scene.h_std) for level in levels]
    values = estimate(levels[:2], 1.0, roughness_scales(scene.shells, 1.0))
    for quantity in MAIN_OBSERVABLES:
        value, exact = getattr(levels[1], quantity), getattr(levels[2], quantity)
        assert abs(value - exact) <= values[quantity].error


def test_no_elastomer_has_a_step():
    layers = [
        Layer(thickness=t, base=base, poisson=poisson)
        for t in np.geomspace(1e-4, 10, 11)
        for base, poisson in (("sliding", None), ("bonded", 0.3), ("bonded", 0.4999))
    ]
    slabs = [Slab(thickness=t) for t in np.geomspace(1e-5, 1, 11)]
    powers = [Power(n=n) for n in (0, 0.5, 1, 2, 3, 4)]
    assert not any(has_step(it, points, 1.0) for it in layers + slabs + powers for points in GRIDS)


def test_a_soft_band_has_errors_only_on_grids_whose_short_waves_are_shorter(tmp_path):
    """The bars at 64 points would be 2.3 (a_r) and 2.9 times (sigma_p) too small."""
    rows_of_table = [[1, 1], [10, 10], [30, 30], [35, 1e-3], [60, 1e-3], [65, 65], [200, 200]]
    np.savetxt(tmp_path / "band.txt", rows_of_table)
    band = Tabulated(path=tmp_path / "band.txt")
    assert [has_step(band, points, 1.0) for points in (64, 128, 512)] == [True, True, False]
    spec = {
        "surface": {"kind": "self-affine", "cutoff": 0.1, "seed": 5},
        "elastomer": {"kind": "table", "path": str(tmp_path / "band.txt")},
        "grid": {"points": 64},
        "load": {"p_star": 0.03},
        "accuracy": {"mean_gap": 0.05},
    }
    row = solve(spec).columns
    assert {row[f"{name}_verdict"] for name in MAIN_OBSERVABLES} == {"unknown"}
    assert "or unknown" in row["warnings"]


@pytest.mark.parametrize(
    ("shape", "resolved", "has_coarser"),
    [
        ((128, 128), 64, True),
        ((128, 128), 65, False),
        ((64, 64), 16, False),  # half of them are fewer than the first grid of "auto" has
        ((64, 128), 16, True),
        ((128, 64), 16, True),
        ((130, 130), 16, False),  # half of them is odd
        ((129, 256), 16, False),
    ],
)
def test_a_second_grid_has_half_the_points_along_both_axes(shape, resolved, has_coarser):
    points_y, points = shape
    task = SimpleNamespace(
        surface=SimpleNamespace(
            dimension=2, smallest_grid=lambda: resolved, smallest_grid_y=lambda: 0
        ),
        points=points,
        points_y=points_y,
        points_y_on=lambda number: number * points_y // points,
    )
    assert has_coarser_grid(task, points) is has_coarser
