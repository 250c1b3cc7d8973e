"""Two studies compared: which rows belong together, and how far they lie apart."""

import json
from math import hypot, inf, isnan, nan

import numpy as np
import pytest
from specs import power_spec

from gfmd_cli import run
from gfmd_cli.analysis.diff import Deviation, Pair, diff
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.study.reading import read_rows

SPEC = power_spec(
    n=[0, 2],
    points=32,
    p_star=[0.1, 1.0],
    more="""\
[output]
histogram = false
""",
)


@pytest.fixture(scope="module")
def study_of(output_of, tmp_path_factory):
    """Runs SPEC with overrides; the same ones give the same study."""
    folder = tmp_path_factory.mktemp("diff")
    (folder / "spec.toml").write_text(SPEC)
    held = {}

    def study(*overrides, status=0):
        if overrides not in held:
            held[overrides] = folder / f"{len(held)}.h5"
            options = [word for override in overrides for word in ("--set", override)]
            words = ("-o", held[overrides], "-q", "-j", "1", *options)
            output_of("run", folder / "spec.toml", *words, status=status)
        return held[overrides]

    return study


def test_a_study_does_not_differ_from_itself(output_of, study_of):
    difference = diff(study_of(), study_of())
    assert len(difference.pairs) == 4
    assert difference.only == ([], [])
    assert difference.spec == []
    assert all(pair.deviation("u_g") == (0.0, pytest.approx(nan, nan_ok=True))
               for pair in difference.pairs)  # fmt: skip
    assert not difference.exceeds(0)
    text = output_of("diff", study_of(), study_of(), "--tolerance", 0)
    assert "+0.00e+00" in text
    assert "Largest of 4 pairs: a_r 0.0e+00, sigma_p 0.0e+00, u_g 0.0e+00." in text


def test_other_grids_are_compared_and_the_keys_that_differ_are_told(output_of, study_of):
    fine = study_of("grid.points=64")
    difference = diff(study_of(), fine)
    assert [(p.one["points"], p.other["points"]) for p in difference.pairs] == [(32, 64)] * 4
    assert difference.spec == ["grid.points: 32 -> 64"]
    for pair, a, b in zip(difference.pairs, read_rows(study_of()), read_rows(fine), strict=True):
        expected = (b["u_g"] - a["u_g"]) / max(a["u_g"], b["u_g"])
        assert pair.deviation("u_g").relative == pytest.approx(expected, rel=1e-12)
    text = output_of("diff", study_of(), fine)
    assert "32 -> 64" in text
    assert "grid.points: 32 -> 64" in text


def test_the_tolerance_decides_the_exit_status(output_of, study_of):
    fine = study_of("grid.points=64")
    largest = max(
        abs(pair.deviation(name).relative)
        for pair in diff(study_of(), fine).pairs
        for name in ("a_r", "sigma_p", "u_g")
    )
    output_of("diff", study_of(), fine, "--tolerance", 1.001 * largest)
    output_of("diff", study_of(), fine, "--tolerance", 0.999 * largest, status=1)
    output_of("diff", study_of(), fine)


def test_rows_of_one_study_alone_are_listed(output_of, study_of):
    more = study_of("load.p_star=[0.3, 1.0]")
    difference = diff(study_of(), more)
    assert len(difference.pairs) == 2
    assert [row["p_star"] for row in difference.only[0]] == [0.1, 0.1]
    assert [row["p_star"] for row in difference.only[1]] == [0.3, 0.3]
    text = output_of("diff", study_of(), more)
    assert "only in A:" in text
    assert "  power n=2 on self-affine cutoff=0.1\n    32: p*=0.3\n" in text


def test_many_rows_of_one_study_alone_are_one_line(output_of, study_of):
    text = output_of("diff", study_of(), study_of("load.p_star=[0.01, 0.02, 0.03]"))
    assert "  power n=2 on self-affine cutoff=0.1\n    32: p*=0.01, p*=0.02, p*=0.03\n" in text


IN_PASCAL = (
    'elastomer={kind="half-space", E_star=2e9}',
    "load={pressure=[1e8, 5e8]}",
    "surface.h_std=0.01",
)


def test_another_elastomer_is_paired_by_pressure_and_compared_in_pascal_and_metres(
    output_of, study_of
):
    stiff = (IN_PASCAL[0].replace("2e9", "4e9"), *IN_PASCAL[1:])
    difference = diff(study_of(*IN_PASCAL), study_of(*stiff))
    assert [(p.one["pressure"], p.other["pressure"]) for p in difference.pairs] == [
        (1e8, 1e8),
        (5e8, 5e8),
    ]
    for pair in difference.pairs:
        for name, unit in (("a_r", None), ("sigma_p", "delta_sigma"), ("u_g", "h_std")):
            a, b = (row[name] * (row[unit] if unit else 1) for row in (pair.one, pair.other))
            expected = pytest.approx((b - a) / max(a, b), rel=1e-12)
            assert pair.deviation(name).relative == expected
        assert pair.deviation("a_r").relative < 0 < pair.deviation("u_g").relative
    text = output_of("diff", study_of(*IN_PASCAL), study_of(*stiff))
    assert text.startswith("Elastomers differ: paired by pressure, sigma_p in Pa, u_g in m. ")
    data = json.loads(output_of("diff", study_of(*IN_PASCAL), study_of(*stiff), "--json"))
    assert data["paired"] == difference.paired
    for row in data["rows"]:
        assert [row[f"{name}_unit"] for name in ("a_r", "sigma_p", "u_g")] == ["1", "Pa", "m"]
        for name in ("a_r", "sigma_p", "u_g"):
            a, b = row[f"{name}_a"], row[f"{name}_b"]
            assert row[f"{name}_relative"] == pytest.approx((b - a) / max(a, b), rel=1e-12)
    assert data["rows"][0]["sigma_p_a"] == pytest.approx(
        difference.pairs[0].one["sigma_p"] * difference.pairs[0].one["delta_sigma"], rel=1e-12
    )


def test_at_one_pressure_in_pascal_two_grids_of_an_indenter_are_compared_in_pascal_and_metres(
    study_of,
):
    keys = ("surface={kind='parabola'}", "elastomer={kind='half-space'}", "load={pressure=0.01}")
    (pair,) = diff(study_of(*keys), study_of(*keys, "grid.points=64")).pairs
    assert pair.one["h_std"] != pytest.approx(pair.other["h_std"], rel=1e-3)  # the units differ
    for name, unit in (("sigma_p", "delta_sigma"), ("u_g", "h_std")):
        a, b = (row[name] * row[unit] for row in (pair.one, pair.other))
        assert pair.deviation(name).relative == pytest.approx((b - a) / max(a, b), rel=1e-12)


def test_another_surface_of_one_elastomer_is_paired_by_load(output_of, study_of):
    one, other = study_of("elastomer.n=1"), study_of("elastomer.n=1", "surface.hurst=0.5")
    difference = diff(one, other)
    assert [pair.one["p_star"] for pair in difference.pairs] == [0.1, 1.0]
    text = output_of("diff", one, other)
    assert text.startswith("Surfaces differ: paired by reduced pressure, values in reduced units")
    assert "A: power n=1 on self-affine cutoff=0.1\nB: power n=1 on self-affine hurst=0.5" in text
    assert "only in" not in text


def test_other_maps_of_one_name_are_other_surfaces(tmp_path):
    heights = 1e-9 * SelfAffine(cutoff=0.2).heights(32)
    studies = []
    for name, factor in (("a", 1), ("b", 2)):
        (tmp_path / name).mkdir()
        np.save(tmp_path / name / "map.npy", factor * heights)
        tables = {
            "surface": {"kind": "file", "path": str(tmp_path / name / "map.npy"), "length": 1e-6},
            "elastomer": {"kind": "half-space", "E_star": 1e9},
            "grid": {"points": 32},
            "load": {"pressure": 1e6},
        }
        studies.append(run(tables, tmp_path / name / "s.h5"))
    difference = diff(*studies)
    assert difference.paired.startswith("Surfaces differ")
    assert difference.pairs[0].physical


def test_rows_of_one_elastomer_and_surface_that_share_no_load_stay_apart(study_of):
    difference = diff(study_of("elastomer.n=1"), study_of("elastomer.n=1", "load.p_star=0.3"))
    assert (difference.pairs, difference.paired) == ([], "")


def test_another_seed_is_another_contact_and_nothing_to_compare_is_no_agreement(
    output_of, study_of
):
    other = study_of("surface.seed=1")
    assert diff(study_of(), other).pairs == []
    assert "no contact in common" in output_of(
        "diff", study_of(), other, "--tolerance", 1, status=1
    )


def test_a_report_says_why_nothing_is_compared(output_of, study_of, tmp_path):
    by_area = study_of("elastomer.n=1", "load={contact_area=0.3}")
    output_of("report", study_of("elastomer.n=1"), by_area, "-o", tmp_path / "both.html")
    page = (tmp_path / "both.html").read_text()
    assert "No contact in common: the loads of A are given by" in page


def test_contacts_that_have_not_converged_are_named_and_paired_last(output_of, study_of):
    few_steps = ("solver.max_steps=1", "solver.tolerance=1e-12", "elastomer.n=2")
    unfinished = study_of(*few_steps, status=1)
    shown = output_of("diff", study_of("elastomer.n=2"), unfinished)
    assert "compared, but not converged in B:" in shown
    assert "converged in A" not in shown
    both = study_of("solver.max_steps=[1, 20000]", "elastomer.n=2", status=1)
    pairs = diff(both, study_of()).pairs
    assert len(pairs) == 2
    assert all(pair.one["status"].is_converged for pair in pairs)


def test_contacts_of_one_study_are_named_with_the_keys_of_the_solver_that_differ(
    output_of, study_of
):
    keys = ("elastomer.n=2", "load.p_star=0.1")
    two, one = study_of(*keys, 'solver.kind=["pcg", "ccg"]'), study_of(*keys, 'solver.kind="pcg"')
    only_a = output_of("diff", two, one).partition("only in A:\n")[2].splitlines()
    assert only_a[:2] == ["  power n=2 on self-affine cutoff=0.1, ccg", "    32: p*=0.1"]
    assert "only in B" not in output_of("diff", two, one)


def test_of_several_grids_the_same_ones_belong_together(study_of):
    both, one = study_of("grid.points=[32, 64]"), study_of("grid.points=64")
    difference = diff(both, one)
    assert [(p.one["points"], p.other["points"]) for p in difference.pairs] == [(64, 64)] * 4
    assert {row["points"] for row in difference.only[0]} == {32}
    assert not difference.exceeds(0)


def test_oblong_grids_of_the_same_points_are_paired_and_named(output_of, study_of):
    keys = ("surface.length_y=2.0", "elastomer.n=1", "load.p_star=0.1")
    one = study_of(*keys, "grid.points_y=[64, 128]")
    other = study_of(*keys, "grid.points_y=[128, 64]")
    difference = diff(one, other)
    assert [(p.one["points_y"], p.other["points_y"]) for p in difference.pairs] == [
        (64, 64), (128, 128),
    ]  # fmt: skip
    assert not difference.exceeds(0)
    assert "32 x 128 -> 32 x 128" in output_of("diff", one, other)


def test_a_free_boundary_is_named_and_paired_with_its_like(output_of, study_of):
    one = study_of("elastomer.n=1", "grid.boundary=['free', 'periodic']")
    other = study_of("elastomer.n=1", "grid.boundary=['periodic', 'free']")
    assert not diff(one, other).exceeds(0)
    headings = output_of("diff", one, other).split("A: ")[0]
    assert headings.count(", free boundary\n") == 1
    free, periodic = (study_of("elastomer.n=1", f"grid.boundary={b}") for b in ("free", "periodic"))
    lines = output_of("diff", free, periodic).splitlines()
    (heading,) = (line for line in lines if line.startswith("A: "))
    assert heading.endswith(", free boundary")
    assert lines[lines.index(heading) + 1] == "B: " + heading[3:].removesuffix(", free boundary")
    row = json.loads(output_of("diff", free, periodic, "--json"))["rows"][0]
    assert (row["boundary_a"], row["boundary_b"]) == ("free", "periodic")


def test_differences_are_told_in_units_of_the_error_bars(output_of, study_of):
    bars = ("accuracy.mean_gap=0.5", "elastomer.n=1", "load.p_star=0.1")
    one, other = study_of(*bars), study_of(*bars, "grid.points=48")
    difference = diff(one, other)
    for pair in difference.pairs:
        error = hypot(pair.one["u_g_error"], pair.other["u_g_error"])
        expected = (pair.other["u_g"] - pair.one["u_g"]) / error
        assert pair.deviation("u_g").in_errors == pytest.approx(expected, rel=1e-12)
    text = output_of("diff", one, other)
    assert f"({difference.pairs[0].deviation('u_g').in_errors:+.1f})" in text


def test_json_holds_rows_and_keys(output_of, study_of):
    data = json.loads(output_of("diff", study_of(), study_of("grid.points=64"), "--json"))
    assert data["spec"] == ["grid.points: 32 -> 64"]
    assert (data["only_a"], data["only_b"]) == ([], [])
    row = data["rows"][0]
    assert (row["points_a"], row["points_b"]) == (32, 64)
    expected = (row["a_r_b"] - row["a_r_a"]) / max(row["a_r_a"], row["a_r_b"])
    assert row["a_r_relative"] == pytest.approx(expected)
    assert row["a_r_in_errors"] is None


def test_the_largest_differences_come_first(output_of, study_of):
    one, other = study_of(), study_of("grid.points=64")
    rows = json.loads(output_of("diff", one, other, "--json"))["rows"]
    names = "a_r", "sigma_p", "u_g"
    largest = {name: max(abs(row[f"{name}_relative"]) for row in rows) for name in names}
    words = ", ".join(f"{name} {value:.1e}" for name, value in largest.items())
    line = output_of("diff", one, other).splitlines()[1]
    assert line == f"Largest of {len(rows)} pairs: {words}."


def test_values_that_are_missing_or_zero_do_not_agree_by_chance():
    def apart(a, b):
        blank = {"u_g_error": nan}
        return Pair(blank | {"u_g": a}, blank | {"u_g": b}).deviation("u_g")

    assert apart(0.0, 0.0).relative == 0
    assert apart(0.0, 1e-9).relative == 1
    assert apart(nan, 1.0).relative == inf
    assert isnan(apart(nan, nan).relative)
    assert isinstance(apart(1.0, 2.0), Deviation)


def test_loads_of_another_key_are_named(output_of, study_of):
    in_pascal = study_of("elastomer={kind='half-space', E_star=1e9}", "load={pressure=1e8}")
    reduced = study_of("elastomer={kind='half-space', E_star=1e9}", "load={p_star=0.1}")
    output = output_of("diff", in_pascal, reduced)
    assert "loads of A are given by pressure, those of B by p_star" in output


def test_a_study_that_is_not_there_is_bad_input(output_of, study_of, tmp_path):
    assert "no such study" in output_of("diff", study_of(), tmp_path / "none.h5", status=2)
    for wrong in ("-1", "nan"):
        output_of("diff", study_of(), study_of(), "--tolerance", wrong, status=2)
