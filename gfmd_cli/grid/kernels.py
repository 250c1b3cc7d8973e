"""Compiled kernels that multiply coefficients between two transforms.

A kernel multiplies the columns `start` to `stop` of the coefficients. In `modes` they are pairs of
real values and begin at column `first`. k is the symbol.
"""

from gfmd_cli.grid.compilation import kernel


@kernel
def apply_symbol(modes, first, k, start, stop, factor, energies):
    """Multiply coefficients by factor k(q); add k(q) |coefficient|^2 of each column to `energies`.

    Sums of columns do not depend on how many columns a thread has.
    """
    sums = energies[start:stop]
    for i in range(k.shape[0]):
        row, weights = modes[i, 2 * first :], k[i, start:stop]
        for j in range(weights.size):
            weight, re, im = weights[j], row[2 * j], row[2 * j + 1]
            sums[j] += weight * (re * re + im * im)
            row[2 * j] = factor * weight * re
            row[2 * j + 1] = factor * weight * im


@kernel
def divide_by_symbol(modes, first, k, start, stop, factor, shift):
    """Multiply coefficients by factor / (k(q) + shift), and by zero where that sum is zero."""
    for i in range(k.shape[0]):
        row, symbol = modes[i, 2 * first :], k[i, start:stop]
        for j in range(symbol.size):
            shifted = symbol[j] + shift
            weight = factor / shifted  # first, as the compiler vectorises no division in a branch
            weight = weight if shifted > 0 else 0.0
            row[2 * j] *= weight
            row[2 * j + 1] *= weight
