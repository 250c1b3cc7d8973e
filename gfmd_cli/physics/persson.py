"""Persson's contact theory for a linear elastomer of any stiffness k(q).

Equation numbers are those of the paper: Mueser, "Elastic contacts of randomly rough surfaces across
the spatial dimensions", Sect. 4.1 and 5.2. Sums over q never contain q = 0.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from scipy.special import erf, erfcx, erfinv

from gfmd_cli.grid.arrays import Field
from gfmd_cli.maps.interpolation import monotone_cubic

_GAMMA = {0.0: 0.5, 0.5: 0.45, 1.0: 0.35, 2.0: 0.2, 3.0: 0.1, 4.0: 0.02}  # Eq. (39)
EXACT_SHELLS, LOGARITHMIC_BINS = 64, 500  # shells of one |q|: a choice; bins: Sect. 4.1.1
_SAME_SHELL = 1e-9  # relative difference of |q| within one shell: far above rounding
_CHUNK = 1 << 18  # elements of one temporary array, 2 MiB: fits a cache and bounds the memory
_NARROW = 1e-5  # bin width / variance where the mid point errs as little as the difference, ~1e-10
_TABLE_PRESSURES = (1e-6, 20.0, 300)  # pressures [Delta_sigma] of a table of the mean gap
UNDERFLOW = 40.0  # exp(-x^2) is zero in double precision well before this x


def ierfc(x: Field) -> Field:
    """Integral of erfc from x to infinity: exp(-x^2)/sqrt(pi) - x erfc(x), to 2 x^2 roundings."""
    y = np.minimum(np.abs(x), UNDERFLOW)
    tail: Field = np.exp(-y * y) * (1 / np.sqrt(np.pi) - y * erfcx(y))
    value: Field = tail + 2 * np.maximum(-x, 0.0)  # ierfc(-y) = ierfc(y) + 2 y
    return value


def gamma_n(n: Field | float) -> Field:
    """Weight gamma_n of the elastic energy for k ~ q^n, 0 <= n <= 4.

    Paper Eq. (39), which tabulates n = 0, 1/2, 1, 2, 3, 4 (fitted to simulations of one surface).
    In between, a monotone cubic (PCHIP) passes through the table.

    Raises ValueError for n outside [0, 4].
    """
    exponent = np.asarray(n, dtype=np.float64)
    nodes, values = np.array(list(_GAMMA.items())).T
    if np.any((exponent < nodes[0]) | (exponent > nodes[-1])):
        raise ValueError(f"gamma_n is known for 0 <= n <= 4, got n = {n}")
    if np.isin(exponent, nodes).all():
        return values[np.searchsorted(nodes, exponent)]
    return monotone_cubic(nodes, values)(exponent)


def gamma_slab(qt: Field) -> Field:
    """Weight gamma_4 + (gamma_1 - gamma_4) tanh(q t / 6) of a slab of thickness t.

    Paper Eq. (42): gamma_4 for q t -> 0 (thin sheet), gamma_1 for q t -> infinity (half-space); the
    paper's conclusions name the two limits the wrong way round.
    """
    return _GAMMA[4.0] + (_GAMMA[1.0] - _GAMMA[4.0]) * np.tanh(np.asarray(qt) / 6)


@dataclass(frozen=True, eq=False)
class Shells:
    """Spectrum of a surface in bins of rising wavenumber, all arrays of shape (bins,)."""

    q: Field  # mean wavenumber, weighted with C(q) [1/m]
    height: Field  # sum of C(q) [m^2]
    energy: Field  # sum of k C: twice the energy of full contact [Pa m]
    variance: Field  # sum of k^2 C: variance of the full-contact stress, Eq. (23) [Pa^2]
    gamma: Field  # mean gamma of Eq. (30), weighted with k C
    modes: Field  # number of modes with power, for fits of the spectrum

    def exponents(self) -> Field:
        """d ln k / d ln q, of k = sum of k^2 C / sum of k C in every shell; NaN for one shell."""
        if self.q.size < 2:
            return np.full_like(self.q, np.nan)
        return np.gradient(np.log(self.variance / self.energy), np.log(self.q))


def shells(q: Field, power: Field, k: Field, gamma: Field, modes: Field) -> Shells:
    """Bin the modes of a surface: exact shells at long wavelengths, then logarithmic bins.

    Paper Sect. 4.1.1 (with 500 bins). Empty bins are dropped.

    Parameters
    ----------
    q : |q| > 0 of every mode [1/m], shape (modes,)
    power : |h(q)|^2 times the multiplicity of the mode [m^2], shape (modes,); not zero for all
    k : stiffness k(q) [Pa/m], shape (modes,)
    gamma : weight gamma(q) of Eq. (30), shape (modes,)
    modes : number of modes that an entry represents, shape (modes,)
    """
    edges = bin_edges(q[power > 0])
    sums = np.zeros((6, edges.size + 1))
    for start in range(0, q.size, _CHUNK):
        part = slice(start, start + _CHUNK)
        bin_number = np.searchsorted(edges, q[part])
        height, energy = power[part], k[part] * power[part]
        products = (q[part] * height, height, energy, k[part] * energy, gamma[part] * energy)
        weights = (*products, modes[part] * (height > 0))
        for total, weight in zip(sums, weights, strict=True):
            total += np.bincount(bin_number, weight, minlength=total.size)
    moment, height, energy, variance, weighted, mode_counts = sums[:, sums[3] > 0]
    return Shells(moment / height, height, energy, variance, weighted / energy, mode_counts)


def bin_edges(q: Field) -> Field:
    """Inner edges: half-way between the smallest |q|, then in geometric progression."""
    low = _smallest_distinct(q, EXACT_SHELLS + 1)
    between = 0.5 * (low[1:] + low[:-1])
    if low.size <= EXACT_SHELLS:
        return between
    return np.concatenate([between, np.geomspace(between[-1], q.max(), LOGARITHMIC_BINS + 1)[1:-1]])


def _smallest_distinct(q: Field, count: int) -> Field:
    """The `count` smallest different values in rising order, or all."""
    for size in (4 * count, q.size):  # so few modes nearly always have enough different values
        low = np.sort(np.partition(q, size)[:size] if size < q.size else q)
        distinct: Field = low[np.append(True, np.diff(low) > _SAME_SHELL * low[1:])]
        if distinct.size >= count:
            break
    return distinct[:count]


@dataclass(frozen=True, eq=False)
class Persson:
    """Persson theory of one surface and elastomer; pressures in the unit of sqrt(variance)."""

    shells: Shells

    mean_gap_source: ClassVar[str] = ""
    """Source of the mean gap where it is not the paper."""

    @property
    def delta_sigma(self) -> float:
        """Standard deviation Delta_sigma of the stress in full contact. Paper Eq. (23)."""
        return float(np.sqrt(np.sum(self.shells.variance)))

    def contact_area(self, p: Field | float) -> Field:
        """Relative contact area a_r = erf(p / sqrt(2) Delta_sigma). Paper Eq. (25)."""
        return erf(self._reduced(p))

    def stress_density(self, sigma: Field | float, p: Field | float) -> Field:
        """Continuous part of the stress distribution Pr(sigma); zero for sigma <= 0.

        Paper Eq. (24), corrected: [exp{-(sigma-p)^2/2V} - exp{-(sigma+p)^2/2V}] / sqrt(2 pi V) with
        V = Delta_sigma^2 (printed: the same exponential twice, over sqrt(2 pi) Delta_sigma^2).

        Parameters
        ----------
        sigma, p : stress and pressure, shapes that broadcast
        """
        width = self.delta_sigma
        x, y = np.maximum(sigma, 0.0) / width, np.asarray(p) / width
        apart = np.minimum(np.abs(x - y), UNDERFLOW)
        density: Field = -np.expm1(-2 * x * y) * np.exp(-0.5 * apart**2)
        density /= np.sqrt(2 * np.pi) * width
        return density

    def stress_deviation(self, p: Field | float) -> Field:
        """Standard deviation sigma_p of the stress under pressure p, in the unit of p.

        Its square, paper Eq. (26) times Delta_sigma^2, is the integral of a_r over the variance.
        """
        return np.sqrt(_resolved_variance(np.asarray(p), self.delta_sigma**2))

    def weight_slopes(self, a_q: Field, a_s: Field) -> tuple[Field, Field]:
        """Derivatives by a_q and a_s of W = gamma a_q + (1 - gamma) a_q^3, weight of the energy.

        Paper Eq. (30), which does not contain a_s. Both of shape (pressures, bins).

        Parameters
        ----------
        a_q : mean contact area of every bin, shape (pressures, bins)
        a_s : contact area with all waves, shape (pressures, 1)
        """
        gamma = self.shells.gamma
        return gamma + 3 * ((1 - gamma) * (a_q * a_q)), np.zeros_like(a_q)

    def mean_gap(self, p: Field | float) -> Field:
        """Mean gap u_g = int_p^infinity dp' v'(p') / p'; infinite at p = 0.

        Paper Eq. (28), where v = sum_q W k C / 2 is the elastic energy, Eqs. (29)-(32). The
        Gauss-Legendre panels in ln p' are shared by all pressures and summed from the top, where
        the integrand has vanished: all terms are positive, so that u_g keeps its relative accuracy
        (about 1e-14) while it falls by orders of magnitude.

        Parameters
        ----------
        p : pressure >= 0, any shape
        """
        p = np.asarray(p, dtype=np.float64)
        return np.where(p > 0, self._finite_gap(p), np.where(np.isnan(p), np.nan, np.inf))

    def _finite_gap(self, p: Field) -> Field:
        """Mean gap, of any value where p = 0."""
        edges = _panel_edges(p[p > 0], self.delta_sigma)
        ends = np.log(edges)[:, None]
        centre, half = 0.5 * (ends[1:] + ends[:-1]), 0.5 * (ends[1:] - ends[:-1])
        node, weight = np.polynomial.legendre.leggauss(8)  # 16 nodes change u_g by < 3e-14
        slope = self._energy_slope(np.exp(centre + half * node))
        panels = np.sum(half * weight * slope, axis=1)
        gap = np.append(np.cumsum(panels[::-1])[::-1], 0.0)
        at = np.minimum(np.searchsorted(edges, p), gap.size - 1)
        return gap[at]

    def pressure_at_area(self, a_r: Field | float) -> Field:
        """Pressure at a relative contact area, sqrt(2) Delta_sigma erfinv(a_r). Eq. (25)."""
        return np.sqrt(2) * self.delta_sigma * erfinv(a_r)

    def pressure_at_gap(self, u_g: Field | float) -> Field:
        """Pressure at a mean gap, Eq. (28) inverted by a monotone cubic in logarithms.

        Good to 2e-4 for Delta_sigma / 1e6 <= p <= 6 Delta_sigma; NaN outside of `gap_range`.
        """
        rising, table = self._pressures_over_gap
        smallest, largest = self.gap_range
        u_g = np.asarray(u_g)
        known = (smallest <= u_g) & (u_g <= largest)
        log_gap = -np.log(np.where(known, u_g, np.nan))
        return np.exp(table(np.clip(log_gap, rising[0], rising[-1])))

    @property
    def gap_range(self) -> tuple[float, float]:
        """The smallest and the largest mean gap of which `pressure_at_gap` gives the pressure."""
        rising, _ = self._pressures_over_gap
        return float(np.exp(-rising[-1])), float(np.exp(-rising[0]))

    @cached_property
    def _pressures_over_gap(self) -> tuple[Field, Callable[[Field], Field]]:
        """Rising values of -ln u_g, and ln p as a function of them; NaN without a mean gap."""
        p = self.delta_sigma * np.geomspace(*_TABLE_PRESSURES)
        gap = self.mean_gap(p)
        known = gap > 0
        if not known.any():
            return np.full(2, np.nan), np.copy  # any function: it is only called with NaN
        rising = -np.log(gap[known])
        return rising, monotone_cubic(rising, np.log(p[known]))

    def _reduced(self, p: Field | float) -> Field:
        """p / sqrt(2) Delta_sigma."""
        return np.asarray(p) / (np.sqrt(2) * self.delta_sigma)

    def _energy_slope(self, p: Field) -> Field:
        """dv/dp, of the shape of p. Paper Eqs. (29) and (30)."""
        energy = 0.5 * self.shells.energy
        slope = np.empty(p.size)
        rows = max(1, _CHUNK // energy.size)
        for start in range(0, p.size, rows):
            part = slice(start, start + rows)
            pressure = p.ravel()[part]
            a_q, slope_q = _bin_area(pressure, self.shells.variance)
            x = np.minimum(self._reduced(pressure), UNDERFLOW)[:, None]
            slope_s = np.sqrt(2 / np.pi) / self.delta_sigma * np.exp(-x * x)
            by_q, by_s = self.weight_slopes(a_q, erf(x))
            slope[part] = (by_q * slope_q + by_s * slope_s) @ energy
        return slope.reshape(p.shape)


def _bin_area(p: Field, variance: Field) -> tuple[Field, Field]:
    """Mean contact area of every bin and its slope in p, both of shape (pressures, bins).

    Paper Eq. (31) and Eq. (32), corrected: I = Psi(V+) - Psi(V-) with
    Psi = (p^2 + V) erf(p/sqrt(2V)) + p sqrt(2V/pi) exp(-p^2/2V) (printed: -I/2).
    """
    total, p = np.cumsum(variance), p[:, None]
    narrow = variance < _NARROW * total
    width = np.where(narrow, 1.0, variance)
    area = np.diff(_resolved_variance(p, total), prepend=0.0) / width
    slope = np.diff(2 * np.sqrt(2 * total) * ierfc(p / np.sqrt(2 * total)), prepend=0.0) / width
    if np.any(narrow):  # the mid point instead of a difference that cancels
        scale = np.sqrt(2 * total - variance)[narrow]
        x = np.minimum(p / scale, UNDERFLOW)
        area[:, narrow] = erf(x)
        slope[:, narrow] = 2 / np.sqrt(np.pi) * np.exp(-x * x) / scale
    return area, slope


def _resolved_variance(p: Field, variance: Field | float) -> Field:
    """int_0^V dV' erf(p/sqrt(2V')) = Psi(V) - Psi(0) in Eq. (32), as a sum of positive terms."""
    x = p / np.sqrt(2 * variance)
    return variance * erf(x) + p * np.sqrt(2 * variance) * ierfc(x)


def _panel_edges(p: Field, delta_sigma: float) -> Field:
    """Increasing pressures from the smallest p to the end of the Gaussian tail, including every p.

    A panel spans at most a factor sqrt(e), and at most a factor e^4 of exp(-p^2 / 2 Delta_sigma^2).
    """
    if not p.size:
        return np.array([1.0, 1.0])
    highest = min(float(p.max() / delta_sigma), UNDERFLOW)
    y_end = min(0.5 * highest**2 + 40, 745)  # exp(-40) < eps; exp(-745) is 0
    end = delta_sigma * np.sqrt(2 * y_end)
    start = min(p.min(), end)
    tail = delta_sigma * np.sqrt(2 * np.arange(4, y_end, 4))
    steps = 2 + int(2 * (np.log(end) - np.log(start)))
    edges = np.concatenate([p[p < end], tail[tail > start], np.geomspace(start, end, steps)])
    return np.unique(edges)
