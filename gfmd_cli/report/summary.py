"""The top of the page: what was run, whether it converged, the key numbers."""

import math
from collections import Counter
from urllib.parse import quote

from gfmd_cli.analysis.compare import in_continuum, load_of, solver_of
from gfmd_cli.analysis.export import csv_text
from gfmd_cli.analysis.selection import grouped
from gfmd_cli.analysis.table import known
from gfmd_cli.analysis.tables import warnings_in
from gfmd_cli.analysis.wording import grid_size, in_si, pretty, span, with_unit
from gfmd_cli.physics.error_estimates import Verdict
from gfmd_cli.physics.observables import MAIN_OBSERVABLES
from gfmd_cli.report.data import ReportData
from gfmd_cli.study.column import Row
from gfmd_cli.units import count, duration

MAX_GAP_RATIO_P_STAR = 0.5  # above, the gap falls by decades, and a ratio of gaps tells little
SECONDS = 120  # below, a time is given with three digits
MAX_CSV = 1_000_000  # bytes of the table of a study in its page; a larger one is for gfmd export
UNQUOTED = " ,;:()*/=@+"
MAX_NAMES = 3  # elastomers and surfaces that the headline names
UNRESOLVED = [verdict for verdict in Verdict if not verdict.has_error]


KeyNumber = tuple[str, str, str]
"""Name, value and note of one number."""


def headline(data: ReportData) -> str:
    """What was run, in one sentence; the range of the pressures is that of the solved contacts."""
    rows, solved = data.comparison.rows, data.solved
    surfaces = list(dict.fromkeys(str(row["ensemble"]) for row in rows))
    elastomers = list(dict.fromkeys(str(row["elastomer"]) for row in rows))
    seeds = len({row["seed"] for row in rows if known(row["seed"])})
    curves = grouped(rows, lambda row: (row["scene"], *solver_of(row)))
    pressures = max(len(set(map(load_of, curve))) for curve in curves.values())
    pascals = f" ({_si_span(solved, 'pressure', 'Pa')})" if data.in_si("Pa") else ""
    return (
        f"{count(len(rows), 'contact')}: {_names_of(elastomers, 'elastomer')}, "
        f"{_names_of(surfaces, 'surface')}, {count(seeds, 'seed') + ', ' if seeds > 1 else ''}"
        f"{count(pressures, 'pressure')}, p* = {_span(solved, 'p_star')}{pascals}"
        f"{' so far' if data.comparison.missing else ''}, {grid_size(solved)}."
    )


def _names_of(names: list[str], what: str) -> str:
    if len(names) == 1:
        return f"{what} {names[0]}"
    listed = f" ({', '.join(names[:-1])} and {names[-1]})" if len(names) <= MAX_NAMES else ""
    return count(len(names), what) + listed


def success(data: ReportData) -> str:
    """Statement that all contacts have converged; empty if some have not."""
    if data.not_converged or data.comparison.missing:
        return ""
    total = len(data.comparison.rows)
    return f"All {total} contacts converged." if total > 1 else "The contact converged."


def key_numbers(data: ReportData) -> list[KeyNumber]:
    """The most important numbers, in SI units where those mean something, else reduced."""
    rows = data.solved
    tolerances = f"natural residual, tolerance: {_span(rows, 'tolerance')}"
    seconds = sum(value for value in _column(rows, "seconds") if math.isfinite(value))
    time = with_unit(seconds, "s") if seconds < SECONDS else duration(seconds)
    return [
        *_quantities(data),
        *_theory_numbers(data),
        ("Largest residual", pretty(max(_column(rows, "residual"))), tolerances),
        ("Time", time, "solving, summed over contacts"),
    ]


def _quantities(data: ReportData) -> list[KeyNumber]:
    """Pressure, area, gap and stress; in SI units with the scales behind them, or reduced."""
    rows = data.comparison.records
    p_star = _span(rows, "p_star")
    note = f"a_r, share of the nominal area{_continuum_note(rows, 'a_r')}"
    pressure = ("Pressure", p_star, "p*, in units of Delta_sigma")
    scales: list[KeyNumber] = []
    if data.in_si("Pa"):
        pascals = _si_span(rows, "pressure", "Pa")
        pressure = ("Pressure", pascals, f"p* = {p_star}{_si_note(rows, 'Pa')}")
        scales = [("Unit of stress", _si_span(rows, "delta_sigma", "Pa"), _unit_note(rows))]
    if data.in_si("m"):
        side = f"rms height h_std, side {_si_span(rows, 'length', 'm')}"
        scales.append(("Roughness", _si_span(rows, "h_std", "m"), side))
    return [
        pressure,
        ("Contact area", _span(rows, "a_r_best"), note),
        _scaled(data, "Mean gap", "u_g"),
        _scaled(data, "Stress deviation", "sigma_p"),
        *scales,
    ]


def _unit_note(rows: list[Row]) -> str:
    """What Delta_sigma is: of a slab it is that of the half-space with the same modulus."""
    note = "Delta_sigma, rms stress in full contact"
    slabs = any(row["elastomer_kind"] == "slab" for row in rows)
    return f"{note}; of a slab that of the half-space" if slabs else note


def _scaled(data: ReportData, title: str, name: str) -> KeyNumber:
    """A quantity that has a reduced unit; in SI units where those mean something."""
    symbol, unit_column, unit = MAIN_OBSERVABLES[name]
    rows = data.comparison.records
    reduced, where = _column(rows, f"{name}_best"), _continuum_note(rows, name)
    if not data.in_si(unit):
        return title, span(reduced), f"{symbol}{where}"
    values = [
        value * row[unit_column]
        for value, row in zip(reduced, rows, strict=True)
        if in_si(row, unit)
    ]
    note = f"{symbol} = {span(reduced)}{where}{_si_note(rows, unit)}"
    return title, span(values, unit), note


def _theory_numbers(data: ReportData) -> list[KeyNumber]:
    """Simulation over theory, where the theory applies."""
    if not data.comparison.has_theory:
        return []
    area, gap = (_continuum_note(data.solved, name) for name in ("a_r", "u_g"))
    up_to = f"u_g up to p* = {MAX_GAP_RATIO_P_STAR}{gap}"
    numbers = [
        ("Area / Persson theory", _ratios(data, "a_r", math.inf), f"a_r{area}"),
        ("Gap / Persson theory", _ratios(data, "u_g", MAX_GAP_RATIO_P_STAR), up_to),
    ]
    return [(title, span(ratios), note) for title, ratios, note in numbers if ratios]


def _continuum_note(rows: list[Row], name: str) -> str:
    """Whether the values are those of the continuum; empty where none is."""
    are_known = [in_continuum(row, name) for row in rows]
    if not any(are_known):
        return ""
    return ", in the continuum" + ("" if all(are_known) else " where known")


def _ratios(data: ReportData, name: str, limit: float) -> list[float]:
    """Simulation over theory at reduced pressures up to `limit`."""
    return [
        record[f"{name}_best"] / record[f"{name}_persson"]
        for record in data.comparison.records
        if record[f"{name}_persson"] > 0 and record["p_star"] <= limit
    ]


def _column(rows: list[Row], name: str) -> list[float]:
    return [float(row[name]) for row in rows]


def _span(rows: list[Row], name: str) -> str:
    return span(_column(rows, name))


def _si_span(rows: list[Row], name: str, unit: str) -> str:
    """The span of a column in SI units, of the contacts in which these mean something."""
    return span(_column([row for row in rows if in_si(row, unit)], name), unit)


def _si_note(rows: list[Row], unit: str) -> str:
    """How many contacts have values in SI units, if not all have them."""
    number = sum(in_si(row, unit) for row in rows)
    return "" if number == len(rows) else f"; in {unit}: {number} of {len(rows)} contacts"


def csv_address(data: ReportData) -> str:
    """The table of a study as the address of a link; empty if it is too large for a page."""
    csv = csv_text(data.solved)
    return f"data:text/csv;charset=utf-8,{quote(csv, UNQUOTED)}" if len(csv) < MAX_CSV else ""


def warnings(data: ReportData) -> list[str]:
    """Warnings above the results: missing, doubtful and unresolved values."""
    total, missing, parts = len(data.comparison.rows), len(data.comparison.missing), []
    if data.not_converged:
        missed = Counter(row["status"].shortfall for row in data.not_converged)
        contacts = count(total, "contact")
        parts += [f"{number} of {contacts}: {what}" for what, number in missed.items()]
    if missing:
        be, have = ("is", "has") if missing == 1 else ("are", "have")
        parts.append(f"{missing} of {total} {be} not solved yet or {have} failed")
    unsolved = ["; ".join(parts) + "."] if parts else []
    return [*unsolved, *warnings_in(data.solved), *_unresolved(data)]


def _unresolved(data: ReportData) -> list[str]:
    """A line for each quantity that has no continuum value though one was asked for."""
    counts = Counter(
        (name, row[f"{name}_verdict"])
        for name in MAIN_OBSERVABLES
        for row in data.solved
        if row[f"{name}_verdict"] in UNRESOLVED
    )
    total = count(len(data.solved), "contact")
    return [
        f"{name} {Verdict(text).explanation} ({number} of {total})"
        for (name, text), number in counts.items()
    ]
