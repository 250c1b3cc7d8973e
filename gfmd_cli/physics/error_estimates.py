"""Observables of a contact on one grid, and estimates of their distance to the continuum."""

from dataclasses import dataclass
from math import nan, pi

from gfmd_cli.physics.observables import QUANTITIES


@dataclass(frozen=True)
class Level:
    """Observables of one contact on one of several nested grids."""

    points: float
    """Points per length L of the cell, at the wider of the spacings along x and y."""
    a_r: float
    """Relative contact area: share of the points that carry load."""
    sigma_p: float
    """Standard deviation of the stress [Delta_sigma, or any unit that all levels share]."""
    u_g: float
    """Mean gap [h_std]."""
    perimeter: float
    """Contact line per area times L, as in `Observables.perimeter`."""
    area: float = 1.0
    """Area of the cell / L^2."""
    border: float | None = None
    """Share of the border of the map in contact, with a free boundary; None with a periodic one."""

    @property
    def line(self) -> float:
        """Contact switches along rows and columns, per point."""
        return self.perimeter / self.points

    @property
    def spots(self) -> float:
        """Number of circles with this area and perimeter, in 8 r grid lines of radius r each."""
        return pi * self.area * self.perimeter**2 / (64 * self.a_r) if self.a_r > 0 else 0.0


@dataclass(frozen=True)
class Estimate:
    """Error of a value on a grid, and the estimated continuum value; NaN where unknown."""

    error: float
    """The continuum value is within value +- error, by calibration in 95 of 100 cases or more."""
    continuum: float
    """Estimate of the continuum value."""
    continuum_error: float
    """The continuum value is within continuum +- continuum_error with the same probability."""
    verdict: str
    """"exact": full contact; "regular"; "bound": only an interval is known; "slow": converges too
    slowly for a number; "diverges": there is no continuum value; "unknown": no valid error can be
    given from these grids."""


UNKNOWN = Estimate(nan, nan, nan, "unknown")


def unknown() -> dict[str, Estimate]:
    """Estimates that give no number."""
    return dict.fromkeys(QUANTITIES, UNKNOWN)
