"""Power spectrum C(q) of a rough surface, its moments, and a self-affine fit.

For Gaussian roughness |h(q)|^2 / C(q) of a mode has an exponential distribution (chi^2 with two
degrees of freedom), so the likelihood of a sum over m modes is that of a Gamma distribution
(Whittle, Ark. Mat. 2 (1953) 423).
"""

from dataclasses import dataclass
from math import inf

import numpy as np
from scipy.optimize import minimize

from gfmd_cli.errors import InputError
from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.persson import Shells

MIN_RANGE = 3.0  # smallest q_s / q_1 of a fit; a choice
MIN_SHELLS = 8  # of a fit with two parameters; a choice
MAX_ITERATIONS = 40  # of fit and cut-off; ten are usual
HURST_BOUNDS = (0.0, 2.0)  # bounds of the fit: wider than those of a self-affine surface, 0 and 1
STEEPEST = 0.99 * HURST_BOUNDS[1]  # from which the bound, not the spectrum, determines the fit
NEGLIGIBLE_GRADIENT = 1e-4  # fraction of its square; a choice: 16 bits leave 1e-5 or less
DIFFERENCE_STEP = 1e-4  # in H and ln q_r, for second differences: about eps^(1/4)
ROUNDING_FACTOR = 1 - 1e-9  # factor by which sums may be too small due to rounding


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

    Paper Eq. (3). H and q_r maximise the likelihood below q_s; q_s is such that the fit has the
    measured ratio of rms gradient to rms height, which determines the contact area at light load.
    """

    hurst: float
    """Hurst exponent H."""
    hurst_error: float
    """Standard error of H, from the likelihood times the measured scatter, as of `q_r`."""
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
        x = (self.hurst, np.log(self.q_r)) if self.q_r else (self.hurst,)
        return np.where(q <= self.q_s, self.c_0 * _shape(q, np.array(x), self.q_1), 0.0)


def density(shells: Shells) -> Field:
    """C(q) = <|h(q)|^2> of the modes of every shell [m^2].

    C(q) L^2 is the isotropic power spectral density in the usual convention [m^4].
    """
    return shells.height / shells.modes


def moments(shells: Shells) -> Moments:
    """Rms height, gradient and curvature, from sums of C, q^2 C and q^4 C / 4 over all modes."""
    sums = [float(np.sum(shells.height * shells.q**power)) for power in (0, 2, 4)]
    return Moments(sums[0] ** 0.5, sums[1] ** 0.5, 0.5 * sums[2] ** 0.5)


def fit(shells: Shells, complete: float = inf) -> SelfAffineFit:
    """Fit a self-affine spectrum to that of a surface in two dimensions.

    The fit below q_s and the choice of q_s from the rms gradient alternate until q_s no longer
    changes. The first fit leaves out the shortest waves if they contribute nearly nothing to the
    rms gradient, as do those of rounded heights.

    Raises InputError where the spectrum is too narrow for a fit, or decreases too fast.

    Parameters
    ----------
    shells : the spectrum
    complete : wavenumber up to which the grid has the modes of all directions [1/m]
    """
    q, count, power = shells.q, shells.modes, density(shells)
    isotropic = _isotropic(q, count, complete)
    gradients = np.cumsum(shells.height * q**2)
    shell_count = int(np.searchsorted(gradients, (1 - NEGLIGIBLE_GRADIENT) * gradients[-1])) + 1
    best = np.array([0.8, np.log(2 * q[0])])
    for _ in range(MAX_ITERATIONS):
        if shell_count < MIN_SHELLS or q[shell_count - 1] < MIN_RANGE * q[0]:
            raise InputError(
                f"spectrum: from q = {q[0]:.3g} to {q[shell_count - 1]:.3g} 1/m; too narrow for a "
                "fit"
            )
        range_ = (q[:shell_count], count[:shell_count], power[:shell_count])
        best = _maximise_likelihood(*range_, best)
        before, shell_count = shell_count, _cut_off(shells, isotropic, best)
        if shell_count == before:
            break
    if best[0] > STEEPEST:
        raise InputError(
            "spectrum: decreases faster than that of a self-affine surface: smooth heights, or the "
            "borders of a map that is not periodic hide its short waves"
        )
    errors, scatter = _errors(*range_, best)
    q_r = float(np.exp(best[1])) if best.size == 2 else 0.0
    return SelfAffineFit(
        hurst=float(best[0]),
        hurst_error=errors[0],
        q_r=q_r,
        q_r_error=q_r * errors[-1] if q_r else 0.0,
        q_s=float(q[shell_count - 1]),
        scatter=scatter,
        c_0=_scale(best, *range_),
        q_1=float(q[0]),
    )


def _shape(q: Field, x: Field, q_1: float) -> Field:
    """C(q) / C_0 below the cut-off: paper Eq. (3) for x = (H, ln q_r), a power law for x = (H,)."""
    ratio = (q / np.exp(x[1])) ** 2 + 1 if x.size == 2 else (q / q_1) ** 2
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


def _maximise_likelihood(q: Field, count: Field, power: Field, start: Field) -> Field:
    """Maximum-likelihood H and ln q_r, or H alone where q_r would be below the lowest mode."""
    bounds = (HURST_BOUNDS, (np.log(q[0] / 2), np.log(q[-1])))[: start.size]
    result = minimize(
        _misfit,
        np.clip(start, *np.transpose(bounds)),
        (q, count, power),
        method="Nelder-Mead",
        bounds=bounds,
        options={"xatol": 1e-9, "fatol": 1e-9, "maxiter": 4000, "maxfev": 4000},
    )
    if start.size == 2 and result.x[1] < np.log(q[0]):
        return _maximise_likelihood(q, count, power, result.x[:1])
    return result.x


def _errors(q: Field, count: Field, power: Field, best: Field) -> tuple[list[float], float]:
    """Standard errors of H and ln q_r from the curvature of the likelihood, and the deviance."""
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
    return [float(np.sqrt(v)) if v >= 0 else float("inf") for v in variances], deviance


def _isotropic(q: Field, count: Field, complete: float) -> Field:
    """Number of modes of every shell, with those beyond the borders of the grid.

    Modes have a constant number per area of the plane of q. Beyond `complete` a shell has this
    number times the area of the ring up to the middles between it and its neighbours.
    """
    beyond = q > complete
    if not beyond.any() or beyond[:2].any():
        return count
    edges = np.concatenate([[0.0], 0.5 * (q[1:] + q[:-1]), [q[-1]]])
    rings, inside = np.diff(edges**2), ~beyond
    return np.where(beyond, rings * (count[inside].sum() / rings[inside].sum()), count)


def _cut_off(shells: Shells, count: Field, best: Field) -> int:
    """Number of shells with which the fit has the measured ratio of rms gradient to height.

    `count` are the numbers of modes of a surface whose spectrum depends on |q| alone.
    """
    q, power = shells.q, count * _shape(shells.q, best, shells.q[0])
    ratio = np.sqrt(np.cumsum(q**2 * power) / np.cumsum(power))
    measured = moments(shells)
    reached = np.searchsorted(ratio, measured.gradient / measured.height * ROUNDING_FACTOR) + 1
    return int(np.clip(reached, 1, q.size))
