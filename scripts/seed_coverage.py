r"""How often errors of means over seeds hold: confidence intervals, and errors of Pr(sigma).

Reads a study of one contact on many seeds, on four nested grids with histograms (or several files
with some of its seeds). From a study of one grid, only the intervals are tested. Groups of seeds
are compared with all others: the 95 % confidence interval of the mean on the finest grid, and the
standard error of ln Pr that is extrapolated from the three coarser grids, with the finest three of
the others. The difference is reduced by the share that the others have in its scatter. "worst" is
the lowest share of a bin that half of the groups resolve. The results are in
docs/stress_distribution.md (first study) and docs/calibration.md (second study).

gfmd run configs/stress-distribution.toml -o study.h5 --set "surface.seed=[$(seq -s, 0 39)]" \
    --set surface.cutoff=0.1 --set "elastomer.n=[1,2,3]" --set solver.tolerance=1e-5 \
    --set "grid.points=[128,256,512,1024]"
python scripts/seed_coverage.py study.h5

gfmd run configs/smoke.toml -o means.h5 --set "surface.seed=[$(seq -s, 0 199)]" \
    --set surface.cutoff=0.0625 --set "elastomer.n=[0.5,1,2,3,4]" --set grid.points=64 \
    --set "load.p_star=[0.003,0.01,0.03,0.1,0.3,1]" --set solver.tolerance=1e-4
python scripts/seed_coverage.py means.h5
"""

import argparse
from collections import defaultdict
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
from markdown_tables import print_head, print_row

from gfmd_cli import rows
from gfmd_cli.analysis.compare import Curve
from gfmd_cli.analysis.distribution import StressDistribution
from gfmd_cli.analysis.ensemble import spread_of
from gfmd_cli.physics.observables import LOGARITHMIC_EDGES, MAIN_OBSERVABLES, geometric_middles

Seeds = list[list[dict[str, Any]]]  # rows of each seed, grids rising
SIZES, GROUPINGS = (1, 2, 3, 4, 8), 20


def distribution(seeds: Seeds, grids: slice) -> StressDistribution:
    """Pr(sigma) of some seeds, from some of their grids."""
    return StressDistribution(Curve(seeds[0], None), [contacts[grids] for contacts in seeds])


def held(group: Seeds, others: Seeds) -> dict[str, Any]:
    """Whether the interval of each quantity holds, and by bin the error of ln Pr; NaN without."""
    share = sqrt(len(others) / (len(others) + len(group)))
    answers: dict[str, Any] = {"Pr": np.full(1, np.nan)}
    if len(group[0]) > 1:
        density, reference = distribution(group, slice(-1)), distribution(others, slice(1, None))
        change = np.abs(density.extrapolated.log_density - reference.extrapolated.log_density)
        answers["Pr"] = np.where(np.isfinite(change), share * change <= density.error, np.nan)
    if len(group) > 1:
        for name in MAIN_OBSERVABLES:
            spread = spread_of([contacts[-1][name] for contacts in group])
            change = abs(spread.mean - np.mean([contacts[-1][name] for contacts in others]))
            answers[name] = share * change <= spread.half_width
    return answers


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("studies", type=Path, nargs="+")
    arguments = parser.parse_args()
    contacts: dict[Any, dict[int, list[Any]]] = defaultdict(lambda: defaultdict(list))
    for path in arguments.studies:
        for row in rows(path):
            contacts[row["n"], round(row["p_star"], 9)][row["seed"]].append(row)
    sigma, draw = geometric_middles(LOGARITHMIC_EDGES), np.random.default_rng(0)
    print_head("n", "p*", "seeds", *MAIN_OBSERVABLES, "Pr(sigma)", "worst")
    for (n, p_star), by_seed in contacts.items():
        seeds = [sorted(each, key=lambda row: row["points"]) for each in by_seed.values()]
        for size in (size for size in SIZES if size < len(seeds)):
            answers = defaultdict(list)
            for _ in range(GROUPINGS if size > 1 else 1):
                order = draw.permutation(len(seeds))
                for first in range(0, len(seeds) - size + 1, size):
                    chosen = set(order[first : first + size].tolist())
                    group = [seeds[i] for i in chosen]
                    others = [each for i, each in enumerate(seeds) if i not in chosen]
                    for name, answer in held(group, others).items():
                        answers[name].append(answer)
            bins = np.array(answers.pop("Pr"))
            cells = [
                f"{np.mean(answers[q]):.0%}" if q in answers else "–" for q in MAIN_OBSERVABLES
            ]
            known = np.isfinite(bins)
            resolved = np.flatnonzero(known.mean(axis=0) >= 0.5)
            density = worst = "–"
            if resolved.size:
                density, shares = f"{np.nanmean(bins):.0%}", np.nanmean(bins[:, resolved], axis=0)
                worst = f"{shares.min():.0%} at {sigma[resolved[shares.argmin()]]:.2g}"
            print_row(f"{n:g}", f"{p_star:g}", size, *cells, density, worst)


if __name__ == "__main__":
    main()
