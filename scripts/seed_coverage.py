"""How often errors of means over seeds hold: confidence intervals, and errors of Pr(sigma).

Reads a study of one contact on many seeds, on four nested grids with histograms (or several files
with some of its seeds). Groups of seeds are compared with all others: the 95 % confidence interval
of the mean on the finest grid, and the standard error of ln Pr that is extrapolated from the three
coarser grids, with the finest three of the others. The difference is reduced by the share that the
others have in its scatter. "worst": the bin with the lowest share, of those with ten errors.

gfmd run configs/stress-distribution.toml -o study.h5 --set "surface.seed=[0, ..., 39]" \
    --set surface.cutoff=0.1 --set "elastomer.n=[1,2,3]" --set "grid.points=[128,256,512,1024]"
python scripts/seed_coverage.py study.h5
"""

import argparse
from collections import defaultdict
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli import rows
from gfmd_cli.analysis.compare import Curve
from gfmd_cli.analysis.distribution import StressDistribution
from gfmd_cli.analysis.ensemble import spread_of
from gfmd_cli.physics.observables import LOGARITHMIC_EDGES, QUANTITIES, geometric_middles

Seeds = list[list[dict[str, Any]]]  # rows of each seed, grids rising
SIZES, GROUPINGS = (1, 2, 4, 8), 20


def distribution(seeds: Seeds, grids: slice) -> StressDistribution:
    """Pr(sigma) of some seeds, from some of their grids."""
    return StressDistribution(Curve(seeds[0], None), [rows[grids] for rows in seeds])


def ratios(group: Seeds, others: Seeds) -> dict[str, Any]:
    """Errors over bars: of the mean of each quantity, and of ln Pr by bin."""
    share = sqrt(len(others) / (len(others) + len(group)))
    density, reference = distribution(group, slice(-1)), distribution(others, slice(1, None))
    change = density.extrapolated.log_density - reference.extrapolated.log_density
    found: dict[str, Any] = {"Pr": share * np.abs(change) / density.error}
    if len(group) > 1:
        for name in QUANTITIES:
            spread = spread_of([rows[-1][name] for rows in group])
            change = spread.mean - np.mean([rows[-1][name] for rows in others])
            found[name] = share * abs(change) / spread.half_width
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("studies", type=Path, nargs="+")
    arguments = parser.parse_args()
    contacts: dict[Any, dict[int, list[Any]]] = defaultdict(lambda: defaultdict(list))
    for path in arguments.studies:
        for row in rows(path):
            contacts[row["n"], round(row["p_star"], 9)][row["seed"]].append(row)
    sigma, draw = geometric_middles(LOGARITHMIC_EDGES), np.random.default_rng(0)
    print(f"| n | p* | seeds | {' | '.join(QUANTITIES)} | Pr(sigma) | worst |\n{'| --- ' * 8}|")
    for (n, p_star), by_seed in contacts.items():
        seeds = [sorted(each, key=lambda row: row["points"]) for each in by_seed.values()]
        for size in SIZES:
            found = defaultdict(list)
            for _ in range(GROUPINGS):
                order = draw.permutation(len(seeds))
                for first in range(0, len(seeds) - size + 1, size):
                    chosen = set(order[first : first + size].tolist())
                    group = [seeds[i] for i in chosen]
                    others = [each for i, each in enumerate(seeds) if i not in chosen]
                    for name, ratio in ratios(group, others).items():
                        found[name].append(ratio)
                if size == 1:  # all groupings are the same
                    break
            bins = np.array(found.pop("Pr"))
            known = np.isfinite(bins)
            shares = {
                f"{np.mean(bins[known[:, i], i] <= 1):.0%} at {sigma[i]:.2g}": np.mean(
                    bins[known[:, i], i] <= 1
                )
                for i in np.flatnonzero(known.sum(axis=0) >= 10)
            }
            cells = [
                f"{np.mean(np.array(found[q]) <= 1):.0%}" if q in found else "–" for q in QUANTITIES
            ]
            held = f"{np.mean(bins[known] <= 1):.0%}" if known.any() else "–"
            worst = min(shares, key=lambda share: shares[share], default="–")
            print(
                f"| {n:g} | {p_star:g} | {size} | {' | '.join(cells)} | {held} | {worst} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
