"""The sweeps of the multigrid cycle, compiled; see `multigrid`.

Rows in rings: each sweep walks down a level and holds the few rows that its stencils reach over,
with two values more at either end, so that no wide field is written between two stencils. What lies
above the first and below the last row is found at the other end, or in the frame of a slab.
"""

import numpy as np

from gfmd_cli.physics.sweeps import kernel

PLATE = 20.0  # the squared five-point Laplacian on the diagonal
DAMPING = 0.55  # of the Jacobi sweeps


@kernel
def _tie(up, mid, down, ties, weights, i):  # type: ignore[no-untyped-def]
    """Row i of ties and weights, from the weights of three fine rows; see `first_ties`."""
    m = weights.shape[1]
    own, east, south, cross, row = ties[i, 0], ties[i, 1], ties[i, 2], ties[i, 3], weights[i]
    for j in range(m):
        e, o = 2 * j, 2 * j + 1
        w = o - 2 if j > 0 else 2 * m - 1
        edges = up[e] + down[e] + mid[w] + mid[o]
        corners = up[w] + up[o] + down[w] + down[o]
        own[j + 1] = 16 * mid[e] + 4 * edges + corners
        east[j + 1] = 4 * mid[o] + up[o] + down[o]
        south[j + 1] = 4 * down[e] + down[w] + down[o]
        cross[j + 1] = down[o]
        row[j] = min(4, (4 * mid[e] + 2 * edges + corners + 2) // 4)
    own[0], east[0], south[0], cross[0] = own[m], east[m], south[m], cross[m]


@kernel
def first_ties(marks, least, ties, weights, a, b):  # type: ignore[no-untyped-def]
    """Springs that tie the bilinear hats to zero at the points held, and weights of the hats.

    ties: P^T w P in 1/64, for a point, its neighbours to the right, below, and across; w is the
    weight of the finer points in quarters, and that of a hat P^T w, at most 1.
    """
    height, n = marks.shape
    rows = np.empty((3, n), dtype=np.int32)
    for i in range(a, b):
        for k in range(3):
            source, row = marks[(2 * i - 1 + k) % height], rows[k]
            for j in range(n):
                row[j] = 4 if source[j] >= least else 0
        _tie(rows[0], rows[1], rows[2], ties, weights, i)


@kernel
def further_ties(fine, ties, weights, a, b):  # type: ignore[no-untyped-def]
    """Likewise, from the weights of the level below."""
    height, n = fine.shape
    rows = np.empty((3, n), dtype=np.int32)
    for i in range(a, b):
        for k in range(3):
            source, row = fine[(2 * i - 1 + k) % height], rows[k]
            for j in range(n):
                row[j] = source[j]
        _tie(rows[0], rows[1], rows[2], ties, weights, i)


@kernel
def _wrap(row):  # type: ignore[no-untyped-def]
    """Two values at either end of a row from the other."""
    n = row.size - 4
    row[0], row[1] = row[n], row[n + 1]
    row[n + 2], row[n + 3] = row[2], row[3]


@kernel
def _laplacian(up, mid, down, out):  # type: ignore[no-untyped-def]
    """Negative five-point Laplacian of a row, in rows with two more values at either end."""
    for j in range(1, mid.size - 1):
        out[j] = np.float32(4.0) * mid[j] - (up[j] + down[j] + mid[j - 1] + mid[j + 1])


@kernel
def _force(sigma, marks, least, out):  # type: ignore[no-untyped-def]
    """Force on the free points of a row."""
    for j in range(sigma.size):
        out[j + 2] = np.float32(0.0) if marks[j] >= least else -np.float32(sigma[j])
    _wrap(out)


@kernel
def _restrict(up, mid, down, coarse):  # type: ignore[no-untyped-def]
    """A coarse row from three fine ones, with their last value before the first; `up` goes."""
    half = np.float32(0.5)
    for j in range(mid.size):
        up[j] = half * (up[j] + down[j]) + mid[j]
    for j in range(coarse.size):
        coarse[j] = half * (up[2 * j] + up[2 * j + 2]) + up[2 * j + 1]


@kernel
def _interpolate(one, other, ratio, out):  # type: ignore[no-untyped-def]
    """A fine row, of rows with two values more at either end, between two coarse rows."""
    m = one.size
    half = np.float32(0.5) * ratio
    here = half * (one[0] + other[0])
    first = here
    for j in range(m - 1):
        there = half * (one[j + 1] + other[j + 1])
        out[2 * j + 2] = here
        out[2 * j + 3] = np.float32(0.5) * (here + there)
        here = there
    out[2 * m] = here
    out[2 * m + 1] = np.float32(0.5) * (here + first)


@kernel
def first_residual(sigma, marks, least, coarse, a, b):  # type: ignore[no-untyped-def]
    """coarse <- restricted residual of the force after one sweep from zero."""
    height, n = sigma.shape
    share = np.float32(DAMPING / PLATE)
    force, bent = np.empty((5, n + 4), np.float32), np.empty((3, n + 4), np.float32)
    rest = np.zeros((3, n + 1), np.float32)
    for i in range(2 * a - 5, 2 * b):
        # row i + 2 of the force, i + 1 of its Laplacian, i of the residual
        k = (i + 2) % height
        _force(sigma[k], marks[k], least, force[(i + 2) % 5])
        _laplacian(force[i % 5], force[(i + 1) % 5], force[(i + 2) % 5], bent[(i + 1) % 3])
        if i < 2 * a - 1:
            continue
        up, mid, down = bent[(i - 1) % 3], bent[i % 3], bent[(i + 1) % 3]
        source, row, held = force[i % 5], rest[i % 3], marks[i % height]
        for j in range(n):
            c = j + 2
            plate = np.float32(4.0) * mid[c] - (up[c] + down[c] + mid[c - 1] + mid[c + 1])
            row[j + 1] = np.float32(0.0) if held[j] >= least else source[c] - share * plate
        row[0] = row[n]
        if i % 2 == 1 and i > 2 * a:
            _restrict(rest[(i - 2) % 3], rest[(i - 1) % 3], rest[i % 3], coarse[i // 2])


@kernel
def last_smooth(sigma, marks, least, coarse, ratio, scale, change, padded, out, a, b):  # type: ignore[no-untyped-def]
    """padded <- z: one sweep on the sum of the first sweep and P coarse; sums as of `apply`.

    `change` and `padded` have no frame.
    """
    (height, n), m = sigma.shape, coarse.shape[0]
    frame = (height - change.shape[0]) // 2
    share, ratio = np.float32(DAMPING / PLATE), np.float32(ratio)
    x, bent = np.empty((5, n + 4), np.float32), np.empty((3, n + 4), np.float32)
    for i in range(a - 4, b):
        k = (i + 2) % height
        new, held, stress = x[(i + 2) % 5], marks[k], sigma[k]
        _interpolate(coarse[k // 2], coarse[((k + 1) // 2) % m], ratio, new)
        for j in range(n):
            moved = new[j + 2] - share * np.float32(stress[j])
            new[j + 2] = np.float32(0.0) if held[j] >= least else moved
        _wrap(new)
        _laplacian(x[i % 5], x[(i + 1) % 5], new, bent[(i + 1) % 3])
        if i < a:
            continue
        up, mid, down = bent[(i - 1) % 3], bent[i % 3], bent[(i + 1) % 3]
        source, held, stress = x[i % 5], marks[i], sigma[i]
        row, changed = padded[i - frame], change[i - frame]
        slope = turned = 0.0
        for j in range(n):
            c = j + 2
            plate = np.float32(4.0) * mid[c] - (up[c] + down[c] + mid[c - 1] + mid[c + 1])
            s = np.float32(stress[j])
            z = source[c] - share * (s + plate)
            z = np.float32(0.0) if held[j] >= least else z * np.float32(scale)
            row[j] = z
            slope -= z * stress[j]
            turned += z * changed[j]
        out[i, 0], out[i, 1] = slope, turned


@kernel
def _rest(i, x, bent, ties, spring, right, out):  # type: ignore[no-untyped-def]
    """out <- row i of right - A x; `x` and `bent` are rings of rows."""
    height, n = right.shape
    xu, xm, xd = x[(i - 1) % 5], x[i % 5], x[(i + 1) % 5]
    up, mid, down = bent[(i - 1) % 3], bent[i % 3], bent[(i + 1) % 3]
    k = i % height
    above = k - 1 if k > 0 else height - 1
    own, east, south, cross = ties[k, 0], ties[k, 1], ties[k, 2], ties[k, 3]
    north, past, b = ties[above, 2], ties[above, 3], right[k]
    for j in range(n):  # four loops: with more arrays in one the compiler gives up on vectors
        c = j + 2
        plate = np.float32(4.0) * mid[c] - (up[c] + down[c] + mid[c - 1] + mid[c + 1])
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
def _relax(i, x, own, spring, rest, out):  # type: ignore[no-untyped-def]
    """A row of x plus its rest over the diagonal, damped."""
    unit, plate = spring * np.float32(1 / DAMPING), np.float32(PLATE / DAMPING)
    source = x[i % 5]
    for j in range(out.size):
        out[j] = source[j + 2] + rest[j + 1] / (plate + unit * np.float32(own[j + 1]))


@kernel
def _sweep(i, a, x, bent, ties, spring, right, rest, y):  # type: ignore[no-untyped-def]
    """Row i of y, from a on, by one sweep on x, of which row i + 2 has just come into the ring."""
    new = x[(i + 2) % 5]
    _wrap(new)
    _laplacian(x[i % 5], x[(i + 1) % 5], new, bent[(i + 1) % 3])
    if i >= a:
        _rest(i, x, bent, ties, spring, right, rest)
        _relax(i, x, ties[i, 0], spring, rest, y[i])


@kernel
def smooth_first(right, ties, spring, y, a, b):  # type: ignore[no-untyped-def]
    """y <- two sweeps from zero."""
    height, n = right.shape
    unit, plate = spring * np.float32(1 / DAMPING), np.float32(PLATE / DAMPING)
    x, bent = np.empty((5, n + 4), np.float32), np.empty((3, n + 4), np.float32)
    rest = np.empty(n + 1, np.float32)
    for i in range(a - 4, b):
        k = (i + 2) % height
        new, force, own = x[(i + 2) % 5], right[k], ties[k, 0]
        for j in range(n):
            new[j + 2] = force[j] / (plate + unit * np.float32(own[j + 1]))
        _sweep(i, a, x, bent, ties, spring, right, rest, y)


@kernel
def smooth(right, old, ties, spring, y, a, b):  # type: ignore[no-untyped-def]
    """y <- one sweep on `old`."""
    height, n = right.shape
    x, bent = np.empty((5, n + 4), np.float32), np.empty((3, n + 4), np.float32)
    rest = np.empty(n + 1, np.float32)
    for i in range(a - 4, b):
        x[(i + 2) % 5, 2 : n + 2] = old[(i + 2) % height]
        _sweep(i, a, x, bent, ties, spring, right, rest, y)


@kernel
def smooth_corrected(right, old, ties, spring, coarse, ratio, y, a, b):  # type: ignore[no-untyped-def]
    """y <- one sweep on `old` plus P coarse."""
    (height, n), m = right.shape, coarse.shape[0]
    ratio = np.float32(ratio)
    x, bent = np.empty((5, n + 4), np.float32), np.empty((3, n + 4), np.float32)
    rest = np.empty(n + 1, np.float32)
    for i in range(a - 4, b):
        k = (i + 2) % height
        new, source = x[(i + 2) % 5], old[k]
        _interpolate(coarse[k // 2], coarse[((k + 1) // 2) % m], ratio, new)
        for j in range(n):
            new[j + 2] += source[j]
        _sweep(i, a, x, bent, ties, spring, right, rest, y)


@kernel
def residual(right, y, ties, spring, coarse, a, b):  # type: ignore[no-untyped-def]
    """coarse <- restricted residual of y."""
    height, n = right.shape
    x, bent = np.empty((5, n + 4), np.float32), np.empty((3, n + 4), np.float32)
    rest = np.zeros((3, n + 1), np.float32)
    for i in range(2 * a - 5, 2 * b):
        new = x[(i + 2) % 5]
        new[2 : n + 2] = y[(i + 2) % height]
        _wrap(new)
        _laplacian(x[i % 5], x[(i + 1) % 5], new, bent[(i + 1) % 3])
        if i < 2 * a - 1:
            continue
        row = rest[i % 3]
        _rest(i, x, bent, ties, spring, right, row)
        row[0] = row[n]
        if i % 2 == 1 and i > 2 * a:
            _restrict(rest[(i - 2) % 3], rest[(i - 1) % 3], row, coarse[i // 2])
