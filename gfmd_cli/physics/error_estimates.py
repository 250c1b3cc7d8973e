"""Discretisation errors of contacts that no law describes: from the change between two grids.

These are contacts of few patches, maps that are clipped, stepped, anisotropic or measured, and
contacts with a free boundary; a_r on most rough surfaces has bars of `discretisation_error`. One
grid gives no error. Most constants were fitted to one half of the calibration set
(`scripts/calibration.py`: maps, and random surfaces with less than six patches; with `--free` for a
free boundary) and checked on the other (docs/calibration.md names the exceptions). Each factor is
the largest that any class of surface needs for 95 of 100 bars. Symbols: D = change of an observable
from the coarser to the finer grid, xi = contact line per area times spacing.

With a free boundary some bars are wider. Where contact reaches the border of the map, the stress
has the singularity of a punch: zeta^(-n/2) at the distance zeta from the border. Then <sigma^2>
converges as spacing^(1 - n), and has no limit for n >= 1.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import hypot, isnan, nan
from typing import NamedTuple

from gfmd_cli.physics.observables import MAIN_OBSERVABLES, estimated_patches
from gfmd_cli.status import ExplainedEnum

# Error bars: FACTOR times the root of the sum of the squares of D and FLOOR times
#   a_r: xi          sigma_p: sigma_p xi / a_r          u_g: u_g xi / a_r
FLOOR = {"a_r": 0.3, "sigma_p": 0.05, "u_g": 0.02}
FACTOR = {"a_r": 1.6, "sigma_p": 2.2, "u_g": 1.5}
MAX_EXPONENT = {"a_r": 2.5, "sigma_p": 1.0, "u_g": 3.0}
"""Exponents n up to which 95 of 100 bars of every class hold; those of a_r of surfaces that are not
band-limited only to `discretisation_error.MAX_KINKED_EXPONENT`."""

DIVERGENT = 3.0  # exponent n from which the stress has no finite variance
FLAT_TOP_FACTOR, MAX_FLAT_TOP_EXPONENT = 4.0, 0.5
"""Factor of sigma_p beyond this n on flat tops with steep edges: with 2.2, 86 of 100 bars of maps
of two levels held at n = 1, where the stress at the edges still grows from grid to grid."""
CONTINUUM_FACTOR = 1.8
"""Of the area, extrapolated with first order in the spacing: with 1.35, 91 to 94 of 100 bars held
of line profiles, with a free boundary and (n = 1.5) on strongly anisotropic surfaces."""
FREE_GAP_FACTOR = 1.8
"""Factor of the mean gap with a free boundary: with 1.5, 94 of 100 bars of maps in steps held."""
BORDER_FACTOR = 2.0  # times what is left of a change D at the order 1 - n: D / (2^(1 - n) - 1)
MAX_FREE_EXPONENT = 2.0  # n up to which any of the bars with a free boundary were calibrated
MAX_BORDER_EXPONENT = 0.75  # n up to which those of contact at the border were calibrated


@dataclass(frozen=True)
class GridValues:
    """Observables of one contact on one of several nested grids."""

    points: float
    """Points per length L of the cell, at the wider of the spacings along x and y."""
    a_r: float
    """Relative contact area: fraction of the points that carry load."""
    sigma_p: float
    """Standard deviation of the stress [Delta_sigma, or any unit that all grids share]."""
    u_g: float
    """Mean gap [h_std]."""
    perimeter: float
    """Contact line per area times L, as in `Observables.perimeter`."""
    area: float = 1.0
    """Area of the cell / L^2, of one copy where it consists of equal tiles or mirror images."""
    border: float | None = None
    """Fraction of the border of the map in contact, with a free boundary; None if periodic."""

    @property
    def switches_per_point(self) -> float:
        """Changes between contact and gap along rows and columns, per point."""
        return self.perimeter / self.points

    @property
    def patches(self) -> float:
        """Estimated number of contact patches that are independent of each other."""
        return estimated_patches(self.perimeter, self.a_r, self.area)


class GridPair(NamedTuple):
    """One contact on the finest of its grids, and what the errors there follow from."""

    fine: GridValues
    coarse: GridValues | None
    """On the next coarser grid, if the contact was solved there."""
    n: float
    """Exponent of the stiffness at the highest wavenumber of the finest grid, 0 or more."""

    def change(self, name: str) -> float:
        """Change of an observable from the coarser to the finer grid."""
        assert self.coarse is not None
        return float(getattr(self.fine, name)) - float(getattr(self.coarse, name))


class Verdict(ExplainedEnum):
    """What is known of the continuum value of an observable; the explanation follows its name."""

    REGULAR = "regular", "has an error bar"
    EXACT = "exact", "is exact: full contact, also between the points of the grid"
    BOUND = "bound", "is known only within an interval"
    SLOW = "slow", "converges too slowly with the grid for a value in the continuum"
    DIVERGES = "diverges", "has no value in the continuum"
    UNKNOWN = "unknown", "has no error bar that is known to hold: see docs/accuracy.md"

    @property
    def has_error(self) -> bool:
        """Whether the error on the grid is known."""
        return self in (Verdict.REGULAR, Verdict.EXACT, Verdict.BOUND)


@dataclass(frozen=True)
class Estimate:
    """Error of a value on a grid, and the estimated continuum value; NaN where unknown."""

    error: float
    """The continuum value is within value +- error, by calibration in 95 of 100 cases or more."""
    continuum: float
    """Estimate of the continuum value."""
    continuum_error: float
    """The continuum value is within continuum +- continuum_error with the same probability."""
    verdict: Verdict
    is_too_coarse: bool = False
    """Whether a single contact has too few points for an error of sigma_p: a finer grid helps."""

    @property
    def is_final(self) -> bool:
        """Whether no finer grid gives a smaller error."""
        return self.verdict in (Verdict.BOUND, Verdict.SLOW, Verdict.DIVERGES)


UNKNOWN = Estimate(nan, nan, nan, Verdict.UNKNOWN)
NO_ERRORS = dict.fromkeys(MAIN_OBSERVABLES, 0.0)


def unknown() -> dict[str, Estimate]:
    """Estimates that give no number."""
    return dict.fromkeys(MAIN_OBSERVABLES, UNKNOWN)


def on_grid(value: float, error: float, verdict: Verdict = Verdict.REGULAR) -> Estimate:
    """The value on the grid as the best estimate."""
    return Estimate(error, value, error, verdict)


def with_independent_error(estimate: Estimate, error: float) -> Estimate:
    """An estimate with a further error, independent of its own: the squares add."""
    errors = hypot(estimate.error, error), hypot(estimate.continuum_error, error)
    return replace(estimate, error=errors[0], continuum_error=errors[1])


def with_shift(estimate: Estimate, change: float) -> Estimate:
    """An estimate of a value that may be shifted by up to a change, which adds to the errors.

    Unknown where the change is NaN.
    """
    if isnan(change) and estimate.verdict.has_error:
        return UNKNOWN
    errors = estimate.error + change, estimate.continuum_error + change
    verdict = Verdict.REGULAR if estimate.verdict is Verdict.EXACT and change else estimate.verdict
    return replace(estimate, error=errors[0], continuum_error=errors[1], verdict=verdict)


def area_estimate(a_r: float, best: float, error: float, continuum_error: float) -> Estimate:
    """The best value of a relative contact area, with bars that do not leave 0 to 1."""
    whole, part = max(a_r, 1 - a_r), max(best, 1 - best)
    return Estimate(min(error, whole), best, min(continuum_error, part), Verdict.REGULAR)


def full_contact(fine: GridValues, errors: Mapping[str, float]) -> dict[str, Estimate]:
    """Full contact with a surface of which all grids contain the same waves.

    `errors` are those of a stress that may be tensile between the points of the grid.
    """
    values = {"a_r": 1.0, "sigma_p": fine.sigma_p, "u_g": 0.0}
    verdict = Verdict.REGULAR if errors["a_r"] > 0 else Verdict.EXACT
    return {name: on_grid(value, errors[name], verdict) for name, value in values.items()}


def estimate_by_change(grids: GridPair, *, has_flat_top: bool = False) -> dict[str, Estimate]:
    """Estimates from two nested grids; unknown from one grid or beyond `MAX_EXPONENT`.

    `has_flat_top`: whether the surface has flat tops with steep edges.
    """
    estimates = unknown()
    if grids.n >= DIVERGENT:
        estimates["sigma_p"] = replace(UNKNOWN, verdict=Verdict.DIVERGES)
    if grids.coarse is None:
        return estimates
    by_change = _by_change(grids, FACTOR["u_g"], has_flat_top=has_flat_top)
    return estimates | {
        name: by_change[name] for name in MAIN_OBSERVABLES if grids.n <= MAX_EXPONENT[name]
    }


def estimate_free(
    grids: GridPair,
    full_contact_errors: Mapping[str, float],
    *,
    same_waves: bool,
    has_flat_top: bool,
) -> dict[str, Estimate]:
    """Estimates of a contact with a free boundary.

    Unknown from one grid, except a_r and u_g of full contact.
    """
    fine, coarse, n = grids
    estimates = unknown()
    if coarse is not None and n <= MAX_FREE_EXPONENT:
        estimates = _by_change(grids, FREE_GAP_FACTOR, has_flat_top=has_flat_top)
    if fine.a_r == 1 and same_waves:
        exact = full_contact(fine, full_contact_errors)
        estimates |= {name: exact[name] for name in ("a_r", "u_g")}
    if fine.border:
        estimates["sigma_p"] = border_stress(grids)
    return estimates


def border_stress(grids: GridPair) -> Estimate:
    """Standard deviation of a pressure that is singular at the border of the map, or at a step."""
    if grids.n > MAX_BORDER_EXPONENT:
        return replace(UNKNOWN, verdict=Verdict.DIVERGES if grids.n >= 1 else Verdict.SLOW)
    if grids.coarse is None:
        return UNKNOWN
    return _value_by_change("sigma_p", grids, BORDER_FACTOR / (2 ** (1 - grids.n) - 1))


def _by_change(grids: GridPair, gap_factor: float, *, has_flat_top: bool) -> dict[str, Estimate]:
    is_steep = has_flat_top and grids.n > MAX_FLAT_TOP_EXPONENT
    factor = FLAT_TOP_FACTOR if is_steep else FACTOR["sigma_p"]
    return {
        "a_r": _area(grids),
        "sigma_p": _value_by_change("sigma_p", grids, factor),
        "u_g": _value_by_change("u_g", grids, gap_factor),
    }


def _area(grids: GridPair) -> Estimate:
    """Relative contact area: of first order in the spacing, as contact lines are a point wide."""
    fine, change = grids.fine, grids.change("a_r")
    scale = hypot(change, FLOOR["a_r"] * fine.switches_per_point)
    best = min(max(fine.a_r + change, 0.0), 1.0)
    return area_estimate(fine.a_r, best, FACTOR["a_r"] * scale, CONTINUUM_FACTOR * scale)


def _value_by_change(name: str, grids: GridPair, factor: float) -> Estimate:
    """sigma_p or u_g: the value on the grid is the best estimate."""
    fine = grids.fine
    value: float = getattr(fine, name)
    floor = FLOOR[name] * value / fine.a_r * fine.switches_per_point
    return on_grid(value, factor * hypot(grids.change(name), floor))
