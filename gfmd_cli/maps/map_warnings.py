"""Warnings about probable mistakes in the use of a measured map.

Each public function returns a warning, or "" without one.
"""

import numpy as np

from gfmd_cli.grid.arrays import Field, row_blocks
from gfmd_cli.maps.map_preparation import level
from gfmd_cli.maps.topography import Topography, ends_without_heights
from gfmd_cli.units import count, labelled, percent

MAX_GRADIENT = 3.0  # rms; a choice: surfaces of machined or worn solids have less
MIN_GRADIENT = 1e-6  # rms; a choice: polished mirrors have about that
MAX_SHORT_WAVE_FACTOR = 1.1  # a choice: 1.0 for surfaces that are resolved
MAX_BORDER_STEP = 5.0  # ratio of the step across the border to that inside; a choice: 1 if periodic
MIN_BORDER_STEP = 1.5  # such a ratio that may be chance; a choice
BORDER_SHARE = 0.1  # largest fraction of the squared gradient that the border may have; a choice
MAX_TILT = 0.5  # fraction of the variance of the heights that is a tilt; a choice
MIN_ROUNDING_STEP = 0.5  # over the rms difference of neighbours: the gradient is 3 % too large
SAMPLE_SIZE = 10_000  # heights that exclude most maps; to sort all takes seconds
SINGLE_EPS = float(np.finfo(np.float32).eps)  # double precision may have been single before
MAX_EQUAL_NEIGHBOURS = 0.2  # fraction of pairs, at which the gradient is 3 % too large
MIN_SHOWN_FRACTION = 0.01  # of the heights, from which a warning states the percentage; a choice
PLATEAU_FRACTION = 0.5  # of the heights: so many equal ones are part of the surface; a choice
MIN_OTHERS = 8  # other heights, without which one that is apart is no outlier; a choice
USUAL_PERCENT = 95  # of the differences between neighbours; of Gaussian ones, below 2 rms values
AXIS_RATIO = 10  # ratio of the numbers of such points along both axes; a choice: 1 by chance
MIN_SCARS = 16  # points of scars, of which fewer may be chance; a choice
SCAR_RATIO = 3.0  # ratio of a scar, a stroke in one line, to such a difference; a choice
SPIKE_RATIO = 10.0  # ratio of a spike to such a difference; a choice
MAX_SPIKES = 16  # on either side; a choice: more are a part of the surface
STANDARD_DEVIATION = 1.4826  # over the median absolute deviation, of Gaussian values
CLIPPED_ROUNDING = 1e-9  # relative to the range: heights so close differ by rounding
CLIPPED_RATIO = 10  # ratio of the numbers of equal heights, highest to second; about 1 if rounded
SIDE_TOLERANCE = 1e-3  # relative difference, beyond which a side is probably wrong; a choice
MAX_FILLED = 0.05  # fraction of filled heights; a choice
CHECKED_LINES = 16  # of those that are repeated; they are alike
MAX_SLOPE = 0.5  # of what levelling subtracts; a choice: 27 degrees, with a cosine of 0.9
MAX_FORM = 0.85  # fraction of the variance of levelled heights; random maps have up to 0.84
MIN_FORM_KINK = 0.5  # of the kink of a parabola at the border; a choice: 0 if periodic
FORM_POINTS = 256  # per side, of a sample that shows the form
MIN_FORM_POINTS = {1: 256, 2: 16}  # per side, by dimension: fewer have such a form by chance
END_FRACTION = 20  # of a side, over which the slope at the border is taken; a choice
MAX_LINE_SHIFT = 0.5  # over the rms difference of neighbours in a line; measured scans: 0 to 0.4
MAX_LINE_CORRELATION = 0.3  # of the signs of successive shifts; roughness is smoother; a choice
JUMP_RATIO = 8  # of a jump to the usual difference of lines; a choice: none by chance
MIN_SEAM = 0.5  # of a step between tiles of a scan, over that rms difference; a choice
SEAMS = 3  # between tiles, at most; a choice: more steps are a part of the surface
SEAM_RATIO = 3.0  # of a seam to the next largest step; calibrated by `scripts/seams_of_maps.py`
MIN_KNOWN = 8  # heights in half a line, for its median; a choice
MIN_LINES = 32  # fewer lines and points per line have such shifts by chance


def given_side(key: str, length: float, stated: float | None, topography: Topography) -> str:
    """Warn if a side [m] that a key of the surface gives is not the one that the file states.

    If the file states none, warn if the side is that of a part of the map.
    """
    axis = 0 if key == "length_y" else -1
    part, whole = topography.heights.shape[axis], topography.shape[axis]
    is_same = part == whole if stated is None else abs(length / stated - 1) <= SIDE_TOLERANCE
    if is_same:
        return ""
    if stated is not None:
        return f"surface.{key} = {length:g} m replaces the side of the file, {stated:g} m"
    return (
        f"surface.{key} = {length:g} m is the side of the part of the map that is used, {part} of "
        f"{whole} points; if the whole map has this side, set {length * part / whole:g}"
    )


def unknown_side(topography: Topography, scale: float, length: float | None) -> str:
    """Warn if the file states no side, or one without unit.

    `length` [m] is the stated side times `scale`, None without one.
    """
    if length is None:
        return "the file does not state its side in metres; L = 1 m is assumed: set surface.length"
    if topography.metric_sides:
        return ""
    if scale == 1.0:
        return (
            "the file does not state the unit of its positions and heights; metres are assumed, "
            f"L = {length:g} m: set surface.scale, the metres per unit"
        )
    return (
        "surface.scale also multiplies the sides, whose unit the file does not state: "
        f"L = {length:g} m; set surface.length"
    )


def unit_of_heights(topography: Topography, scale: float) -> str:
    """Warn if `scale` multiplies heights that are in metres already.

    Warn, too, if heights without unit stand beside sides in metres, and there is no factor.
    """
    if topography.metric_heights and scale != 1.0:
        return "the file states the unit of its heights: surface.scale multiplies metres"
    if scale != 1.0 or not topography.metric_sides or topography.metric_heights:
        return ""
    return (
        "the file states the unit of its sides, but not of its heights; metres are assumed: set "
        "surface.scale"
    )


def many_filled_in(topography: Topography) -> str:
    """Warn if many heights were missing and have been filled in."""
    fraction = topography.missing_count / topography.heights.size
    if fraction <= MAX_FILLED:
        return ""
    return (
        f"{percent(fraction)} of the heights are missing and were filled in: contact there was "
        'not measured; set surface.region, or surface.missing = "void" where nothing can touch'
    )


def missing_ends(topography: Topography) -> str:
    """Warn if heights at the ends of a line profile are missing, with known ones on one side."""
    if topography.missing is None or topography.heights.ndim == 2:
        return ""
    first, last = (int(np.argmin(ends)) for ends in (topography.missing, topography.missing[::-1]))
    if not first + last:
        return ""
    return (
        f"{ends_without_heights(first, last)}: they get the height of the nearest known one; "
        "surface.region leaves them out"
    )


def unlikely_gradient(heights: Field, spacing: tuple[float, ...]) -> str:
    """Warn if heights and spacing [m] make an unlikely gradient."""
    slopes = (np.diff(heights, axis=i) / step for i, step in enumerate(spacing))
    gradient = np.sqrt(sum(float(np.mean(slope**2)) for slope in slopes))
    if not (gradient > MAX_GRADIENT or 0 < gradient < MIN_GRADIENT):
        return ""
    return (
        f"rms gradient {gradient:.3g}: check that heights and side are in metres; surface.scale is "
        "the factor from the heights of the file to metres, surface.length the side"
    )


def unresolved(factor: float, period_limit: float = 0.0) -> str:
    """Warn if the surface seems to have shorter waves than the map.

    `factor` is that of `surface_spectrum.short_wave_factor`. `period_limit` is the lateral period
    limit of the microscope, or the length of two points if that is longer [m]; 0 if it is not
    known.
    """
    if not factor > MAX_SHORT_WAVE_FACTOR:
        return ""
    waves, limit = "2 to 4 points of the map", "the pixels"
    consequence = (
        "the next halving of its shortest wavelength divides the contact area at light load by "
        "roughly this factor"
    )
    if period_limit > 0:
        limit, longest = (labelled(length, "m") for length in (period_limit, 2 * period_limit))
        waves = f"{limit} (surface.lateral_period_limit, at least two points) to {longest}"
        consequence = (
            "the contact area at light load is probably too large by more than this factor, as the "
            "microscope also damps these waves"
        )
    return (
        f"the waves of {waves} increase Delta_sigma, the rms stress in full contact, by a factor "
        f"of {factor:.2f}: unless this is noise, the roughness probably continues below {limit}. "
        f"If it does, {consequence}. Error bars do not include this"
    )


def step_at_border(heights: Field, remedy: str) -> str:
    """Warn if opposite borders of a repeated map do not fit; `remedy` says what to change."""
    axes = range(heights.ndim)
    ends = [np.ravel(heights.take(0, axis) - heights.take(-1, axis)) for axis in axes]
    inside = np.mean([np.mean(np.diff(heights, axis=axis) ** 2) for axis in axes])
    cliff = np.sqrt(np.mean(np.concatenate(ends) ** 2) / inside) if inside > 0 else 1.0
    limit = np.sqrt(BORDER_SHARE * max(heights.shape))  # one of so many steps is at the border
    if cliff <= np.clip(limit, MIN_BORDER_STEP, MAX_BORDER_STEP):
        return ""
    return f"the height step across the border is {cliff:.3g} times that inside the map: {remedy}"


def tilted(heights: Field) -> str:
    """Warn if the heights, from which nothing is subtracted, are tilted."""
    tilt = 1 - float(np.var(level(heights, "plane")) / (np.var(heights) or 1.0))
    if tilt <= MAX_TILT:
        return ""
    return (
        f"a tilt makes up {percent(tilt)} of the variance of the heights, and nothing is "
        'subtracted: contact is at one edge first; surface.level = "plane" subtracts it'
    )


def curved(heights: Field) -> str:
    """Warn if the map has a parabolic form, with a kink at the borders where it is repeated."""
    if min(heights.shape) < MIN_FORM_POINTS[heights.ndim]:
        return ""
    heights = heights[tuple(slice(None, None, 1 + n // FORM_POINTS) for n in heights.shape)]
    flat = level(heights, "plane")
    form = flat - level(flat, "curvature")
    share = float(np.var(form) / (np.var(flat) or 1.0))
    kinks = [[_kink(field, axis) for field in (form, flat)] for axis in range(heights.ndim)]
    of_form, of_all = max(kinks, key=lambda kink: abs(kink[0]))
    if share <= MAX_FORM or of_all * np.sign(of_form) <= MIN_FORM_KINK * abs(of_form):
        return ""
    return (
        f"a parabolic form makes up {percent(share)} of the variance of the heights, so that "
        "contact is in one part of the map only; if it is a bow of the scanner, surface.level = "
        '"curvature" subtracts it'
    )


def steep(levelling: str, subtracted: Field, sides: tuple[float, ...]) -> str:
    """Warn if levelling subtracts a steep slope: heights are not along the normal of the plane.

    `subtracted` has the heights [m] that it subtracts at the corners of a map of these sides [m].
    """
    steps = [np.diff(subtracted, axis=axis).mean() for axis in range(subtracted.ndim)]
    slope = float(np.hypot.reduce(np.divide(steps, sides)))
    if slope <= MAX_SLOPE:
        return ""
    return (
        f"levelling ({levelling}) subtracts a slope of {slope:.2g}, an angle of "
        f"{np.degrees(np.arctan(slope)):.0f} degrees: are heights and side in metres? Heights "
        "above such a plane are not distances from it; rotate the map in another program"
    )


def repeated_lines(heights: Field) -> str:
    """Warn if some lines of a map are equal to the line before them."""
    for lines, along in ((heights, "x"), (heights.T, "y")) if heights.ndim == 2 else ():
        equal = 1 + np.flatnonzero((lines[1:] == lines[:-1]).all(axis=1))
        if not 0 < equal.size < len(lines) - 1:
            continue
        checked = equal[(equal > 1) & (equal < len(lines) - 1)]
        checked = checked[:: 1 + checked.size // CHECKED_LINES]
        is_varied = any(2 * np.unique(lines[i]).size >= lines.shape[1] for i in checked)
        if is_varied and not any(_is_mirror(lines, i) for i in checked):
            return (
                f"{equal.size} of {len(lines)} lines along {along} are equal to the line before: "
                "repeated by the instrument or a program? Replace them by NaN"
            )
    return ""


def _is_mirror(lines: Field, i: int) -> bool:
    """Whether a map is mirrored between the lines i - 1 and i: one line beyond them, or two."""
    beyond = min(2, i - 1, len(lines) - i - 1)
    is_same = np.array_equal(lines[i + 1 : i + 1 + beyond], lines[i - 1 - beyond : i - 1][::-1])
    return is_same and not np.array_equal(lines[i], lines[i + 1])


def _kink(heights: Field, axis: int) -> float:
    """Change of height over the last points of an axis less that over the first, mean of lines."""
    mean = np.moveaxis(heights, axis, 0).reshape(heights.shape[axis], -1).mean(axis=1)
    width = max(1, len(mean) // END_FRACTION)
    return float(mean[-1] - mean[-1 - width] - (mean[width] - mean[0]))


def shifted_lines(topography: Topography, spacing: tuple[float, ...]) -> str:
    """Warn if lines of a scan have offsets of their own, all of them or some.

    `spacing` is that of the map [m]. An offset is the median difference to the line before, where
    both halves of the line agree on it.
    """
    heights = topography.with_gaps()
    if heights.ndim == 1 or min(heights.shape) < MIN_LINES:
        return ""
    dy, dx = spacing
    for lines, along, ratio in ((heights, "x", dy / dx), (heights.T, "y", dx / dy)):
        lag = max(1, round(ratio))  # points of a line as far apart as the lines
        step_y, step_x = (1 + points // (4 * FORM_POINTS) for points in lines.shape)
        halves = np.array_split(np.diff(lines[:, ::step_x], axis=0), 2, axis=1)
        is_known = np.all([np.isfinite(half).sum(axis=1) >= MIN_KNOWN for half in halves], axis=0)
        differences = lines[::step_y, lag:] - lines[::step_y, :-lag]
        differences = differences[np.isfinite(differences)]
        inside = float(differences.std()) if differences.size else 0.0
        if np.count_nonzero(is_known) < MIN_LINES // 2 or not inside > 0:
            continue
        medians = np.array([np.nanmedian(half[is_known], axis=1) for half in halves])
        medians -= np.median(medians, axis=1, keepdims=True)
        shifts = np.where(medians.prod(axis=0) > 0, np.abs(medians).min(axis=0), 0.0)
        shifts *= np.sign(medians[0])
        usual = STANDARD_DEVIATION * float(np.median(np.abs(shifts)))
        spread = STANDARD_DEVIATION * float(np.median(np.abs(medians)))
        jumps = int(np.count_nonzero(np.abs(shifts) > max(JUMP_RATIO * spread, inside)))
        correlation = float(np.mean(np.sign(shifts[1:] * shifts[:-1])))
        if usual > MAX_LINE_SHIFT * inside and correlation < MAX_LINE_CORRELATION:
            what = f"are shifted against each other, by {usual / inside:.2g} times"
        elif jumps and spread > 0:  # medians of rounded heights are mostly zero
            what = f"jump at {count(jumps, 'place')}, by more than"
        elif (seam := _seam(medians)) > MIN_SEAM * inside:
            what = f"jump at one place or more, as between tiles, by {seam / inside:.2g} times"
        else:
            continue
        return (
            f"the lines along {along} {what} the rms difference of two points of a line that are "
            "as far apart as the lines: drift or jumps of the scan? Align the lines (median of "
            "differences) in another program, unless these are steps or grooves of the surface "
            f"along {along}"
        )
    return ""


def _seam(medians: Field) -> float:
    """The largest step between lines, 0 if more than `SEAMS` are about as large.

    A step is the distance of a median difference from the range of the two before it and the two
    after it. Of the steps in the two halves of the lines the smaller one counts.
    """
    own, last = medians[:, 2:-2], medians.shape[1] - 4
    around = np.stack([medians[:, shift : shift + last] for shift in (0, 1, 3, 4)])
    beyond = np.maximum(own - around.max(axis=0), around.min(axis=0) - own)
    steps = np.sort(beyond.min(axis=0))
    changes = own - around[1:3].mean(axis=0)
    usual = STANDARD_DEVIATION * np.median(np.abs(changes), axis=1)
    is_seam = steps[-1] > SEAM_RATIO * max(steps[-1 - SEAMS], usual.max())
    return float(steps[-1]) if is_seam and usual.min() > 0 else 0.0  # medians of rounded heights


def outliers(topography: Topography) -> str:
    """Warn if equal heights are farther from all others than these are apart, or at a limit."""
    heights = topography.heights
    if topography.missing is not None:
        heights = heights[~topography.missing]
    for nearest, word in ((np.min, "minimum"), (np.max, "maximum")):
        extreme = nearest(heights)
        others = heights[heights != extreme]
        number = heights.size - others.size
        fraction = number / heights.size
        if others.size < MIN_OTHERS:
            continue
        percentage = f" ({percent(fraction)})" if fraction > MIN_SHOWN_FRACTION else ""
        if min(abs(others.max() - extreme), abs(others.min() - extreme)) > np.ptp(others) > 0:
            what = "1 height is" if number == 1 else f"{number} heights{percentage} are"
            return (
                f"{what} exactly {extreme:g}, far from all others: a spike or a mark of missing "
                "heights? Replace it by NaN"
            )
        if number <= CLIPPED_RATIO or fraction > PLATEAU_FRACTION:
            continue
        following, rounding = nearest(others), CLIPPED_ROUNDING * np.ptp(heights)
        near = int(np.count_nonzero(abs(others - following) <= rounding))
        if abs(following - extreme) > rounding and number > CLIPPED_RATIO * near:
            return (
                f"{number} heights{percentage} are exactly the {word}, {extreme:g}: clipped at the "
                "range of the instrument, or a mark of missing heights? Replace such a mark by NaN"
            )
    return _often_equal(heights) or _spikes(heights)


def _often_equal(heights: Field) -> str:
    """Warn if a height within the range is far more frequent than any other."""
    sample = heights.flat[:: 1 + heights.size // SAMPLE_SIZE]
    values, counts = np.unique(sample, return_counts=True)
    order = np.argsort(counts)
    if values.size < 2 or counts[order[-1]] <= CLIPPED_RATIO * counts[order[-2]]:
        return ""
    value = values[order[-1]]
    fraction = np.count_nonzero(heights == value) / heights.size
    if not MIN_SHOWN_FRACTION < fraction <= PLATEAU_FRACTION:
        return ""
    return (
        f"{percent(fraction)} of the heights are exactly {value:g}: an unfinished scan, or a mark "
        "of missing heights? Set surface.region, or replace the mark by NaN"
    )


def single_points(topography: Topography) -> str:
    """Warn if single points, or strokes along one axis, are far above or below their neighbours."""
    is_map, singles, strokes = topography.heights.ndim == 2, 0, np.zeros((2, 2), int)
    inner = slice(1, -1) if is_map else slice(None)
    usual = _usual_difference(topography)
    for rows in row_blocks(topography.heights) if usual else ():
        around = slice(max(rows.start - 1, 0), rows.stop + 1)
        heights = np.atleast_2d(topography.with_gaps(around))
        for block, of_sign in ((heights, strokes[0]), (-heights, strokes[1])):
            own = block[inner, 1:-1]
            axes = [(block[inner, :-2], block[inner, 2:])]
            axes += [(block[:-2, 1:-1], block[2:, 1:-1])] if is_map else []
            rises = np.stack([np.minimum(own - one, own - other) for one, other in axes])
            singles += int(np.count_nonzero(rises.min(axis=0) > SPIKE_RATIO * usual))
            of_sign[: len(axes)] += np.count_nonzero(rises > SCAR_RATIO * usual, axis=(1, 2))
    than = f"times the difference that {USUAL_PERCENT} % of neighbouring heights have at most"
    if singles:
        what = "1 point lies" if singles == 1 else f"{singles} points lie"
        return (
            f"{what} above or below all neighbours by more than {SPIKE_RATIO:g} {than}: spikes? "
            "Replace them by NaN"
        )
    for counts, where in zip(strokes, ("above", "below"), strict=True):
        if is_map and counts.max() > max(MIN_SCARS, AXIS_RATIO * counts.min()):
            along = "yx"[int(counts.argmax())]
            return (
                f"{counts.max()} points lie {where} both neighbours in the next lines along "
                f"{along} by more than {SCAR_RATIO:g} {than}, but {counts.min()} {where} both in "
                "the line: scars of the scan? Replace them by NaN"
            )
    return ""


def _usual_difference(topography: Topography) -> float:
    """The difference that most neighbours along the rougher axis have at most, from a sample."""
    step, usual = 1 + topography.heights.size // (10 * SAMPLE_SIZE), 0.0
    samples = ((-1, np.s_[::step]), (0, np.s_[:, ::step]))
    for axis, sample in samples if topography.heights.ndim == 2 else ((0, ...),):
        differences = np.abs(np.diff(topography.with_gaps(sample), axis=axis))
        differences = differences[np.isfinite(differences)]
        if differences.size:
            usual = max(usual, float(np.percentile(differences, USUAL_PERCENT)))
    return usual


def _spikes(heights: Field) -> str:
    """Warn if a few heights lie beyond a gap wider than the range of the others (`MIN_OTHERS`)."""
    most = max(0, min(MAX_SPIKES, heights.size // 4, heights.size - MIN_OTHERS))
    values = np.partition(heights, (most, -most - 1), axis=None)
    low, high = np.sort(values[: most + 1])[::-1], np.sort(values[-most - 1 :])
    bottom, top = float(low[0]), float(high[0])
    if not bottom < top:
        return ""
    for value in high[1:]:
        top = float(value) if value - top <= top - bottom else top
    for value in low[1:]:
        bottom = float(value) if bottom - value <= top - bottom else bottom
    apart = np.concatenate([low[low < bottom], high[high > top]])
    if not apart.size:
        return ""
    what = f"{apart.size} heights, from {apart.min():g} to {apart.max():g}, are"
    if apart.size == 1:
        what = f"1 height, {apart[0]:g}, is"
    return f"{what} far from all others, {bottom:g} to {top:g}: spikes? Replace them by NaN"


def rounded(topography: Topography, scale: float) -> str:
    """Warn if heights have steps as coarse as differences of neighbours along the rougher axis."""
    heights, smallest = topography.heights, np.inf
    pairs, changes = np.zeros((2, heights.ndim), int)
    for rows in row_blocks(heights):
        block = topography.with_gaps(rows)
        for axis in range(heights.ndim):
            steps = np.abs(np.diff(block, axis=axis))
            pairs[axis] += np.count_nonzero(np.isfinite(steps))
            steps = steps[steps > 0]
            changes[axis] += steps.size
            smallest = min(smallest, steps.min(initial=np.inf))
    equal = 1 - float((changes / np.maximum(pairs, 1)).max())
    if equal < MAX_EQUAL_NEIGHBOURS or not changes.any():
        return ""
    return (
        f"{percent(equal)} of the neighbouring heights are equal: if they were rounded (the "
        f"smallest step is {scale * smallest:.3g} m), the gradient is too large and the contact "
        "area too small; export the heights with more digits"
    )


def rounded_trend(topography: Topography, levelled: Field, scale: float) -> str:
    """Warn if levelled heights [m] are to a large part the rounding of what was subtracted.

    Equal neighbours do not show it, because the trend makes them different.
    """
    heights = scale * topography.heights
    squares = [np.mean(np.diff(levelled, axis=axis) ** 2) for axis in range(levelled.ndim)]
    if topography.missing is not None:
        heights, levelled = heights[~topography.missing], levelled[~topography.missing]
    change, left = float(np.sqrt(max(squares))), float(np.ptp(levelled))
    if not 0 < left < 0.5 * np.ptp(heights):  # the trend has two steps or more
        return ""
    stored = topography.heights
    is_single = np.array_equal(stored.astype(np.float32), stored)  # perhaps converted to double
    smallest = max(heights.max(), -heights.min()) * (
        SINGLE_EPS if is_single else topography.precision
    )
    sample = heights.flat[:: 1 + heights.size // SAMPLE_SIZE]
    for values in (sample, heights):  # no step of a sample is smaller than the smallest of all
        step = max(np.diff(np.unique(values)).min(initial=np.inf), smallest)
        if step < MIN_ROUNDING_STEP * change:
            return ""
    return (
        f"levelling leaves height differences of {change:.3g} m (rms) between neighbours, and the "
        f"heights are rounded to {step:.3g} m: part of the roughness is rounding, or all of it; "
        "export the heights with more digits, or level them before"
    )
