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


@kernel
def gap_in_contact(sigma, gap, out, a, b):
    """Sum of the gap over the points under pressure, and their number."""
    for i in range(a, b):
        total, count = 0.0, 0
        for j in range(sigma.shape[1]):
            pressed = sigma[i, j] > 0
            total += gap[i, j] if pressed else 0.0
            count += pressed
        out[i, 0], out[i, 1] = total, count


@kernel
def set_level(h, obstacle, sigma, gap, level, u, out, a, b):
    """Subtract the level from the gap, and set u; sum of the squares of min(u - obstacle, sigma).

    u = h under pressure and where a point that can touch penetrates the indenter, else h + gap.
    """
    for i in range(a, b):
        square = 0.0
        for j in range(h.shape[1]):
            g, s = gap[i, j] - level, sigma[i, j]
            drop = h[i, j] - obstacle[i, j]  # zero where the point can touch
            violation = min(g + drop, s)
            square += violation * violation
            gap[i, j] = g
            u[i, j] = h[i, j] + (0.0 if s > 0 or (g < 0 and drop == 0) else g)
        out[i, 0] = square
