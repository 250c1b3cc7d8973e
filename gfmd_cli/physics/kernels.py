"""Compiled kernels of the contact; see `contact`."""

from gfmd_cli.grid.compilation import kernel


@kernel
def squared_violations(h, u, sigma, out, a, b):
    """Sums of the squares of min(g, sigma), by rows."""
    for i in range(a, b):
        square = 0.0
        for j in range(h.shape[1]):
            violation = min(u[i, j] - h[i, j], sigma[i, j])
            square += violation * violation
        out[i, 0] = square


@kernel
def lay_pressed(h, u, sigma, change, stiffness, error, out, a, b):
    """Write the change of u that lays pressed points on the indenter; see `Contact.lay_pressed`.

    Returns, by rows, the number of these points with a gap below the error, and the sum of the
    squares of the change.
    """
    for i in range(a, b):
        count, square = 0, 0.0
        for j in range(h.shape[1]):
            gap = u[i, j] - h[i, j]
            pressed = sigma[i, j] > max(stiffness * gap, error)
            move = gap if pressed else 0.0
            count += 0.0 < move < error
            square += move * move
            change[i, j] = -move
        out[i, 0], out[i, 1] = count, square
