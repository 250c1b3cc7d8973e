"""Power laws of Pr(sigma): theory at the edge of a contact, and fits to a study.

At a distance zeta inside the edge of a contact the stress is sigma = J zeta^(1 - n/2) (paper Eqs.
(5) and (6), corrected), on rough surfaces too (paper Sect. 5). A contact line of length l per area
then holds the share l dzeta of points between sigma and sigma + dsigma, so that for every n but 2

    Pr(sigma) = l <J^(-2/(2-n))> 2 / |2 - n| sigma^(n/(2-n)),

for n < 2 at small stress (n = 1/2: 1/3; n = 1: 1), for 2 < n < 4 at large stress (n = 3: -3, so
that the variance diverges with the logarithm of the spacing). A paraboloid has this law at all its
stresses; other contacts depart from it in proportion to zeta over their size, that is to
sigma^(2/(2-n)). At n = 2 the stress at the edge is finite and differs from edge to edge: no law
follows; at n = 4 the edge carries a line force. Persson theory is linear at small stress for all n.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import spherical_in

from gfmd_cli.analysis.distribution import PRIOR_SEEDS, StressDistribution
from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.observables import LOGARITHMIC_EDGES, geometric_middles

USABLE = 0.3  # largest relative error of a bin in a fit; a choice
NEAREST = 3  # bins next to the limit of resolution, for the prefactor of the edge law; a choice
FEWEST, BASE, LONGEST = 4, 6, 9  # bins of a window; ten are a decade; choices
SHIFTS = 3  # positions of the end of a window near the limit of resolution; a choice
SMALL, LARGE = 0.5, 0.75  # limits of small and large stresses / mean stress p / a_r; choices


def edge_exponent(n: float) -> float:
    """Exponent n / (2 - n) of Pr(sigma) by the stress near the edge; NaN where there is none."""
    return n / (2 - n) if 0 <= n < 4 and n != 2 else np.nan


@dataclass(frozen=True)
class PowerLaw:
    """Pr = prefactor sigma^exponent in a window, and the exponent at the edge itself."""

    law: str
    """"small" or "large" stress."""
    lowest: float
    """Lower edge of the first bin of the window [Delta_sigma]."""
    highest: float
    """Upper edge of the last bin."""
    exponent: float
    """Slope of a straight line through ln Pr(ln sigma): that of the window, not of the limit."""
    error: float
    """Its standard error: of the bins, of discretisation, of the choice of window."""
    prefactor: float
    limit: float
    """Exponent beside a term b sigma^(2/(2-n)), the first departure from the edge law, in all bins
    that may be used; NaN at n = 2 or with fewer than FEWEST + 1 bins."""
    limit_error: float
    theory: float
    """n / (2 - n) where the edge has this law at such stresses, else NaN."""
    edge_prefactor: float
    """Prefactor at the theoretical exponent in the NEAREST bins, NaN where there is none."""


@dataclass(frozen=True)
class Line:
    """Straight line, or with one more term, through ln Pr."""

    slope: float
    error: float
    """Standard error of the slope."""
    shared: float
    """The part of it that is shared between the bins."""
    intercept: float
    """ln Pr at sigma = 1 without the correction."""


def straight_line(
    x: Field, y: Field, own: Field, shared: Field, correction: Field | None = None
) -> Line:
    """Least squares of y = intercept + slope x (+ b correction).

    Parameters
    ----------
    x, y : ln sigma and ln Pr
    own : standard errors of y that bins have each for themselves
    shared : standard error that all have together, with its sign: y + t shared, t normal
    correction : the first departure from a power law
    """
    weight = 1 / (own**2 + shared**2)
    centre = float(weight @ x / weight.sum())
    columns = [np.ones_like(x), x - centre, *([] if correction is None else [correction])]
    design = np.array(columns)
    levers = np.linalg.pinv((design * weight) @ design.T) @ (design * weight)
    coefficients = levers @ y
    deviations = (y - coefficients @ design) / own
    freedom = max(x.size - len(columns), 1)
    misfit = np.sqrt(max(1.0, float(deviations @ deviations) / freedom))
    errors: Field = np.hypot(np.sqrt(levers**2 @ own**2) * misfit, levers @ shared)
    return Line(
        slope=float(coefficients[1]),
        error=float(errors[1]),
        shared=float(abs(levers[1] @ shared)),
        intercept=float(coefficients[0] - coefficients[1] * centre),
    )


def fit_power_law(stress: StressDistribution, law: str) -> PowerLaw | None:
    """Power law nearest to the limit of resolution; None where too few bins are resolved.

    "small": the lowest BASE usable bins below SMALL p / a_r. "large" (n > 2 alone): the highest
    above LARGE p / a_r. The window is then moved and stretched; half the range of exponents that
    this gives is an error of its own.
    """
    n, small = stress.curve.n, law == "small"
    if not (small or n > 2):
        return None
    edges, middle = LOGARITHMIC_EDGES, geometric_middles(LOGARITHMIC_EDGES)
    mean = stress.finest["p_star"] / stress.a_r
    usable = np.isfinite(stress.density) & (stress.error < USABLE)
    usable &= middle < SMALL * mean if small else middle > LARGE * mean
    places = np.flatnonzero(usable)
    runs = np.split(places, np.flatnonzero(np.diff(places) > 1) + 1)
    places = runs[0] if small else runs[-1][::-1]  # from the limit of resolution inwards
    if places.size < FEWEST:
        return None
    windows = [
        places[start : start + length]
        for start in range(SHIFTS)
        for length in range(FEWEST, LONGEST + 1)
        if start + length <= places.size
    ]
    base = places[:BASE]
    line = _line(stress, base, middle)
    slopes = [_line(stress, window, middle).slope for window in windows]
    theory = edge_exponent(n) if (n < 2) == small else np.nan  # n > 2, small: patch centres
    limit, limit_error = np.nan, np.nan
    if np.isfinite(theory) and places.size > FEWEST:
        correction = (middle / mean) ** (2 / (2 - n))
        longest = _line(stress, places[:LONGEST], middle, correction)
        shorter = _line(stress, places[: min(LONGEST, places.size) - 1], middle, correction)
        limit = longest.slope
        limit_error = float(np.hypot(longest.error, longest.slope - shorter.slope))
    nearest = base[:NEAREST]
    fixed = stress.extrapolated.log_density[nearest] - theory * np.log(middle[nearest])
    weight = 1 / stress.error[nearest] ** 2
    return PowerLaw(
        law=law,
        lowest=float(edges[base.min()]),
        highest=float(edges[base.max() + 1]),
        exponent=line.slope,
        error=float(np.hypot(line.error, 0.5 * (max(slopes) - min(slopes)))),
        prefactor=float(np.exp(line.intercept - _bending(line.slope))),
        limit=limit,
        limit_error=limit_error,
        theory=float(theory),
        edge_prefactor=float(np.exp(weight @ fixed / weight.sum() - _bending(theory))),
    )


def _line(
    stress: StressDistribution, chosen: Any, middle: Field, correction: Field | None = None
) -> Line:
    """The law in some bins.

    What surfaces differ by is counted as each bin's own, at first. With the law found anew without
    each seed in turn (jackknife) the error is that of whole curves, weighed as in `sampling`.
    """
    part, fine = stress.extrapolated, stress.counts[:, -1][:, chosen]
    x, y = np.log(middle[chosen]), part.log_density[chosen]
    own, shared = np.hypot(part.counting, stress.sampling)[chosen], part.discretisation[chosen]
    more = None if correction is None else correction[chosen]
    line, others = straight_line(x, y, own, shared, more), len(fine) - 1
    without = fine.sum(axis=0) - fine
    if not np.all(without > 0):  # as for a single seed
        return line
    shifts = np.log(without / others) - np.log(fine.mean(axis=0))
    slopes = [straight_line(x, y + shift, own, shared, more).slope for shift in shifts]
    scatter = others * float(np.var(slopes)) + line.shared**2
    error = np.sqrt((others * scatter + PRIOR_SEEDS * line.error**2) / (others + PRIOR_SEEDS))
    return replace(line, error=float(error))


def _bending(exponent: float) -> float:
    """ln of the mean of sigma^exponent over a bin over its value in the (geometric) middle."""
    half = 0.5 * np.log(LOGARITHMIC_EDGES[1] / LOGARITHMIC_EDGES[0])
    mean, width = spherical_in(0, [half * abs(exponent + 1), half])  # sinh(x) / x
    return float(np.log(mean / width))
