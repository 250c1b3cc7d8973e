"""Compiled kernels of the multigrid cycle; see `multigrid`.

Each kernel goes through the rows of a level and keeps the few rows that its stencils need in ring
buffers, so that no field is written between two stencils. Rows in ring buffers have two more values
at either end. The rows above the first and below the last row are those at the other end of the
array, which are the halo in a slab decomposition.
"""

import numpy as np

from gfmd_cli.grid.compilation import kernel, part_of_kernel

PLATE = 20.0  # diagonal element of the squared five-point Laplacian (a plate)
DAMPING = 0.55  # of the Jacobi iteration
WHOLE_WEIGHT = 4  # weight of a point held, in quarters
ZERO, HALF, FOUR = np.float32(0.0), np.float32(0.5), np.float32(4.0)


@part_of_kernel
def _weight(value, threshold, weighted):  # type: ignore[no-untyped-def]
    """Weight of a fine point in quarters; see `compute_ties`."""
    return WHOLE_WEIGHT if value >= threshold else weighted * value


@kernel
def compute_ties(fine, threshold, weighted, ties, weights, a, b):  # type: ignore[no-untyped-def]
    """Springs that tie bilinear hats to zero at the points held, and the weights of the hats.

    The ties are P^T w P in units of 1/64 for a point itself, its right neighbour, its lower
    neighbour and its lower right neighbour, where w is the weight of the finer points in quarters:
    4 where `fine` reaches the threshold, else `fine` if these are weights (`weighted` is 1) and 0
    if they are contact states (0). The weight of a hat is P^T w, at most 1.
    """
    (height, n), m = fine.shape, weights.shape[1]
    rows = np.empty((3, n), np.int32)
    down, tied, loaded = rows[0], rows[1], rows[2]  # columns weighted by 0 0 1, 1 4 1, 1 2 1
    for i in range(a, b):
        above, here, below = fine[(2 * i - 1) % height], fine[2 * i], fine[2 * i + 1]
        for j in range(n):
            middle = 2 * _weight(here[j], threshold, weighted)
            down[j] = _weight(below[j], threshold, weighted)
            loaded[j] = _weight(above[j], threshold, weighted) + middle + down[j]
            tied[j] = loaded[j] + middle
        own, east, south, cross = ties[i, 0], ties[i, 1], ties[i, 2], ties[i, 3]
        weight = weights[i]
        for j in range(m):
            e, o = 2 * j, 2 * j + 1
            w = o - 2 if j > 0 else n - 1
            own[j + 1] = tied[w] + 4 * tied[e] + tied[o]
            east[j + 1] = tied[o]
            south[j + 1] = down[w] + 4 * down[e] + down[o]
            cross[j + 1] = down[o]
            weight[j] = min(WHOLE_WEIGHT, (loaded[w] + 2 * loaded[e] + loaded[o] + 2) >> 2)
        own[0], east[0], south[0], cross[0] = own[m], east[m], south[m], cross[m]


@part_of_kernel
def _wrap(row):  # type: ignore[no-untyped-def]
    """Copy two values from either end of a row to the other (periodic boundary)."""
    n = row.size - 4
    row[0], row[1] = row[n], row[n + 1]
    row[n + 2], row[n + 3] = row[2], row[3]


@part_of_kernel
def _laplacian(up, mid, down, out):  # type: ignore[no-untyped-def]
    """Negative five-point Laplacian of a row, in rows with two more values at either end."""
    for j in range(1, mid.size - 1):
        out[j] = FOUR * mid[j] - (up[j] + down[j] + mid[j - 1] + mid[j + 1])


@part_of_kernel
def _restrict(up, mid, down, coarse):  # type: ignore[no-untyped-def]
    """Restrict three fine rows, with the last value before the first; `up` is overwritten."""
    for j in range(mid.size):
        up[j] = HALF * (up[j] + down[j]) + mid[j]
    for j in range(coarse.size):
        coarse[j] = HALF * (up[2 * j] + up[2 * j + 2]) + up[2 * j + 1]


@part_of_kernel
def _interpolate(coarse, k, ratio, out):  # type: ignore[no-untyped-def]
    """Write ratio times row k of P coarse to a row of a ring buffer."""
    rows, m = coarse.shape
    one, other = coarse[k // 2], coarse[((k + 1) // 2) % rows]
    half = HALF * ratio
    here = half * (one[0] + other[0])
    first = here
    for j in range(m - 1):
        there = half * (one[j + 1] + other[j + 1])
        out[2 * j + 2] = here
        out[2 * j + 3] = HALF * (here + there)
        here = there
    out[2 * m] = here
    out[2 * m + 1] = HALF * (here + first)


@kernel
def first_residual(sigma, contact_state, threshold, coarse, a, b):  # type: ignore[no-untyped-def]
    """Restrict the residual of the force after one Jacobi sweep from zero to `coarse`."""
    height, n = sigma.shape
    step = np.float32(DAMPING / PLATE)
    force, laplacian = np.empty((5, n + 4), np.float32), np.empty((3, n + 4), np.float32)
    defect = np.empty((3, n + 1), np.float32)
    for i in range(2 * a - 5, 2 * b):
        # row i + 2 of the force, i + 1 of its Laplacian, i of the residual
        k = (i + 2) % height
        new, held, stress = force[(i + 2) % 5], contact_state[k], sigma[k]
        for j in range(n):
            new[j + 2] = ZERO if held[j] >= threshold else -np.float32(stress[j])
        _wrap(new)
        _laplacian(force[i % 5], force[(i + 1) % 5], new, laplacian[(i + 1) % 3])
        if i < 2 * a - 1:
            continue
        up, mid, down = laplacian[(i - 1) % 3], laplacian[i % 3], laplacian[(i + 1) % 3]
        source, row, held = force[i % 5], defect[i % 3], contact_state[i % height]
        for j in range(n):
            c = j + 2
            plate = FOUR * mid[c] - (up[c] + down[c] + mid[c - 1] + mid[c + 1])
            row[j + 1] = ZERO if held[j] >= threshold else source[c] - step * plate
        row[0] = row[n]
        if i % 2 == 1 and i > 2 * a:
            _restrict(defect[(i - 2) % 3], defect[(i - 1) % 3], defect[i % 3], coarse[i // 2])


@kernel
def last_smooth(sigma, contact_state, threshold, coarse, ratio, scale, change, padded, out, a, b):  # type: ignore[no-untyped-def]
    """Write z, one Jacobi sweep on the sum of the first sweep and P coarse, to `padded`.

    Returns the sums of `Multigrid.apply`. `change` and `padded` have no halo.
    """
    height, n = sigma.shape
    halo = (height - change.shape[0]) // 2
    step = np.float32(DAMPING / PLATE)
    x, laplacian = np.empty((5, n + 4), np.float32), np.empty((3, n + 4), np.float32)
    for i in range(a - 4, b):
        k = (i + 2) % height
        new, held, stress = x[(i + 2) % 5], contact_state[k], sigma[k]
        _interpolate(coarse, k, ratio, new)
        for j in range(n):
            moved = new[j + 2] - step * np.float32(stress[j])
            new[j + 2] = ZERO if held[j] >= threshold else moved
        _wrap(new)
        _laplacian(x[i % 5], x[(i + 1) % 5], new, laplacian[(i + 1) % 3])
        if i < a:
            continue
        up, mid, down = laplacian[(i - 1) % 3], laplacian[i % 3], laplacian[(i + 1) % 3]
        source, held, stress = x[i % 5], contact_state[i], sigma[i]
        row, changed = padded[i - halo], change[i - halo]
        slope = turned = 0.0
        for j in range(n):
            c = j + 2
            plate = FOUR * mid[c] - (up[c] + down[c] + mid[c - 1] + mid[c + 1])
            s = np.float32(stress[j])
            z = source[c] - step * (s + plate)
            z = ZERO if held[j] >= threshold else z * scale
            row[j] = z
            slope -= z * stress[j]
            turned += z * changed[j]
        out[i, 0], out[i, 1] = slope, turned


@part_of_kernel
def _residual_row(i, x, laplacian, ties, spring, rhs, out):  # type: ignore[no-untyped-def]
    """Write row i of the residual rhs - A x to `out`; `x` and `laplacian` are ring buffers."""
    height, n = rhs.shape
    xu, xm, xd = x[(i - 1) % 5], x[i % 5], x[(i + 1) % 5]
    up, mid, down = laplacian[(i - 1) % 3], laplacian[i % 3], laplacian[(i + 1) % 3]
    k = i % height
    above = k - 1 if k > 0 else height - 1
    own, east, south, cross = ties[k, 0], ties[k, 1], ties[k, 2], ties[k, 3]
    north, past, b = ties[above, 2], ties[above, 3], rhs[k]
    # Four loops, because the compiler does not vectorise one loop over as many arrays.
    for j in range(n):
        c = j + 2
        plate = FOUR * mid[c] - (up[c] + down[c] + mid[c - 1] + mid[c + 1])
        out[j + 1] = b[j] - plate
    for j in range(n):
        c, t = j + 2, j + 1
        springs = np.float32(own[t]) * xm[c]
        springs += np.float32(east[t]) * xm[c + 1] + np.float32(east[t - 1]) * xm[c - 1]
        out[t] -= spring * springs
    for j in range(n):
        c, t = j + 2, j + 1
        out[t] -= spring * (np.float32(south[t]) * xd[c] + np.float32(north[t]) * xu[c])
    for j in range(n):
        c, t = j + 2, j + 1
        springs = np.float32(cross[t]) * xd[c + 1] + np.float32(cross[t - 1]) * xd[c - 1]
        springs += np.float32(past[t]) * xu[c + 1] + np.float32(past[t - 1]) * xu[c - 1]
        out[t] -= spring * springs


@kernel
def smooth(rhs, ties, spring, old, coarse, ratio, is_zero, y, a, b):  # type: ignore[no-untyped-def]
    """Write the result of one Jacobi sweep on x to `y`.

    x is the result of a sweep from zero where `is_zero`, else `old`, plus P coarse where the ratio
    of the scales is positive.
    """
    height, n = rhs.shape
    unit, plate = spring * np.float32(1 / DAMPING), np.float32(PLATE / DAMPING)
    x, laplacian = np.empty((5, n + 4), np.float32), np.empty((3, n + 4), np.float32)
    defect = np.empty(n + 1, np.float32)
    for i in range(a - 4, b):
        k = (i + 2) % height
        new, own, source = x[(i + 2) % 5], ties[k, 0], old[k]
        if is_zero:
            force = rhs[k]
            for j in range(n):
                new[j + 2] = force[j] / (plate + unit * np.float32(own[j + 1]))
        elif ratio > 0:
            _interpolate(coarse, k, ratio, new)
            for j in range(n):
                new[j + 2] += source[j]
        else:
            for j in range(n):
                new[j + 2] = source[j]
        _wrap(new)
        _laplacian(x[i % 5], x[(i + 1) % 5], new, laplacian[(i + 1) % 3])
        if i >= a:
            _residual_row(i, x, laplacian, ties, spring, rhs, defect)
            own, source, target = ties[i, 0], x[i % 5], y[i]
            for j in range(n):
                diagonal = plate + unit * np.float32(own[j + 1])
                target[j] = source[j + 2] + defect[j + 1] / diagonal


@kernel
def residual(rhs, y, ties, spring, coarse, a, b):  # type: ignore[no-untyped-def]
    """Restrict the residual of y to `coarse`."""
    height, n = rhs.shape
    x, laplacian = np.empty((5, n + 4), np.float32), np.empty((3, n + 4), np.float32)
    defect = np.empty((3, n + 1), np.float32)
    for i in range(2 * a - 5, 2 * b):
        new, source = x[(i + 2) % 5], y[(i + 2) % height]
        for j in range(n):
            new[j + 2] = source[j]
        _wrap(new)
        _laplacian(x[i % 5], x[(i + 1) % 5], new, laplacian[(i + 1) % 3])
        if i < 2 * a - 1:
            continue
        row = defect[i % 3]
        _residual_row(i, x, laplacian, ties, spring, rhs, row)
        row[0] = row[n]
        if i % 2 == 1 and i > 2 * a:
            _restrict(defect[(i - 2) % 3], defect[(i - 1) % 3], row, coarse[i // 2])
