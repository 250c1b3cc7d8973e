"""Persson theory with Delta_sigma over the contact in the place of that of the whole surface."""

import numpy as np

from gfmd_cli.analysis.compare import Curve
from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.true_contact import contact_area

VARIANTS = {
    name: f"a_r_persson_{name}" for name in ("deviation_bearing", "deviation_c", "quadrature_c")
}
"""Columns of a study with the keys that their contact areas have in records."""


def true_contact_areas(curve: Curve) -> dict[str, Field]:
    """Contact areas over the pressures by their keys in records; empty where nothing is known."""
    values = {name: curve.column(name) for name in VARIANTS if name in curve.rows[0]}
    if not any(np.any(np.isfinite(value)) for value in values.values()):
        return {}
    p_star = curve.column("p_star")
    return {VARIANTS[name]: contact_area(value, p_star) for name, value in values.items()}
