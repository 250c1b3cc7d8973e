"""The records of `gfmd analyze --json`: one for each solved pressure."""

from typing import Any

from gfmd_cli.analysis.compare import VARIANTS, Comparison
from gfmd_cli.analysis.ensemble import ensembles
from gfmd_cli.analysis.export import parameter_names
from gfmd_cli.analysis.table import plain
from gfmd_cli.analysis.tables import IN_TABLE
from gfmd_cli.physics.observables import QUANTITIES

KEYS = (
    "n", "thickness", "points", "seed", "p_star",
    "a_r", "a_r_persson", "sigma_p", "sigma_p_persson", "u_g", "u_g_persson",
    "p_star_persson_at_u_g", "surface", "elastomer", "pressure", "residual", "status", "warnings",
)  # fmt: skip
"""Keys of every record; others follow where they apply."""
ERRORS = [
    f"{name}_{what}"
    for name in QUANTITIES
    for what in ("error", "continuum", "continuum_error", "verdict")
]


def as_records(comparison: Comparison) -> list[dict[str, Any]]:
    """One record for each solved pressure, as JSON has it; what does not apply is None."""
    means = {
        row["task"]: ensemble.means() for ensemble in ensembles(comparison) for row in ensemble.rows
    }
    records = []
    parameters = parameter_names([row for curve in comparison.curves for row in curve.rows])
    for curve in comparison.curves:
        areas = [*VARIANTS, *VARIANTS.values()] if curve.stores(VARIANTS.values()) else []
        optional = [each.column.name for each in IN_TABLE if curve.stores([each.column.name])]
        keys = [*KEYS, *parameters, *ERRORS, *areas, *optional]
        if not curve.has_theory:
            keys = [key for key in keys if "persson" not in key]
        for row in curve.records:
            record = {key: plain(row[key]) for key in keys}
            records.append(record | means.get(row["task"], {}))
    return records
