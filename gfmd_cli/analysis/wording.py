"""Contacts, values in SI units and sizes of grids in words."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gfmd_cli.analysis.table import Record, TableColumn, value_in
from gfmd_cli.grid.arrays import Field
from gfmd_cli.units import LARGEST_RMS_HEIGHT, scaled

SPACE = "\u00a0"
"""No-break space."""
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def largest(values: Field) -> float:
    """The largest finite value, at least zero."""
    return float(np.max(values, initial=0.0, where=np.isfinite(values)))


def in_si(row: Mapping[str, Any], unit: str) -> bool:
    """Whether values of a contact in this unit mean something, and not reduced units alone.

    They do where the load was given in Pa, or where the surface has heights of a real one. In the
    second case, a unit with Pa also needs an elastomer whose stiffness the spec gives.
    """
    if row["load"] == "pressure":
        return True
    is_given = row["stiffness_given"] == 1
    return bool(row["h_std"] <= LARGEST_RMS_HEIGHT and (is_given or "Pa" not in unit))


def shown(columns: Sequence[TableColumn], rows: Sequence[Record]) -> list[TableColumn]:
    """The columns without those in SI units where these mean nothing in any row.

    Cells in SI units are blank in the rows where these mean nothing.
    """
    return [
        _in_si_only(column) if column.unit else column
        for column in columns
        if not column.unit or any(in_si(row, column.unit) for row in rows)
    ]


def _in_si_only(column: TableColumn) -> TableColumn:
    """A column in SI units, blank in the rows where these mean nothing."""
    return replace(
        column,
        value=lambda row: value_in(row, column.value) if in_si(row, column.unit) else None,
    )


def pressure_text(row: Mapping[str, Any]) -> str:
    """The pressure of a contact, reduced and, where that means something, in Pa."""
    return f"p* = {row['p_star']:.4g}" + (
        f" ({with_unit(row['pressure'], 'Pa')})" if in_si(row, "Pa") else ""
    )


def with_unit(value: float, unit: str) -> str:
    """A value with its unit."""
    divisor, prefixed = scaled(abs(value), unit)
    return f"{pretty(value / divisor)}{SPACE}{prefixed}"


def pretty(value: float) -> str:
    """A number with three digits and a power of ten."""
    if not math.isfinite(value):
        return "–"
    mantissa, _, power = f"{value:.3g}".partition("e")
    if not power:
        return mantissa
    return f"{mantissa}{SPACE}×{SPACE}10{str(int(power)).translate(RAISED)}"


def span(values: Iterable[float], unit: str = "") -> str:
    """From the least to the largest of the finite values."""
    finite = [value for value in values if math.isfinite(value)]
    if not finite:
        return "unknown"
    least, most = min(finite), max(finite)
    low, high = (with_unit(end, unit) if unit else pretty(end) for end in (least, most))
    if low == high:
        return low
    bare, _, low_unit = low.rpartition(SPACE)
    shares_unit = unit and (high.endswith(SPACE + low_unit) or least == 0)
    return f"{bare if shares_unit else low} to {high}"


def contact_title(row: Mapping[str, Any], *, of_seeds: bool = False) -> str:
    """Elastomer and surface of a contact; `of_seeds`: the surface without its seed."""
    return f"{row['elastomer']} on {row['ensemble' if of_seeds else 'surface']}"


def contact_and_boundary(row: Mapping[str, Any], *, of_seeds: bool = False) -> str:
    """A contact as `contact_title` names it, and its boundary where that is free."""
    free = ", free boundary" if row.get("boundary") == "free" else ""
    return contact_title(row, of_seeds=of_seeds) + free


def points_text(points: int, points_y: int) -> str:
    """Points of a grid: "256", or "256 x 128" along x and y; of a line those along x."""
    return str(points) if points_y in (1, points) else f"{points} x {points_y}"


def grid_size(rows: Sequence[Mapping[str, Any]]) -> str:
    """Points of the grids of some rows, from the coarsest to the finest.

    "256 points a side"; of an oblong grid "256 x 128 points" along x and y; of a line "256 points";
    of both "256 points (line contacts), 64 points a side (surfaces)". A free boundary is named
    before them, if all rows have it.
    """
    lines = [row for row in rows if row["points_y"] == 1]
    if 0 < len(lines) < len(rows):
        areas = [row for row in rows if row["points_y"] != 1]
        return f"{grid_size(lines)} (line contacts), {grid_size(areas)} (surfaces)"
    sizes = sorted({(int(row["points"]), int(row["points_y"])) for row in rows})
    is_square = all(points == points_y for points, points_y in sizes)
    texts = [str(x) if lines or is_square else f"{x} x {y}" for x, y in sizes]
    size = texts[0] if len(texts) == 1 else f"{texts[0]} to {texts[-1]}"
    free = "free boundary, " if all(row.get("boundary") == "free" for row in rows) else ""
    return f"{free}{size} points{' a side' if is_square else ''}"
