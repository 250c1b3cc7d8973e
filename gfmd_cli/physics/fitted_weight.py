"""Persson theory with a weight of the elastic energy that is fitted to simulated mean gaps.

No equation of the paper: constants from scripts/gap_theories.py, errors in docs/theory.md.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.persson import Persson

_ALPHA = (0.413, 0.609)  # alpha = 0.413 + 0.609 n
_BETA = (0.623, 0.874)  # beta = 0.623 exp(-n / 0.874)
_C = (0.921, -0.304, 0.144)  # c = 0.921 - 0.304 n + 0.144 n^2
_LEAST = 1e-300  # contact area: below, the slopes count as zero


@dataclass(frozen=True, eq=False)
class FittedWeight(Persson):
    """Persson theory with W = a^alpha s^beta [c + (1 - c) a^2] of two contact areas.

    a is the contact area at the scale q, as in Eq. (30), s that with all waves. Fitted at p* = 0.01
    to 0.3 on nine spectra with lambda_r / lambda_s = 16 and 32 for n = 0 to 4.
    """

    n: Field
    """Exponent of k(q) of every shell; exponents beyond [0, 4] count as these ends."""

    mean_gap_source: ClassVar[str] = "a fitted weight"

    def weight(self, a: Field, s: Field) -> tuple[Field, Field, Field]:
        """W, dW/da and dW/ds, all of shape (pressures, bins); 0 <= a, s <= 1.

        Parameters
        ----------
        a : mean contact area of every bin, shape (pressures, bins)
        s : contact area with all waves, shape (pressures, 1)
        """
        n = np.clip(self.n, 0.0, 4.0)
        alpha = _ALPHA[0] + _ALPHA[1] * n
        beta = _BETA[0] * np.exp(-n / _BETA[1])
        c = _C[0] + _C[1] * n + _C[2] * n * n
        power, rest = a**alpha * s**beta, (1 - c) * a * a
        w = power * (c + rest)
        by_a = (alpha * w + 2 * power * rest) / np.maximum(a, _LEAST)
        return w, by_a, beta * w / np.maximum(s, _LEAST)
