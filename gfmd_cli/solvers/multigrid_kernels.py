"""Compiled kernels of the multigrid cycle; see `multigrid`.

The kernels go through the rows of a level and keep the few rows that the stencils need in ring
buffers, so that no field is written between two stencils. Rows in ring buffers have two more values
at either end. The rows above the first and below the last row are those at the other end of the
array, which are the halo in a slab decomposition.
"""

from typing import NamedTuple

import numpy as np

from gfmd_cli.grid.compilation import kernel, part_of_kernel

ZERO, HALF, ONE = map(np.float32, (0.0, 0.5, 1.0))


class Operator(NamedTuple):
    """The negative nine-point Laplacian, or its square; all numbers are in single precision."""

    centre: np.float32
    """Element of the Laplacian for the point itself."""
    y: np.float32
    """Minus the element for the neighbours along y."""
    x: np.float32
    """Minus the element for the neighbours along x."""
    corner: np.float32
    """Minus the element for the diagonal neighbours."""
    is_squared: bool
    """Whether the operator is the square of the Laplacian."""
    damped_diagonal: np.float32
    """Diagonal element of the operator, divided by the damping of the Jacobi iteration."""
    penalty_scale: np.float32
    """Stiffness per unit of the penalty."""
    damped_penalty_scale: np.float32
    """`penalty_scale` divided by the damping."""


@part_of_kernel
def _wrap(row):
    """Copy two values from either end of a row to the other (periodic boundary)."""
    n = row.size - 4
    row[0], row[1] = row[n], row[n + 1]
    row[n + 2], row[n + 3] = row[2], row[3]


@part_of_kernel
def _laplacian(up, mid, down, operator, j):
    """Negative Laplacian at column j."""
    sides = operator.y * (up[j] + down[j]) + operator.x * (mid[j - 1] + mid[j + 1])
    corners = (up[j - 1] + up[j + 1]) + (down[j - 1] + down[j + 1])
    return operator.centre * mid[j] - sides - operator.corner * corners


@part_of_kernel
def _inner_rows(i, x, laplacian, operator):
    """Rows i - 1, i and i + 1 of the field whose Laplacian is A x: of x, or of its Laplacian.

    `x` and `laplacian` are ring buffers. The last row of the Laplacian is computed here from row
    i + 2 of x.
    """
    if not operator.is_squared:
        return x[(i - 1) % 5], x[i % 5], x[(i + 1) % 5]
    up, mid, down = x[i % 5], x[(i + 1) % 5], x[(i + 2) % 5]
    out = laplacian[(i + 1) % 3]
    for j in range(1, mid.size - 1):
        out[j] = _laplacian(up, mid, down, operator, j)
    return laplacian[(i - 1) % 3], laplacian[i % 3], out


@part_of_kernel
def _restrict(up, mid, down, coarse):
    """Restrict three fine rows, with the last value before the first; `up` is overwritten."""
    for j in range(mid.size):
        up[j] = HALF * (up[j] + down[j]) + mid[j]
    for j in range(coarse.size):
        coarse[j] = HALF * (up[2 * j] + up[2 * j + 2]) + up[2 * j + 1]


@part_of_kernel
def _restrict_or_copy(i, a, ratio, defect, coarse):
    """Restrict the residual down to its row i, or write the row to a field that is as wide."""
    row = defect[i % 3]
    row[0] = row[-1]
    if ratio == 1:
        for j in range(row.size - 1):
            coarse[i, j] = row[j + 1]
    elif i % 2 == 1 and i > 2 * a:
        _restrict(defect[(i - 2) % 3], defect[(i - 1) % 3], row, coarse[i // 2])


@part_of_kernel
def _interpolate(coarse, k, ratio, out):
    """Write ratio times row k of P coarse to a row of a ring buffer.

    A field that is as wide as the row is P coarse itself.
    """
    rows, m = coarse.shape
    if m == out.size - 4:
        for j in range(m):
            out[j + 2] = ratio * coarse[k, j]
        return
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
def first_residual(sigma, contact_state, threshold, operator, coarse, a, b):
    """Restrict the residual of the force after one smoothing step from zero to `coarse`.

    The residual itself is written to a field that is as wide as `sigma`.
    """
    height, n = sigma.shape
    step = ONE / operator.damped_diagonal
    force, laplacian = np.empty((5, n + 4), np.float32), np.empty((3, n + 4), np.float32)
    defect = np.empty((3, n + 1), np.float32)
    ratio = 1 if coarse.shape[1] == n else 2
    for i in range(ratio * a - ratio - 3, ratio * b):
        # row i + 2 of the force, i + 1 of its Laplacian, i of the residual
        k = (i + 2) % height
        new, held, stress = force[(i + 2) % 5], contact_state[k], sigma[k]
        for j in range(n):
            new[j + 2] = ZERO if held[j] >= threshold else -np.float32(stress[j])
        _wrap(new)
        up, mid, down = _inner_rows(i, force, laplacian, operator)
        if i < ratio * (a - 1) + 1:
            continue
        source, row, held = force[i % 5], defect[i % 3], contact_state[i % height]
        for j in range(n):
            c = j + 2
            pull = _laplacian(up, mid, down, operator, c)
            row[j + 1] = ZERO if held[j] >= threshold else source[c] - step * pull
        _restrict_or_copy(i, a, ratio, defect, coarse)


@kernel
def last_smooth(
    sigma, contact_state, threshold, operator, coarse, ratio, scale, change, padded, out, a, b
):
    """Write z, one smoothing step on the result of the first plus P coarse, to `padded`.

    Returns the sums of `Multigrid.apply`. `change` and `padded` have no halo.
    """
    height, n = sigma.shape
    halo = (height - change.shape[0]) // 2
    step = ONE / operator.damped_diagonal
    x, laplacian = np.empty((5, n + 4), np.float32), np.empty((3, n + 4), np.float32)
    for i in range(a - 4, b):
        k = (i + 2) % height
        new, held, stress = x[(i + 2) % 5], contact_state[k], sigma[k]
        _interpolate(coarse, k, ratio, new)
        for j in range(n):
            moved = new[j + 2] - step * np.float32(stress[j])
            new[j + 2] = ZERO if held[j] >= threshold else moved
        _wrap(new)
        up, mid, down = _inner_rows(i, x, laplacian, operator)
        if i < a:
            continue
        source, held, stress = x[i % 5], contact_state[i], sigma[i]
        row, changed = padded[i - halo], change[i - halo]
        slope = z_change = 0.0
        for j in range(n):
            c = j + 2
            s = np.float32(stress[j])
            z = source[c] - step * (s + _laplacian(up, mid, down, operator, c))
            z = ZERO if held[j] >= threshold else z * scale
            row[j] = z
            slope -= z * stress[j]
            z_change += z * changed[j]
        out[i, 0], out[i, 1] = slope, z_change


@part_of_kernel
def _residual_row(i, x, rows, operator, penalty, rhs, out):
    """Write row i of the residual rhs - A x to `out`; see `_inner_rows`."""
    height, n = rhs.shape
    xu, xm, xd = x[(i - 1) % 5], x[i % 5], x[(i + 1) % 5]
    up, mid, down = rows
    scale = operator.penalty_scale
    k = i % height
    above = k - 1 if k > 0 else height - 1
    own, east, south, cross = penalty[k, 0], penalty[k, 1], penalty[k, 2], penalty[k, 3]
    north, past, b = penalty[above, 2], penalty[above, 3], rhs[k]
    # Four loops, because the compiler does not vectorise one loop over as many arrays.
    for j in range(n):
        out[j + 1] = b[j] - _laplacian(up, mid, down, operator, j + 2)
    for j in range(n):
        c, t = j + 2, j + 1
        terms = np.float32(own[t]) * xm[c]
        terms += np.float32(east[t]) * xm[c + 1] + np.float32(east[t - 1]) * xm[c - 1]
        out[t] -= scale * terms
    for j in range(n):
        c, t = j + 2, j + 1
        out[t] -= scale * (np.float32(south[t]) * xd[c] + np.float32(north[t]) * xu[c])
    for j in range(n):
        c, t = j + 2, j + 1
        terms = np.float32(cross[t]) * xd[c + 1] + np.float32(cross[t - 1]) * xd[c - 1]
        terms += np.float32(past[t]) * xu[c + 1] + np.float32(past[t - 1]) * xu[c - 1]
        out[t] -= scale * terms


@part_of_kernel
def _start_row(rhs, operator, penalty, old, is_zero, k, row):
    """Write row k of `old`, or of the result of a smoothing step from zero, to a ring buffer."""
    force, own, source = rhs[k], penalty[k, 0], old[k]
    if is_zero:
        for j in range(force.size):
            added = operator.damped_penalty_scale * np.float32(own[j + 1])
            row[j + 2] = force[j] / (operator.damped_diagonal + added)
    else:
        for j in range(force.size):
            row[j + 2] = source[j]


@kernel
def smooth(rhs, operator, penalty, old, is_zero, coarse, ratio, y, a, b):
    """Write the result of one smoothing step (damped Jacobi) on x to `y`.

    x is the result of a smoothing step from zero where `is_zero`, else `old`, plus P coarse where
    the ratio of the scales is positive.
    """
    height, n = rhs.shape
    diagonal, scale = operator.damped_diagonal, operator.damped_penalty_scale
    x, laplacian = np.empty((5, n + 4), np.float32), np.empty((3, n + 4), np.float32)
    defect, correction = np.empty(n + 1, np.float32), np.empty(n + 4, np.float32)
    for i in range(a - 4, b):
        k = (i + 2) % height
        new = x[(i + 2) % 5]
        _start_row(rhs, operator, penalty, old, is_zero, k, new)
        if ratio > 0:
            _interpolate(coarse, k, ratio, correction)
            for j in range(2, n + 2):
                new[j] += correction[j]
        _wrap(new)
        rows = _inner_rows(i, x, laplacian, operator)
        if i >= a:
            _residual_row(i, x, rows, operator, penalty, rhs, defect)
            own, source, target = penalty[i, 0], x[i % 5], y[i]
            for j in range(n):
                stiffened = diagonal + scale * np.float32(own[j + 1])
                target[j] = source[j + 2] + defect[j + 1] / stiffened


@kernel
def residual(rhs, operator, penalty, y, is_zero, coarse, a, b):
    """Restrict the residual of y to `coarse`, or write it to a field as wide as `rhs`.

    Where `is_zero`, the result of a smoothing step from zero takes the place of y.
    """
    height, n = rhs.shape
    x, laplacian = np.empty((5, n + 4), np.float32), np.empty((3, n + 4), np.float32)
    defect = np.empty((3, n + 1), np.float32)
    ratio = 1 if coarse.shape[1] == n else 2
    for i in range(ratio * a - ratio - 3, ratio * b):
        new = x[(i + 2) % 5]
        _start_row(rhs, operator, penalty, y, is_zero, (i + 2) % height, new)
        _wrap(new)
        rows = _inner_rows(i, x, laplacian, operator)
        if i < ratio * (a - 1) + 1:
            continue
        row = defect[i % 3]
        _residual_row(i, x, rows, operator, penalty, rhs, row)
        _restrict_or_copy(i, a, ratio, defect, coarse)
