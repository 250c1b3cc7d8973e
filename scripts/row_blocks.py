"""Seconds to plan the transforms of the rows of a grid block by block, and their duration.

    python scripts/row_blocks.py
    python scripts/row_blocks.py --points 8192 --coefficients 65536 524288 1e12

One thread, both directions. Plans are measured for blocks of at most so many coefficients; with
1e12 all rows are one block. Each number of coefficients is timed in turn; the least time counts.
`PLANNED_COEFFICIENTS` in gfmd_cli/grid/shared_transforms.py is chosen by it.
"""

import argparse
import time
from functools import partial

import numpy as np
import pyfftw
from markdown_tables import print_head, print_row

from gfmd_cli.grid import shared_transforms
from gfmd_cli.grid.arrays import aligned
from gfmd_cli.grid.rows import LocalRows


def planned(
    points: int, kind: str, coefficients: float
) -> tuple[shared_transforms.RowTransforms, float]:
    """Transforms of the rows of a square grid, and the seconds that their planning takes."""
    shared_transforms.PLANNED_COEFFICIENTS = int(coefficients)
    lines = aligned((points, points // 2 + 1), np.dtype(kind))
    values = lines.view(lines.real.dtype)[:, :points]
    fftw = partial(pyfftw.FFTW, flags=("FFTW_MEASURE",))
    pyfftw.forget_wisdom()
    begun = time.process_time()
    rows = shared_transforms.RowTransforms(values, lines, LocalRows(points, 1), fftw, None)
    seconds = time.process_time() - begun
    lines[...] = 0.0
    return rows, seconds


def duration(rows: shared_transforms.RowTransforms) -> float:
    """Seconds of the transforms of all rows, and back."""
    begun = time.process_time()
    rows.forward()
    rows.backward()
    return time.process_time() - begun


def main() -> None:
    """Plan and time all grids and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, nargs="+", default=[1024, 2048, 3000, 4096])
    parser.add_argument(
        "--coefficients", type=float, nargs="+", default=[2**17, 2**18, 2**19, 2**20, 1e12]
    )
    parser.add_argument("--repeats", type=int, default=15)
    options = parser.parse_args()
    print_head("points a side", "precision", "coefficients", "planning [s]", "pair [ms]")
    for points in options.points:
        for kind in ("complex64", "complex128"):
            plans = [planned(points, kind, each) for each in options.coefficients]
            times = [[duration(rows) for rows, _ in plans] for _ in range(options.repeats)]
            least = 1e3 * np.min(times, axis=0)
            for each, (_, seconds), pair in zip(options.coefficients, plans, least, strict=True):
                print_row(points, kind, f"{each:.3g}", f"{seconds:.2f}", f"{pair:.2f}")


if __name__ == "__main__":
    main()
