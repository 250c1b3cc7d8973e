"""Compiled kernels between two levels of the multigrid cycle; see `multigrid`.

They compute the penalty of a level, and restrict and interpolate between levels of any numbers of
points. `multigrid_kernels` does the latter without a field of its own where a level has exactly
half the points of the next finer one.
"""

import numpy as np

from gfmd_cli.grid.compilation import kernel, part_of_kernel
from gfmd_cli.solvers.multigrid_kernels import HALF, ONE, ZERO

WHOLE_WEIGHT = 4  # weight of a point held, in quarters
UNITS_PER_QUARTER = 16  # units of the penalty per unit of the weights


@part_of_kernel
def _weight(value, threshold, weighted):
    """Weight of a fine point in quarters; see `compute_penalty`."""
    return WHOLE_WEIGHT if value >= threshold else weighted * value


@kernel
def compute_penalty(fine, threshold, weighted, penalty, weights, a, b):
    """The penalty on bilinear hats at the points held, and the weights of the hats.

    The penalty is P^T w P in units of 1/64 for a point itself, its right neighbour, its lower
    neighbour and its lower right neighbour, where w is the weight of the finer points in quarters:
    4 where `fine` reaches the threshold, else `fine` if these are weights (`weighted` is 1) and 0
    if they are contact states (0). The weight of a hat is P^T w, at most 1.
    """
    (height, n), m = fine.shape, weights.shape[1]
    rows = np.empty((3, n), np.uint8)  # the sums below are at most 144
    down, squared, loaded = rows[0], rows[1], rows[2]  # columns weighted by 0 0 1, 1 4 1, 1 2 1
    for i in range(a, b):
        above, here, below = fine[(2 * i - 1) % height], fine[2 * i], fine[2 * i + 1]
        for j in range(n):
            middle = 2 * _weight(here[j], threshold, weighted)
            down[j] = _weight(below[j], threshold, weighted)
            loaded[j] = _weight(above[j], threshold, weighted) + middle + down[j]
            squared[j] = loaded[j] + middle
        own, east, south, cross = penalty[i, 0], penalty[i, 1], penalty[i, 2], penalty[i, 3]
        weight = weights[i]
        for j in range(m):
            e, o = 2 * j, 2 * j + 1
            w = o - 2 if j > 0 else n - 1
            own[j + 1] = squared[w] + 4 * squared[e] + squared[o]
            east[j + 1] = squared[o]
            south[j + 1] = down[w] + 4 * down[e] + down[o]
            cross[j + 1] = down[o]
            weight[j] = min(WHOLE_WEIGHT, (loaded[w] + 2 * loaded[e] + loaded[o] + 2) >> 2)
        own[0], east[0], south[0], cross[0] = own[m], east[m], south[m], cross[m]


@part_of_kernel
def _hats(n, m):
    """The two of m hats that reach each of n points, and the weight of the right one."""
    left, right = np.empty(n, np.int32), np.empty(n, np.int32)
    fraction = np.empty(n, np.float32)
    for i in range(n):
        left[i], right[i] = i * m // n, (i * m // n + 1) % m
        fraction[i] = np.float32(i * m % n) / np.float32(n)
    return left, right, fraction


@part_of_kernel
def _reach(k, n, m):
    """First of n points that hat k of m reaches, and the one after the last."""
    return -((1 - k) * n // m), -(-(k + 1) * n // m)


@kernel
def restrict(fine, coarse, a, b):
    """Write P^T fine to `coarse`, for any numbers of points."""
    (height, n), (rows, m) = fine.shape, coarse.shape
    left, right, fraction = _hats(n, m)
    column = np.empty(n, np.float32)
    for k in range(a, b):
        column[:] = ZERO
        first, end = _reach(k, height, rows)
        for i in range(first, end):
            value = np.float32(1 - abs(i * rows - k * height) / height)
            row = fine[i % height]
            for j in range(n):
                column[j] += value * row[j]
        target = coarse[k]
        target[:] = ZERO
        for j in range(n):
            target[left[j]] += (ONE - fraction[j]) * column[j]
            target[right[j]] += fraction[j] * column[j]


@kernel
def interpolate(coarse, fine, a, b):
    """Write P coarse to `fine`, for any numbers of points."""
    (height, n), (rows, m) = fine.shape, coarse.shape
    left, right, fraction = _hats(n, m)
    row = np.empty(m, np.float32)
    for i in range(a, b):
        k = i * rows // height
        one, other, value = coarse[k], coarse[(k + 1) % rows], np.float32(i * rows / height - k)
        for j in range(m):
            row[j] = one[j] + value * (other[j] - one[j])
        for j in range(n):
            here = row[left[j]]
            fine[i, j] = here + fraction[j] * (row[right[j]] - here)


@kernel
def compute_any_penalty(fine, threshold, weighted, penalty, weights, a, b):
    """The same as `compute_penalty`, rounded, for any numbers of points."""
    (height, n), (rows, m) = fine.shape, weights.shape
    left, right, fraction = _hats(n, m)
    columns, sums = np.empty((3, n), np.float32), np.empty((5, m), np.float32)
    down, squared, loaded = columns[0], columns[1], columns[2]
    own, east, south, cross, weight = sums[0], sums[1], sums[2], sums[3], sums[4]
    for k in range(a, b):
        columns[:] = ZERO
        sums[:] = ZERO
        first, end = _reach(k, height, rows)
        for i in range(first, end):
            value = np.float32(1 - abs(i * rows - k * height) / height)
            below = ONE - value if i * rows > k * height else ZERO  # of the next hat
            row = fine[i % height]
            for j in range(n):
                w = np.float32(_weight(row[j], threshold, weighted)) * value
                loaded[j] += w
                squared[j] += value * w
                down[j] += below * w
        for j in range(n):
            e, o, t = left[j], right[j], fraction[j]
            s = ONE - t
            weight[e] += s * loaded[j]
            weight[o] += t * loaded[j]
            own[e] += s * s * squared[j]
            own[o] += t * t * squared[j]
            east[e] += s * t * squared[j]
            south[e] += s * s * down[j]
            south[o] += t * t * down[j]
            cross[e] += s * t * down[j]
        for j in range(m):
            weights[k, j] = min(WHOLE_WEIGHT, int(weight[j] + HALF))
            for kind in range(4):
                penalty[k, kind, j + 1] = int(np.float32(UNITS_PER_QUARTER) * sums[kind, j] + HALF)
        for kind in range(4):
            penalty[k, kind, 0] = penalty[k, kind, m]
