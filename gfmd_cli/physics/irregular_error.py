"""Discretisation errors of contacts that no law describes: from the change between two grids.

Contacts of few spots, and maps that are clipped, stepped, anisotropic or measured. One grid gives
no error. All constants were fitted to one half of the calibration set (`scripts/calibration.py`:
maps, and random surfaces with less than six spots) and checked on the other (docs/accuracy.md).
Each factor is the largest that any class of surface needs for 95 of 100 bars. Symbols: D = change
of an observable from the coarser to the finer grid, x = contact line times spacing.
"""

from dataclasses import replace
from math import hypot

from gfmd_cli.physics.error_estimates import UNKNOWN, Estimate, Level, unknown

# Error bars: FACTOR times the root of the sum of the squares of D and FLOOR times
#   a_r: x          sigma_p: sigma_p x / a_r          u_g: u_g x / a_r
FLOOR = {"a_r": 0.3, "sigma_p": 0.05, "u_g": 0.02}
FACTOR = {"a_r": 1.6, "sigma_p": 2.2, "u_g": 1.5}
CONTINUUM_FACTOR = 1.35  # of the area, extrapolated with first order in the spacing
MAX_EXPONENT = {"a_r": 2.5, "sigma_p": 1.0, "u_g": 3.0}
"""Exponents n up to which 95 of 100 bars of every class hold."""

DIVERGENT = 3.0  # exponent n from which the stress has no finite variance


def estimate_by_change(fine: Level, coarse: Level | None, n: float) -> dict[str, Estimate]:
    """Estimates from two nested grids; unknown from one grid or beyond `MAX_EXPONENT`."""
    estimates = unknown()
    if n >= DIVERGENT:
        estimates["sigma_p"] = replace(UNKNOWN, verdict="diverges")
    if coarse is None:
        return estimates
    makers = {"a_r": area_by_change, "sigma_p": stress_by_change, "u_g": gap_by_change}
    return estimates | {
        name: make(fine, coarse) for name, make in makers.items() if n <= MAX_EXPONENT[name]
    }


def _scale(name: str, fine: Level, change: float, unit: float) -> float:
    return hypot(change, FLOOR[name] * unit * fine.line)


def area_by_change(
    fine: Level, coarse: Level, continuum_factor: float = CONTINUUM_FACTOR
) -> Estimate:
    """Relative contact area: of first order in the spacing, as contact lines are a point wide."""
    change = fine.a_r - coarse.a_r
    scale = _scale("a_r", fine, change, 1.0)
    best = min(max(fine.a_r + change, 0.0), 1.0)
    error, rest = (factor * scale for factor in (FACTOR["a_r"], continuum_factor))
    whole, part = max(fine.a_r, 1 - fine.a_r), max(best, 1 - best)
    return Estimate(min(error, whole), best, min(rest, part), "regular")


def stress_by_change(fine: Level, coarse: Level, factor: float = FACTOR["sigma_p"]) -> Estimate:
    """Standard deviation of the pressure; the value on the grid is the best estimate."""
    scale = _scale("sigma_p", fine, fine.sigma_p - coarse.sigma_p, fine.sigma_p / fine.a_r)
    error = factor * scale
    return Estimate(error, fine.sigma_p, error, "regular")


def gap_by_change(fine: Level, coarse: Level, factor: float = FACTOR["u_g"]) -> Estimate:
    """Mean gap; the value on the grid is the best estimate."""
    scale = _scale("u_g", fine, fine.u_g - coarse.u_g, fine.u_g / fine.a_r)
    error = factor * scale
    return Estimate(error, fine.u_g, error, "regular")
