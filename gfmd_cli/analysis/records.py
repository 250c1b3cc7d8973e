"""Records of a study: one for each solved pressure, with theory, optional outputs and seeds."""

from typing import Any

import numpy as np

from gfmd_cli.analysis.compare import Comparison, Curve, best, einstein_prediction
from gfmd_cli.analysis.ensemble import Ensemble, ensembles
from gfmd_cli.analysis.export import parameter_names
from gfmd_cli.analysis.table import known, plain
from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.observables import QUANTITIES
from gfmd_cli.physics.true_contact import contact_area
from gfmd_cli.study.observables import OBSERVABLES

KEYS = (
    "n", "thickness", "points", "seed", "p_star",
    "a_r", "a_r_persson", "sigma_p", "sigma_p_persson", "u_g", "u_g_persson",
    "p_star_persson_at_u_g", "surface", "elastomer", "pressure", "residual", "status", "warnings",
)  # fmt: skip
"""Keys of every record of `gfmd analyze --json`; others follow where they apply."""
ERRORS = [
    f"{name}_{what}"
    for name in QUANTITIES
    for what in ("error", "continuum", "continuum_error", "verdict")
]
"""Keys of records where an accuracy was requested."""
OPTIONAL = tuple(observable.column.name for observable in OBSERVABLES if observable.heading)
"""Keys of the observables that [output] turns on."""
VARIANTS = {
    name: f"a_r_persson_{name}" for name in ("deviation_bearing", "deviation_c", "quadrature_c")
}
"""Columns with Delta_sigma over the contact, and the keys of Persson's contact areas with it."""


def records_of(curve: Curve) -> list[dict[str, Any]]:
    """The rows of a curve with Persson theory at each pressure.

    The keys `NAME_best` and `NAME_best_error` hold the continuum value where that is known, else
    the value on the grid.
    """
    columns = {f"{name}_persson": getattr(curve.prediction, name) for name in QUANTITIES}
    columns["p_star_persson_at_u_g"] = curve.pressure_at_gap(curve.column("u_g"))
    columns |= true_contact_areas(curve)
    if curve.n == 0 and curve.has_theory:
        exact = einstein_prediction(curve.column("p_star"))
        columns |= {f"{name}_einstein": getattr(exact, name) for name in QUANTITIES}
    return [
        row | with_best(row) | {name: float(values[i]) for name, values in columns.items()}
        for i, row in enumerate(curve.rows)
    ]


def true_contact_areas(curve: Curve) -> dict[str, Field]:
    """Contact areas over the pressures by the keys of `VARIANTS`; empty where nothing is known."""
    values = {name: curve.column(name) for name in VARIANTS if name in curve.rows[0]}
    if not any(np.any(np.isfinite(value)) for value in values.values()):
        return {}
    p_star = curve.column("p_star")
    return {VARIANTS[name]: contact_area(value, p_star) for name, value in values.items()}


def with_best(row: dict[str, Any]) -> dict[str, Any]:
    """A row with the best value of each quantity and its error."""
    pairs = {name: best(row, name) for name in QUANTITIES}
    values = {f"{name}_best": value for name, (value, _) in pairs.items()}
    return row | values | {f"{name}_best_error": error for name, (_, error) in pairs.items()}


def as_records(comparison: Comparison) -> list[dict[str, Any]]:
    """One record for each solved pressure, as JSON has it; what does not apply is None."""
    means = {
        row["task"]: means_of(ensemble)
        for ensemble in ensembles(comparison)
        for row in ensemble.rows
    }
    records = []
    parameters = parameter_names([row for curve in comparison.curves for row in curve.rows])
    for curve in comparison.curves:
        rows = records_of(curve)
        optional = [name for name in OPTIONAL if any(known(row[name]) for row in rows)]
        areas = [*VARIANTS, *VARIANTS.values()] if rows[0].keys() & set(VARIANTS.values()) else []
        keys = [*KEYS, *parameters, *(key for key in ERRORS if key in rows[0]), *areas, *optional]
        if not curve.has_theory:
            keys = [key for key in keys if "persson" not in key]
        for row in rows:
            record = {key: plain(row[key]) for key in keys}
            records.append(record | means.get(row["task"], {}))
    return records


def means_of(ensemble: Ensemble) -> dict[str, Any]:
    """What all rows of an ensemble share."""
    record: dict[str, Any] = {"seeds": len(ensemble.rows)}
    for name in QUANTITIES:
        spread = ensemble.spread(name)
        record |= {
            f"{name}_mean": spread.mean,
            f"{name}_standard_error": spread.standard_error,
            f"{name}_confidence": spread.half_width,
        }
    return record
