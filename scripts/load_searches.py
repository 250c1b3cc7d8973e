"""Transforms of a load search relative to those of the solve at the pressure that it finds.

    python scripts/load_searches.py [--accuracy]

The table of docs/performance.md: default surface with lambda_s / L = 0.02, means over seeds that
were not used to choose the search. With `--accuracy` the load is a continuum value, and the search
measures errors. The single solve is always one on one grid.
"""

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from markdown_tables import print_head, print_row

from gfmd_cli.api import solve

LOADS = {"contact_area": (0.01, 0.05, 0.3), "mean_gap": (1.5, 0.5)}
EXPONENTS = (0.5, 1, 2, 3)


def transforms(n: float, points: int, seed: int, **tables: dict[str, float]) -> tuple[float, float]:
    """Transforms of the whole task, in units of those of its grid, and the pressure p*."""
    result = solve(
        {
            "surface": {"kind": "self-affine", "cutoff": 0.02, "seed": seed},
            "elastomer": {"kind": "power", "n": n},
            "grid": {"points": points},
            **tables,
        }
    )
    return result.columns["transforms"], result.p_star


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--points", type=int, default=1024)
    parser.add_argument("--seeds", type=int, nargs="+", default=[10, 11, 12])
    parser.add_argument("--accuracy", action="store_true", help="add a table [accuracy]")
    arguments = parser.parse_args()
    tables = {"accuracy": {"mean_gap": 0.5}} if arguments.accuracy else {}
    print_head("load", *(f"n = {n:g}" for n in EXPONENTS))
    for name, values in LOADS.items():
        for value in values:
            ratios = []
            for n in EXPONENTS:
                of_seeds = []
                for seed in arguments.seeds:
                    case = n, arguments.points, seed
                    searched, p_star = transforms(*case, load={name: value}, **tables)
                    alone, _ = transforms(*case, load={"p_star": p_star})
                    of_seeds.append(searched / alone)
                ratios.append(f"{np.mean(of_seeds):.1f}")
            print_row(f"`{name} = {value:g}`", *ratios)


if __name__ == "__main__":
    main()
