"""Compiled kernels between two transforms; see `rows` for how they run."""

from gfmd_cli.grid.compilation import kernel


@kernel
def apply_symbol(modes, k, factor, first, final, out, a, b):
    """Multiply coefficients by factor k(q); sums over q of k(q) |coefficient|^2.

    `first` and `final` tell whether a row begins at q_x = 0 and ends at the highest q_x.
    """
    last = k.shape[1] - 1
    for i in range(a, b):
        total = 0.0
        ends = first * k[i, 0] * (modes[i, 0] ** 2 + modes[i, 1] ** 2)
        ends += final * k[i, last] * (modes[i, 2 * last] ** 2 + modes[i, 2 * last + 1] ** 2)
        for j in range(k.shape[1]):
            weight, re, im = k[i, j], modes[i, 2 * j], modes[i, 2 * j + 1]
            total += weight * (re * re + im * im)
            modes[i, 2 * j] = factor * weight * re
            modes[i, 2 * j + 1] = factor * weight * im
        out[i, 0] = 2 * total - ends  # a coefficient stands for q and -q, but at both ends


@kernel
def divide_by_symbol(modes, k, factor, a, b):
    """Multiply coefficients by factor / k(q), and by zero where k is zero."""
    for i in range(a, b):
        for j in range(k.shape[1]):
            weight = factor / k[i, j] if k[i, j] > 0 else 0.0
            modes[i, 2 * j] *= weight
            modes[i, 2 * j + 1] *= weight
