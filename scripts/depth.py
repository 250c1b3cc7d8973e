"""Errors of Persson theory over lambda_r / lambda_s: what a longer spectrum changes.

Reads the studies `depth` and `resolution` of scripts/theory_studies.py and prints the tables of
docs/mean_gap.md, and the areas of one spectrum on three grids.

python scripts/depth.py --folder results/theory
"""

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
from gamma_fit import spread
from markdown_tables import print_table
from theory_studies import LIGHT, run_with_studies

from gfmd_cli.analysis.compare import Curve, compare
from gfmd_cli.analysis.selection import grouped
from gfmd_cli.physics.discretisation_error import AREA_EXCESS

Groups = dict[tuple[float, float], list[Curve]]
"""The curves of all seeds by n, and lambda_r / lambda_s or points per lambda_s."""
Measure = Callable[[Curve], np.ndarray]


def over_theory(curve: Curve, name: str) -> np.ndarray:
    """Simulation over theory with Eq. (39), at the pressures of LIGHT."""
    return curve.column(name) / getattr(curve.predict(curve.column("p_star")), name)


def area_ratio(curve: Curve) -> np.ndarray:
    """Contact area without the excess of the grid (docs/error_estimates.md) over the theory."""
    n, points = curve.rows[0]["n"], curve.rows[0]["points"]
    excess = AREA_EXCESS * n * curve.column("perimeter") / points
    return (curve.column("a_r") - excess) / curve.predict(curve.column("p_star")).a_r


def gap_error(curve: Curve) -> np.ndarray:
    """ln u_g of the theory less that of the simulation, in per cent."""
    return -100 * np.log(over_theory(curve, "u_g"))


def print_trend(title: str, groups: Groups, measure: Measure, digits: int) -> None:
    """One row for each n and pressure, one column for each lambda_r / lambda_s."""
    exponents, depths = (sorted(set(keys)) for keys in zip(*groups, strict=True))
    rows = []
    for n in exponents:
        for place, p in enumerate(LIGHT):
            values = [spread([measure(c)[place] for c in groups[n, depth]]) for depth in depths]
            rows.append(
                [f"{n:g}", f"{p:g}", *(f"{m:.{digits}f} ± {e:.{digits}f}" for m, e in values)]
            )
    print_table(title, ["$n$", "$p^\\ast$", *(f"{depth:g}" for depth in depths)], rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--folder", type=Path, default=Path("results/theory"))
    folder = parser.parse_args().folder
    curves = compare(folder / "depth.h5").curves
    groups = grouped(curves, lambda c: (c.rows[0]["n"], c.rows[0]["rolloff"] / c.rows[0]["cutoff"]))
    title = "ln u_g of the theory less that of the simulation, in per cent"
    print_trend(title, groups, gap_error, 1)
    print_trend("a_r over that of the theory", groups, area_ratio, 3)
    print_trend("the same on the grid", groups, lambda c: over_theory(c, "a_r"), 3)
    curves = compare(folder / "resolution.h5").curves
    groups = grouped(curves, lambda c: (c.rows[0]["n"], c.rows[0]["points"] * c.rows[0]["cutoff"]))
    print_trend("a_r over that of the theory, by points per lambda_s", groups, area_ratio, 3)


if __name__ == "__main__":
    run_with_studies(main, "python scripts/theory_studies.py")
