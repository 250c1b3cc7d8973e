"""What copied columns and skipped rows save of a pair of transforms with multiplication by k(q).

    python scripts/transform_work.py [--points 1024 2048 4096] [--rows 0.12]

Milliseconds on one thread, the least of several: columns transformed where they lie, columns
copied in blocks, and the latter where all but a fraction of the rows are zero. The results are in
docs/solver_measurements.md.
"""

import argparse
from unittest.mock import patch

import numpy as np
from timing import least

from gfmd_cli.grid import shared_transforms
from gfmd_cli.grid.fft_grid import Grid

REPEATS = 9


def milliseconds(points, precision, *, copied, fraction=1.0):
    """The time of a pair of transforms of a field, of which a fraction of the rows is not zero."""
    grid = Grid(points, precision=precision)
    count = points // shared_transforms.BLOCK_ROWS
    blocks = None
    if fraction < 1:
        blocks = [int(block) for block in np.linspace(0, count - 1, round(fraction * count))]
    symbol = grid.mode_number()
    with patch.object(shared_transforms, "MIN_COPIED_BYTES", 0 if copied else np.inf):
        grid.padded[...] = 0.0  # makes the transforms
    return 1e3 * least(lambda: grid.filter_padded(symbol, blocks), REPEATS)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, nargs="+", default=[1024, 2048, 4096], help="a side")
    parser.add_argument("--rows", type=float, default=0.12, help="fraction that is not zero")
    options = parser.parse_args()
    print("grid    precision  in place  copied  copied, rows skipped")
    for points in options.points:
        for precision in ("double", "single"):
            fractions = ((False, 1.0), (True, 1.0), (True, options.rows))
            times = [milliseconds(points, precision, copied=c, fraction=f) for c, f in fractions]
            print(f"{points}^2  {precision:9}", *(f"{time:8.1f}" for time in times), flush=True)


if __name__ == "__main__":
    main()
