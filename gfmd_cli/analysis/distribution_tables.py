"""Pr(sigma) in the continuum: its power laws as a table, its bins as records."""

from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.analysis.compare import Comparison, compare
from gfmd_cli.analysis.distribution import StressDistribution, distributions
from gfmd_cli.analysis.edge_law import Fit, fit
from gfmd_cli.analysis.table import Column, Group, Record, Table, plain
from gfmd_cli.physics.observables import logarithmic_edges

LAWS = ("small", "large")
POWER_LAWS = (
    Column("p*", "p_star", ".4g"),
    Column("a_r", "a_r"),
    Column("grids", "grids"),
    Column("seeds", "seeds", "d"),
    Column("stress", "law"),
    Column("sigma / Delta_sigma\nfrom", "sigma_from", ".3g"),
    Column("\nto", "sigma_to", ".3g"),
    Column("exponent", "exponent", error="exponent_error"),
    Column("at the edge", "edge_exponent", error="edge_exponent_error"),
    Column("theory", "edge_exponent_theory", ".3g"),
    Column("prefactor", "prefactor", ".3g"),
)


def power_laws(study: Path | Comparison) -> Table:
    """The power laws of Pr(sigma), a record each; without one where no contact has two grids."""
    groups: dict[str, list[Record]] = {}
    for found in _distributions(study):
        record = {
            "p_star": found.finest["p_star"],
            "a_r": found.a_r,
            "grids": f"{found.points[0]} to {found.points[-1]}",
            "seeds": len(found.seeds),
        }
        fits = [law for law in (fit(found, name) for name in LAWS) if law is not None]
        records = [record | {"law": law.law} | _as_record(law) for law in fits]
        groups.setdefault(found.scene, []).extend(
            records or [record | {"law": "too few bins are resolved"}]
        )
    caption = (
        "Power laws of Pr(sigma) in the continuum. exponent: fit between the two stresses; at the "
        "edge: fit with the first correction to the power law; theory: exponent at the edge of a "
        "contact, n / (2 - n)."
    )
    return Table(caption, POWER_LAWS, [Group(title, held) for title, held in groups.items()])


def distribution_records(study: Path | Comparison) -> list[dict[str, Any]]:
    """One record per contact and pressure: Pr(sigma) bin by bin, and its power laws."""
    edges = logarithmic_edges()
    records = []
    for found in _distributions(study):
        known = np.flatnonzero(np.isfinite(found.density))
        parts = {
            "sigma_from": edges[:-1],
            "sigma_to": edges[1:],
            "density": found.density,
            "relative_error": found.error,
            "discretisation": found.extrapolated.discretisation,
            "counting": found.extrapolated.counting,
            "sampling": found.sampling,
        }
        fits = {name: fit(found, name) for name in LAWS}
        records.append(
            {
                "surface": found.surface,
                "elastomer": found.curve.elastomer,
                "n": plain(found.curve.n),
                "p_star": found.finest["p_star"],
                "a_r": found.a_r,
                "points": found.points,
                "seeds": len(found.seeds),
                "bins": {name: part[known].tolist() for name, part in parts.items()},
                "fits": {name: _as_record(law) for name, law in fits.items() if law is not None},
            }
        )
    return records


def _distributions(study: Path | Comparison) -> list[StressDistribution]:
    return distributions(study if isinstance(study, Comparison) else compare(study))


def _as_record(law: Fit) -> dict[str, Any]:
    return {
        "sigma_from": law.window[0],
        "sigma_to": law.window[1],
        "exponent": law.exponent,
        "exponent_error": law.error,
        "prefactor": law.prefactor,
        "prefactor_relative_error": law.prefactor_error,
        "edge_exponent": plain(law.limit),
        "edge_exponent_error": plain(law.limit_error),
        "edge_exponent_theory": plain(law.theory),
        "edge_prefactor": plain(law.edge_prefactor),
    }
