"""How far a number measured on a grid is from that of the continuum, and which that is.

All constants were fitted to one half of the calibration set of `scripts/calibration.py` and checked
on the other (docs/accuracy.md): bodies of n = 0 to 4 and slabs, random, measured and simple
surfaces, each on up to six nested grids. Symbols: x = contact line times spacing, that is contact
switches per point; n = exponent of the stiffness k(q); w = 2 pi waves / points, the phase of the
short waves from one point to the next (pi at most); b = curvature / points^2, the height [h_std] by
which the surface bends from one point to the next.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import exp, hypot, isnan, log2, nan, pi, sqrt

import numpy as np

from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.observables import QUANTITIES
from gfmd_cli.physics.persson import Shells

# Counted area: too large by LINE n x. Measured: the share of x is 0.00, 0.05, 0.10, 0.15, 0.21,
# 0.26, 0.31, 0.36 at n = 0, 0.5, ... 3.5, the same on all grids that resolve the surface. Yastrebov
# et al. (2017) have (pi - 1 + ln 2)/24 = 0.118 for n = 1. No such share at n = 4: 0.3 to 0.9, and
# still rising on the finest grid of a broad contact.
LINE = 0.104
LAST_LINE = 3.5  # exponent up to which that holds; beyond, the error is below x and below a_r
LAST_STRESS = 2.5  # sigma_p converges as spacing^(3 - n): above, too slowly for a number

# Typical errors on one grid, shapes and medians by regression; of those that did as well, the ones
# that long waves added to a surface change least (they thin out its contacts, no more):
#   a_r, once corrected:  exp(-5.56 + 0.14 n) x^0.6 w
#   sigma_p, relative:    exp(-7.08 + 2.18 n) (x / a_r)^(3/2) w^(5/4) / (1 - a_r)^(1/2), n >= LEAST
#   u_g [h_std]:          exp(-6.80 + 0.62 n) (x / a_r)^(1/4) w^(3/2) (b u_g)^(1/2), n likewise
# Bars: ONE times that. With a coarser grid beside it, the change D from there to here, brought down
# by the order of convergence, in quadrature with FLOOR times the typical error, times MORE.
# Set so that 95.5 to 98.8 of 100 bars hold in the half of the set that was fitted.
ONE = {"a_r": 4.2, "sigma_p": 4.1, "u_g": 4.2}
MORE = {"a_r": 0.4, "sigma_p": 1.4, "u_g": 2.2}
FLOOR = {"a_r": 8.0, "sigma_p": 1.2, "u_g": 1.2}
ORDER = 3.0  # of u_g on a rough surface; sigma_p: 3 - n, at most 2; a_r: D as it is
LEAST = 0.5  # exponent below which bars no longer shrink: what is left at n = 0 is chance
ALONE = 2.5  # times the change: bar of a single body
BODY = 0.2  # typical error of a corrected a_r, in x, where nothing averages: one contact, or a line
SINGLE_GAP = 5.0  # in u_g / points^2: waves and paraboloids have 2.7 to 3.5 at 32 points
EXTRAPOLATED = 0.8  # bar of the extrapolated sigma_p, in bars of the value; n from 1 on


@dataclass(frozen=True)
class Level:
    """What one grid gave."""

    points: int
    """Per side of the cell."""
    a_r: float
    """Relative contact area: share of the points that carry load."""
    sigma_p: float
    """Standard deviation of the stress [Delta_sigma, or any unit that all levels share]."""
    u_g: float
    """Mean gap [h_std]."""
    perimeter: float
    """Contact line per area times L, as in `Observables.perimeter`."""

    @property
    def line(self) -> float:
        """Contact switches along rows and columns, per point."""
        return self.perimeter / self.points


@dataclass(frozen=True)
class Estimate:
    """The error of a value and the continuum behind it, NaN where nothing can be said."""

    error: float
    """The continuum value is within value +- error, by calibration in 95 of 100 cases or more."""
    continuum: float
    """Best guess at the continuum value."""
    continuum_error: float
    """The continuum value is within continuum +- continuum_error, as often."""
    verdict: str
    """"exact": full contact; "regular"; "bound": only an interval is known; "slow": converges too
    slowly for a number; "diverges": there is no continuum value; "unknown": more grids needed."""


@dataclass(frozen=True)
class Texture:
    """What counts of a rough surface."""

    waves: float
    """Short waves along the side of the cell: L rms(grad^2 h) / rms(grad h) / 2 pi."""
    curvature: float
    """L^2 rms(grad^2 h) / h_std."""


def texture(shells: Shells, length: float) -> Texture:
    """Texture of a surface by its spectrum, for a side L [m]."""
    height, q2 = shells.height, np.square(shells.q * length)
    flat, steep, bent = (float(np.sum(height * q2**power)) for power in (0, 1, 2))
    return Texture(sqrt(bent / steep) / (2 * pi), sqrt(bent / flat))


def local_exponent(stiffness: Callable[[Field, float], Field], points: int, length: float) -> float:
    """d ln k / d ln q at the highest wave of a grid, q = pi points / L; n where k = k_n q^n.

    `stiffness` is that of an elastomer, `length` the side of the cell [m]. A slab is a plate on a
    coarse grid and a half-space on a fine one.
    """
    q = np.pi * points / length * np.sqrt([0.5, 2.0])
    low, high = stiffness(q, length)
    return log2(high / low)


def estimate(
    levels: Sequence[Level], exponent: float, rough: Texture | None = None
) -> dict[str, Estimate]:
    """Errors and continuum values of `a_r`, `sigma_p` and `u_g` on the finest of nested grids.

    Parameters
    ----------
    levels : one contact at one pressure on grids N, N/2, ... in any order, all of which resolve the
        surface; the two finest count
    exponent : of the stiffness at the short waves of the finest grid, see `local_exponent`
    rough : texture of a rough surface. None for a single body or a line scene: there, no errors of
        many contacts average out, and one grid says nothing of sigma_p and u_g
    """
    ordered = sorted(levels, key=lambda level: level.points)
    fine, coarse = ordered[-1], ordered[-2] if len(ordered) > 1 else None
    if fine.a_r == 1:
        return {
            "a_r": Estimate(0.0, 1.0, 0.0, "exact"),
            "sigma_p": Estimate(0.0, fine.sigma_p, 0.0, "exact"),
            "u_g": Estimate(0.0, 0.0, 0.0, "exact"),
        }
    if fine.a_r == 0:  # no contact: not solved
        return dict.fromkeys(QUANTITIES, Estimate(nan, nan, nan, "unknown"))
    n, phase, bend = max(exponent, 0.0), nan, nan
    if rough is not None:
        phase, bend = 2 * pi * rough.waves / fine.points, rough.curvature / fine.points**2
    return {
        "a_r": _area(fine, coarse, n, phase),
        "sigma_p": _stress(fine, coarse, n, phase),
        "u_g": _gap(fine, coarse, n, phase, bend),
    }


def _bar(name: str, typical: float, change: float) -> float:
    """Bar from the typical error on this grid, and the change from the coarser one if any."""
    if isnan(change):
        return ONE[name] * typical
    if isnan(typical):
        return ALONE * abs(change)
    return MORE[name] * hypot(change, FLOOR[name] * typical)


def _area(fine: Level, coarse: Level | None, n: float, phase: float) -> Estimate:
    """Relative contact area: first order in the spacing, with a known share of the contact line."""
    if n > LAST_LINE:
        return Estimate(min(fine.a_r, fine.line), nan, nan, "bound")
    best = max(0.0, fine.a_r - LINE * n * fine.line)
    change = nan
    if coarse is not None:
        change = best - max(0.0, coarse.a_r - LINE * n * coarse.line)
    typical = BODY * fine.line
    if not isnan(phase):
        typical = exp(-5.56 + 0.14 * n) * fine.line**0.6 * phase
    error = min(_bar("a_r", typical, change), max(best, 1 - best))
    whole = min(fine.a_r - best + error, max(fine.a_r, 1 - fine.a_r))
    return Estimate(whole, best, error, "regular")


def _stress(fine: Level, coarse: Level | None, n: float, phase: float) -> Estimate:
    """Stress deviation: at the edge of a contact the stress goes like (1 - r^2/a^2)^(1 - n/2)."""
    value = fine.sigma_p
    if n > LAST_STRESS:
        return Estimate(nan, nan, nan, "diverges" if n >= 3 else "slow")
    patch = fine.line / fine.a_r
    typical = exp(-7.08 + 2.18 * max(n, LEAST)) * patch**1.5 * phase**1.25 * value
    typical /= sqrt(1 - fine.a_r)
    if coarse is None:
        error = _bar("sigma_p", typical, nan)
        return Estimate(error, nan if isnan(error) else value, error, _known(error))
    single = isnan(phase)
    rest = (value - coarse.sigma_p) / (2 ** min(1.0 if single else 2.0, 3 - n) - 1)
    error = _bar("sigma_p", typical, rest)
    if n < 1 or single:
        return Estimate(error, value, error, "regular")
    return Estimate(error, max(0.0, value + rest), EXTRAPOLATED * error, "regular")


def _gap(fine: Level, coarse: Level | None, n: float, phase: float, bend: float) -> Estimate:
    """Mean gap: fast and without a sign to rely on, so the value is its own best guess."""
    value = fine.u_g
    patch = fine.line / fine.a_r
    typical = exp(-6.8 + 0.62 * max(n, LEAST)) * patch**0.25 * phase**1.5 * sqrt(bend * value)
    order = 2.0 if isnan(phase) else ORDER
    change = nan if coarse is None else (value - coarse.u_g) / (2**order - 1)
    error = _bar("u_g", typical, change)
    if isnan(phase) and coarse is not None:
        error = max(error, SINGLE_GAP * value / fine.points**2)
    return Estimate(error, nan if isnan(error) else value, error, _known(error))


def _known(error: float) -> str:
    return "unknown" if isnan(error) else "regular"
