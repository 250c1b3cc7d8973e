"""Tables of a study: for people, as records."""

import math
from typing import Any

from gfmd_cli.analysis.compare import (
    Comparison,
    Curve,
    Row,
    best,
    einstein_prediction,
    in_continuum,
)
from gfmd_cli.analysis.ensemble import Ensemble, ensembles
from gfmd_cli.analysis.export import plain
from gfmd_cli.analysis.further import further_records, further_tables
from gfmd_cli.analysis.true_contact import VARIANTS, true_contact_areas, true_contact_tables
from gfmd_cli.physics.observables import QUANTITIES

ERRORS = [
    f"{name}_{what}"
    for name in QUANTITIES
    for what in ("error", "continuum", "continuum_error", "verdict")
]
"""Columns of records where an accuracy was asked for."""
HEADER = (
    "      p*        a_r  Persson  ratio    sigma_p  Persson  ratio        u_g    Persson  ratio"
    "  p ratio  status"
)


def tables(comparison: Comparison) -> str:
    """One table per curve: simulation, Persson theory, their ratio.

    `p ratio` is the pressure of the theory at the simulated mean gap over the simulated one.
    """
    blocks = [_table(curve) for curve in comparison.curves]
    blocks += true_contact_tables(comparison)
    blocks += further_tables(comparison)
    blocks += _spreads(ensembles(comparison))
    if comparison.missing:
        blocks.append(f"{comparison.missing} tasks are not solved yet: run the spec again.")
    return "\n\n".join(blocks)


def _table(curve: Curve) -> str:
    row = curve.rows[0]
    theory = curve.prediction
    extrapolated = any(row.get(f"{name}_verdict") for row in curve.rows for name in QUANTITIES)
    lines = [
        f"{curve.elastomer} on {curve.surface}, {_points(curve)} points a side",
        f"Delta_sigma = {row['delta_sigma']:.6g} Pa, h_std = {row['h_std']:.6g} m, "
        f"L = {row['length']:.6g} m",
        *([row["preparation"]] if row.get("preparation") else []),
        *(["  counted on the grid:"] if extrapolated else []),
        HEADER,
    ]
    at_gap = curve.pressure_at_gap(curve.column("u_g"))
    for i, row in enumerate(curve.rows):
        a_r, sigma_p, u_g = theory.a_r[i], theory.sigma_p[i], theory.u_g[i]
        lines.append(
            f"{row['p_star']:8.4g} {row['a_r']:10.5f} {a_r:8.5f} {_ratio(row['a_r'], a_r)} "
            f"{row['sigma_p']:10.5f} {sigma_p:8.5f} {_ratio(row['sigma_p'], sigma_p)} "
            f"{row['u_g']:10.4g} {u_g:10.4g} {_ratio(row['u_g'], u_g)} "
            f"{_ratio(at_gap[i], row['p_star'])}   {row['status']}"
        )
    if curve.n == 0:
        exact = einstein_prediction(curve.column("p_star"))
        lines.append("  Gaussian heights in closed form (ratio: simulation / closed form):")
        lines += [
            f"{row['p_star']:8.4g} {'':10} {exact.a_r[i]:8.5f} {_ratio(row['a_r'], exact.a_r[i])} "
            f"{'':10} {exact.sigma_p[i]:8.5f} {_ratio(row['sigma_p'], exact.sigma_p[i])} "
            f"{'':10} {exact.u_g[i]:10.4g} {_ratio(row['u_g'], exact.u_g[i])}"
            for i, row in enumerate(curve.rows)
        ]
    if extrapolated:
        lines += _continuum(curve)
    return "\n".join(lines)


def _points(curve: Curve) -> str:
    sizes = sorted({int(row["points"]) for row in curve.rows})
    return str(sizes[0]) if len(sizes) == 1 else f"{sizes[0]} to {sizes[-1]}"


def _continuum(curve: Curve) -> list[str]:
    """Continuum values with their errors, or what keeps them from having one."""
    lines = ["  in the continuum:", "      p*  points" + _centred("a_r", "sigma_p", "u_g")]
    for row in curve.rows:
        cells = [continuum_cell(row, name) for name in QUANTITIES]
        lines.append(f"{row['p_star']:8.4g} {row['points']:7d}" + _centred(*cells))
    return lines


def continuum_cell(row: Row, name: str) -> str:
    """The continuum value of a quantity with its error, or what keeps it from having one."""
    return plus_minus(*best(row, name)) if in_continuum(row, name) else str(row[f"{name}_verdict"])


def _spreads(found: list[Ensemble]) -> list[str]:
    """One table per body: means over seeds, with the half-width of the 95 % interval."""
    blocks: dict[str, list[str]] = {}
    for ensemble in found:
        head = f"{ensemble.title}: mean of {len(ensemble.rows)} seeds +- 95 % confidence"
        lines = blocks.setdefault(head, [head, "      p*" + _centred(*QUANTITIES)])
        spreads = [ensemble.spread(name) for name in QUANTITIES]
        cells = [plus_minus(spread.mean, spread.half_width) for spread in spreads]
        lines.append(f"{ensemble.rows[0]['p_star']:8.4g}" + _centred(*cells))
    return ["\n".join(lines) for lines in blocks.values()]


def _centred(*cells: str) -> str:
    return "".join(f"{cell:>24}" for cell in cells)


def plus_minus(value: float, error: float) -> str:
    """A value and its error, as many digits as the error has meaning."""
    if not error > 0:
        return f"{value:.6g}"
    digits = max(0, 1 - math.floor(math.log10(error)))
    return f"{value:.{min(digits, 12)}f} +- {error:.2g}"


def _ratio(value: float, reference: float) -> str:
    ratio = value / reference if reference else math.nan
    return f"{ratio:6.3f}" if math.isfinite(ratio) else "     -"


def as_records(comparison: Comparison) -> list[dict[str, Any]]:
    """One record per solved pressure; what does not apply is None."""
    records = []
    spreads = {
        row["task"]: _as_record(ensemble)
        for ensemble in ensembles(comparison)
        for row in ensemble.rows
    }
    for curve in comparison.curves:
        theory = curve.prediction
        at_gap = curve.pressure_at_gap(curve.column("u_g"))
        areas = true_contact_areas(curve)
        further = further_records(curve)
        records += [
            {
                **{key: plain(row[key]) for key in ("n", "thickness", "points", "seed", "p_star")},
                "a_r": row["a_r"],
                "a_r_persson": float(theory.a_r[i]),
                "sigma_p": row["sigma_p"],
                "sigma_p_persson": float(theory.sigma_p[i]),
                "u_g": row["u_g"],
                "u_g_persson": float(theory.u_g[i]),
                "p_star_persson_at_u_g": plain(float(at_gap[i])),
                "surface": curve.surface,
                "elastomer": curve.elastomer,
                "pressure": row["pressure"],
                "residual": row["residual"],
                "status": row["status"],
                **{name: plain(row[name]) for name in ERRORS if name in row},
                **{name: plain(row[name]) for name in VARIANTS if areas},
                **{name: plain(float(area[i])) for name, area in areas.items()},
                **further[i],
                **spreads.get(row["task"], {}),
            }
            for i, row in enumerate(curve.rows)
        ]
    return records


def _as_record(ensemble: Ensemble) -> dict[str, Any]:
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
