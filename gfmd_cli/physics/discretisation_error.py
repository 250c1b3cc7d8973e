"""Discretisation errors of the observables on a grid, and estimates of their continuum values.

Most constants were fitted to one half of the calibration set of `scripts/calibration.py` and
checked on the other (docs/calibration.md names the exceptions): elastomers of n = 0 to 4 and slabs,
random and simple surfaces, each on up to six nested grids. For contacts of few patches and surfaces
that are not isotropic or not band-limited, sigma_p and u_g are left to `error_estimates`. Symbols:
xi = contact line per area times spacing, that is contact switches per point; n = exponent of the
stiffness k(q); phi = 2 pi waves / points, the phase of the short waves from one point to the next
(pi at most); b = curvature / points^2, the height [h_std] by which the surface bends from one point
to the next; D = change of an observable from the coarser to the finer grid.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp, hypot, inf, log, nan, pi, sqrt
from typing import NamedTuple

import numpy as np

from gfmd_cli.physics.error_estimates import (
    DIVERGENT,
    NO_ERRORS,
    UNKNOWN,
    Estimate,
    GridPair,
    GridValues,
    Verdict,
    area_estimate,
    border_stress,
    estimate_by_change,
    estimate_free,
    full_contact,
    on_grid,
    unknown,
    with_independent_error,
)
from gfmd_cli.physics.linear_elastomer import LinearElastomer
from gfmd_cli.physics.persson import Shells

# Excess of the counted area: AREA_EXCESS n xi. Measured: 0.00, 0.05, 0.10, 0.15, 0.21, 0.26, 0.31,
# 0.36 of xi at n = 0, 0.5, ... 3.5 on all grids that resolve the surface. Yastrebov et al. (2017)
# derive (pi - 1 + ln 2)/24 = 0.118 for n = 1. At n = 4 the ratio is not constant: 0.3 to 0.9.
AREA_EXCESS = 0.104
MAX_AREA_EXPONENT = 3.5  # n up to which that holds; beyond, the error is below xi and below a_r
# Of a line contact: LINE_EXCESS n xi, by the Wiener-Hopf equation of the half-space of grid points
# next to an edge, whose stiffness is |q|^n up to the Nyquist wavenumber (docs/error_estimates.md):
#   1/4 - int_0^pi ln[phi / (2 sin(phi/2))] / sin^2(phi/2) dphi / 4 pi
# The place of the edge between two points adds an error that is uniform within a spacing.
LINE_EXCESS = 0.19001

# For n > 3.5 the excess is a multiple of -D, the decrease from the coarser of two grids. Measured
# (`scripts/plate_areas.py`, n = 3.6, 3.75 and 4): 0.4 in light contacts, of lone points, whose area
# falls with the square of the spacing (factor 1/3), 0.75 at p* = 0.2, 1 to 1.6 in broad contacts,
# whose edge is a ragged line (first order: factor 1). D / xi tells them apart: the factor
# 1.78 + 1.99 D / xi leaves a scatter of 0.1 to 0.16. The bar is the root of D^2 + (0.2 xi)^2
# times 0.6.
PLATE_EXCESS, PLATE_EXCESS_SLOPE, LONE_POINTS = 1.78, 1.99, 1 / 3
PLATE_BAR, PLATE_FLOOR = 0.6, 0.2
# Bar of a_r on rough surfaces, once corrected: root of the sum of the squares of
#   AREA_CHANCE (1 + n / 10) (xi / A)^(1/2) / N independent errors of A N^2 xi points
#   AREA_LAW (n + 1) xi phi                        the law itself, where few points resolve a wave
#   AREA_CHANGE D                                  what neither explains; D of the corrected values
# A = area / L^2, N = points per L. Chosen on seeds 20 and 47 (full), 11 (--quick --shift 1.37).
AREA_CHANCE, AREA_LAW, AREA_CHANGE = 0.5, 0.01, 0.3
# AREA_LAW and AREA_CHANGE are those of isotropic band-limited roughness. Other surfaces, from two
# grids, have IRREGULAR_AREA_CHANGE D, and the law SMOOTH_AREA_LAW (n + 1) xi, or
# KINKED_AREA_LAW (n + 1) xi if they are not band-limited or the pixels are oblong. The ratio of
# their excess to n xi is between 0.05 and LINE_EXCESS, its value where edges run along rows or
# columns. Chosen on --maps 20, 101, 102, 103, --free 20, 101, --shapes 20 and --maps 300 with
# scans; checked on other seeds (docs/calibration.md).
SMOOTH_AREA_LAW, KINKED_AREA_LAW, IRREGULAR_AREA_CHANGE = 0.04, 0.08, 1.5
MAX_EXCESS_ANISOTROPY = 8.0
"""Ratio of rms slopes up to which these bars are used. Beyond it 98 of 100 would hold, but only 84
beyond a ratio of 25 (`scripts/calibration.py --beyond`)."""
MAX_KINKED_EXPONENT = 2.0
"""Exponent n up to which surfaces that are not band-limited have these bars: at 2.5, 80 of 100 bars
of scans would hold, and errors are up to 8 times the bar (`--beyond`)."""
# Line profiles have, in place of the first two terms, LINE_CHANCE xi over the root of the A N xi
# edges, or of the number of independent waves if less; with 12^(-1/2) = 0.29 as the factor this is
# the standard deviation. A gap of w_g points has the error LINE_GAP u_g / w_g^2 in u_g, over the
# root of the number of gaps; also with a free boundary. Chosen by `scripts/line_bars.py`, seeds 0
# to 29 (with --free 0 to 19); checked on others.
LINE_CHANCE, LINE_GAP = 0.75, 2.0
EXPONENT_CHANGE = 0.6  # of its change with q is uncertain; chosen on --layers, seeds 1 and 2
MAX_STRESS_EXPONENT = 2.5  # sigma_p converges as spacing^(3 - n): too slow for larger n

# Typical errors on one grid: power laws and medians by regression; of equally good ones, those that
# change least when long waves are added to a surface (which only reduce the contact area):
#   sigma_p, relative:    exp(-7.08 + 2.18 n) (xi / a_r)^(3/2) phi^(5/4) / (1 - a_r)^(1/2), at least
#                         exp(-7.80 + 2.18 n) (xi / a_r)^r, order r of convergence: fine grids
#   u_g [h_std]:          exp(-6.80 + 0.62 n) (xi / a_r)^(1/4) phi^(3/2) (b u_g)^(1/2)
# with n >= MIN_EXPONENT before the powers. The constant -7.80 is from 36 surfaces, up to 512^2.
# Error bars on one grid: SINGLE_GRID times that. On two grids: TWO_GRIDS times the root of the sum
# of the squares of TYPICAL_WEIGHT times the typical error and of the change D from the coarser
# grid, reduced by the order of convergence. 98.2 to 100 of 100 bars hold in the fitted half of the
# set. Here a_r is that of a single indenter, in one or two dimensions, with
# SINGLE_CONTACT_AREA xi.
SINGLE_GRID = {"a_r": 4.2, "sigma_p": 4.1, "u_g": 4.2}
TWO_GRIDS = {"a_r": 0.4, "sigma_p": 1.4, "u_g": 2.2}
TYPICAL_WEIGHT = {"a_r": 8.0, "sigma_p": 1.2, "u_g": 1.2}
GAP_ORDER = 3.0  # of u_g on a rough surface; sigma_p: 3 - n, at most 2; a_r: D as it is
MIN_EXPONENT = 0.5  # n below which bars no longer decrease: the error at n = 0 is random
SINGLE_CONTACT = 2.5  # bar of a single indenter over D / (2^order - 1), from the calibration set
SINGLE_CONTACT_AREA = 0.2  # error of a corrected a_r in xi, of a single indenter, likewise
SINGLE_CONTACT_STRESS = 0.07  # in n sigma_p xi / a_r: waves at n = 2 have up to 0.07 where D = 0
MAX_EDGE_RATIO = 1.5  # xi / a_r of a single contact beyond which sigma_p has no bar: few points
SINGLE_CONTACT_GAP = 5.0  # in u_g / [points (1 - a_r)]^2: smooth indenters have 3.8 at most

# A tip -r^m has the stress r^(m - n) around it, so that <sigma^2> converges as spacing^(2 (M - n))
# with M = m + dimension / 2. Measured on ridges, cones and r^m, m = 0.5 to 1.5, n = 0 to 3.5.
# For m below SMOOTH_EXPONENT this law holds, and the bars of u_g are those of the next lines.
SMOOTH_EXPONENT = 2.0
SHARP_GAP_CHANGE = 5.0  # times D: the order is n - 1 where the contact is smaller than the spacing
SHARP_GAP = 20.0  # in place of SINGLE_CONTACT_GAP
MAX_RIDGE_EXPONENT = 1.75  # n beyond which the stress of a line's tip rings over spacing^(1/2)
MIN_STRESS_ORDER = 0.5  # order of <sigma^2> below which it converges too slowly for an estimate
MIN_PATCHES = 10.0
"""Contact patches from which errors average out: with 6 or less 70 to 90 of 100 bars held."""
MAX_ANISOTROPY = 2.0
"""Largest ratio of rms slopes of a calibrated surface; isotropic maps of 32 points have up to 1.3,
maps stretched by 3, whose bars failed, 2.6 or more."""
MIN_WAVES = 30.0
"""Independent waves of the slopes from which patches differ from each other: random surfaces of at
least four waves per side have 40 and more, textures of one wavelength 4 to 12."""
MAX_REPETITIONS = 5.0
"""Copies of one patch that a calibrated surface may resemble, beside equal tiles and mirror images,
which count as one. Errors of copies do not average out: with 4 x 4 rough bumps they were up to 13
times the bar. Random surfaces have 0.7 to 2.6, and up to 4 if half of their waves are missing;
2 x 2 copies of them that differ slightly have 2.7 to 7, bumps that are rough or differ 11 to 13."""
MIN_HIGHEST = 1.0
"""Smallest highest point of a calibrated surface, in h_std above the mean: surfaces with pits have
1.1 and more. With 0.7 to 0.8 (h = -a^2 of a Gaussian a) contacts are ribbons on ridges that are as
high as each other, and hardly any bar held."""
PLATEAU_DEPTH, MAX_PLATEAU = 0.4, 0.1
"""Largest share of a surface within so many h_std of its highest point with which one grid gives an
error. Of surfaces whose peaks are cut off (0.12 to 0.4), 70 to 83 of 100 bars of sigma_p held on
one grid, but 98 on two. Random surfaces have up to 0.05, surfaces with pits 0.03 to 0.5."""
MAX_HIGHEST = 5.0
"""Highest point, in h_std above the mean, up to which the law of u_g holds. Of lattices of jittered
bumps (5.7 to 6.3) 83 of 100 bars held on one grid and 93 on two, of surfaces with peaks (5 to 16)
96 and 92. `scripts/surface_classes.py --laws` repeats these shares."""
MAX_SPACING_RATIO = 1.1
"""Largest ratio of grid spacings with the excess of square pixels. With the wider spacing in x, a
ratio of 2 has 0.7 of it and of 4 half, so that 56 of 100 bars of the corrected area held."""
HALF_OCTAVE = 0.5 * log(2)  # in ln q: step of the local exponent that the calibration used
CALIBRATED_EXPONENTS = (-2.5, 4.5)  # with a margin: bonded layers have -2, plates 4
OCTAVES = np.arange(-1, 10)  # from the highest wave of a grid; the last has a weight of 0.002
EXTRAPOLATED_BAR = 0.8  # bar of the extrapolated sigma_p over that of the value, n >= 1, likewise


@dataclass(frozen=True)
class RoughnessScales:
    """Properties of a rough surface that determine its discretisation error."""

    waves: float
    """Number of short waves per side of the cell: L rms(grad^2 h) / rms(grad h) / 2 pi."""
    curvature: float
    """Reduced curvature L^2 rms(grad^2 h) / h_std."""
    anisotropy: float = 1.0
    """Ratio of the rms slopes along the principal axes, at least 1."""
    band_limited: bool = True
    """Whether the coarsest grid contains all waves of the surface."""
    aspect: float = 1.0
    """Ratio of the grid spacings along x and y, at least 1."""
    highest: float = 3.0
    """Height of the highest point above the mean [h_std]; by default that of a Gaussian surface."""
    plateau: float = 0.0
    """Share of the surface within `PLATEAU_DEPTH` of the highest point."""
    independent_waves: float = inf
    """Effective number of waves, (sum s)^2 / sum s^2, with the power s of the slope of a wave."""
    repetitions: float = 1.0
    """Number of copies of one patch that the surface resembles; see `waves.Texture`."""

    @property
    def calibrated(self) -> bool:
        """Whether the errors are those of isotropic band-limited roughness."""
        return (
            self.band_limited
            and self.anisotropy <= MAX_ANISOTROPY
            and self.highest >= MIN_HIGHEST
            and self.independent_waves >= MIN_WAVES
            and self.repetitions <= MAX_REPETITIONS
        )

    @property
    def has_steep_flat_top(self) -> bool:
        """Whether flat tops may end in steps, as grids contain ever shorter waves of them."""
        return self.plateau > MAX_PLATEAU and not self.band_limited

    def phase(self, points: float) -> float:
        """Phase phi of the short waves from one point to the next."""
        return 2 * pi * self.waves / points


@dataclass(frozen=True)
class IndenterTip:
    """Tip of a single indenter."""

    exponent: float = SMOOTH_EXPONENT
    """Exponent m of the heights -r^m."""
    dimension: int = 2

    @property
    def is_sharp(self) -> bool:
        """Whether the exponent m is below that of a smooth tip."""
        return self.exponent < SMOOTH_EXPONENT

    def stress_order(self, n: float) -> float:
        """Order at which <sigma^2> around the tip converges; infinite for a smooth tip."""
        return 2 * (self.exponent - n) + self.dimension if self.is_sharp else inf


SMOOTH_TIP = IndenterTip()


def roughness_scales(shells: Shells, length: float) -> RoughnessScales:
    """Scales of a rough surface by its spectrum, for a cell of side `length` [m]."""
    height, q2 = shells.height, np.square(shells.q * length)
    flat, steep, bent = (float(np.sum(height * q2**power)) for power in (0, 1, 2))
    waves, curvature = sqrt(bent / steep) / (2 * pi), sqrt(bent / flat)
    slopes = height * q2
    independent = float(slopes.sum() ** 2 / np.sum(slopes**2 / shells.modes))
    return RoughnessScales(waves, curvature, independent_waves=independent)


def local_exponent(elastomer: LinearElastomer, points: float, length: float) -> float:
    """Exponent of k(q) at the highest wave of a grid, over one octave around pi points / L.

    It is rounded to 12 digits, because the estimates change at n = 1 and the last bits of k(q)
    must not decide on which side a half-space lies.
    """
    highest = np.array(pi * points / length)
    return round(float(elastomer.local_exponent(highest, length, HALF_OCTAVE)), 12)


def has_step(elastomer: LinearElastomer, points: float, length: float) -> bool:
    """Whether k(q) has a step at short waves, which no calibrated elastomer has.

    Short waves are those from an eighth of the highest wavenumber of the grid on.
    """
    q = pi * points / length * 2.0 ** np.arange(-3.0, 0.5, 0.5)
    low, high = CALIBRATED_EXPONENTS
    exponents = elastomer.local_exponent(q, length, HALF_OCTAVE)
    return bool(np.any((exponents < low) | (exponents > high)))


class ExcessExponent(NamedTuple):
    """Exponent n of the excess AREA_EXCESS n xi of the contact area on a grid."""

    value: float
    uncertainty: float = 0.0


def excess_exponent(elastomer: LinearElastomer, points: float, length: float) -> ExcessExponent:
    """Exponent of the excess of the contact area where the local exponent depends on q.

    From a grid to the next finer one, xi halves, and the excess decreases by AREA_EXCESS n xi / 2
    with the local exponent n at this scale. Hence the mean over this and all finer scales, weighted
    1/2, 1/4, ... Its uncertainty is EXPONENT_CHANGE times the difference from the exponent on the
    next coarser scale.
    """
    highest = pi * points / length * 2.0**OCTAVES
    # k may overflow beyond a table that ends steeply: the exponent is infinite there
    with np.errstate(over="ignore", invalid="ignore"):
        exponents = elastomer.local_exponent(highest, length, HALF_OCTAVE)
    exponents = np.maximum(np.nan_to_num(exponents, nan=inf, posinf=inf), 0.0)
    weights = 0.5 ** np.minimum(OCTAVES[1:] + 1, OCTAVES[-1])
    mean = float(weights @ exponents[1:])
    return ExcessExponent(round(mean, 12), EXPONENT_CHANGE * abs(float(exponents[0]) - mean))


def estimate(
    contacts: Sequence[GridValues],
    exponent: float,
    scales: RoughnessScales | None = None,
    area_exponent: ExcessExponent | None = None,
    *,
    same_waves: bool = True,
    stepped: bool = False,
    tip: IndenterTip = SMOOTH_TIP,
    full_contact_errors: Mapping[str, float] = NO_ERRORS,
) -> dict[str, Estimate]:
    """Estimate errors and continuum values of `a_r`, `sigma_p` and `u_g` on the finest grid.

    Parameters
    ----------
    contacts : one contact at one pressure on grids N, N/2, ... in any order, all of which resolve
        the surface; the two finest are used
    exponent : local exponent of the stiffness at the highest wavenumber of the finest grid
    scales : scales of a rough surface. None for a single indenter: the errors of many
        patches then do not average out, and one grid gives no error of sigma_p and u_g
    area_exponent : exponent of the excess of the area, see `excess_exponent`; by default `exponent`
    same_waves : whether all grids contain the same waves, so that full contact is exact
    stepped : whether the surface has vertical steps, where the stress is that of a punch
    tip : of a single indenter
    full_contact_errors : errors in full contact, of tensile stress between the points, by quantity
    """
    ordered = sorted(contacts, key=lambda contact: contact.points)
    coarse = ordered[-2] if len(ordered) > 1 else None
    grids = GridPair(ordered[-1], coarse, max(exponent, 0.0))
    fine, _, n = grids
    excess = area_exponent or ExcessExponent(n)
    is_free, is_rough = fine.border is not None, scales is not None
    has_flat_top = scales is not None and scales.has_steep_flat_top
    if fine.a_r == 0:
        return unknown()
    if is_free:
        estimates = estimate_free(
            grids, full_contact_errors, same_waves=same_waves, has_flat_top=has_flat_top
        )
    elif fine.a_r == 1 and same_waves:
        return full_contact(fine, full_contact_errors)
    elif fine.a_r == 1 and not is_rough:
        return unknown()
    else:
        estimates = estimate_by_change(grids, has_flat_top=has_flat_top)
        if scales is None or _laws_hold(grids, scales):
            estimates |= {"sigma_p": _stress(grids, scales, tip), "u_g": _gap(grids, scales, tip)}
    if is_rough or not is_free:
        estimates["a_r"] = _area_of_any_surface(estimates["a_r"], grids, scales, excess, tip)
    if tip.dimension == 1 and (is_rough or is_free) and estimates["u_g"].verdict.has_error:
        estimates["u_g"] = with_independent_error(estimates["u_g"], _error_of_gaps(fine))
    if fine.a_r == 1 and not same_waves:  # the grids agree and have no contact line
        for name, error in full_contact_errors.items():
            estimates[name] = with_independent_error(estimates[name], error)
    if stepped:
        return estimates | {"sigma_p": border_stress(grids)}
    if tip.is_sharp and tip.dimension == 1 and n > MAX_RIDGE_EXPONENT:
        estimates["a_r"] = UNKNOWN
    is_undecided = estimates["sigma_p"].verdict != Verdict.DIVERGES
    if is_undecided and tip.stress_order(n) < MIN_STRESS_ORDER and n < DIVERGENT:
        verdict = Verdict.SLOW if tip.stress_order(n) > 0 else Verdict.DIVERGES
        return estimates | {"sigma_p": replace(UNKNOWN, verdict=verdict)}
    return estimates


def _laws_hold(grids: GridPair, scales: RoughnessScales) -> bool:
    """Whether the laws of many patches hold for a contact on a rough surface."""
    if grids.coarse is None and scales.plateau > MAX_PLATEAU:
        return False
    return grids.fine.patches >= MIN_PATCHES and scales.calibrated


def _area_of_any_surface(
    by_change: Estimate,
    grids: GridPair,
    scales: RoughnessScales | None,
    excess: ExcessExponent,
    tip: IndenterTip,
) -> Estimate:
    """The area from its excess, where that is known, or as estimated from the change alone."""
    fine = grids.fine
    if scales is None or (_laws_hold(grids, scales) and _has_area_law(fine, scales)):
        return _area(grids, scales, excess, tip)
    if fine.a_r == 1 or not by_change.verdict.has_error:
        return by_change
    if tip.dimension == 1:
        is_smooth = scales.band_limited and scales.plateau <= MAX_PLATEAU
        has_excess = is_smooth and fine.border is None
    elif not scales.band_limited and grids.n > MAX_KINKED_EXPONENT:
        return UNKNOWN
    else:
        has_excess = scales.anisotropy <= MAX_EXCESS_ANISOTROPY
    return _area(grids, scales, excess, tip) if has_excess else by_change


def _has_area_law(fine: GridValues, scales: RoughnessScales) -> bool:
    """Whether the area has the narrow bars of isotropic band-limited roughness."""
    is_square = scales.aspect <= MAX_SPACING_RATIO
    return scales.calibrated and is_square and fine.border is None


def _bar(name: str, typical: float, change: float | None) -> float:
    """Error bar from the typical error on this grid and the change from a coarser grid, if any."""
    if change is None:
        return SINGLE_GRID[name] * typical
    return TWO_GRIDS[name] * hypot(change, TYPICAL_WEIGHT[name] * typical)


def _area(
    grids: GridPair, scales: RoughnessScales | None, excess: ExcessExponent, tip: IndenterTip
) -> Estimate:
    """Relative contact area: the error is of first order in the spacing, AREA_EXCESS area_n xi.

    In a line contact it is LINE_EXCESS area_n xi.

    Where the exponent is not that of all short waves, the excess is uncertain.
    """
    fine, coarse, _ = grids
    area_n, xi = excess.value, fine.switches_per_point
    if area_n > MAX_AREA_EXPONENT:
        if scales is not None:
            return _plate_area(grids)
        # the line force at the edge of a plate is, on a grid, a row of points
        return Estimate(min(fine.a_r, xi), nan, nan, Verdict.BOUND)
    factor = LINE_EXCESS if tip.dimension == 1 else AREA_EXCESS
    best = max(0.0, fine.a_r - factor * area_n * xi)
    change = None
    if coarse is not None:
        change = best - max(0.0, coarse.a_r - factor * area_n * coarse.switches_per_point)
    if scales is None:
        error = _bar("a_r", SINGLE_CONTACT_AREA * xi, change)
    elif tip.dimension == 1:
        edges = min(xi * fine.area * fine.points, scales.independent_waves)
        chance = LINE_CHANCE * xi / sqrt(edges) if edges > 0 else 0.0
        error = hypot(chance, AREA_CHANGE * (change or 0.0))
    else:
        chance = AREA_CHANCE * (1 + area_n / 10) * sqrt(xi / fine.area) / fine.points
        if _has_area_law(fine, scales):
            law, weight = AREA_LAW * scales.phase(fine.points), AREA_CHANGE
        else:
            is_kinked = not scales.band_limited or scales.aspect > MAX_SPACING_RATIO
            law = KINKED_AREA_LAW if is_kinked else SMOOTH_AREA_LAW
            weight = IRREGULAR_AREA_CHANGE
        error = hypot(chance, law * (area_n + 1) * xi, weight * (change or 0.0))
    return _corrected_area(fine.a_r, best, hypot(error, factor * excess.uncertainty * xi))


def _plate_area(grids: GridPair) -> Estimate:
    """Relative contact area of a plate on a rough surface."""
    if grids.coarse is None:
        return UNKNOWN
    a_r, step, xi = grids.fine.a_r, -grids.change("a_r"), grids.fine.switches_per_point
    excess = PLATE_EXCESS - PLATE_EXCESS_SLOPE * step / xi
    best = min(1.0, max(0.0, a_r - min(max(excess, LONE_POINTS), PLATE_EXCESS) * step))
    return _corrected_area(a_r, best, PLATE_BAR * hypot(step, PLATE_FLOOR * xi))


def _corrected_area(a_r: float, best: float, error: float) -> Estimate:
    error = min(error, max(best, 1 - best))
    return area_estimate(a_r, best, abs(a_r - best) + error, error)


def _stress(grids: GridPair, scales: RoughnessScales | None, tip: IndenterTip) -> Estimate:
    """Stress deviation: at the edge of a patch the stress is as (1 - r^2/a^2)^(1 - n/2)."""
    fine, coarse, n = grids
    if n > MAX_STRESS_EXPONENT:
        return replace(UNKNOWN, verdict=Verdict.DIVERGES if n >= DIVERGENT else Verdict.SLOW)
    if scales is None:
        return _single_stress(grids, tip) if coarse else UNKNOWN
    value, edge_ratio = fine.sigma_p, fine.switches_per_point / fine.a_r
    phase, order = scales.phase(fine.points), min(2.0, 3 - n)
    coarse_law = exp(-7.08) * edge_ratio**1.5 * phase**1.25 / sqrt(1 - fine.a_r)
    fine_law = exp(-7.8) * edge_ratio**order
    typical = exp(2.18 * max(n, MIN_EXPONENT)) * max(coarse_law, fine_law) * value
    if coarse is None:
        return on_grid(value, _bar("sigma_p", typical, None))
    rest = grids.change("sigma_p") / (2**order - 1)
    error = _bar("sigma_p", typical, rest)
    if n < 1:
        return on_grid(value, error)
    return Estimate(error, max(0.0, value + rest), EXTRAPOLATED_BAR * error, Verdict.REGULAR)


def _single_stress(grids: GridPair, tip: IndenterTip) -> Estimate:
    """Stress deviation of a single indenter, in one or two dimensions."""
    fine, _, n = grids
    value, edge_ratio = fine.sigma_p, fine.switches_per_point / fine.a_r
    if edge_ratio > MAX_EDGE_RATIO:
        return replace(UNKNOWN, is_too_coarse=True)
    order = min(1.0, 3 - n, max(tip.stress_order(n), MIN_STRESS_ORDER))
    rest = grids.change("sigma_p") / (2**order - 1)
    floor = SINGLE_CONTACT_STRESS * max(n, MIN_EXPONENT) * value * edge_ratio
    return on_grid(value, hypot(SINGLE_CONTACT * abs(rest), floor))


def _gap(grids: GridPair, scales: RoughnessScales | None, tip: IndenterTip) -> Estimate:
    """Mean gap: the error is small and of either sign, so the value is not extrapolated."""
    fine, coarse, n = grids
    if scales is None:
        return _single_gap(grids, tip) if coarse else UNKNOWN
    if scales.highest > MAX_HIGHEST:
        return estimate_by_change(grids)["u_g"]
    value, edge_ratio = fine.u_g, fine.switches_per_point / fine.a_r
    phase, bend = scales.phase(fine.points), scales.curvature / fine.points**2
    typical = exp(-6.8 + 0.62 * max(n, MIN_EXPONENT)) * edge_ratio**0.25
    typical *= phase**1.5 * sqrt(bend * value)
    change = None if coarse is None else grids.change("u_g") / (2**GAP_ORDER - 1)
    return on_grid(value, _bar("u_g", typical, change))


def _error_of_gaps(fine: GridValues) -> float:
    """Error of u_g of a line profile, by the few points across its gaps.

    It matters near full contact, where u_g may by chance hardly change from grid to grid.
    """
    xi = fine.switches_per_point
    if not xi:
        return 0.0
    gaps, points = 0.5 * xi * fine.area * fine.points, 2 * (1 - fine.a_r) / xi
    return LINE_GAP * fine.u_g / points**2 / sqrt(gaps)


def _single_gap(grids: GridPair, tip: IndenterTip) -> Estimate:
    """Mean gap of a single indenter, in one or two dimensions."""
    fine, change = grids.fine, abs(grids.change("u_g"))
    points = fine.points * min(1.0, fine.area)  # along the shorter side
    across = fine.u_g / (points * (1 - fine.a_r)) ** 2  # points across the gap, in one line
    smooth = max(SINGLE_CONTACT * change / 3, SINGLE_CONTACT_GAP * across)  # 3: second order
    sharp = max(SHARP_GAP_CHANGE * change, SHARP_GAP * across)
    return on_grid(fine.u_g, sharp if tip.is_sharp else smooth)
