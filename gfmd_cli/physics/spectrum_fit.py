"""Power spectrum C(q) of a rough surface, its moments, and a self-affine fit.

For Gaussian roughness |h(q)|^2 / C(q) of a mode has an exponential distribution (chi^2 with two
degrees of freedom), so the likelihood of a sum over m modes is that of a Gamma distribution
(Whittle, Ark. Mat. 2 (1953) 423).
"""

from dataclasses import dataclass, replace
from math import inf, nan

import numpy as np
import scipy

from gfmd_cli.errors import InputError
from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.persson import Shells

MIN_RANGE = 3.0  # smallest q_s / q_1 of a fit; a choice
MIN_SHELLS = 8  # of a fit with two parameters; a choice
FIRST_SHARE = 0.9  # of the square of the rms gradient: waves of the first fit; a choice
FIRST_RANGE = 8.0  # smallest q / q_1 at the end of the first fit; a choice
BLUR = 3.0  # in q_1: a window blurs an abrupt cut-off; with 0, H = 0.3 becomes 0.35 (q_s = 64 q_1)
START_HURST = 0.8
START_ROLL_OFFS = 2.0, 8.0  # q_r / q_1
SIMPLEX = 0.2  # size of the first simplex in H and ln q_r; a choice
HURST_BOUNDS = (-1.0, 2.0)  # bounds of the fit: wider than those of a self-affine surface, 0 and 1
AT_BOUND = 0.02  # distance from a bound at which it, not the spectrum, determines the fit
DIFFERENCE_STEP = 1e-4  # in H and ln q_r, for second differences: about eps^(1/4)
SEARCH_ERROR = 2e-6
"""Standard error of H and ln q_r as the search finds them: the likelihood is flat at its maximum.
On 200 surfaces of random phases, of which the fit is exact, the largest errors were 1.5e-6 and
2.2e-6, their root mean squares half of them: `scripts/spectrum_fits.py --search --hurst 0.2 0.3 0.5
0.8 1.0`."""
ROUNDING_FACTOR = 1 - 1e-9  # by which sums and wavenumbers may be too small due to rounding
LONG_WAVES = 0.5  # of the highest wavenumber of the fit: range of a second fit
MIN_CHANGE = 0.01  # of H between both fits; a choice: a surface of random phases has tiny errors
MAX_CHANGE = 4.0
"""Largest change of H between both fits, over the root of the sum of the squares of their errors.
Measured: at most 2.8 of 309 parts of self-affine surfaces with 64 to 512 points per side; at least
4.8 with white noise of 0.3 of the rms difference of neighbours, on 256 points and 2 to 5 roll-off
wavelengths per side."""


@dataclass(frozen=True)
class Moments:
    """Root-mean-square height, gradient and curvature, over all directions."""

    height: float
    """Rms height [m]."""
    gradient: float
    """Rms of |grad h|."""
    curvature: float
    """Rms of the mean curvature (d^2 h/dx^2 + d^2 h/dy^2) / 2 [1/m]."""


@dataclass(frozen=True)
class SelfAffineFit:
    """Self-affine spectrum C = C_0 [1 + (q/q_r)^2]^(-1-H) up to q_s, fitted to a surface.

    Paper Eq. (3). H, q_r and C_0 maximise the likelihood of the waves below q_s; q_s gives the fit
    the rms gradient of the surface, which determines the contact area at light load.
    """

    hurst: float
    """Hurst exponent H."""
    hurst_error: float
    """Standard error of H from the curvature of the likelihood and the scatter, as that of `q_r`.
    It includes the change of H where the longer waves have another one."""
    q_r: float
    """Roll-off wavenumber [1/m]; 0 if the spectrum has none: C is then a power law."""
    q_r_error: float
    """Standard error of the roll-off wavenumber [1/m]."""
    q_s: float
    """Wavenumber of the short-wavelength cut-off [1/m]."""
    scatter: float
    """Deviance per shell: 1 for Gaussian roughness, 0 if only the phases are random, larger than 1
    if the surface has another spectrum."""
    c_0: float
    """C at long wavelengths, or C of the longest wave if there is no roll-off [m^2]."""
    q_1: float
    """Wavenumber of the longest wave [1/m]."""
    rms_height: float
    """Rms height of the fit [m]; that of a single surface differs, as it has few long waves."""
    hurst_of_long_waves: float = nan
    """H of the waves below `LONG_WAVES` of the range where it differs significantly, else NaN."""

    @property
    def rolloff_wavelength(self) -> float | None:
        """2 pi / q_r [m]; None if the spectrum has no roll-off."""
        return 2 * np.pi / self.q_r if self.q_r else None

    @property
    def rolloff_error(self) -> float | None:
        """Standard error of the roll-off wavelength [m]."""
        return 2 * np.pi / self.q_r**2 * self.q_r_error if self.q_r else None

    @property
    def cutoff_wavelength(self) -> float:
        """2 pi / q_s [m]."""
        return 2 * np.pi / self.q_s

    def density(self, q: Field) -> Field:
        """C(q) of one mode [m^2], zero beyond q_s. Paper Eq. (3)."""
        x = (self.hurst, np.log(self.q_r / self.q_1)) if self.q_r else (self.hurst,)
        return np.where(q <= self.q_s, self.c_0 * _shape(q, np.array(x), self.q_1), 0.0)


def moments(shells: Shells) -> Moments:
    """Rms height, gradient and curvature, from sums of C, q^2 C and q^4 C / 4 over all modes."""
    sums = [float(np.sum(shells.height * shells.q**power)) for power in (0, 2, 4)]
    return Moments(sums[0] ** 0.5, sums[1] ** 0.5, 0.5 * sums[2] ** 0.5)


def fit(shells: Shells, complete: float = inf) -> SelfAffineFit:
    """Fit a self-affine spectrum to that of a surface in two dimensions.

    The first fit is to the longest waves, those with most of the square of the rms gradient. It
    predicts the cut-off q_s, up to which the fit has all of it. The next fit is to waves up to half
    way there, and so on: a fit to waves beyond the cut-off, which have no power but rounding, noise
    and what a window adds, would be too steep.

    Raises InputError where the spectrum is too narrow to determine a fit, or not self-affine.

    Parameters
    ----------
    shells : the spectrum
    complete : wavenumber up to which the grid has the modes of all directions [1/m]
    """
    q, square = shells.q, shells.height * shells.q**2
    counts = _isotropic(q, shells.modes, complete)
    first = np.searchsorted(np.cumsum(square), FIRST_SHARE * square.sum()) + 1
    range_ = max(int(first), _below(q, FIRST_RANGE * q[0]))
    best, cut_off = _fit_below(shells, range_, counts)
    while cut_off > range_ + 1:
        further = (range_ + cut_off + 1) // 2
        nearest, cut_off = _fit_below(shells, further, counts)
        if cut_off < further:  # this fit has waves beyond the cut-off
            break
        best, range_ = nearest, further
    if min(abs(best.hurst - bound) for bound in HURST_BOUNDS) < AT_BOUND:
        raise InputError(f"{_range(q, range_)}: not self-affine there, H = {best.hurst:.2g}")
    if not np.isfinite([best.hurst_error, best.q_r_error]).all():
        raise InputError(f"{_range(q, range_)}: too narrow to determine H and q_r")
    highest = q[range_ - 1] - BLUR * q[0]
    return _with_change(best, shells, LONG_WAVES * highest, counts)


def _with_change(
    best: SelfAffineFit, shells: Shells, highest: float, counts: Field
) -> SelfAffineFit:
    """The fit with the H of the waves up to `highest`, if this differs significantly."""
    try:
        part = _up_to(shells.q, highest + BLUR * shells.q[0])
        longer, _ = _fit_below(shells, part, counts)
    except InputError:  # too few waves
        return best
    change = abs(longer.hurst - best.hurst)
    error = np.hypot(longer.hurst_error, best.hurst_error)
    if not change > max(MIN_CHANGE, MAX_CHANGE * error):
        return best
    whole = float(np.hypot(best.hurst_error, change))
    return replace(best, hurst_error=whole, hurst_of_long_waves=longer.hurst)


def _fit_below(shells: Shells, range_: int, counts: Field) -> tuple[SelfAffineFit, int]:
    """The fit to shells that end BLUR q_1 below the last of `range_`, and the number up to its q_s.

    `counts` are the numbers of modes of a surface whose spectrum depends on |q| alone.
    """
    q, power = shells.q, shells.height / shells.modes  # C(q) [m^2]
    used = _up_to(q, q[range_ - 1] - BLUR * q[0])
    if used < MIN_SHELLS or q[used - 1] < MIN_RANGE * q[0]:
        raise InputError(f"{_range(q, range_)}: too narrow for a fit")
    fitted = (q[:used], shells.modes[:used], power[:used])
    best = _maximise_likelihood(*fitted)
    c_0 = _scale(best, *fitted)
    squares = counts * c_0 * _shape(q, best, q[0])
    gradients = np.cumsum(squares * q**2)
    measured = moments(shells).gradient ** 2 * ROUNDING_FACTOR
    cut_off = min(int(np.searchsorted(gradients, measured)) + 1, q.size)
    errors, scatter = _errors(*fitted, best)
    q_r = float(q[0] * np.exp(best[1])) if best.size == 2 else 0.0
    nearest = SelfAffineFit(
        hurst=float(best[0]),
        hurst_error=errors[0],
        q_r=q_r,
        q_r_error=q_r * errors[-1] if q_r else 0.0,
        q_s=float(q[cut_off - 1]),
        scatter=scatter,
        c_0=c_0,
        q_1=float(q[0]),
        rms_height=float(np.sqrt(squares[:cut_off].sum())),
    )
    return nearest, cut_off


def _below(q: Field, limit: float) -> int:
    """Number of shells below a wavenumber, which may itself be that of a shell."""
    return int(np.searchsorted(q, limit * ROUNDING_FACTOR))


def _up_to(q: Field, limit: float) -> int:
    """Number of shells up to a wavenumber, which may itself be that of a shell."""
    return int(np.searchsorted(q, limit / ROUNDING_FACTOR))


def _range(q: Field, shells: int) -> str:
    """The wavenumbers of the first shells, for messages."""
    return f"spectrum: the slopes are of waves q = {q[0]:.3g} to {q[shells - 1]:.3g} 1/m"


def _shape(q: Field, x: Field, q_1: float) -> Field:
    """C(q) / C_0 below the cut-off: paper Eq. (3) for (H, ln q_r / q_1), a power law for (H,)."""
    square = (q / q_1) ** 2
    ratio = square / np.exp(2 * x[1]) + 1 if x.size == 2 else square
    return ratio ** (-1 - x[0])


def _misfit(x: Field, q: Field, count: Field, power: Field) -> float:
    """Negative log-likelihood of |h(q)|^2 up to a constant, maximised over C_0.

    The sum of m [C_i / C + ln C], which for C = C_0 c is sum m [ln(sum m C_i/c / sum m) + ln c].
    """
    total, shape = float(np.sum(count)), _shape(q, x, q[0])
    return float(total * np.log(_scale(x, q, count, power)) + np.sum(count * np.log(shape)))


def _scale(x: Field, q: Field, count: Field, power: Field) -> float:
    """Maximum-likelihood value of C_0."""
    return float(np.sum(count * power / _shape(q, x, q[0])) / np.sum(count))


def _maximise_likelihood(q: Field, count: Field, power: Field) -> Field:
    """Maximum-likelihood H and ln q_r / q_1, or H alone where q_r would be below the lowest mode.

    The likelihood can have two maxima, so that the search starts twice.
    """
    bounds = (HURST_BOUNDS, (-np.log(2.0), np.log(q[-1] / q[0])))

    def search(start: list[float]) -> scipy.optimize.OptimizeResult:
        sides = bounds[: len(start)]
        first = np.clip(start, *np.transpose(sides))
        corners = np.vstack([first, first + SIMPLEX * np.eye(len(start))])
        return scipy.optimize.minimize(
            _misfit,
            first,
            (q, count, power),
            method="Nelder-Mead",
            bounds=sides,
            options={
                "initial_simplex": corners,
                "xatol": 1e-8, "fatol": 1e-3, "maxiter": 4000, "maxfev": 4000,
            },
        )  # fmt: skip

    results = [search([START_HURST, float(np.log(ratio))]) for ratio in START_ROLL_OFFS]
    best: Field = min(results, key=lambda result: float(result.fun)).x
    return search([float(best[0])]).x if best[1] < 0 else best


def _errors(q: Field, count: Field, power: Field, best: Field) -> tuple[list[float], float]:
    """Standard errors of H and ln q_r from the curvature of the likelihood, and the deviance.

    They include the error of the search, SEARCH_ERROR.
    """
    steps = DIFFERENCE_STEP * np.eye(best.size)

    def misfit(shift: Field) -> float:
        return _misfit(best + shift, q, count, power)

    def second(a: Field, b: Field) -> float:
        difference = misfit(a + b) - misfit(a - b) - misfit(b - a) + misfit(-a - b)
        return difference / (4 * DIFFERENCE_STEP**2)

    curvature = np.array([[second(a, b) for b in steps] for a in steps])
    ratio = power / (_scale(best, q, count, power) * _shape(q, best, q[0]))
    # of q and -q only one is free: m / 2 samples per shell
    deviance = float(np.sum(count * (ratio - 1 - np.log(ratio)))) / (q.size - best.size - 1)
    try:
        variances = 2 * np.diag(np.linalg.inv(curvature)) * deviance
    except np.linalg.LinAlgError:
        variances = np.full(best.size, np.inf)
    errors = [float(np.hypot(np.sqrt(v), SEARCH_ERROR)) if v >= 0 else np.inf for v in variances]
    return errors, deviance


def _isotropic(q: Field, count: Field, complete: float) -> Field:
    """Number of modes of every shell, with those beyond the borders of the grid.

    Modes have a constant number per area of the plane of q. Beyond `complete` a shell has this
    number times the area of the ring up to the middles between it and its neighbours.
    """
    beyond = np.arange(q.size) >= _up_to(q, complete)
    if not beyond.any() or beyond[:2].any():
        return count
    edges = np.concatenate([[0.0], 0.5 * (q[1:] + q[:-1]), [q[-1]]])
    rings, inside = np.diff(edges**2), ~beyond
    return np.where(beyond, rings * (count[inside].sum() / rings[inside].sum()), count)
