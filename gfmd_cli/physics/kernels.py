"""Compiled kernels of the contact; see `contact`."""

from gfmd_cli.grid.compilation import kernel


@kernel
def squared_violations(h, u, sigma, out, a, b):
    """Sums of the squares of min(g, sigma), by rows."""
    for i in range(a, b):
        violation = 0.0
        for j in range(h.shape[1]):
            worst = min(u[i, j] - h[i, j], sigma[i, j])
            violation += worst * worst
        out[i, 0] = violation
