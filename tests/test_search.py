"""Loads given as a contact area or a mean gap."""

import math
import signal
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import exact_solutions as reference
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gfmd_cli.errors import InputError, Interrupted
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.status import Status
from gfmd_cli.study import load_search, run_task
from gfmd_cli.study.history import Trial
from gfmd_cli.study.load_search import _chords
from gfmd_cli.study.pressure_search import MAX_TRIALS, PressureSearch
from gfmd_cli.study.reading import read_rows
from gfmd_cli.study.tasks import plan

SPEC = """\
[surface]
kind = "self-affine"
cutoff = 0.05
[elastomer]
kind = "power"
n = 1
[grid]
points = 128
[load]
contact_area = 0.1
"""


def test_springs_press_as_hard_as_sorting_says(rows_of, spec_of):
    (row,) = rows_of("elastomer.n=0", "load={contact_area=0.25}")
    task = plan(spec_of("elastomer.n=0"))[0]
    scene = build_scene(task.surface, task.elastomer, 128)
    heights = np.sort(scene.height.ravel())[::-1]
    count = heights.size // 4
    low, high = (heights[:k].sum() - k * heights[k] for k in (count - 4, count + 4))
    assert row["status"] == "converged"
    assert abs(row["a_r"] - 0.25) < 1e-3 * 0.25
    assert low < row["p_star"] * heights.size < high


@pytest.mark.parametrize("area", [0.1, 0.5, 0.9])
def test_a_membrane_on_a_paraboloid_has_the_pressure_of_theory(rows_of, area):
    (row,) = rows_of(
        "surface={kind='parabola'}",
        "elastomer.n=2",
        f"load={{contact_area={area}, tolerance=2e-3}}",
    )
    assert row["status"] == "converged"
    exact = reference.membrane_area(row["pressure"], 1.0, 1.0)
    assert exact == pytest.approx(area, abs=row["perimeter"] / 128)  # a point along the edge


@pytest.mark.parametrize("area", [0.1, 0.5])
def test_with_an_accuracy_the_area_is_that_of_the_continuum(rows_of, area):
    """The exact area at the pressure found, where the grid counts 2 to 4 % more points."""
    (row,) = rows_of(
        "surface={kind='parabola'}",
        "elastomer.n=2",
        f"load={{contact_area={area}, tolerance=2e-3}}",
        "accuracy={contact_area=0.1}",
    )
    assert row["a_r_continuum"] == pytest.approx(area, rel=2e-3)
    assert row["a_r"] > area + 0.5 * 0.104 * 2 * row["perimeter"] / 128
    exact = float(reference.membrane_area(row["pressure"], 1.0, 1.0))
    assert abs(exact - area) < row["a_r_continuum_error"]
    assert abs(exact - area) < 0.5 * (row["a_r"] - area)


def test_a_string_on_a_parabola_has_the_pressure_of_theory(rows_of):
    gap = 0.3
    (row,) = rows_of(
        "surface={kind='line-parabola'}", "elastomer.n=2", "grid.points=1024",
        f"load={{mean_gap={gap}, tolerance=1e-9}}",
        "solver.tolerance=1e-10",  # the search parts no pressures that are closer than this
    )  # fmt: skip
    a_r = 1 - math.sqrt(24 * gap * row["h_std"])
    assert row["u_g"] == pytest.approx(gap, rel=1e-9)
    assert row["pressure"] == pytest.approx(a_r / (1 - a_r), rel=1e-5)


@pytest.mark.parametrize("n", [0.5, 3, 4])
@pytest.mark.parametrize("load", ["contact_area=0.02", "mean_gap=0.05", "mean_gap=1.5"])
def test_what_is_found_is_the_contact_at_that_pressure(rows_of, n, load):
    (row,) = rows_of(f"elastomer.n={n}", f"load={{{load}}}")
    name, aim = load.split("=")
    column = {"contact_area": "a_r", "mean_gap": "u_g"}[name]
    assert (row["load"], row["load_value"]) == (name, float(aim))
    assert row["status"] == "converged"
    assert abs(row[column] / float(aim) - 1) <= 1e-3
    (direct,) = rows_of(
        f"elastomer.n={n}", f"load={{pressure={row['pressure']!r}}}", name="direct.h5"
    )
    assert direct["u_g"] == row["u_g"]
    assert direct["a_r"] == row["a_r"]


def test_both_scales_of_a_slab_are_told_apart(rows_of):
    (row,) = rows_of("elastomer={kind='slab', thickness=0.02}", "load={mean_gap=0.2}")
    assert row["u_g"] == pytest.approx(0.2, rel=1e-3)


def test_errors_come_with_a_load_that_was_searched(rows_of):
    (row,) = rows_of("accuracy={mean_gap=0.1}")
    assert abs(row["a_r_continuum"] / 0.1 - 1) <= 1e-3
    assert 0 < row["a_r_error"] < 0.1
    assert row["a_r_continuum"] < row["a_r"]


@pytest.mark.parametrize("gap", [0.05, 0.3, 0.8])
def test_the_error_of_a_searched_pressure_contains_the_exact_one(rows_of, gap):
    keys = "surface={kind='line-parabola'}", "elastomer.n=2", f"load={{mean_gap={gap}}}"
    for points in (128, 256):
        words = (*keys, "accuracy={mean_gap=0.1}", f"grid.points={points}")
        (row,) = rows_of(*words, name=f"{points}.h5")
        a_r = 1 - math.sqrt(24 * gap / math.sqrt(720))  # of a parabola h_std = 1 / sqrt(720)
        error = abs(row["pressure"] * (1 - a_r) / a_r - 1)
        assert 0 < error <= row["p_star_error"] / row["p_star"] < 0.1
    (row,) = rows_of(*keys, "grid.points=256")
    assert np.isnan(row["p_star_error"])


@pytest.mark.parametrize("area", [0.3, 0.7])
def test_the_error_of_the_pressure_of_a_wave_is_at_least_that_of_its_area(rows_of, area):
    """p = p_full sin^2(pi a / 2) of Westergaard is concave or convex (a_r below or above 1/2)."""
    keys = "surface={kind='wave'}", "elastomer.n=1", f"load={{contact_area={area}}}"
    (row,) = rows_of(*keys, "accuracy={mean_gap=0.1}", "grid.points=1024")
    half, error = math.pi * area / 2, row["p_star_error"] / row["p_star"]
    assert abs(row["p_star"] / (math.sqrt(2) * math.sin(half) ** 2) - 1) <= error
    needed = math.pi / math.tan(half) * row["a_r_continuum_error"]
    assert needed < error < 0.1


def test_slopes_are_those_over_the_logarithm_of_the_pressure():
    """Values that are linear in ln p have the same slope towards both neighbours."""

    def trial(ln_p, **keys):
        values = {"a_r": 0.5 + 0.1 * ln_p, "sigma_p": 2.0, "u_g": 3.0 - 0.2 * ln_p}
        return Trial(64, math.exp(ln_p), 0.5, 0.0, values, **keys)

    neighbours = [trial(-2.3 + math.log(ratio), is_neighbour=True) for ratio in (1.25, 0.8)]
    slopes = _chords(trial(-2.3), [trial(-1.0), *neighbours])
    assert slopes == [pytest.approx({"a_r": 0.1, "sigma_p": 0.0, "u_g": 0.2})] * 2


def test_a_slope_of_a_jump_moves_the_search_on():
    search = a_search(math.exp(-1.0), "contact_area", slope=1e300)
    search.add(Trial(64, math.exp(-1.0), 0.9, 0.0))
    assert search.next() < math.exp(-1.0)


def test_two_areas_of_the_same_points_give_no_slope():
    """The next trial is near: the area between two steps is a plateau."""
    search = a_search(1.0, "contact_area", slope=1.0, size=10_000)
    for p, points in ((1.0, 500), (1.9, 998), (1.902, 998)):
        search.add(Trial(64, p, points / 10_000, 0.0))
    assert 1.902 < search.next() < 1.92


@pytest.mark.parametrize(("points", "ends"), [(999, False), (1000, True), (1001, False)])
def test_a_search_ends_with_the_number_of_points_nearest_to_the_load(points, ends):
    search = a_search(1.0, "contact_area", slope=1.0, size=10_000, load=0.10004)
    search.add(Trial(64, 1.0, points / 10_000, 0.0))
    assert search.succeeded == ends
    assert (search.next() is None) == ends


def test_a_search_goes_on_where_the_area_falls():
    search = a_search(1.0, "contact_area", slope=1.0)
    while (p := search.next()) is not None:
        search.add(Trial(64, p, 0.09 if p < 1.05 else max(0.05, 2e-3 * p), 0.0))
    assert search.nearest.pressure == pytest.approx(50.0, rel=1e-5)


@pytest.mark.parametrize("load", ["contact_area=0.03", "contact_area=0.5", "mean_gap=0.3"])
@pytest.mark.parametrize("n", [1, 2])
def test_results_at_a_searched_load_agree_with_those_of_finer_grids_within_their_errors(
    rows_of, load, n
):
    """Those at the pressure that was found do not: it is another one on the finer grid."""
    searched = {"contact_area": "a_r", "mean_gap": "u_g"}[load.partition("=")[0]]
    keys = ("surface.seed=[5, 6]", f"elastomer.n={n}", f"load={{{load}}}", "accuracy.mean_gap=0.5")
    fine = rows_of(*keys, "grid.points=512", name="fine.h5")
    for points in (64, 128):
        rows = rows_of(*keys, f"grid.points={points}", name=f"{points}.h5")
        for coarse, exact in zip(rows, fine, strict=True):
            assert abs(coarse["p_star"] - exact["p_star"]) <= coarse["p_star_error"]
            assert exact["p_star_error"] < 0.5 * coarse["p_star_error"]
            for name in {"a_r", "sigma_p", "u_g"} - {searched}:
                error = abs(coarse[f"{name}_continuum"] - exact[f"{name}_continuum"])
                assert error <= coarse[f"{name}_continuum_error"]


def test_an_area_that_is_smaller_than_its_error_leaves_the_pressure_unknown(rows_of):
    (row,) = rows_of(
        "surface={kind='self-affine', rolloff=1.0, hurst=0.5, cutoff=0.042, seed=966460}",
        "elastomer.n=3", "load={contact_area=0.0032}", "grid.points=64", "accuracy.mean_gap=0.5",
    )  # fmt: skip
    assert row["a_r_continuum_error"] > row["a_r_continuum"]
    assert np.isnan(row["p_star_error"])
    assert (row["u_g_verdict"], row["sigma_p_verdict"]) == ("unknown", "diverges")


def test_a_displacement_that_was_searched_leaves_the_error_of_the_pressure_unknown(rows_of):
    layer = "elastomer={kind='layer', base='sliding', thickness=1}"
    (row,) = rows_of(layer, "load={displacement=2}", "accuracy.mean_gap=0.1")
    assert row["status"] == "converged"
    assert np.isnan(row["p_star_error"])


@pytest.mark.parametrize(("area", "count"), [(409.6 / 64**2, 410), (409.4 / 64**2, 409)])
def test_a_share_between_two_points_gives_the_nearer(rows_of, area, count):
    (row,) = rows_of("grid.points=64", f"load={{contact_area={area}, tolerance=1e-6}}")
    assert row["status"] == "converged"
    assert row["a_r"] == count / 64**2


@pytest.mark.parametrize(("load", "count"), [(11, 10), (13, 14)])
def test_four_points_that_enter_contact_together_are_a_step(rows_of, tmp_path, load, count):
    heights = np.linspace(0.0, 1.0, 256)
    heights[-14:-10] = heights[-14]
    np.save(tmp_path / "map.npy", np.random.default_rng(0).permutation(heights).reshape(16, 16))
    (row,) = rows_of(
        "surface={kind='file', path='map.npy'}", "elastomer.n=0", "grid.points=16",
        f"load={{contact_area={load / 256}}}",
    )  # fmt: skip
    assert row["status"] == "converged"
    assert row["a_r"] == count / 256


def test_a_share_of_a_flat_top_is_not_reached(rows_of, tmp_path):
    heights = np.zeros((16, 16))
    heights[:4, :4] = 1.0
    np.save(tmp_path / "map.npy", heights)
    (row,) = rows_of(
        "surface={kind='file', path='map.npy'}", "elastomer.n=0", "grid.points=16",
        "load={contact_area=0.03}",
    )  # fmt: skip
    assert row["status"] == "load_not_reached"
    assert row["a_r"] == 16 / 256


@pytest.mark.parametrize("boundary", ["periodic", "free"])
@pytest.mark.parametrize("load", [0.08, 0.12])
def test_less_than_the_face_of_a_punch_is_not_reached(rows_of, boundary, load):
    """At the smallest pressures rounding takes points from it."""
    (row,) = rows_of(
        "surface={kind='punch', radius=2e-4, depth=1e-4, length=1e-3}", f"grid.boundary={boundary}",
        "elastomer={kind='half-space', E_star=1e9}", "grid.points=64", f"load.contact_area={load}",
    )  # fmt: skip
    assert row["status"] == "load_not_reached"
    x, y = np.meshgrid(np.arange(64) - 32, np.arange(64) - 32)
    assert row["a_r"] == np.mean(np.hypot(x, y) <= 0.2 * 64)


def test_the_face_of_a_punch_on_a_membrane_does_not_vanish_at_small_pressures(rows_of):
    """The stiffness of the shortest waves is 30000 times that of the longest."""
    keys = "surface={kind='punch', radius=0.2, depth=0.1}", "elastomer.n=2", "grid.points=256"
    (row,) = rows_of(*keys, "load.contact_area=0.05")
    (resolved,) = rows_of(*keys, "load={p_star=1e-8}", name="resolved.h5")
    assert (row["status"], resolved["status"]) == ("load_not_reached", "converged")
    assert row["a_r"] == resolved["a_r"] > 0.05


def test_a_first_trial_whose_contact_rounding_has_taken_is_not_the_nearest():
    """The area of a face, 0.1, is farther from 0.04 than none."""
    search = a_search(first=1e-3, load_key="contact_area", slope=1.0, load=0.04)
    pressures = []
    while (pressure := search.next()) is not None:
        pressures.append(pressure)
        search.add(Trial(64, pressure, 0.1 if pressure > 0.01 else 0.0, 0.0))
    assert pressures[:3] == pytest.approx([1e-3, 8e-3, 6.4e-2])
    assert min(pressures[3:]) > 8e-3
    assert search.nearest.value == 0.1
    assert not search.succeeded


def test_a_contact_whose_area_is_0_in_the_continuum_has_too_little_load(rows_of, tmp_path):
    """Of a few points: larger areas, and the load, are at higher pressures."""
    np.save(tmp_path / "map.npy", np.random.default_rng(0).standard_normal(47))
    (row,) = rows_of(
        "surface={kind='file', path='map.npy'}", "elastomer.n=2", "grid.points=188",
        "load.contact_area=0.011", "accuracy.mean_gap=0.1",
    )  # fmt: skip
    assert row["status"] == "converged"
    assert abs(row["a_r_continuum"] - 0.011) * 188 < 1
    assert row["a_r_continuum"] > 0


@pytest.mark.parametrize("n", [2, 3])
def test_coarser_grids_predict_the_pressure_of_a_continuum_area(rows_of, monkeypatch, n):
    """Their contact areas on the grid have far lower pressures: by a factor of 2 to 20."""
    solved = []
    solve = load_search.solve_on_grids

    def solve_and_note(task, *arguments):
        solved.append(task)
        return solve(task, *arguments)

    monkeypatch.setattr(load_search, "solve_on_grids", solve_and_note)
    (row,) = rows_of(
        "surface.cutoff=0.02", f"elastomer.n={n}", "grid.points=256", "load.contact_area=0.01",
        "accuracy.mean_gap=0.5",
    )  # fmt: skip
    first = next(task.load for task in solved if task.points == 256)
    assert first == pytest.approx(row["pressure"], rel=0.3)


def test_points_that_enter_contact_together_end_a_search_early():
    """The area rises by 8 points at a time, about the load of 400 points at p = 1."""
    search = a_search(0.95, "contact_area", slope=1.0, size=10**6, load=4e-4)
    while (p := search.next()) is not None:
        search.add(Trial(64, p, (8 * math.floor(50 * p) + 4) / 10**6, 0.0))
    assert search.succeeded
    assert search.nearest.pressure == pytest.approx(1.0, rel=2e-4)
    assert len(search.points) <= 12


def test_a_small_area_has_a_pressure_with_an_error(rows_of):
    """It is about 60 points of the coarser of two grids."""
    keys = "surface.seed=[5, 6]", "load={contact_area=0.015}", "accuracy.mean_gap=0.5"
    coarse = rows_of(*keys, "grid.points=128", name="coarse.h5")
    fine = rows_of(*keys, "grid.points=512", name="fine.h5")
    for row, exact in zip(coarse, fine, strict=True):
        assert abs(row["p_star"] - exact["p_star"]) <= row["p_star_error"] < 0.5 * row["p_star"]
        assert exact["p_star_error"] < 0.5 * row["p_star_error"]


@pytest.mark.parametrize("solver", [1e-4, 1e-2])
def test_a_mean_gap_has_no_jumps(rows_of, solver):
    """Next to full contact it falls steeply: pressures nearer than the solver's tolerance count."""
    load = {"mean_gap": 3.4e-4, "tolerance": 1e-5}
    (row,) = rows_of(
        "elastomer.n=1.9", "grid.points=32", "surface.cutoff=0.125", f"solver.tolerance={solver}",
        f"load={{mean_gap={load['mean_gap']}, tolerance={load['tolerance']}}}",
    )  # fmt: skip
    within = abs(row["u_g"] / load["mean_gap"] - 1) <= load["tolerance"]
    assert row["status"] == ("converged" if within else "load_not_reached")
    assert within or solver > 1e-3


def test_a_load_in_a_jump_of_the_area_is_warned_of(gfmd):
    heights = np.where(np.arange(16)[:, None] < 8, 1.0, 0.0)  # two terraces
    heights = heights + 1e-9 * np.random.default_rng(0).random((16, 16))
    np.save("map.npy", heights)
    words = ("run", "spec.toml", "-j", "1", "--set", "elastomer.n=0", "--set",
             "surface={kind='file', path='map.npy'}", "--set", "grid.points=16", "--set",
             "solver.tolerance=1e-3")  # fmt: skip
    for area, warned in ((0.5, 0), (0.7, 1)):
        done = gfmd(*words, "-o", f"{area}.h5", "--set", f"load={{contact_area={area}}}")
        assert done.exit_code == 0
        warning = f"load.contact_area = {area} lies in a jump; this is the nearest contact found"
        (row,) = read_rows(Path(f"{area}.h5"))
        for text in (done.output, row["warnings"], gfmd("analyze", f"{area}.h5").output):
            assert text.count(warning) == warned


def test_a_solve_that_ended_early_is_not_called_a_jump(rows_of):
    (row,) = rows_of("grid.points=64", "solver.max_steps=2", "load={contact_area=0.1}")
    assert row["status"] == "max_steps"
    assert "jump" not in row["warnings"]


@pytest.mark.parametrize("load", ["contact_area=0.1", "mean_gap=0.5"])
@pytest.mark.parametrize(("points", "status"), [(64, "converged"), (128, "diverged")])
def test_a_solver_that_diverges_ends_the_search_on_a_grid(
    rows_of, monkeypatch, points, status, load
):
    solve = load_search.solve_on_grids

    def solve_or_diverge(task, *arguments):
        solved = solve(task, *arguments)
        if task.points == points:
            solved.solution.status = Status.DIVERGED
            solved.observables = replace(solved.observables, a_r=0.0, u_g=math.nan)
        return solved

    monkeypatch.setattr(load_search, "solve_on_grids", solve_or_diverge)
    (row,) = rows_of(f"load={{{load}}}", "grid.points=128")
    assert (row["status"], row["points"]) == (status, 128)


@pytest.mark.parametrize("seed", [0, 3])
def test_a_mean_gap_above_those_of_coarser_grids_is_found(rows_of, spec_of, seed):
    """Without load the gap is the highest point, which is lower on a coarser grid."""
    words = (f"surface.seed={seed}", "grid.points=128")
    (task,) = plan(spec_of(*words))
    coarse, fine = (build_scene(task.surface, task.elastomer, n).highest for n in (64, 128))
    load = 0.5 * (coarse + fine)
    assert coarse < load < fine
    (row,) = rows_of(*words, f"load.mean_gap={load}")
    assert row["status"] == "converged"
    assert row["u_g"] == pytest.approx(load, rel=1e-3)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (("load={contact_area=1.0}",), "less than 1"),
        (("load={contact_area=0.1, p_star=1}",), "give one of p_star"),
        (("load={p_star=0.1, tolerance=0.01}",), "tolerance belongs to"),
        (("grid.points='auto'", "accuracy={mean_gap=0.1}"), "searched on a given grid"),
    ],
)
def test_what_makes_no_sense_is_refused(spec_of, overrides, message):
    with pytest.raises(InputError, match=message):
        spec_of(*overrides)


@pytest.mark.parametrize(
    ("load", "reason"),
    [
        ("mean_gap=20", "without load the mean gap is"),
        ("contact_area=6e-5", "less than one of the 16384"),
    ],
)
def test_a_load_that_no_pressure_has_fails_and_says_so(rows_of, load, reason):
    reports = []
    rows_of(f"load={{{load}}}", report=reports.append)
    (failed,) = (report.message for report in reports if report.status == Status.FAILED)
    assert reason in failed


@pytest.mark.parametrize(
    ("steps", "overrides"),
    [
        (37, ("elastomer.n=4", "load={contact_area=0.1}", "accuracy={mean_gap=0.1}")),
        (9, ("elastomer.n=1", "load={contact_area=0.3}", "accuracy={mean_gap=0.1}")),
        (9, ("grid.points=64", f"load={{contact_area={409.4 / 64**2}, tolerance=1e-6}}")),
        (9, ("grid.points=64", f"load={{contact_area={409.6 / 64**2}, tolerance=1e-6}}")),
    ],
    ids=["errors", "slopes", "lower", "upper"],  # one of the last two solves the nearest again
)
def test_a_search_stopped_again_and_again_ends_bit_for_bit(rows_of, steps, overrides):
    check_stopped(rows_of, steps, overrides)


def test_a_search_stopped_after_a_negative_mean_gap_goes_on(rows_of, tmp_path):
    """The elastomer enters missing heights deeper than those filled in."""
    rng = np.random.default_rng(1)
    heights = rng.standard_normal((32, 32))
    heights[rng.random(heights.shape) < 0.4] = np.nan
    np.save(tmp_path / "map.npy", heights)
    keys = "surface={kind='file', path='map.npy', missing='void'}", "elastomer.n=1"
    check_stopped(rows_of, 9, (*keys, "grid.points=32", "load.mean_gap=0.1"))


def check_stopped(rows_of, steps, overrides):
    """A search that is stopped at every so many steps has the bits of one that is not."""
    (unbroken,) = rows_of(*overrides, name="unbroken.h5")
    stops = 0

    def stop_after_some_words(progress):
        words.append(progress.event)
        if words.count("step") == steps:
            signal.raise_signal(signal.SIGTERM)

    before, run_task.REPORT_EVERY = run_task.REPORT_EVERY, 0.0
    try:
        while stops < 500:
            words = []
            try:
                (broken,) = rows_of(*overrides, report=stop_after_some_words)
                break
            except Interrupted:
                stops += 1
    finally:
        run_task.REPORT_EVERY = before
    assert 5 < stops < 500
    errors = ("u_g_error", "p_star_error")
    for name in ("pressure", "a_r", "u_g", "sigma_p", "residual", "transforms", *errors):
        np.testing.assert_array_equal(broken[name], unbroken[name], name)


def test_a_pressure_without_contact_is_no_side_of_a_jump():
    """Any pressure has contact: where a solve finds none, rounding has taken it."""
    search = a_search(1e-3, "contact_area", 1.0)
    trials = 0
    while (p := search.next()) is not None:
        search.add(Trial(64, p, 0.2 if p > 1e-7 else 0.0, 0.0))
        trials += 1
    assert not search.succeeded
    assert search.nearest.value == 0.2
    assert trials < 10


curves = given(
    power=st.floats(0.05, 6.0),
    first=st.floats(-12.0, 12.0),
    steps=st.sampled_from([0, 12, 101, 10_001]),
    load_key=st.sampled_from(["contact_area", "mean_gap"]),
)
SOME = settings(max_examples=300)


@example(power=5.0, first=10.0, steps=0, load_key="contact_area")  # a start on the plateau
@example(power=5.0, first=-10.0, steps=101, load_key="contact_area")
@example(power=0.05, first=-7.8125, steps=12, load_key="contact_area")  # a jump near p* = 1e6
@SOME
@curves
def test_every_monotone_curve_is_searched_to_its_end(power, first, steps, load_key):
    check_search(power, first, steps, load_key)


@pytest.mark.validation
@settings(SOME, max_examples=2000)
@curves
def test_many_more_monotone_curves_are_searched_to_their_ends(power, first, steps, load_key):
    check_search(power, first, steps, load_key)


def check_search(power, first, steps, load_key):
    """The value 0.1 is at p = 1; with steps it lies between two of them."""
    search = a_search(math.exp(first), load_key, 1.0)
    sign = 1 if load_key == "contact_area" else -1

    def value(p):
        exact = 1 / (1 + 9 * p ** (-sign * power))
        return max(math.floor(exact * steps), 1) / steps if steps else exact  # a point at least

    trials = 0
    while (p := search.next()) is not None:
        search.add(Trial(64, p, value(p), 0.0))
        trials += 1
    assert 0 < trials < MAX_TRIALS
    assert search.succeeded == (steps == 0 or load_key == "contact_area")  # gaps have no steps
    count = min(range(1, steps + 1), key=lambda k: abs(math.log(k / steps / 0.1)), default=0)
    nearest = count / steps if steps else pytest.approx(0.1, rel=1e-5)
    assert search.nearest.value == nearest


def a_search(first, load_key, slope, size=10**9, load=0.1):
    """A search of a value on a grid of `size` points."""
    task = SimpleNamespace(
        load_key=load_key,
        load=load,
        load_tolerance=1e-5,
        accuracy=None,
        points=64,
        solver=SimpleNamespace(tolerance=1e-6),
        elastomer=SimpleNamespace(stiffness=lambda q, length: 0.0 * q),  # all pressures resolved
    )
    grid = SimpleNamespace(points=64, size=size, length=1.0, spacings=(1 / 64,))
    scene = SimpleNamespace(grid=grid, delta_sigma=1.0, h_std=1.0)
    return PressureSearch(task, scene, first, slope)
