"""A table is declared once; text and cells follow from the declaration."""

from math import inf, nan

import pytest

from gfmd_cli.analysis.run_summary import MAX_ROWS, unconverged
from gfmd_cli.analysis.surface_summary import COLUMNS as SURFACE
from gfmd_cli.analysis.table import Group, Table, TableColumn, plain, plus_minus, ratio
from gfmd_cli.analysis.tables import COMPARISON
from gfmd_cli.analysis.wording import shown
from gfmd_cli.status import Status

COLUMNS = (
    TableColumn("p*", "p_star", ".4g"),
    TableColumn("gap", "gap", unit="m", error="gap_error", otherwise="verdict"),
    TableColumn("ratio\nto theory", ratio("gap", "theory"), ".2f"),
    TableColumn("percolates", "percolates", optional=True),
)


def record(**values):
    return {"p_star": 0.1, "gap": 2.0, "theory": 4.0} | values


def cells(**values):
    return [column.cell(record(**values)) for column in COLUMNS]


def test_a_cell_has_the_format_of_its_column():
    assert cells() == ["0.1", "2.000", "0.50", "-"]
    assert cells(percolates=True)[-1] == "yes"


def test_a_value_is_printed_with_its_error_where_that_is_known():
    assert cells(gap_error=0.1)[1] == "2.00 +- 0.10"
    assert cells(gap_error=nan)[1] == "2.000"


def test_a_remark_follows_a_value_without_error():
    column = TableColumn("gap", "gap", ".3g", error="error", remark=lambda row: row["remark"])
    assert column.cell({"gap": 2.0, "error": nan, "remark": " (grid)"}) == "2 (grid)"
    assert column.cell({"gap": 2.0, "error": 0.1, "remark": " (grid)"}) == "2.00 +- 0.10"
    assert column.cell({"gap": 2.0, "error": nan, "remark": ""}) == "2"


@pytest.mark.parametrize("power", [-12, 0, 9])
def test_ratios_to_the_theory_have_four_digits_however_large(power):
    column = next(column for column in COMPARISON if column.heading == "ratio")
    text = column.cell({"a_r": 1.5, "a_r_persson": 7 * 10.0**-power})
    assert float(text) == pytest.approx(1.5 / 7 * 10.0**power, rel=5e-4, abs=0)
    assert len(text) <= 9


def test_a_skewness_of_zero_has_no_sign():
    (skewness,) = (column for column in SURFACE if column.heading == "Ssk")
    assert skewness.cell({"Ssk": -1e-17}) == "0.000"


def test_an_unknown_value_is_a_dash_or_the_reason():
    assert cells(gap=nan)[1] == "-"
    assert cells(gap=None, theory=0.0, verdict="irregular")[1] == "irregular"
    assert cells(theory=0.0)[2] == "-"


def test_an_optional_column_without_any_value_is_left_out():
    blank = Table("", COLUMNS, [Group("", [record(), record(percolates=None)])])
    assert [column.heading for column in blank.columns] == ["p*", "gap", "ratio\nto theory"]
    filled = Table("", COLUMNS, [Group("", [record(), record(percolates=False)])])
    assert len(filled.columns) == 4


def test_the_text_has_caption_groups_and_aligned_columns():
    groups = [Group("first", [record(), record(p_star=10.0)], ["a note"]), Group("empty", [])]
    assert Table("About gaps.", COLUMNS, groups).as_text().splitlines() == [
        "About gaps.",
        "",
        "first",
        "a note",
        "   p*  gap [m]      ratio",
        "                to theory",
        "  0.1    2.000       0.50",
        "   10    2.000       0.50",
    ]


def test_a_table_without_records_is_no_text():
    assert Table("About gaps.", COLUMNS, [Group("empty", [])]).as_text() == ""


def test_a_column_in_si_units_is_shown_where_it_means_something_in_one_row():
    columns = [TableColumn("p*", "p_star"), TableColumn("p", "pressure", unit="Pa")]
    reduced = {"load": "p_star", "h_std": 1.0, "stiffness_given": 0}
    in_pascal = reduced | {"load": "pressure"}
    assert shown(columns, [reduced, reduced]) == columns[:1]
    both = shown(columns, [reduced, in_pascal])
    assert [column.title for column in both] == ["p*", "p [Pa]"]
    records = (row | {"p_star": 0.1, "pressure": 2.0} for row in (reduced, in_pascal))
    cells = [[column.cell(record) for column in both] for record in records]
    assert cells == [["0.1000", "-"], ["0.1000", "2.000"]]


def test_a_long_list_of_failed_tasks_is_cut():
    rows = [{"task": task, "status": Status.FAILED} for task in range(MAX_ROWS + 2)]
    lines = unconverged(rows, {1: "a reason"})
    assert lines[:2] == ["task 0: an error ended the task", "task 1: a reason"]
    assert lines[MAX_ROWS:] == ["and 2 more tasks"]
    assert len(unconverged(rows[:MAX_ROWS], {})) == MAX_ROWS


def test_json_has_none_for_what_does_not_apply():
    assert [plain(value) for value in (nan, inf, -1, None, 0, 0.0, "")] == [
        None, None, None, None, 0, 0.0, "",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (1.0, inf, "1.000 +- inf"),
        (0.5, 0.0, "0.5"),
        (1e-9, 1e-15, "1.0000000e-09 +- 1.0e-15"),
        (4.2123e-6, 4.9e-7, "4.21e-06 +- 4.9e-07"),
        (-4.2e-6, 5e-5, "-4e-06 +- 5.0e-05"),
        (0.0354, 0.008, "0.0354 +- 0.0080"),
        (0.1, 0.00996, "0.100 +- 0.010"),  # rounded up to another power of ten
        (12345.6, 150.0, "12346 +- 150"),
        (1234567.0, 1500.0, "1.2346e+06 +- 1.5e+03"),
        (0.3, 2e7, "0 +- 2.0e+07"),
        (-0.0004, 0.02, "0.000 +- 0.020"),
    ],
)
def test_errors_of_any_size_can_be_printed(value, error, text):
    assert plus_minus(value, error) == text
