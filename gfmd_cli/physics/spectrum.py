"""What a rough surface is: its power spectrum C(q), moments, and the self-affine fit to it.

A mode's |h(q)|^2 scatters about C(q) like chi^2 with two degrees of freedom, so that a sum over
m modes has the likelihood of a Gamma distribution (Whittle, Ark. Mat. 2 (1953) 423).
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from gfmd_cli.errors import InputError
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.persson import Shells

SHORTEST = 3.0  # q_s / q_1 below which there is no range to fit
FEWEST = 8  # shells for a fit
ROUNDS = 40  # of fit and cut-off; ten are usual
HURST = (0.0, 2.0)  # bounds of the fit
STEP = 1e-4  # in H and ln q_r, for second differences
ALIKE = 1 - 1e-9  # a ratio that differs by rounding is reached


@dataclass(frozen=True)
class Moments:
    """Root-mean-square height, gradient and curvature; each a sum over C(q), of all directions."""

    height: float
    """[m]."""
    gradient: float
    """Of |grad h|."""
    curvature: float
    """Of the mean curvature (d^2 h/dx^2 + d^2 h/dy^2) / 2 [1/m]."""


@dataclass(frozen=True)
class SelfAffineFit:
    """The self-affine surface that comes nearest: C = C_0 [1 + (q/q_r)^2]^(-1-H) up to q_s.

    Paper Eq. (3). H and q_r maximise the likelihood below q_s, which gives the fit the measured
    ratio of rms gradient to rms height: the contact area at light load follows from these.
    """

    hurst: float
    hurst_error: float
    """Standard error, as are all errors here; scatter about the fit is counted as it is."""
    q_r: float
    """Roll-off [1/m]; 0 where the spectrum shows none: C is then a power of q."""
    q_r_error: float
    q_s: float
    """Short-wavelength cut-off [1/m]."""
    scatter: float
    """Deviance per shell: 1 where |h(q)|^2 is as random as that of Gaussian roughness, 0 where
    the phases alone are random, more where the surface has another spectrum."""
    c_0: float
    """C at long wavelengths; without a roll-off, C of the longest wave [m^2]."""
    q_1: float
    """Wavenumber of the longest wave [1/m]."""

    def density(self, q: Field) -> Field:
        """C(q) of one mode [m^2], zero beyond q_s. Paper Eq. (3)."""
        x = (self.hurst, np.log(self.q_r)) if self.q_r else (self.hurst,)
        return np.where(q <= self.q_s, self.c_0 * _shape(q, np.array(x), self.q_1), 0.0)


def density(shells: Shells) -> Field:
    """C(q) = <|h(q)|^2> of the modes of every shell [m^2]. Raises InputError without mode counts.

    Times L^2 it is the isotropic power spectral density of the field's convention [m^4].
    """
    return np.asarray(shells.height / _modes(shells))


def moments(shells: Shells) -> Moments:
    """rms height, gradient and curvature, sums of C, q^2 C, q^4 C / 4 over all modes."""
    sums = [float(np.sum(shells.height * shells.q**power)) for power in (0, 2, 4)]
    return Moments(sums[0] ** 0.5, sums[1] ** 0.5, 0.5 * sums[2] ** 0.5)


def fit(shells: Shells) -> SelfAffineFit:
    """Fit a self-affine surface to the spectrum of a surface in two dimensions.

    Likelihood below q_s and q_s by the rms gradient take turns until they agree. Raises InputError
    where the spectrum is too narrow to be fitted.
    """
    q, count, power = shells.q, _modes(shells), density(shells)
    best, used = np.array([0.8, np.log(2 * q[0])]), q.size
    for _ in range(ROUNDS):
        if used < FEWEST or q[used - 1] < SHORTEST * q[0]:
            raise InputError(
                f"spectrum: from q = {q[0]:.3g} to {q[used - 1]:.3g} 1/m; too narrow for a fit"
            )
        range_ = (q[:used], count[:used], power[:used])
        best = _most_likely(*range_, best)
        before, used = used, _cut_off(shells, best)
        if used == before:
            break
    errors, scatter = _errors(*range_, best)
    q_r = float(np.exp(best[1])) if best.size == 2 else 0.0
    q_r_error = q_r * errors[-1] if q_r else 0.0
    return SelfAffineFit(
        hurst=float(best[0]),
        hurst_error=errors[0],
        q_r=q_r,
        q_r_error=q_r_error,
        q_s=float(q[used - 1]),
        scatter=scatter,
        c_0=_scale(best, *range_),
        q_1=float(q[0]),
    )


def _modes(shells: Shells) -> Field:
    if shells.modes is None:
        raise InputError("spectrum: this study does not say how many modes its shells hold")
    return shells.modes


def _shape(q: Field, x: Field, q_1: float) -> Field:
    """C(q) / C_0 below the cut-off, for x = (H, ln q_r) paper Eq. (3), for x = (H,) a power."""
    ratio = (q / np.exp(x[1])) ** 2 + 1 if x.size == 2 else (q / q_1) ** 2
    return np.asarray(ratio ** (-1 - x[0]))


def _misfit(x: Field, q: Field, count: Field, power: Field) -> float:
    """Minus the logarithm of the likelihood over m of |h(q)|^2, C_0 at its best, but a constant.

    sum m [C_i / C + ln C], which for C = C_0 c is sum m [ln(sum m C_i/c / sum m) + ln c].
    """
    total, shape = float(np.sum(count)), _shape(q, x, q[0])
    return float(total * np.log(_scale(x, q, count, power)) + np.sum(count * np.log(shape)))


def _scale(x: Field, q: Field, count: Field, power: Field) -> float:
    """The most likely C_0."""
    return float(np.sum(count * power / _shape(q, x, q[0])) / np.sum(count))


def _most_likely(q: Field, count: Field, power: Field, start: Field) -> Field:
    """H and ln q_r; H alone where q_r would lie below the lowest mode."""
    bounds = (HURST, (np.log(q[0] / 2), np.log(q[-1])))[: start.size]
    found = minimize(
        _misfit,
        np.clip(start, *np.transpose(bounds)),
        (q, count, power),
        method="Nelder-Mead",
        bounds=bounds,
        options={"xatol": 1e-9, "fatol": 1e-9, "maxiter": 4000, "maxfev": 4000},
    )
    if start.size == 2 and found.x[1] < np.log(q[0]):
        return _most_likely(q, count, power, found.x[:1])
    return np.asarray(found.x)


def _errors(q: Field, count: Field, power: Field, best: Field) -> tuple[list[float], float]:
    """Standard errors of H and ln q_r from the curvature of the likelihood, and the scatter."""
    steps = STEP * np.eye(best.size)

    def misfit(shift: Field) -> float:
        return _misfit(best + shift, q, count, power)

    curvature = np.array(
        [
            [
                (misfit(a + b) - misfit(a - b) - misfit(b - a) + misfit(-a - b)) / (4 * STEP**2)
                for b in steps
            ]
            for a in steps
        ]
    )
    ratio = power / (_scale(best, q, count, power) * _shape(q, best, q[0]))
    # of q and -q one is free: m / 2 draws a shell
    deviance = float(np.sum(count * (ratio - 1 - np.log(ratio)))) / (q.size - best.size - 1)
    try:
        variances = 2 * np.diag(np.linalg.inv(curvature)) * deviance
    except np.linalg.LinAlgError:
        variances = np.full(best.size, np.inf)
    return [float(np.sqrt(v)) if v >= 0 else float("inf") for v in variances], deviance


def _cut_off(shells: Shells, best: Field) -> int:
    """How many shells of the fit have the ratio of rms gradient to rms height that was seen."""
    q, modes = shells.q, _modes(shells) * _shape(shells.q, best, shells.q[0])
    ratio = np.sqrt(np.cumsum(q**2 * modes) / np.cumsum(modes))
    seen = moments(shells)
    return int(np.clip(np.searchsorted(ratio, seen.gradient / seen.height * ALIKE) + 1, 1, q.size))
