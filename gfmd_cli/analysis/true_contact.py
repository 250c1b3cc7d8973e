"""Persson theory with Delta_sigma over the contact in the place of the whole surface."""

import numpy as np

from gfmd_cli.analysis.compare import Comparison, Curve
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.true_contact import contact_area

VARIANTS = {
    name: f"a_r_persson_{name}" for name in ("deviation_bearing", "deviation_c", "quadrature_c")
}
"""Columns of a study with the names that their contact areas have in records."""
PERSSON = "whole surface"


def true_contact_areas(curve: Curve) -> dict[str, Field]:
    """Contact areas over the pressures by their names in records; empty where nothing is known."""
    names = [name for name in VARIANTS if name in curve.rows[0]]
    values = {name: curve.column(name) for name in names}
    if not any(np.any(np.isfinite(value)) for value in values.values()):
        return {}
    p_star = curve.column("p_star")
    return {VARIANTS[name]: contact_area(value, p_star) for name, value in values.items()}


def true_contact_tables(comparison: Comparison) -> list[str]:
    """One table per curve that has Delta_sigma over its contact."""
    known = ((curve, true_contact_areas(curve)) for curve in comparison.curves)
    return [_table(curve, areas) for curve, areas in known if areas]


def _table(curve: Curve, areas: dict[str, Field]) -> str:
    """Contact areas of the simulation and of Persson theory with each Delta_sigma_c."""
    simulated, p_star = curve.column("a_r"), curve.column("p_star")
    lines = [
        f"{curve.elastomer} on {curve.surface}: Delta_sigma over the contact",
        "      p*        a_r" + "".join(f"{name:>28}" for name in (PERSSON, *VARIANTS)),
        " " * 19 + f"{'a_r    ratio':>28}" + f"{'/ D_sigma    a_r    ratio':>28}" * len(VARIANTS),
    ]
    for i, row in enumerate(curve.rows):
        cells = [f"{curve.prediction.a_r[i]:8.5f} {simulated[i] / curve.prediction.a_r[i]:6.3f}"]
        for name, key in VARIANTS.items():
            told = areas[key][i]
            cells.append(f"{row[name]:7.4f} {told:8.5f} {simulated[i] / told:6.3f}")
        lines.append(f"{p_star[i]:8.4g} {simulated[i]:10.5f}" + "".join(f"{c:>28}" for c in cells))
    return "\n".join(lines)
