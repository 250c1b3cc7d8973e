"""The top of the page: what was run, whether it converged, the key numbers; what failed."""

import math
from collections import Counter
from typing import NamedTuple

from gfmd_cli.analysis.compare import Row, best, in_continuum
from gfmd_cli.analysis.grid_size import grid_size
from gfmd_cli.analysis.run_summary import edge_warnings
from gfmd_cli.analysis.table import Column, Group, Record, Table
from gfmd_cli.analysis.tables import P_STAR, RESIDUAL, STATUS, warnings_in
from gfmd_cli.analysis.units import count, listed, pretty, quantity, span
from gfmd_cli.physics.observables import QUANTITIES
from gfmd_cli.report.data import ReportData
from gfmd_cli.report.section import Section
from gfmd_cli.status import Status
from gfmd_cli.units import duration

NEARLY_FULL = 0.5  # p*; above, the gap falls by decades, and a ratio of gaps tells little
SECONDS = 120  # below, a time is given with three digits
MAX_NAMES = 3  # elastomers and surfaces that the headline names
UNRESOLVED = {
    "slow": "converges too slowly with the grid for a value in the continuum",
    "diverges": "has no value in the continuum",
    "unknown": "has no error bar: the grids are too coarse for one",
}
"""Verdicts on a quantity that leave it without an error bar."""
CONVERGED = "The contact converged."
MAX_ROWS = 100  # contacts that the table of failures lists
UNCONVERGED = (
    Column("task", "task", "d"),
    Column("body", "elastomer"),
    Column("surface", "surface"),
    P_STAR,
    STATUS,
    RESIDUAL,
    Column("tolerance", "tolerance", ".1e"),
    Column("steps", "steps", "d"),
    Column("reason", lambda row: _reason(row)),
)


class Verdict(NamedTuple):
    """Whether all contacts are solved, in words."""

    good: bool
    text: str


class KeyNumber(NamedTuple):
    """One number of the summary."""

    name: str
    value: str
    note: str


def headline(data: ReportData) -> str:
    """What was run, in one sentence."""
    rows, curves = data.solved, data.comparison.curves
    surfaces = list(dict.fromkeys(str(row["ensemble"]) for row in rows))
    elastomers = list(dict.fromkeys(str(row["elastomer"]) for row in rows))
    seeds = len({row["seed"] for row in rows})
    pascals = span(_column(rows, "pressure"), "Pa")
    pressures = count(max(len(curve.rows) for curve in curves), "pressure")
    return (
        f"{count(len(data.rows), 'contact')}: {_some(elastomers, 'elastic body')} on "
        f"{_some(surfaces, 'surface')}, {count(seeds, 'seed') + ', ' if seeds > 1 else ''}"
        f"{pressures} from p* = {span(_column(rows, 'p_star'))}"
        f"{f' ({pascals})' if data.in_si else ''}, {grid_size(rows)}."
    )


def _some(names: list[str], what: str) -> str:
    if len(names) == 1:
        return f"the {what} {names[0]}"
    return count(len(names), what) + (f" ({listed(names)})" if len(names) <= MAX_NAMES else "")


def verdict(data: ReportData) -> Verdict:
    """Whether every contact is solved to its tolerance."""
    total, missing = len(data.rows), len(_missing(data))
    failed = sum(row["status"] != Status.CONVERGED for row in data.solved)
    parts = []
    if failed:
        parts.append(f"{failed} of {total} contacts did not reach their tolerance")
    if missing:
        parts.append(f"{missing} of {total} are not solved yet")
    if parts:
        return Verdict(False, "; ".join(parts) + ".")
    return Verdict(True, f"All {total} contacts converged." if total > 1 else CONVERGED)


def key_numbers(data: ReportData) -> list[KeyNumber]:
    """The most important numbers, in SI units where those mean something, else reduced."""
    rows = data.solved
    tolerances = span(_column(rows, "tolerance"))
    return [
        *_quantities(data),
        *_theory_numbers(data),
        KeyNumber(
            "Largest residual",
            pretty(max(_column(rows, "residual"))),
            f"natural residual, tolerance: {tolerances}",
        ),
        KeyNumber("Time", _time(rows), "solving, summed over contacts"),
    ]


def _quantities(data: ReportData) -> list[KeyNumber]:
    """Pressure, area, gap and stress; in SI units with the scales behind them, or reduced."""
    rows = data.solved
    p_star, full = span(_column(rows, "p_star")), span(_column(rows, "delta_sigma"), "Pa")
    gap, deviation = (span(_best(rows, name)) for name in ("u_g", "sigma_p"))
    gap_where, deviation_where = (_where(rows, name) for name in ("u_g", "sigma_p"))
    note = f"a_r, share of the nominal area{_where(rows, 'a_r')}"
    area = KeyNumber("Contact area", span(_best(rows, "a_r")), note)
    if not data.in_si:
        return [
            KeyNumber("Pressure", p_star, "p*, in units of Delta_sigma"),
            area,
            KeyNumber("Mean gap", gap, f"u_g / h_std{gap_where}"),
            KeyNumber("Stress deviation", deviation, f"sigma_p / Delta_sigma{deviation_where}"),
        ]
    return [
        KeyNumber("Pressure", span(_column(rows, "pressure"), "Pa"), f"p* = {p_star}"),
        area,
        KeyNumber(
            "Mean gap", span(_best(rows, "u_g", "h_std"), "m"), f"u_g / h_std = {gap}{gap_where}"
        ),
        KeyNumber(
            "Stress deviation",
            span(_best(rows, "sigma_p", "delta_sigma"), "Pa"),
            f"sigma_p / Delta_sigma = {deviation}{deviation_where}",
        ),
        KeyNumber("Stress in full contact", full, "rms Delta_sigma"),
        KeyNumber(
            "Roughness",
            span(_column(rows, "h_std"), "m"),
            f"rms height h_std, side {span(_column(rows, 'length'), 'm')}",
        ),
    ]


def _theory_numbers(data: ReportData) -> list[KeyNumber]:
    """Simulation over theory, where the theory applies."""
    if not data.comparison.has_theory:
        return []
    rows = data.solved
    return [
        KeyNumber(
            "Area / Persson theory", _ratios(data, "a_r", math.inf), f"a_r{_where(rows, 'a_r')}"
        ),
        KeyNumber(
            "Gap / Persson theory",
            _ratios(data, "u_g", NEARLY_FULL),
            f"u_g up to p* = {NEARLY_FULL}{_where(rows, 'u_g')}",
        ),
    ]


def _best(rows: list[Row], name: str, unit: str = "") -> list[float]:
    """A quantity in the continuum where that is known, in its unit or times that column."""
    return [best(row, name)[0] * (row[unit] if unit else 1.0) for row in rows]


def _where(rows: list[Row], name: str) -> str:
    """Whether the values are those of the continuum; empty where none is."""
    known = [in_continuum(row, name) for row in rows]
    if not any(known):
        return ""
    return ", in the continuum" + ("" if all(known) else " where known")


def _time(rows: list[Row]) -> str:
    seconds = sum(value for value in _column(rows, "seconds") if math.isfinite(value))
    return quantity(seconds, "s") if seconds < SECONDS else duration(seconds)


def _ratios(data: ReportData, name: str, most: float) -> str:
    """Simulation over theory at reduced pressures up to `most`."""
    return span(
        simulated / theory
        for curve in data.comparison.curves
        for p_star, simulated, theory in zip(
            curve.column("p_star"),
            curve.best(name)[0],
            getattr(curve.prediction, name),
            strict=True,
        )
        if theory > 0 and p_star <= most
    )


def _column(rows: list[Row], name: str) -> list[float]:
    return [float(row[name]) for row in rows]


def warnings(data: ReportData) -> list[str]:
    """What stands before any result: what failed, is doubtful or not resolved, the edges."""
    told = verdict(data)
    failed = [] if told.good else [told.text]
    return [*failed, *warnings_in(data.solved), *_unresolved(data), *edge_warnings(data.solved)]


def _unresolved(data: ReportData) -> list[str]:
    """A line for each quantity that has no continuum value though one was asked for."""
    counts = Counter(
        (name, row[f"{name}_verdict"])
        for name in QUANTITIES
        for row in data.solved
        if row[f"{name}_verdict"] in UNRESOLVED
    )
    total = len(data.solved)
    return [
        f"{name} {UNRESOLVED[found]} ({number} of {total} contacts)"
        for (name, found), number in counts.items()
    ]


def failures(data: ReportData) -> Section | None:
    """Contacts that are not converged or missing."""
    failed = [row for row in data.solved if row["status"] != Status.CONVERGED]
    missing = _missing(data)
    if not (failed or missing):
        return None
    caption = (
        "Contacts that ended above the requested tolerance. Their values are kept; figures show "
        "them as crosses."
    )
    left_out = len(failed) > MAX_ROWS
    return Section(
        "What failed or is missing",
        notes=[f"The first {MAX_ROWS} of {len(failed)} are listed."] if left_out else [],
        template="failures.html",
        content={
            "unconverged": Table(caption, UNCONVERGED, [Group("", failed[:MAX_ROWS])]),
            "missing": count(len(missing), "contact") if missing else "",
            "tasks": ", ".join(missing[:MAX_ROWS]) + (", ..." if len(missing) > MAX_ROWS else ""),
        },
    )


def _reason(row: Record) -> str:
    """Why a contact is not converged; empty for a status that is unknown."""
    return Status(row["status"]).explain(row) if row["status"] in list(Status) else ""


def _missing(data: ReportData) -> list[str]:
    return [str(row["task"]) for row in data.rows if row["status"] == Status.MISSING]
