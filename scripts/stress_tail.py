"""Exponent of the tail of Pr(sigma) at n = 3, by window of stress and by grid.

Reads the study of configs/paper/fig13.toml and prints the table of docs/stress_distribution.md, and
from grid to grid the increments of sigma_p^2 and the length of the contact line.

python scripts/stress_tail.py --study results/paper/fig13.h5
"""

import argparse
from pathlib import Path

import numpy as np
from markdown_tables import print_table
from paper.ensembles import groups
from paper.stress import increment_factors, mean_stress, tail_exponent
from paper.studies import StoredStudies
from theory_studies import run_with_studies

from gfmd_cli.analysis.compare import compare
from gfmd_cli.analysis.distribution import distributions
from gfmd_cli.physics.observables import LOGARITHMIC_EDGES, geometric_middles

WINDOWS = ((2.0, 6.0), (4.0, 8.0), (4.0, 12.0), (6.0, 13.0), (8.0, 16.0), (10.0, 20.0))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--study", type=Path, default=Path("results/paper/fig13.h5"))
    study = parser.parse_args().study
    (distribution,) = distributions(compare(study))
    sigma, rows = geometric_middles(LOGARITHMIC_EDGES), []
    finest = distribution.finest["points"]
    studied = distribution.counts.shape[1]
    for place in range(studied):
        counts = distribution.counts[:, place]
        cells = []
        for low, high in WINDOWS:
            inside = (sigma > low) & (sigma < high)
            inner = counts[:, inside]
            enough = np.count_nonzero(inner.sum(axis=0)) > 2
            cells.append(str(tail_exponent(sigma[inside], inner)) if enough else "")
        points = distribution.points[place] * distribution.finest["cutoff"]
        rows.append([f"{points:.0f}", f"{mean_stress(sigma, counts):.1f}", *cells])
    heads = ["points per λs", "mean stress", *(f"{low:g} to {high:g}" for low, high in WINDOWS)]
    print_table(f"n = 3, exponents on grids up to {finest}², stress in Δσ", heads, rows)
    grids = groups(StoredStudies(study.parent), study.stem)
    factors = ", ".join(f"{factor}" for factor in increment_factors(grids))
    print(f"\nincrement of σ_p² at a doubling of the grid over the one before: {factors}")
    lines = ", ".join(f"{group.column('perimeter').value[0]:.2f}" for group in grids)
    print(f"length of the contact line (column perimeter) from grid to grid: {lines}")


if __name__ == "__main__":
    run_with_studies(main, "make paper")
