"""Compiled kernels that multiply coefficients between two transforms; see `Grid.filter_by`.

A kernel multiplies the columns `start` to `stop` of the coefficients. In `modes` they are pairs of
real values and begin at column `first`. k is the symbol.
"""

from gfmd_cli.grid.compilation import kernel


@kernel
def apply_symbol(modes, first, k, start, stop, factor, has_zero, has_nyquist):
    """Multiply coefficients by factor k(q); sum over q of k(q) |coefficient|^2.

    `has_zero` is 1 if the first column of k is q_x = 0, and `has_nyquist` is 1 if its last one is
    the Nyquist wavenumber; otherwise they are 0.
    """
    total, last = 0.0, stop - start - 1
    has_zero *= start == 0
    has_nyquist *= stop == k.shape[1]
    for i in range(k.shape[0]):
        row, weights = modes[i, 2 * first :], k[i, start:stop]
        ends = has_zero * weights[0] * (row[0] ** 2 + row[1] ** 2)
        ends += has_nyquist * weights[last] * (row[2 * last] ** 2 + row[2 * last + 1] ** 2)
        row_total = 0.0
        for j in range(weights.size):
            weight, re, im = weights[j], row[2 * j], row[2 * j + 1]
            row_total += weight * (re * re + im * im)
            row[2 * j] = factor * weight * re
            row[2 * j + 1] = factor * weight * im
        total += 2 * row_total - ends  # a coefficient stands for q and -q, but at both ends
    return total


@kernel
def divide_by_symbol(modes, first, k, start, stop, factor):
    """Multiply coefficients by factor / k(q), and by zero where k is zero."""
    for i in range(k.shape[0]):
        row, stiffness = modes[i, 2 * first :], k[i, start:stop]
        for j in range(stiffness.size):
            weight = factor / stiffness[j] if stiffness[j] > 0 else 0.0
            row[2 * j] *= weight
            row[2 * j + 1] *= weight
    return 0.0
