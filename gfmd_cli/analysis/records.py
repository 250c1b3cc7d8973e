"""The records of `gfmd analyze --json`: one for each solved pressure."""

from typing import Any

from gfmd_cli.analysis.compare import VARIANTS, Comparison
from gfmd_cli.analysis.ensemble import ensembles
from gfmd_cli.analysis.export import column_names
from gfmd_cli.analysis.table import plain
from gfmd_cli.physics.observables import QUANTITIES

THEORY = (*(f"{name}_persson" for name in QUANTITIES), "p_star_persson_at_u_g")


def as_records(comparison: Comparison) -> list[dict[str, Any]]:
    """One record for each solved pressure, as JSON has it; what does not apply is None.

    The keys are the columns of `gfmd export`, then theory and the means over seeds where they
    apply.
    """
    means = {
        row["task"]: ensemble.means() for ensemble in ensembles(comparison) for row in ensemble.rows
    }
    records = []
    names = column_names([row for curve in comparison.curves for row in curve.rows])
    for curve in comparison.curves:
        keys = [*names, *(THEORY if curve.has_theory else ())]
        if curve.stores(VARIANTS.values()):
            keys += VARIANTS.values()
        for row in curve.records:
            record = {key: plain(row[key]) for key in keys}
            records.append(record | means.get(row["task"], {}))
    return records
