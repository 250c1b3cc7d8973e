"""How the optional observables, the energy and the contact line change with the grid.

Random surfaces (lambda_r = L/4, lambda_s = L/32) are solved on grids of 128^2 to 1024^2 points, 4
to 32 per lambda_s. The table shows values over those on the finest grid: the smallest and the
largest ratio of all pressures and seeds.

python scripts/observable_grids.py            # docs/observables.md
"""

import argparse
from itertools import product

import numpy as np
from markdown_tables import print_head, print_row

from gfmd_cli import solve

GRIDS, POINTS_PER_WAVE = (128, 256, 512, 1024), 32
EXPONENTS = (0.5, 1.0, 2.0, 3.0, 4.0)
PRESSURES = (0.003, 0.03, 0.3, 1.0)
NAMES = ("stiffness", "energy", "perimeter", "patches", "patch_area_mean", "patch_area_largest")


def values(n: float, p_star: float, seed: int, points: int) -> list[float]:
    spec = {
        "surface": {"kind": "self-affine", "rolloff": 0.25, "cutoff": 1 / 32, "seed": seed},
        "elastomer": {"kind": "power", "n": n},
        "grid": {"points": points},
        "load": {"p_star": p_star},
        "solver": {"tolerance": 1e-5},
        "output": {"patches": True, "stiffness": True, "histogram": False},
    }
    columns = solve(spec).columns
    return [float(columns[name]) for name in NAMES]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2, 10, 11, 12])
    contacts = list(product(PRESSURES, parser.parse_args().seeds))
    print_head("n", "points per lambda_s", *NAMES)
    for n in EXPONENTS:
        of_grids = [[values(n, *contact, points) for contact in contacts] for points in GRIDS]
        for points, of_grid in zip(GRIDS[:-1], of_grids, strict=False):
            ratio = np.array(of_grid) / of_grids[-1]
            ends = zip(ratio.min(axis=0), ratio.max(axis=0), strict=True)
            cells = (f"{low:.3g} – {high:.3g}" for low, high in ends)
            print_row(f"{n:g}", POINTS_PER_WAVE * points // GRIDS[-1], *cells)


if __name__ == "__main__":
    main()
