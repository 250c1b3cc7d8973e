"""Compiled kernels of `preconditioners` and of `multilevel`."""

import numpy as np

from gfmd_cli.grid.compilation import kernel, part_of_kernel


@kernel
def pattern(contact_state, threshold, out, a, b):
    """Numbers of points held, and of changes between neighbours along rows and columns."""
    rows, columns = contact_state.shape
    for i in range(a, b):
        next_row = i + 1 if i + 1 < rows else 0
        held = changes = 0
        for j in range(columns):
            here = contact_state[i, j] >= threshold
            held += here
            changes += here != (contact_state[next_row, j] >= threshold)
        row = contact_state[i]
        for j in range(columns - 1):
            changes += (row[j] >= threshold) != (row[j + 1] >= threshold)
        changes += (row[columns - 1] >= threshold) != (row[0] >= threshold)
        out[i, 0], out[i, 1] = held, changes


@kernel
def free_force(sigma, contact_state, threshold, padded, a, b):
    """Write the force -sigma on the free points to `padded`, zero on those held."""
    for i in range(a, b):
        for j in range(sigma.shape[1]):
            padded[i, j] = 0.0 if contact_state[i, j] >= threshold else -sigma[i, j]


@kernel
def slopes(sigma, contact_state, threshold, change, z, out, a, b):
    """Sums of z times force and of z times change over the free points."""
    for i in range(a, b):
        slope = z_change = 0.0
        for j in range(sigma.shape[1]):
            free_z = 0.0 if contact_state[i, j] >= threshold else z[i, j]
            slope -= free_z * sigma[i, j]
            z_change += free_z * change[i, j]
        out[i, 0], out[i, 1] = slope, z_change


@kernel
def apply_greens_function(modes, k, screening, factor, a, b):
    """Multiply coefficients by factor / (k(q) + screening)."""
    for i in range(a, b):
        for j in range(k.shape[1]):
            weight = factor / (k[i, j] + screening)
            modes[i, 2 * j] *= weight
            modes[i, 2 * j + 1] *= weight


@part_of_kernel
def _gather(column, column_held, coarse, coarse_held):
    """Compute a coarse row from the weighted sums of three fine rows."""
    m = coarse.size
    coarse[0] = 0.5 * (column[2 * m - 1] + column[1]) + column[0]
    coarse_held[0] = column_held[2 * m - 1] | column_held[0] | column_held[1]
    for j in range(1, m):
        coarse[j] = 0.5 * (column[2 * j - 1] + column[2 * j + 1]) + column[2 * j]
        coarse_held[j] = column_held[2 * j - 1] | column_held[2 * j] | column_held[2 * j + 1]


@kernel
def first_restriction(sigma, contact_state, threshold, coarse, coarse_held, a, b):
    """Restrict the force -sigma of the free points."""
    height, m = sigma.shape[0], coarse.shape[1]
    column, column_held = np.empty(2 * m, dtype=coarse.dtype), np.empty(2 * m, dtype=np.bool_)
    for i in range(a, b):
        up, mid, down = (2 * i - 1) % height, 2 * i, 2 * i + 1
        for j in range(2 * m):
            above, here, below = (
                contact_state[up, j] >= threshold,
                contact_state[mid, j] >= threshold,
                contact_state[down, j] >= threshold,
            )
            outer = (0.0 if above else sigma[up, j]) + (0.0 if below else sigma[down, j])
            column[j] = -0.5 * outer - (0.0 if here else sigma[mid, j])
            column_held[j] = above | here | below
        _gather(column, column_held, coarse[i], coarse_held[i])


@kernel
def restriction(fine, held, coarse, coarse_held, a, b):
    """Write P^T fine to `coarse`; a coarse hat is held if one of its fine hats is held."""
    height, m = fine.shape[0], coarse.shape[1]
    column, column_held = np.empty(2 * m, dtype=coarse.dtype), np.empty(2 * m, dtype=np.bool_)
    for i in range(a, b):
        up, mid, down = (2 * i - 1) % height, 2 * i, 2 * i + 1
        for j in range(2 * m):
            column[j] = 0.5 * (fine[up, j] + fine[down, j]) + fine[mid, j]
            column_held[j] = held[up, j] | held[mid, j] | held[down, j]
        _gather(column, column_held, coarse[i], coarse_held[i])


@kernel
def prolongation(coarse, held, energy, fine, a, b):
    """Divide `fine` by the energy of its hats, zero for hats held, and add P coarse."""
    rows, m = coarse.shape
    for i in range(a, b):
        one, other = i // 2, ((i + 1) // 2) % rows
        for j in range(m):
            here = 0.5 * (coarse[one, j] + coarse[other, j])
            nxt = j + 1 if j + 1 < m else 0
            there = 0.5 * (coarse[one, nxt] + coarse[other, nxt])
            e, o = 2 * j, 2 * j + 1
            fine[i, e] = here + (0.0 if held[i, e] else fine[i, e] / energy)
            fine[i, o] = 0.5 * (here + there) + (0.0 if held[i, o] else fine[i, o] / energy)


@kernel
def last_prolongation(coarse, sigma, contact_state, threshold, energy, change, padded, out, a, b):
    """Write z = -sigma / energy + P coarse on the free points; sums of `Multilevel.apply`."""
    rows, m = coarse.shape
    halo = (sigma.shape[0] - change.shape[0]) // 2
    row = np.empty(2 * m, dtype=coarse.dtype)
    for i in range(a, b):
        one, other = i // 2, ((i + 1) // 2) % rows
        for j in range(m):
            row[2 * j] = 0.5 * (coarse[one, j] + coarse[other, j])
        for j in range(m - 1):
            row[2 * j + 1] = 0.5 * (row[2 * j] + row[2 * j + 2])
        row[2 * m - 1] = 0.5 * (row[2 * m - 2] + row[0])
        slope = z_change = 0.0
        for j in range(2 * m):
            s = sigma[i, j]
            z = 0.0 if contact_state[i, j] >= threshold else row[j] - s / energy
            padded[i - halo, j] = z
            slope -= z * s
            z_change += z * change[i - halo, j]
        out[i, 0], out[i, 1] = slope, z_change
