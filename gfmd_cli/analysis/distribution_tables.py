"""What is known of Pr(sigma) in the continuum: tables for people, records for programs."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.analysis.compare import Comparison, compare
from gfmd_cli.analysis.distribution import Distribution, distributions
from gfmd_cli.analysis.edge_law import Fit, fit
from gfmd_cli.analysis.tables import plus_minus
from gfmd_cli.physics.observables import logarithmic_edges

LAWS = ("small", "large")
HEADER = (
    "      p*      a_r  grids           seeds  stress   sigma from     to         exponent"
    "        at the edge   theory  prefactor"
)


def distribution_table(study: Path | Comparison) -> str:
    """The power laws of Pr(sigma), one line each; empty where no contact has two grids.

    `exponent` is that of the window, `at the edge` that beside a first departure from a power law,
    `theory` that of the stress at the edge of a contact, n / (2 - n).
    """
    blocks: dict[str, list[str]] = {}
    for found in _found(study):
        lines = blocks.setdefault(found.scene, [f"Pr(sigma) of {found.scene}", HEADER])
        fits = [law for law in (fit(found, name) for name in LAWS) if law is not None]
        lines += [_line(found, law) for law in fits]
        if not fits:
            lines.append(_head(found) + "  no power law: too few bins are resolved")
    return "\n\n".join("\n".join(lines) for lines in blocks.values())


def distribution_records(study: Path | Comparison) -> list[dict[str, Any]]:
    """One record per contact and pressure: Pr(sigma) bin by bin, and its power laws."""
    edges = logarithmic_edges()
    records = []
    for found in _found(study):
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
                "n": _plain(found.curve.n),
                "p_star": found.finest["p_star"],
                "a_r": found.a_r,
                "points": found.points,
                "seeds": len(found.seeds),
                "bins": {name: part[known].tolist() for name, part in parts.items()},
                "fits": {name: _as_record(law) for name, law in fits.items() if law is not None},
            }
        )
    return records


def _found(study: Path | Comparison) -> list[Distribution]:
    return distributions(study if isinstance(study, Comparison) else compare(study))


def _head(found: Distribution) -> str:
    grids = f"{found.points[0]} to {found.points[-1]}"
    return f"{found.finest['p_star']:8.4g} {found.a_r:8.4f}  {grids:14} {len(found.seeds):6d}"


def _line(found: Distribution, law: Fit) -> str:
    edge = "-" if math.isnan(law.limit) else plus_minus(law.limit, law.limit_error)
    theory = "-" if math.isnan(law.theory) else f"{law.theory:.3g}"
    return (
        f"{_head(found)}  {law.law:8} {law.window[0]:8.3g} {law.window[1]:8.3g} "
        f"{plus_minus(law.exponent, law.error):>18} {edge:>18} {theory:>8} {law.prefactor:10.3g}"
    )


def _as_record(law: Fit) -> dict[str, Any]:
    return {
        "sigma_from": law.window[0],
        "sigma_to": law.window[1],
        "exponent": law.exponent,
        "exponent_error": law.error,
        "prefactor": law.prefactor,
        "prefactor_relative_error": law.prefactor_error,
        "edge_exponent": _plain(law.limit),
        "edge_exponent_error": _plain(law.limit_error),
        "edge_exponent_theory": _plain(law.theory),
        "edge_prefactor": _plain(law.edge_prefactor),
    }


def _plain(value: float) -> float | None:
    """None for what does not apply."""
    return value if math.isfinite(value) else None
