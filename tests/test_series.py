"""What figures show of several seeds: the mean with its confidence band."""

import numpy as np
import pytest
from scipy import stats

from gfmd_cli.analysis.compare import compare, with_solvers
from gfmd_cli.analysis.curve_styles import seed_groups, with_styles
from gfmd_cli.analysis.ensemble import Ensemble, ensembles
from gfmd_cli.analysis.figures import PANELS, Series, _point, study_figures
from gfmd_cli.analysis.plotting import styled
from gfmd_cli.analysis.wording import with_unit

SPEC = """\
[surface]
kind = "self-affine"
cutoff = 0.2
seed = [0, 1, 2, 3]
[elastomer]
kind = "power"
n = [0, 1]
[grid]
points = 16
[load]
p_star = [0.1, 0.3, 1.0]
"""
AREA, RATIO = PANELS[0], PANELS[1]


@pytest.fixture
def comparison(tmp_path, rows_of):
    rows_of()
    return compare(tmp_path / "study.h5")


def values(comparison, n, p_star, name="a_r"):
    rows = [row for curve in comparison.curves if curve.n == n for row in curve.rows]
    return np.array([row[name] for row in rows if row["p_star"] == pytest.approx(p_star)])


def test_seeds_are_shown_by_their_mean_and_students_interval(comparison):
    groups = seed_groups(with_styles(comparison))
    assert [len(group) for group in groups] == [4, 4]
    series = Series.of(AREA, groups[1])
    assert series.x == pytest.approx([0.1, 0.3, 1.0])
    for x, y, half_width in zip(series.x, series.y, series.half_width, strict=True):
        areas = values(comparison, 1, x)
        low, high = stats.t.interval(0.95, len(areas) - 1, areas.mean(), stats.sem(areas))
        assert (y - half_width, y + half_width) == pytest.approx((low, high), rel=1e-12)
    assert series.style.label == "n = 1, 4 seeds"


def test_a_ratio_is_that_of_each_seed_to_its_own_theory(comparison):
    group = seed_groups(with_styles(comparison))[0]
    ratios = [item.curve.column("a_r") / item.curve.prediction.a_r for item in group]
    assert Series.of(RATIO, group).y == pytest.approx(np.mean(ratios, axis=0), rel=1e-12)


def test_one_seed_is_shown_as_it_is(comparison):
    (item, *_), _ = seed_groups(with_styles(comparison))
    series = Series.of(AREA, [item])
    np.testing.assert_array_equal(series.y, item.curve.column("a_r"))
    assert np.isnan(series.half_width).all()
    assert series.style == item.style


def test_a_figure_has_one_curve_for_all_seeds(comparison):
    with styled():
        figures = study_figures(comparison, with_styles(comparison))
    drawn = figures["contact_area"]
    assert {"n = 0, 4 seeds", "n = 1, 4 seeds", "95 % confidence"} <= set(drawn.legend)
    assert len(drawn.axes.collections) == 2  # bands
    assert [line.get_xydata().shape for line in drawn.axes.lines][:2] == [(3, 2), (0, 2)]


def test_figures_of_the_mean_gap_name_another_theory(comparison):
    for theory, label in (("paper", "Persson theory"), ("fitted", "theory by a fitted weight")):
        study = compare(comparison.path, theory)
        with styled():
            figures = study_figures(study, with_styles(study))
        assert label in figures["mean_gap_log"].legend
        assert "Persson theory" in figures["contact_area"].legend


def test_seeds_with_other_loads_are_averaged_where_they_agree(tmp_path, rows_of):
    rows_of()
    rows_of("surface.seed=[0, 1]", "load.p_star=[0.2]", "elastomer.n=1")
    comparison = compare(tmp_path / "study.h5")
    points = [
        (each.rows[0]["n"], each.rows[0]["p_star"], len(each.rows))
        for each in ensembles(comparison)
    ]
    assert (1.0, 0.2, 2) in [(n, round(p, 9), count) for n, p, count in points]
    assert sum(count == 4 for *_, count in points) == 6


def test_continuum_values_are_averaged_if_all_seeds_have_one(comparison):
    records = [dict(row) for row in ensembles(comparison)[0].rows[:2]]
    for record, area in zip(records, (0.2, 0.4), strict=True):
        record |= {"a_r": area, "a_r_error": 0.01, "a_r_persson": 0.3, "p_star": 0.1}
        record |= {"a_r_continuum": area / 2, "a_r_continuum_error": 0.02}
    for mean, error in ((0.15, 0.02), (0.3, 0.01)):
        assert Ensemble(records).spread("a_r").mean == pytest.approx(mean)
        assert _point(AREA, records)[1:3] == pytest.approx((mean, error))
        records[1]["a_r_continuum"] = np.nan


def test_the_pressure_of_a_mean_over_seeds_is_that_of_its_place_on_the_axis(tmp_path, rows_of):
    in_metres_and_pascals = ("surface.h_std=1e-6", "elastomer={kind='power', n=1, k_n=1e9}")
    rows = rows_of(
        *in_metres_and_pascals, "load={mean_gap=0.5}", "surface.seed=[0, 1]", name="gap.h5"
    )
    assert rows[0]["pressure"] != pytest.approx(rows[1]["pressure"], rel=0.01)
    (group,) = seed_groups(with_styles(compare(tmp_path / "gap.h5")))
    series = Series.of(AREA, group)
    mean = np.mean([row["pressure"] for row in rows])
    assert series.details[0].startswith(f"pressure {with_unit(mean, 'Pa')}\n")
    assert mean == pytest.approx(series.x[0] * rows[0]["delta_sigma"], rel=1e-12)


def test_a_key_that_one_of_the_solvers_lacks_splits_no_curve(tmp_path, rows_of):
    rows_of("elastomer.n=1", "surface.seed=0", "solver.kind=['fire', 'ccg']", name="two.h5")
    curves = compare(tmp_path / "two.h5").curves  # ccg has no time_step: its cells are blank
    assert [len(curve.rows) for curve in curves] == [3, 3]
    titles = with_solvers(["a", "b"], [curve.rows[0] for curve in curves])
    assert titles == ["a, fire", "b, ccg"]
