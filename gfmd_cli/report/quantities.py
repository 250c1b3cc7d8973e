"""Sections: contact area, stress deviation and mean gap over pressure; error bars; observables."""

from gfmd_cli.analysis.table import Column, Table
from gfmd_cli.analysis.tables import (
    CONTACT_AREA,
    MEAN_GAP,
    STRESS_DEVIATION,
    continuum_table,
    observables_table,
    over_pressure,
    seeds_table,
    true_contact_table,
)
from gfmd_cli.report.data import ReportData
from gfmd_cli.report.section import Drawing, Section
from gfmd_cli.report.svg import drawing

EXPLANATION = (
    "In this and the next figures over the pressure, symbols are the simulation: in the continuum "
    "with its error where that is known, else on the grid. Bars: estimated distance to the "
    "continuum; crosses: not converged."
)
LINES = " Lines: Persson theory of the same spectrum."
SUMMARY = "Table behind the figures"
FIGURES = {
    "contact_area": "Relative contact area over reduced pressure",
    "contact_area_ratio": "Contact area over that of Persson theory",
    "mean_gap_log": "Mean gap over the logarithm of the reduced pressure",
    "mean_gap_tail": "Logarithm of the mean gap over the reduced pressure",
    "stress_deviation": "Standard deviation of the stress over reduced pressure",
}
"""Figures by name, with what they show."""


def contact_area(data: ReportData) -> Section:
    """Relative contact area."""
    caption = "Relative contact area a_r."
    if data.comparison.has_theory:
        caption = "Relative contact area a_r and Persson theory; ratio: simulation / theory."
    tables = _behind(data, CONTACT_AREA, caption)
    true_contact = true_contact_table(data.curves)
    if true_contact.records:
        tables["Table: Persson theory with the stress over the true contact"] = true_contact
    drawings = _drawings(data, "contact_area", "contact_area_ratio")
    notes = [EXPLANATION + (LINES if data.comparison.has_theory else "")]
    return Section("Contact area", notes=notes, drawings=drawings, tables=tables)


def mean_gap(data: ReportData) -> Section:
    """Mean gap."""
    caption = "Mean gap u_g between the surfaces, over the whole interface."
    drawings = _drawings(data, "mean_gap_log", "mean_gap_tail")
    return Section("Mean gap", drawings=drawings, tables=_behind(data, MEAN_GAP, caption))


def stress_deviation(data: ReportData) -> Section:
    """Standard deviation of the stress."""
    caption = "Standard deviation sigma_p of the stress over the whole interface."
    tables = _behind(data, STRESS_DEVIATION, caption)
    return Section("Stress deviation", drawings=_drawings(data, "stress_deviation"), tables=tables)


def error_bars(data: ReportData) -> Section | None:
    """Continuum values with error bars, and means over seeds."""
    tables = [continuum_table(data.curves), seeds_table(data.comparison)]
    return _visible("Error bars", [table for table in tables if table.records])


def optional_observables(data: ReportData) -> Section | None:
    """The observables that keys of [output] have turned on."""
    table = observables_table(data.curves)
    return _visible("Optional observables", [table] if table.records else [])


def _visible(title: str, tables: list[Table]) -> Section | None:
    return Section(title, template="tables.html", content=tables) if tables else None


def _behind(data: ReportData, columns: tuple[Column, ...], caption: str) -> dict[str, Table]:
    return {SUMMARY: over_pressure(columns, caption, data.curves)}


def _drawings(data: ReportData, *names: str) -> list[Drawing]:
    """The figures of these names that the study has data for."""
    drawings = []
    for name in names:
        if name in data.figures:
            what, figure = FIGURES[name], data.figures[name]
            label = f"{what}: {', '.join(figure.legend)}"
            drawings.append(drawing(figure, name, label, f"{what}."))
    return drawings
