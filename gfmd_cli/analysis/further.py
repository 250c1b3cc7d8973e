"""What was asked for in [output] beside the scalars: columns of a study, as a table and records."""

import math
from typing import Any

from gfmd_cli.analysis.compare import Comparison, Curve, Row

NAMES = ("patches", "patch_area_mean", "patch_area_largest", "stiffness", "leaks_x", "leaks_y")
HEADS = ("patches", "mean area", "largest", "-dp/du_g", "leaks x", "y")


def further_records(curve: Curve) -> list[dict[str, Any]]:
    """The columns that some pressure of the curve has, for each pressure.

    None for what is not known; for an infinite stiffness too, which JSON cannot tell.
    """
    names = [name for name in NAMES if any(_is_known(row, name) for row in curve.rows)]
    return [
        {
            name: row[name] if _is_known(row, name) and math.isfinite(row[name]) else None
            for name in names
        }
        for row in curve.rows
    ]


def further_tables(comparison: Comparison) -> list[str]:
    """One table per curve that has such columns."""
    return [_table(curve) for curve in comparison.curves if further_records(curve)[0]]


def _table(curve: Curve) -> str:
    names = list(further_records(curve)[0])
    heads = [HEADS[NAMES.index(name)] for name in names]
    lines = [
        f"{curve.elastomer} on {curve.surface}: areas / L^2, stiffness / (Delta_sigma / h_std)",
        "      p*        a_r" + "".join(f"{head:>12}" for head in heads),
    ]
    for row in curve.rows:
        cells = "".join(f"{_cell(row, name):>12}" for name in names)
        lines.append(f"{row['p_star']:8.4g} {row['a_r']:10.5f}{cells}")
    return "\n".join(lines)


def _cell(row: Row, name: str) -> str:
    if not _is_known(row, name):
        return "-"
    if name.startswith("leaks"):
        return "yes" if row[name] else "no"
    return f"{row[name]:.5g}"


def _is_known(row: Row, name: str) -> bool:
    """Whether a row has a value in a column: blank are NaN and -1."""
    return not (math.isnan(row[name]) or row[name] == -1)
