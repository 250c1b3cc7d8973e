"""Figures as data for the scripts of a page: the same values, names and axes as the static ones."""

import json
import math

import numpy as np
import pytest

from gfmd_cli.analysis.curve_styles import CurveStyle
from gfmd_cli.analysis.figures import LABELS, P_STAR
from gfmd_cli.analysis.plotting import CONFIDENCE, THEORY, ColumnFigure
from gfmd_cli.report.interactive import interactive
from gfmd_cli.report.rendering import html_label, plain_label
from gfmd_cli.status import TOLERANCE_NOT_REACHED, Status

STYLE = CurveStyle((0.0, 0.0, 1.0), "s", r"n = 1 \$<b>")
X = np.array([0.1, 1.0, 10.0])
Y = np.array([0.5, 2.0, 1 / 3])


@pytest.fixture
def figure():
    """Points of which one is not converged and one has an error, a band, a line of theory."""
    plot = ColumnFigure(P_STAR, LABELS["u_g"])
    statuses = [Status.CONVERGED, Status.CONVERGED, Status.MAX_STEPS]
    error = np.array([np.nan, 0.25, np.nan])
    plot.points(STYLE, X, Y, statuses, error=error, details=["a < b", "c\nd", "e"])
    plot.band(STYLE, X, Y / 2, 2 * Y)
    plot.theory([(STYLE, X, Y), (STYLE, X, np.array([3.0, np.nan, 2.0]))])
    plot.scale("x", "log", X)
    plot.scale("y", "linear", Y)
    return plot


def test_a_figure_is_plain_data_that_json_can_hold(figure):
    data = interactive(figure)
    assert json.loads(json.dumps(data, allow_nan=False)) == json.loads(json.dumps(data))
    assert interactive(ColumnFigure("x", "y")) is None


def test_points_have_the_values_that_are_drawn_with_their_errors(figure):
    converged, other = interactive(figure)["data"][:2]
    assert (converged["x"], converged["y"]) == ([0.1, 1.0], [0.5, 2.0])
    assert converged["error_y"]["array"] == [None, 0.25]
    assert other["y"] == [pytest.approx(1 / 3, rel=1e-9)]
    assert other["marker"]["symbol"] == "x-thin-open"
    assert other["meta"] == ["n = 1 $<b>", TOLERANCE_NOT_REACHED]
    assert "error_y" not in other


def test_bars_of_two_lengths_go_down_and_up():
    plot = ColumnFigure(P_STAR, LABELS["u_g"])
    plot.points(STYLE, X, Y, error=np.array([[0.1, 0.25, 0.3], [0.1, 0.5, 0.2]]))
    (points,) = interactive(plot)["data"]
    bars = points["error_y"]
    assert (bars["arrayminus"], bars["array"]) == ([0.1, 0.25, 0.3], [0.1, 0.5, 0.2])
    assert bars["symmetric"] is False
    assert points["text"][1].endswith(": 2.00 ± 0.50")  # the longer one


def test_the_second_axis_has_the_range_of_the_first_one_times_its_factor(figure):
    figure.second_x("p (MPa)", 5.0)
    data = interactive(figure)
    ends = np.log10(5 * np.array(figure.axes.get_xlim()))
    assert data["layout"]["xaxis2"]["range"] == pytest.approx(list(ends))
    assert (data["layout"]["xaxis2"]["type"], data["factor"]) == ("log", 5.0)


def test_a_point_says_its_curve_values_and_details_as_escaped_text(figure):
    first, second = interactive(figure)["data"][0]["text"]
    assert first.split("<br>") == [
        "n = 1 $&lt;b&gt;",
        "reduced pressure p* = p / Δσ: 0.1",
        "mean gap u_g / h_std: 0.5",
        "a &lt; b",
    ]
    assert second.split("<br>")[2:] == ["mean gap u_g / h_std: 2.00 ± 0.25", "c", "d"]


def test_a_band_goes_there_and_back(figure):
    band = next(trace for trace in interactive(figure)["data"] if trace["mode"] == "none")
    assert band["x"] == [*X, *X[::-1]]
    assert band["y"] == pytest.approx([*(Y / 2), *(2 * Y[::-1])], rel=1e-9)
    assert band["meta"] == ["n = 1 $<b>", CONFIDENCE]


def test_lines_are_blank_where_there_is_nothing_to_draw(figure):
    lines = [trace for trace in interactive(figure)["data"] if trace["mode"] == "lines"]
    assert [line["y"] for line in lines] == [[0.5, 2.0, 0.33333], [3.0, None, 2.0]]
    assert all(line["meta"] == ["n = 1 $<b>", THEORY] for line in lines)


def test_every_curve_belongs_to_an_entry_of_the_legend(figure):
    data = interactive(figure)
    entries = {entry["name"]: entry["symbol"] for entry in data["legend"]}
    assert {name for trace in data["data"] for name in trace["meta"]} == set(entries)
    assert entries["n = 1 $<b>"] == "□"
    assert entries[TOLERANCE_NOT_REACHED] == "×"
    assert entries[THEORY] == "—"
    assert data["legend"][0]["colour"] == "#0000ff"


def test_axes_have_the_scales_and_ends_of_the_static_figure(figure):
    layout = interactive(figure)["layout"]
    low, high = figure.axes.get_xlim()
    ends = pytest.approx([math.log10(low), math.log10(high)])
    assert (layout["xaxis"]["type"], layout["xaxis"]["range"]) == ("log", ends)
    assert layout["yaxis"]["type"] == "linear"
    assert layout["yaxis"]["range"] == pytest.approx(figure.axes.get_ylim())


@pytest.mark.parametrize(
    ("label", "html", "plain"),
    [
        (P_STAR, "reduced pressure <i>p</i>* = <i>p</i> / Δ<i>σ</i>",
         "reduced pressure p* = p / Δσ"),
        (LABELS["u_g"], "mean gap <i>u</i><sub>g</sub> / <i>h</i><sub>std</sub>",
         "mean gap u_g / h_std"),
        (r"$C(q)$ (m$^4$)", "<i>C</i>(<i>q</i>) (m⁴)", "C(q) (m⁴)"),
        (r"$q$ (m$^{-1}$)", "<i>q</i> (m⁻¹)", "q (m⁻¹)"),
        (r"a \$ < b", "a $ &lt; b", "a $ < b"),
    ],
)  # fmt: skip
def test_labels_are_typeset_as_in_the_static_figure(label, html, plain):
    assert (html_label(label), plain_label(label)) == (html, plain)
