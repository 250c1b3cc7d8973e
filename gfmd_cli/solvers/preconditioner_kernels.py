"""Compiled kernels of `preconditioners`."""

from gfmd_cli.grid.compilation import kernel


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
