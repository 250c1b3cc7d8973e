"""Forecast of what a task takes: memory, time, and the points of "auto" grids."""

from functools import lru_cache

import numpy as np

from gfmd_cli.grid.plans import fast_length
from gfmd_cli.physics.discretisation_error import MAX_AREA_EXPONENT, MAX_STRESS_EXPONENT
from gfmd_cli.physics.indenters import POINTS_ROUNDING, RigidSurface
from gfmd_cli.solvers.multigrid import MAX_PIXEL_ASPECT
from gfmd_cli.spec.models import AccuracyTable, OutputTable

# Memory beyond that of the solver, in numbers of fields, measured as peak memory.
OUTPUT_FIELDS = {"stiffness": 3.0, "spectra": 1.0}
"""Of keys of [output]."""
MIRRORED_FIELDS = {"true_contact": 2.0, "spectra": 11.0}
"""What these keys take besides with a free boundary, at 1536^2."""
STORED_FIELDS, ACCURACY_FIELDS = 1.0, 0.5
"""Of each name in output.fields, and of [accuracy]."""
OBLONG_FIELDS, ODD_FIELDS = 4.5, 0.5
"""Of coarser grids and levels where only the shorter side of the pixels is coarsened, and where the
number of points is odd."""
BASE_BYTES = 240e6
"""Memory of the interpreter and its libraries."""
MIN_FIRST_POINTS = 64  # along x, on the first grid of "auto"; such a solve costs nothing
MAX_CONVERGENT_EXPONENT = {"a_r": MAX_AREA_EXPONENT, "u_g": 4.0, "sigma_p": MAX_STRESS_EXPONENT}
"""Exponents n up to which finer grids approach a continuum value."""
SOLVES_PER_SEARCH = {False: 3.5, True: 4.5}
"""Solves that a search of the pressure takes, those on coarser grids included, without and with
[accuracy]: then each trial has two grids, and two more contacts give the slopes. The means over the
tables of `scripts/load_searches.py --points 256` and of the same with `--accuracy` are 3.4 and 4.3,
here to the nearest half; with finer grids they are smaller."""
SECONDS_PER_PAIR = 1.7e-8
"""Per grid point and pair of transforms, with all work between two of them, on one thread."""
P_STAR = 0.1  # reduced pressure of a forecast where the load is another quantity; a choice
DECADES = -4, -3, -2, -1, 0
PAIRS = {
    "periodic": {
        0.1: (13, 13, 12, 9, 7),
        0.25: (3, 2, 3, 10, 9),
        0.5: (3, 3, 4, 13, 12),
        1.0: (3, 3, 6, 11, 9),
        1.5: (4, 6, 12, 11, 9),
        2.0: (7, 17, 16, 15, 11),
        2.5: (7, 20, 24, 21, 15),
        3.0: (8, 21, 32, 25, 18),
        3.5: (11, 44, 48, 39, 23),
        4.0: (30, 120, 72, 54, 31),
    },
    "free": {
        0.5: (15, 14, 12, 24, 26),
        1.0: (14, 16, 16, 43, 37),
        1.5: (16, 18, 73, 120, 98),
        1.75: (72, 99, 130, 380, 560),
    },
}
"""Time of a solve in units of SECONDS_PER_PAIR times grid points, by boundary and n, at p* of these
powers of ten. Means of 1024^2 and 2048^2, each at most 1.4 times larger or smaller:
`scripts/forecast_pairs.py`; with a free boundary of 512^2 and 1024^2, at most 1.5 times:
`--boundary free --points 512 1024 --cutoff 0.01`."""
UNKNOWN_EXPONENT = {"periodic": 2.0, "free": 1.0}
"""The n of k(q) that is no power law, by boundary; a choice."""
OTHER_PAIRS = 4.0
"""Time to prepare the surface and store the result, in the units of `PAIRS`; a choice."""


def fields_of_output(output: OutputTable, boundary: str) -> float:
    """Fields that [output] adds to those of the solver."""
    keys = output.names()
    fields = STORED_FIELDS * len(output.fields) + sum(OUTPUT_FIELDS.get(key, 0.0) for key in keys)
    if boundary == "free":
        fields += sum(MIRRORED_FIELDS.get(key, 0.0) for key in keys)
    return fields


def fields_of_levels(shape: tuple[int, int], sides: tuple[float, ...]) -> float:
    """Fields that coarser grids and levels add where the points are not halved."""
    dy, dx = (side / count for side, count in zip(sides, shape, strict=True))
    if max(dy, dx) > MAX_PIXEL_ASPECT * min(dy, dx):
        return OBLONG_FIELDS
    return ODD_FIELDS if any(count % 2 for count in shape) else 0.0


@lru_cache(maxsize=1024)
def pairs(exponent: float | None, p_star: float, tolerance: float, boundary: str) -> float:
    """Time of a solve in units of SECONDS_PER_PAIR times grid points: `PAIRS`, interpolated."""
    if exponent == 0:
        return 1.0
    n = UNKNOWN_EXPONENT[boundary] if exponent is None else exponent
    table = PAIRS[boundary]
    by_pressure = [
        np.interp(n, list(table), ratios) for ratios in zip(*table.values(), strict=True)
    ]
    tightness = 1 - 0.1 * float(np.log10(max(tolerance, 1e-14) / 1e-6))
    return tightness * float(np.interp(np.log10(max(p_star, 1e-14)), DECADES, by_pressure))


def first_grid(surface: RigidSurface) -> int:
    """Points along x that an "auto" grid begins with: the fewest that resolve the surface."""
    needed = surface.smallest_grid()
    if surface.is_map:
        return needed
    needed_y, sides = surface.smallest_grid_y(), surface.sides
    same_spacing = needed_y * sides[-1] / sides[0] - POINTS_ROUNDING
    points = 2 * fast_length(max(needed, MIN_FIRST_POINTS, same_spacing) / 2)
    while surface.points_y(points) < needed_y:  # an even number, perhaps rounded down
        points = 2 * fast_length(points / 2 + 1)
    return points


def last_grid(
    surface: RigidSurface,
    exponent: float | None,
    p_star: float,
    boundary: str | None,
    accuracy: AccuracyTable,
) -> int:
    """Points along x that an "auto" grid ends with, mostly within a factor of two.

    Relative errors on the first grid, and the order at which they fall: read off the default
    surface with cutoff = 0.03, n = 0 to 4, p* = 0.01 to 1.
    """
    n, p = 1.0 if exponent is None else exponent, p_star
    steep = float(np.interp(n, [0, 2, 3], [0.4, 0.48, 0.96]))
    area = float(np.interp(n, [0, 1, 2, 3], [0.05, 0.09, 0.26, 0.8])) * min(p / 0.1, 1.0) ** -steep
    gap = float(np.interp(n, [0, 1, 2, 3, 4], [0.007, 0.012, 0.035, 0.09, 0.27]))
    typical = {
        "a_r": (area, 1.6),
        "u_g": (3 * gap if p > 0.3 else gap, 2.5),
        "sigma_p": (0.03 * 3**n, max(0.5, min(2.0, 3.0 - n))),
    }
    doublings = [1 if boundary == "free" else 0]  # one grid gives no error there
    for name, share in accuracy.tolerances().items():
        error, order = typical[name]
        if n <= MAX_CONVERGENT_EXPONENT[name]:
            doublings.append(int(np.ceil((np.log2(error) - np.log2(share)) / order)))
    first = points = first_grid(surface)
    while 2 * points <= min(first * 2 ** max(doublings), accuracy.max_points):
        points *= 2
    return points
