"""Loads given as a contact area or a mean gap."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gfmd_cli.errors import InputError, Interrupted
from gfmd_cli.physics import reference
from gfmd_cli.physics.contact import build_scene
from gfmd_cli.study import solve
from gfmd_cli.study.search import TRIALS, Trial, _Search
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
        "surface={kind='parabola'}", "elastomer.n=2", f"load={{contact_area={area}, within=2e-3}}"
    )
    assert row["status"] == "converged"
    exact = reference.membrane_area(row["pressure"], 1.0, 1.0)
    assert exact == pytest.approx(area, abs=row["perimeter"] / 128)  # a point along the edge


def test_a_string_on_a_parabola_has_the_pressure_of_theory(rows_of):
    gap = 0.3
    (row,) = rows_of(
        "surface={kind='line-parabola'}", "elastomer.n=2", "grid.points=1024",
        f"load={{mean_gap={gap}, within=1e-9}}",
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
    assert (row["load"], row["asked"]) == (name, float(aim))
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
    assert abs(row["a_r"] / 0.1 - 1) <= 1e-3
    assert 0 < row["a_r_error"] < 0.1
    assert row["a_r_continuum"] < row["a_r"]


def test_a_share_between_two_points_is_not_reached(rows_of):
    (row,) = rows_of("grid.points=64", "load={contact_area=0.1, within=1e-6}")
    assert row["status"] == "load_not_reached"
    assert abs(row["a_r"] - 0.1) <= 1 / 64**2


@pytest.mark.parametrize(
    ("overrides", "told"),
    [
        (("load={contact_area=1.0}",), "less than 1"),
        (("load={contact_area=0.1, p_star=1}",), "give one of p_star"),
        (("load={p_star=0.1, within=0.01}",), "within belongs to"),
        (("grid.points='auto'", "accuracy={mean_gap=0.1}"), "that of a given grid"),
    ],
)
def test_what_makes_no_sense_is_refused(spec_of, overrides, told):
    with pytest.raises(InputError, match=told):
        spec_of(*overrides)


def test_a_gap_wider_than_without_load_fails_and_says_so(rows_of):
    words = []
    rows_of("load={mean_gap=20}", report=words.append)
    (failed,) = (word.note for word in words if word.event == "failed")
    assert "without load it is" in failed


def test_a_search_stopped_again_and_again_ends_bit_for_bit(rows_of, spec_of, tmp_path):
    overrides = ("elastomer.n=4", "load={contact_area=0.1}", "accuracy={mean_gap=0.1}")
    (unbroken,) = rows_of(*overrides, name="unbroken.h5")
    stops = 0

    def stop_after_some_words(progress):
        words.append(progress.event)
        if words.count("step") == 37:
            solve.stop.set()

    before, solve.REPORT_EVERY = solve.REPORT_EVERY, 0.0
    try:
        while stops < 500:
            words = []
            try:
                (broken,) = rows_of(*overrides, report=stop_after_some_words)
                break
            except Interrupted:
                stops += 1
    finally:
        solve.REPORT_EVERY = before
    assert 5 < stops < 500
    for name in ("pressure", "a_r", "u_g", "sigma_p", "residual", "transforms", "u_g_error"):
        assert broken[name] == unbroken[name], name


@example(power=5.0, first=10.0, steps=0, quantity="contact_area")  # a start on the plateau
@example(power=5.0, first=-10.0, steps=100, quantity="contact_area")
@settings(derandomize=True, max_examples=2000, deadline=None)
@given(
    power=st.floats(0.05, 6.0),
    first=st.floats(-12.0, 12.0),
    steps=st.sampled_from([0, 100, 10_000]),
    quantity=st.sampled_from(["contact_area", "mean_gap"]),
)
def test_every_monotone_curve_is_searched_to_its_end(power, first, steps, quantity):
    task = SimpleNamespace(quantity=quantity, load=0.1, within=1e-3, points=64)
    scene = SimpleNamespace(grid=SimpleNamespace(points=64), delta_sigma=1.0)
    search, sign = (
        _Search(task, scene, math.exp(first), 1.0),
        1 if quantity == "contact_area" else -1,
    )

    def value(p):
        exact = 1 / (1 + 9 * p ** (-sign * power))  # 0.1 at p = 1
        return math.floor(exact * steps) / steps if steps else exact

    trials = 0
    while (p := search.next()) is not None:
        search.take_in(Trial(64, p, value(p), 0.0))
        trials += 1
    assert 0 < trials <= TRIALS
    if not steps:
        assert abs(value(search.best) / 0.1 - 1) <= 1e-3
