import importlib
import sys
from dataclasses import replace

import numpy as np
import pytest
from specs import power_spec

from gfmd_cli.analysis import figures
from gfmd_cli.analysis.compare import Curve, compare
from gfmd_cli.analysis.curve_styles import (
    MAX_LABEL,
    colours,
    curve_styles,
    distinct_labels,
    distinct_styles,
)
from gfmd_cli.analysis.figures import PANELS, draw_all, study_figures, with_styles
from gfmd_cli.analysis.plotting import ColumnFigure, styled
from gfmd_cli.errors import InputError, SpaceError
from gfmd_cli.report.interactive import interactive
from gfmd_cli.spec.parse import read_spec
from gfmd_cli.status import Status
from gfmd_cli.study.run import RunOptions, run_study

ROUGH = power_spec(n=[0, 1], points=64, p_star=[0.05, 0.3, 1.5], cutoff=0.05)
LINE = """\
[surface]
kind = "ridge"
slope = 1.0
[elastomer]
kind = "power"
n = [1, 3]
[grid]
points = 256
[load]
p_star = [0.01, 0.1]
"""
LONG = "measurement_2024_11_sample_steel_ground_position_"
OVER_PRESSURE = {
    "contact_area", "contact_area_ratio", "stress_deviation", "mean_gap_log", "mean_gap_tail",
}  # fmt: skip
DISTRIBUTIONS = {"stress_distribution", "stress_distribution_pressures"}


@pytest.fixture
def study(tmp_path):
    """Runs a spec and sets it beside theory."""

    def study(text=ROUGH, *overrides):
        path = tmp_path / "spec.toml"
        path.write_text(text)
        spec, _ = read_spec(path, overrides)
        run_study(spec, text, tmp_path / "study.h5", lambda _: None, RunOptions(jobs=1))
        return compare(tmp_path / "study.h5")

    return study


def drawn(comparison, folder):
    """Names of the figures, each checked to be a PDF and a PNG of the width of a column."""
    paths = draw_all(comparison, folder)
    assert sorted(paths) == sorted(folder.iterdir())
    names = {path.stem for path in paths}
    assert len(paths) == 2 * len(names)
    for name in names:
        pdf, png = ((folder / f"{name}.{kind}").read_bytes() for kind in ("pdf", "png"))
        assert pdf.startswith(b"%PDF")
        assert b"/Type3" not in pdf
        width = int.from_bytes(png[16:20], "big")
        assert 85 < width / 300 * 25.4 < 87  # mm
    return names


def marked(comparison, rows):
    """The comparison with other values in the rows of its first curve."""
    first, *others = comparison.curves
    changed = [row | new for row, new in zip(first.rows, rows, strict=True)]
    return replace(comparison, curves=[Curve(changed, first.persson), *others])


def panel(name):
    return next(panel for panel in PANELS if panel.name == name)


def figure_of(name, comparison):
    curves = comparison.curves
    p_star = np.geomspace(0.01, 3, 50)
    items = [
        figures.StyledCurve(curve, style, p_star, curve.predict(p_star))
        for curve, style in zip(curves, curve_styles(curves), strict=True)
    ]
    if name in DISTRIBUTIONS:
        return figures.distribution_figures(items)[name]
    return figures._over_pressure(panel(name), items)


def test_every_figure_is_a_pdf_and_a_png(study, tmp_path):
    assert drawn(study(), tmp_path / "new") == OVER_PRESSURE | DISTRIBUTIONS


def test_a_single_point_is_drawn(study, tmp_path):
    comparison = study(ROUGH, "elastomer.n=1", "load.p_star=0.3")
    assert drawn(comparison, tmp_path / "out") == OVER_PRESSURE | {"stress_distribution"}


def test_two_grids_of_one_contact_give_the_continuum_too(study, tmp_path):
    comparison = study(ROUGH, "elastomer.n=1", "grid.points=[64, 128]", "load.p_star=0.3")
    continuum = {"stress_distribution_continuum"}
    assert (
        drawn(comparison, tmp_path / "out") == OVER_PRESSURE | {"stress_distribution"} | continuum
    )


def test_a_line_scene_is_drawn(study):
    """Without theory, which does not apply to a single indenter."""
    comparison = study(LINE)
    for name in (OVER_PRESSURE | {"stress_distribution"}) - {"contact_area_ratio"}:
        plot = figure_of(name, comparison)
        plot.figure.draw_without_rendering()
        assert "Persson theory" not in plot.legend
    assert figure_of("contact_area_ratio", comparison) is None


def test_slabs_each_have_a_theory_of_their_own_and_need_no_histogram(study):
    text = ROUGH.replace('"power"', '"slab"').replace("n = [0, 1]", "thickness = [0.01, 0.1]")
    slabs = study(text, "output.histogram=false")
    plot = figure_of("contact_area", slabs)
    assert list(plot.legend) == ["t/L = 0.01", "t/L = 0.1", "Persson theory"]
    assert plot.legend["Persson theory"].get_color() != "black"
    for name in OVER_PRESSURE:
        figure_of(name, slabs).figure.draw_without_rendering()
    for name in DISTRIBUTIONS:
        assert figure_of(name, slabs) is None
    plot = figure_of("contact_area_ratio", slabs)
    assert plot.legend["Persson theory"].get_color() == "black"


def test_theory_that_is_the_same_for_all_curves_is_one_black_line(study):
    comparison = study()
    assert figure_of("contact_area", comparison).legend["Persson theory"].get_color() == "black"
    assert figure_of("mean_gap_log", comparison).legend["Persson theory"].get_color() != "black"


def test_the_closed_form_belongs_to_n_0_alone(study):
    comparison = study()
    assert "n = 0, Gaussian" in figure_of("mean_gap_tail", comparison).legend
    without = replace(comparison, curves=[c for c in comparison.curves if c.n != 0])
    assert "n = 0, Gaussian" not in figure_of("mean_gap_tail", without).legend


def test_what_is_not_converged_is_a_cross_and_known_errors_are_bars(study):
    comparison = study()
    assert "tolerance not reached" not in figure_of("mean_gap_log", comparison).legend
    assert not figure_of("mean_gap_log", comparison).axes.containers
    states = [{"status": Status.MAX_STEPS}, {"u_g_error": 0.1}, {}]
    plot = figure_of("mean_gap_log", marked(comparison, states))
    assert "tolerance not reached" in plot.legend
    assert len(plot.axes.containers) == 1


def test_a_missed_accuracy_is_not_said_to_be_a_missing_convergence(study):
    states = [{"status": Status.ACCURACY_NOT_REACHED}, {"status": Status.LOAD_NOT_REACHED}, {}]
    plot = figure_of("mean_gap_log", marked(study(), states))
    assert {"accuracy not reached", "load not reached"} < plot.legend.keys()
    assert "tolerance not reached" not in plot.legend


def test_symbols_stand_at_the_continuum_value_where_it_is_known(study):
    known = {"a_r_continuum": 0.04, "a_r_continuum_error": 0.01, "a_r_error": 0.02}
    unknown = {"a_r_continuum": np.nan, "a_r_continuum_error": np.nan, "a_r_error": 0.03}
    comparison = marked(study(ROUGH, "elastomer.n=1"), [known, unknown, {}])
    (curve,) = comparison.curves
    grid = curve.column("a_r")
    plot = figure_of("contact_area", comparison)
    (bars,) = plot.axes.containers
    ends = np.array([segment[:, 1] for segment in bars.lines[2][0].get_segments()])
    assert ends == pytest.approx(np.array([[0.03, 0.05], [grid[1] - 0.03, grid[1] + 0.03]]))
    symbols = next(line for line in plot.axes.lines if line.get_marker() == "o")
    assert symbols.get_ydata() == pytest.approx([0.04, *grid[1:]])


def test_no_gap_is_left_out_of_the_logarithmic_figure(study):
    comparison = study()
    closed = [{"u_g": 0.0}] * 3
    one = replace(comparison, curves=comparison.curves[:1])
    assert figure_of("mean_gap_tail", marked(one, closed)) is None
    assert figure_of("mean_gap_tail", marked(comparison, closed)) is not None
    assert figure_of("mean_gap_log", marked(one, closed)) is not None


def test_values_that_are_not_finite_are_left_out(study):
    nothing = dict.fromkeys(("a_r", "sigma_p", "u_g"), np.nan) | {"status": Status.DIVERGED}
    comparison = marked(study(), [nothing, {}, {}])
    for name in OVER_PRESSURE:
        assert "tolerance not reached" not in figure_of(name, comparison).legend


def test_curves_that_differ_by_their_seed_alone_share_a_style(study):
    curves = study(ROUGH, "surface.seed=[0, 1]", "load.p_star=0.3", "output.histogram=false").curves
    styles = curve_styles(curves)
    assert [style.label for style in styles] == ["n = 0", "n = 1", "n = 0", "n = 1"]
    assert styles[:2] == styles[2:]
    assert len({style.colour for style in styles}) == len({style.marker for style in styles}) == 2


def test_surfaces_under_one_elastomer_are_named_by_what_differs_and_told_apart(study):
    some = ("surface.hurst=[0.3, 0.8]", "surface.seed=[0, 1]", "elastomer.n=1")
    comparison = study(ROUGH, *some, "load.p_star=0.3", "output.histogram=false")
    styles = curve_styles(comparison.curves)
    labels = {style.label for style in styles}
    assert labels == {"n = 1, hurst=0.3", "n = 1, hurst=0.8"}
    assert len(set(styles)) == len({style.colour for style in styles}) == 2
    assert len({style.marker for style in styles}) == 2
    shown = {f"{label}, 2 seeds" for label in labels} | {"Persson theory", "95 % confidence"}
    assert set(figure_of("contact_area", comparison).legend) == shown


def test_more_variants_than_can_be_told_apart_are_named_by_their_elastomer(study):
    (first, second) = study(ROUGH, "load.p_star=0.3", "output.histogram=false").curves
    many = [
        Curve([row | {"hurst": 0.1 * place} for row in curve.rows],
              curve.persson)
        for place in range(1, 10) for curve in (first, second)
    ]  # fmt: skip
    few = curve_styles(many[:16])
    assert {style.label for style in few} >= {"n = 0, hurst=0.1", "n = 1, hurst=0.3"}
    assert len({(style.colour, style.marker) for style in few}) == 16
    labels = {style.label for style in curve_styles(many)}
    assert labels == {"n = 0, several hurst", "n = 1, several hurst"}
    assert len({style.colour for style in curve_styles(many)}) == 2


def test_kinds_alone_are_named_where_they_tell_curves_apart(study):
    surface = "[{kind='self-affine', cutoff=0.1, h_std=1e-8}, {kind='wave', amplitude=1e-8}]"
    elastomer = "[{kind='half-space'}, {kind='layer', thickness=0.2, poisson=0.4, E_star=1.0}]"
    keys = (f"surface={surface}", f"elastomer={elastomer}", "load.p_star=0.3")
    labels = [style.label for style in curve_styles(study(ROUGH, *keys).curves)]
    assert sorted(labels) == [
        "half-space, self-affine", "half-space, wave", "layer, self-affine", "layer, wave"
    ]  # fmt: skip


def test_names_of_elastomers_are_short_where_they_can_be(study):
    curves = study(ROUGH, "elastomer.n=[0.5, 1.0, 0.77]", "load.p_star=1").curves
    names = [style.label for style in curve_styles(curves)]
    assert names == ["n = 1/2", "n = 1", "n = 0.77"]


def test_a_half_space_is_called_so(study):
    (curve,) = study(ROUGH, 'elastomer={kind="half-space", E_star=2e9}').curves
    assert [style.label for style in curve_styles([curve])] == ["half-space"]


def test_lines_of_the_theory_go_on_where_they_underflow(study):
    """u_g = 0 in double precision from p* = 39 on, where exp(-p*^2 / 2) is below 5e-324."""
    comparison = study(ROUGH, "load.p_star=[0.3, 100.0]")
    with styled():
        plot = study_figures(comparison, with_styles(comparison))["mean_gap_log"]
    lines = [layer for layer in plot.layers if layer.kind == "line"]
    assert len(lines) == 3  # of two elastomers, and the exact one of n = 0
    for line in lines:
        beyond = line.y[line.x > 50]
        assert beyond.size > 0
        assert np.all(beyond == 0.0)


def test_a_study_in_pascals_has_them_on_a_second_axis(study):
    pressures = "load={pressure=[1e6, 1e7, 1e8]}"
    comparison = study(ROUGH, 'elastomer={kind="half-space", E_star=2e9}', pressures)
    with styled():
        plot = study_figures(comparison, with_styles(comparison))["contact_area"]
        plot.svg()
    (second,) = plot.axes.child_axes
    delta_sigma = comparison.curves[0].rows[0]["delta_sigma"]
    low, high = plot.axes.get_xlim()
    divisor = {"(MPa)": 1e6, "(GPa)": 1e9}[second.get_xlabel().split()[-1]]
    scale = delta_sigma / divisor
    assert second.get_xlim() == pytest.approx((low * scale, high * scale))


def test_a_study_in_reduced_units_has_no_second_axis(study):
    comparison = study(ROUGH)
    with styled():
        plot = study_figures(comparison, with_styles(comparison))["contact_area"]
    assert plot.axes.child_axes == []


@pytest.mark.parametrize(
    ("elastomer", "labels"),
    [
        ("{kind='power', n=1, k_n=[1.0, 2.0]}", ["n = 1 k_n=1", "n = 1 k_n=2"]),
        (
            "{kind='layer', thickness=[1e-5, 2e-5], E_star=1e9, poisson=0.3}",
            ["layer thickness=10 µm", "layer thickness=20 µm"],
        ),
    ],
)
def test_elastomers_are_named_by_what_they_differ_in(study, elastomer, labels):
    few = ("load.p_star=0.3", "output.histogram=false")
    curves = study(ROUGH, f"elastomer={elastomer}", *few).curves
    assert [style.label for style in curve_styles(curves)] == labels


def test_grids_are_named_once(study):
    few = ("elastomer.n=1", "load.p_star=0.3", "output.histogram=false")
    curves = study(ROUGH, "grid.points=[64, 96]", *few).curves
    labels = [style.label for style in curve_styles(curves)]
    assert labels == ["n = 1, 64 points", "n = 1, 96 points"]


def test_the_stress_at_several_pressures_names_its_curve_in_full(study):
    """Curves with one style, "several hurst", are not told apart by its label."""
    hurst = ", ".join(f"0.{digit}" for digit in range(1, 10))
    keys = ("elastomer.n=1", f"surface.hurst=[{hurst}]", "load.p_star=[0.3, 1.5]")
    plot = figure_of("stress_distribution_pressures", study(ROUGH, *keys))
    label = " ".join(plot.axes.get_xlabel().split())
    assert "several" not in label
    assert "hurst=0.1" in label
    assert "64 points a side" in label


def test_a_linear_axis_holds_negative_values():
    plot = ColumnFigure("x", "y")
    plot.scale("y", "linear", [-2.0, 1.0])
    assert plot.axes.get_ylim()[0] < -2
    plot.scale("y", "linear", [0.5, 1.0])
    assert plot.axes.get_ylim()[0] == pytest.approx(-0.03)


def test_a_logarithmic_axis_of_many_decades_has_few_ticks():
    plot = ColumnFigure("x", "y")
    plot.scale("x", "log", np.array([1e-30, 1e-6]))
    assert len(plot.axes.get_xticks(minor=True)) < 30
    low, high = plot.axes.get_xlim()
    assert 2 <= sum(low <= tick <= high for tick in plot.axes.get_xticks()) <= 5


@pytest.mark.parametrize(("decades", "ticks"), [(0.9, 5), (1.2, 3), (1.6, 5)])
def test_labels_of_a_short_logarithmic_axis_do_not_overlap_on_the_page(decades, ticks):
    """At five ticks, plotly.js labels all of 2 to 9 on an axis of 1 to 1.5 decades."""
    plot = ColumnFigure("x", "y")
    plot.line("a line", np.array([0.0, 1.0]), np.array([1.0, 2.0]), color="black")
    plot.axes.set(yscale="log", ylim=(1.0, 10.0**decades))
    layout = interactive(plot)["layout"]
    assert layout["yaxis"]["nticks"] == ticks
    assert layout["xaxis"]["nticks"] == 5


def test_error_bars_up_to_half_of_their_value_are_within_the_axes(study):
    keys = ("elastomer.n=1", "accuracy={contact_area=1e-9, mean_gap=1e-9}")
    comparison = study(ROUGH, *keys, "output.histogram=false")
    for name in ("contact_area_ratio", "mean_gap_tail"):
        plot = figure_of(name, comparison)
        low, high = plot.axes.get_ylim()
        points = [layer for layer in plot.layers if layer.kind == "points"]
        bars = [np.minimum(layer.error, layer.y / 2) for layer in points]
        assert any(np.any(bar > 0) for bar in bars)
        for layer, (down, up) in zip(points, bars, strict=True):
            known = np.isfinite(down)
            assert np.all((layer.y - down)[known] >= low)
            assert np.all((layer.y + up)[known] <= high)


def test_values_that_are_nearly_the_same_need_no_offset_on_their_axis():
    plot = ColumnFigure("x", "y")
    plot.scale("y", "linear", np.array([1.0, 1.0 + 6e-7]), zero=False)
    plot.figure.draw_without_rendering()
    assert plot.axes.yaxis.get_offset_text().get_text() == ""


def test_entries_that_curves_share_follow_the_curves(study):
    seeds = ("surface.seed=[0, 1]", "load.p_star=[0.1, 0.3]", "output.histogram=false")
    entries = [*figure_of("contact_area", study(ROUGH, *seeds)).entries]
    assert entries == ["n = 0, 2 seeds", "n = 1, 2 seeds", "Persson theory", "95 % confidence"]


def test_figures_name_a_solver_as_the_tables_do(study):
    """With "auto", the solver that was used is not what sets the curves apart."""
    keys = ("elastomer.n=1", "load.p_star=0.3", "output.histogram=false")
    comparison = study(ROUGH, *keys, 'solver.kind=["auto", "pcg", "ccg"]')
    kinds = ["auto", "pcg", "ccg"]
    labels = [style.label for style in curve_styles(comparison.curves)]
    assert labels == [f"n = 1, {kind}" for kind in kinds]
    assert all(f"points a side, {kind}\n" in str(comparison) for kind in kinds)


def test_the_legend_says_of_how_many_seeds_the_points_are_means(study):
    study(ROUGH, "surface.seed=[0, 1, 2]", "load.p_star=0.1", "output.histogram=false")
    study(ROUGH, "surface.seed=[0, 1]", "load.p_star=0.3", "output.histogram=false")
    comparison = study(ROUGH, "surface.seed=0", "load.p_star=1", "output.histogram=false")
    assert "n = 1, 1 to 3 seeds" in figure_of("contact_area", comparison).entries


def test_a_legend_is_no_wider_than_its_figure():
    """A label of the largest length, and the number of seeds after it."""
    (style,) = distinct_styles(["half-space hurst=0.8 " + "x" * (MAX_LABEL - 21)])
    with styled():
        plot = ColumnFigure("x", "y")
        plot.points(replace(style, label=f"{style.label}, 10 to 12 seeds"), *np.ones((2, 1)))
        plot.svg()
        (legend,) = plot.figure.legends
        assert legend.get_window_extent().width <= plot.figure.bbox.width
        (text,) = legend.get_texts()
        assert text.get_text().replace("\n", " ") == f"{style.label}, 10 to 12 seeds"


def test_a_folder_that_cannot_be_written_is_told(study, tmp_path):
    comparison = study(ROUGH, "elastomer.n=1", "load.p_star=0.3")
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(SpaceError):
        draw_all(comparison, tmp_path / "taken")


def test_missing_matplotlib_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    monkeypatch.delitem(sys.modules, "gfmd_cli.analysis.plotting")
    with pytest.raises(InputError, match=r'pip install "\.\[plot\]"'):
        importlib.import_module("gfmd_cli.analysis.plotting")


@pytest.mark.parametrize(
    "names",
    [
        [f"{LONG}1.npy", f"{LONG}2.npy"],
        ["a" * 60 + word + "b" * 60 for word in ("one", "two")],
        ["short", "other"],
    ],
)
def test_long_labels_that_end_differently_stay_different(names):
    cut = distinct_labels(names)
    assert len(set(cut)) == len(names)
    assert all(len(label) <= MAX_LABEL for label in cut)
    assert cut[0].startswith("short" if names[0] == "short" else cut[0][:3])
    assert distinct_labels(["x" * 90] * 2)[0] == distinct_labels(["x" * 90] * 2)[1]


def test_a_label_that_is_numbered_and_cut_says_so():
    labels = [f"{'slope=0.05 ' * 6}{word}{' slope=0.05' * 6}" for word in ("one", "two")]
    for i, label in enumerate(distinct_labels(labels), 1):
        assert label.startswith(f"{i}: slope=0.05")
        assert label.endswith("\N{HORIZONTAL ELLIPSIS}")
        assert len(label) <= MAX_LABEL


def hurst_sweep(study, values):
    """One elastomer on surfaces of several H, from the rows of one contact."""
    comparison = study(ROUGH, "elastomer.n=1", "load.p_star=0.3", "output.histogram=false")
    (curve,) = comparison.curves
    rows = [curve.rows[0] | {"hurst": hurst} for hurst in values]
    return replace(comparison, curves=[Curve([row], curve.persson) for row in rows])


def test_colours_go_along_a_long_sweep_of_one_parameter(study):
    values = [0.9, 0.05, *np.linspace(0.1, 0.8, 15)]
    items = with_styles(hurst_sweep(study, values))
    assert [item.style.label for item in items] == [f"hurst={h:.12g}" for h in sorted(values)]
    assert [item.style.colour for item in items] == colours(17)


@pytest.mark.parametrize(("count", "heading"), [(8, ""), (9, "n = 1"), (20, "n = 1")])
def test_a_figure_of_a_long_sweep_names_its_elastomer_above_the_legend(study, count, heading):
    comparison = hurst_sweep(study, np.linspace(0.1, 0.9, count))
    with styled():
        plot = study_figures(comparison, with_styles(comparison))["contact_area"]
        plot.svg()
    (legend,) = plot.figure.legends
    texts = [legend.get_title().get_text(), *(text.get_text() for text in legend.get_texts())]
    assert texts[0] == heading
    assert interactive(plot)["heading"] == heading
    assert any("n = 1" in text for text in texts)


def test_the_legend_of_very_many_curves_names_a_few_of_them(study):
    """Each curve keeps a colour of its own, along the sweep; the legend says what it leaves out.

    The interactive figure leaves nothing out, so that every curve can be turned off.
    """
    values = np.linspace(0.1, 0.9, 33)
    items = with_styles(hurst_sweep(study, values))
    assert len({item.style.colour for item in items}) == values.size
    with styled():
        plot = study_figures(hurst_sweep(study, values), items)["contact_area"]
    named = [f"hurst={hurst:.12g}" for hurst in values[::4]]
    assert [*plot.named_entries] == [*named, "Persson theory"]
    assert plot.heading == "n = 1, 9 of 33 curves are named"
    every = [f"hurst={hurst:.12g}" for hurst in values]
    page = interactive(plot)
    assert [entry["name"] for entry in page["legend"]] == [*every, "Persson theory"]
    assert page["heading"] == "n = 1"


def test_curves_of_a_long_sweep_of_two_parameters_differ_in_colour_and_label(study):
    curves = hurst_sweep(study, np.linspace(0.1, 0.9, 21)).curves
    rows = [curve.rows[0] | {"cutoff": 0.1 + 0.001 * i} for i, curve in enumerate(curves)]
    both = [replace(curve, rows=[row]) for curve, row in zip(curves, rows, strict=True)]
    styles = curve_styles(both)
    assert [style.colour for style in styles] == colours(21)
    assert styles[0].label == "hurst=0.1 cutoff=0.1"
    assert len({style.label for style in styles}) == 21
