"""Two theories of the mean gap that are not in the paper; docs/mean_gap.md compares them.

`FittedWeight` has another weight of the elastic energy, with constants that scripts/gap_theories.py
fits to simulations.

`CoarseGrained` has no constant of its own (docs/theory.md): waves are added to the interface, the
shortest first. With all waves shorter than a wavelength the interface has a law u_g(p). Under a
longer wave it acts as springs of stiffness kappa = -dp/du_g in series with the elastomer of
stiffness k(q), so that the elastomer follows the fraction T = kappa / (kappa + k) of the wave.
Phi(p), the integral of u_g from 0 to p, increases by T k dC / 2 with waves of squared height dC.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
import scipy

from gfmd_cli.grid.arrays import Field
from gfmd_cli.maps.interpolation import monotone_cubic
from gfmd_cli.physics.persson import Persson

_LOWEST, _HIGHEST = 1e-8, 8.0  # pressures of the law [Delta_sigma]
_CELL, _BEND = 0.06, 0.5  # cells of 6 % of p well below _BEND, of 0.03 Delta_sigma above
_STEP_FRACTION = 1 / 64  # of the squared height that waves may add in one step
_STAGE = 1 - np.sqrt(0.5)  # of SDIRK2, of second order and L-stable
_MAX_IMPLICIT_STEPS = 50  # a bound; 2 to 3 are taken
_CONVERGED = 1e-6  # last Newton step relative to the largest gap; it converges quadratically
_VANISHED = 1e-12  # relative to the largest gap; rounding below
_ALPHA = (0.413, 0.609)  # alpha = 0.413 + 0.609 n
_BETA = (0.623, 0.874)  # beta = 0.623 exp(-n / 0.874)
_C = (0.921, -0.304, 0.144)  # c = 0.921 - 0.304 n + 0.144 n^2
_MIN_AREA = 1e-300  # below, the slopes count as zero


@dataclass(frozen=True, eq=False)
class CoarseGrained(Persson):
    """Persson theory of area and stress, with the mean gap by coarse-graining.

    The law is solved once, for 1e-8 to 8 Delta_sigma; u_g is good to 2e-4 for p <= Delta_sigma and
    5e-3 at 3 Delta_sigma. It is linear in ln p below the law, and zero beyond it.
    """

    mean_gap_source: ClassVar[str] = "coarse-graining"

    def _finite_gap(self, p: Field) -> Field:
        faces, gap = self._law
        known = gap > _VANISHED * gap[0]
        x = np.log(_centres(faces)[known])
        log_p = np.log(np.where(p > 0, p, 1.0))
        inside = np.exp(monotone_cubic(x, np.log(gap[known]))(np.clip(log_p, x[0], x[-1])))
        below = np.maximum(x[0] - log_p, 0.0) * (gap[0] - gap[1]) / (x[1] - x[0])
        return np.where(log_p <= x[-1], inside + below, 0.0)

    @cached_property
    def _law(self) -> tuple[Field, Field]:
        """Faces of cells of pressure, shape (cells + 1,), and u_g in the cells, shape (cells,)."""
        x = np.arange(np.log(_LOWEST / _BEND), _HIGHEST / _BEND, _CELL)
        faces = np.append(0.0, self.delta_sigma * _BEND * np.log1p(np.exp(x)))
        gap: Field = np.zeros(x.size)
        height = self.shells.height
        steps = 1 + (height / (_STEP_FRACTION * height.sum())).astype(int)
        stiffness = np.repeat(self.shells.energy / height, steps)
        for k, added in zip(stiffness[::-1], np.repeat(height / steps, steps)[::-1], strict=True):
            middle = _implicit(faces, gap, gap, k, _STAGE * added)
            start = gap + (1 - _STAGE) / _STAGE * (middle - gap)
            gap = _implicit(faces, start, middle, k, _STAGE * added)
        return faces, gap


@dataclass(frozen=True, eq=False)
class FittedWeight(Persson):
    """Persson theory with W = a_q^alpha a_s^beta [c + (1 - c) a_q^2] of two contact areas.

    a_q is the contact area at the scale q, as in Eq. (30), a_s that with all waves. Fitted at
    p* = 0.01 to 0.3 on nine spectra with lambda_r / lambda_s = 16 and 32 for n = 0 to 4.
    """

    n: Field
    """Exponent of k(q) of every shell; values beyond [0, 4] are replaced by these limits."""

    mean_gap_source: ClassVar[str] = "a fitted weight"

    def weight_slopes(self, a_q: Field, a_s: Field) -> tuple[Field, Field]:
        """See `Persson.weight_slopes`; 0 <= a_q, a_s <= 1."""
        n = np.clip(self.n, 0.0, 4.0)
        alpha = _ALPHA[0] + _ALPHA[1] * n
        beta = _BETA[0] * np.exp(-n / _BETA[1])
        c = _C[0] + _C[1] * n + _C[2] * n * n
        power, rest = a_q**alpha * a_s**beta, (1 - c) * a_q * a_q
        weight = power * (c + rest)
        by_q = (alpha * weight + 2 * power * rest) / np.maximum(a_q, _MIN_AREA)
        return by_q, beta * weight / np.maximum(a_s, _MIN_AREA)


def _centres(faces: Field) -> Field:
    """Pressures where ln p has its mean over the cells, to second order in their width."""
    return np.append(faces[1] / np.e, np.sqrt(faces[1:-1] * faces[2:]))


def _implicit(faces: Field, start: Field, guess: Field, k: float, added: float) -> Field:
    """The u that solves u = start + added d(T k / 2)/dp at u, by Newton steps from a guess.

    T is 0 at p = 0 and 1 at the largest pressure, so that the integral of u grows by k added / 2,
    the energy of full contact. u never rises with p.
    """
    width, distance = np.diff(faces), np.diff(_centres(faces))
    u = guess
    for _ in range(_MAX_IMPLICIT_STEPS):
        flattened = 1 / (1 - k * np.diff(u) / distance)
        flow = 0.5 * k * np.concatenate([[0.0], flattened, [1.0]])
        coupling = 0.5 * added * (k * flattened) ** 2 / distance
        bands = np.zeros((3, u.size))
        bands[0, 1:] = bands[2, :-1] = -coupling
        bands[1] = width - bands[0] - bands[2]
        missing = (start - u) * width + added * np.diff(flow)
        step = scipy.linalg.solve_banded((1, 1), bands, missing, check_finite=False)
        u = np.maximum.accumulate((u + step)[::-1])[::-1]
        if np.abs(step).max() < _CONVERGED * u[0]:
            break
    return u
