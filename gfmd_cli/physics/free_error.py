"""Discretisation errors of contacts with a free boundary: from the change between two grids.

One grid gives no error. Area and gap have the bars of irregular surfaces, some of them wider. Where
contact reaches the border of the map, the stress has the singularity of a punch: s^(-n/2) at the
distance s from the border. Then <sigma^2> converges as spacing^(1 - n), and has no limit for
n >= 1. All factors were checked on the free contacts of `scripts/calibration.py --free`
(docs/accuracy.md).
"""

from dataclasses import replace

from gfmd_cli.physics.error_estimates import UNKNOWN, Estimate, Level, unknown
from gfmd_cli.physics.irregular_error import area_by_change, gap_by_change, stress_by_change

CONTINUUM_FACTOR = 1.8  # of the extrapolated area: with 1.35, 91 of 100 bars of profiles held
GAP_FACTOR = 1.8  # of the mean gap: with 1.5, 94 of 100 bars of maps in steps held
BORDER_FACTOR = 2.0  # times what is left of a change D at the order 1 - n: D / (2^(1 - n) - 1)
MAX_EXPONENT = 2.0  # n up to which any of the bars were calibrated
MAX_BORDER_EXPONENT = 0.75  # n up to which these bars were calibrated


def estimate_free(fine: Level, coarse: Level | None, n: float) -> dict[str, Estimate]:
    """Estimates from two nested grids; unknown from one grid, except full contact."""
    estimates = unknown()
    if fine.a_r == 0 or fine.border is None:
        return estimates
    if coarse is not None and n <= MAX_EXPONENT:
        estimates = {
            "a_r": area_by_change(fine, coarse, CONTINUUM_FACTOR),
            "sigma_p": stress_by_change(fine, coarse),
            "u_g": gap_by_change(fine, coarse, GAP_FACTOR),
        }
    if fine.a_r == 1:
        estimates["a_r"] = Estimate(0.0, 1.0, 0.0, "exact")
        estimates["u_g"] = Estimate(0.0, 0.0, 0.0, "exact")
    if fine.border > 0:
        estimates["sigma_p"] = _border_stress(fine, coarse, n)
    return estimates


def _border_stress(fine: Level, coarse: Level | None, n: float) -> Estimate:
    """Standard deviation of a pressure that is singular at the border of the map."""
    if n > MAX_BORDER_EXPONENT:
        return replace(UNKNOWN, verdict="diverges" if n >= 1 else "slow")
    if coarse is None:
        return UNKNOWN
    return stress_by_change(fine, coarse, BORDER_FACTOR / (2 ** (1 - n) - 1))
