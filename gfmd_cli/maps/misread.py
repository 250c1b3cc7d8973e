"""Signs of a map that was read or saved wrongly: type, byte order, order of lines, more points.

`misread`, `interpolated` and `filled_lines` return a warning, or "" if what their docstrings
describe does not occur; `filled_lines` also returns the map. The limits lie between the values of
sound and of damaged maps (`docs/map_evidence.md`).
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from gfmd_cli.grid.arrays import Field, row_blocks
from gfmd_cli.maps.topography import Topography
from gfmd_cli.units import count, percent

MIN_POINTS = 32  # per side: fewer have such patterns by chance
SAMPLED_LINES = 128  # of each axis, and points of each, at least; all of smaller maps
MIN_FILLED = 0.15  # of a line of one height from the mean of the next ones, over that of others
MAX_COMMON = 0.1  # fraction of the points of the next lines with this height; a choice
MAX_REVERSED = 0.86  # difference to the next line in reverse over that to the next line
MIN_ALTERNATION = 1.33  # difference to the next line over that to the next but one
MAX_INTERLACED = 0.87  # difference to the same line of the other half over that to the next line
MIN_HALVES_JUMP = 1.5  # difference of the lines where the halves meet, likewise
MIN_DISTANCE = 4  # lines: those of the halves that are so far apart differ more; a choice
MAX_CONTINUED = 0.63  # step from the end of a line to the next beginning, over that between lines
MIN_BROKEN_LINES = 64  # fewer can seem to continue in each other by chance
NARROW = 4  # least ratio of lines to points per line of a map with broken lines; a choice
MIN_SEAM = 1.7  # median difference across the former border over that of neighbours in a line
MAX_DISPLACED = 0.93  # difference to the next line, displaced by one point, over that without
MAX_SHEARED = 0.97  # difference to the next line, shifted by one point, over that without a shift
LEVELS = 256  # heights, evenly distributed over all, that show how different distant ones are
TAIL = 20  # one of so many heights on either side is clipped, so that spikes matter little
MIN_NOISE = 0.9  # difference of neighbours over that of distant heights
MIN_JUMPS = 4  # along one axis; a choice
MIN_JUMPS_ACROSS = 0.02  # jumps along one axis over those along the other: saw teeth have none
ROUNDING = 1e-6  # spread at both ends over the range, below which a map has two levels; a choice
MAX_SINGLE = 0.95  # fraction of the jumps along x to and from single points; spikes have 1
MAX_WRAP_GAP = 2.3  # median distance of a jump from the whole range over the spread at both ends
MIN_INTERPOLATED_POINTS = 64  # per side: fewer have such a period by chance
PERIODS = (2, 3)  # of interpolated heights, in points; a choice
PART = 32  # points of a part of a line, short enough that the period does not drift; a choice
MIN_EXTREMA = 0.75  # fraction of the points one period apart at which differences are extreme


def filled_lines(topography: Topography) -> tuple[str, Topography]:
    """A warning of lines of a map that have one height each, and the map without them.

    Lines of a surface that are even, such as those between mesas, share this height with the next
    lines; lines of a frame share it with the opposite border.
    """
    heights = topography.with_gaps()
    filled = np.zeros(heights.shape, bool)
    warning = ""
    for lines, along, mask in ((heights, "x", filled), (heights.T, "y", filled.T)):
        if lines.ndim == 1 or min(lines.shape) < MIN_POINTS:
            break
        is_even = lines[:, 0] == lines[:, -1]
        is_even[is_even] = np.ptp(lines[is_even], axis=1) == 0
        if 2 * np.count_nonzero(is_even) > len(lines):
            continue
        first = _sample(len(lines))
        own, following, last = (_after(lines, first, later) for later in range(3))
        usual = _median(following - (own + last) / 2)
        start, stop = np.flatnonzero(np.diff(is_even, prepend=False, append=False)).reshape(-1, 2).T
        is_filled = np.zeros(len(lines), bool)
        for begin, end in zip(start, stop, strict=True):
            height, around = lines[begin, 0], lines[[begin - 1, end % len(lines)]]
            distance = _median(height - around.mean(axis=0))
            if begin == 0 or end == len(lines):  # `around` has a line of the opposite border:
                # the lines are sound where these two fit them, or the next two lines lead to them
                one, other = lines[[end, end + 1]] if begin == 0 else lines[[begin - 1, begin - 2]]
                distance = min(distance, _median(one - (height + other) / 2))
            is_filled[begin:end] = (
                np.ptp(lines[begin:end, 0]) == 0  # no tilt
                and distance > MIN_FILLED * usual
                and np.mean(around == height) < MAX_COMMON
            )
        numbers = np.flatnonzero(is_filled)
        mask[numbers] = True
        if numbers.size and not warning:
            warning = (
                f"{count(numbers.size, 'line')} along {along} of equal heights each, first line "
                f"{numbers[0]} with {lines[numbers[0], 0]:g}: missing lines that were filled with "
                "a number? Replace them by NaN"
            )
    if not warning:
        return "", topography
    missing = filled if topography.missing is None else filled | topography.missing
    return warning, replace(topography, missing=missing)


def misread(topography: Topography) -> str:
    """The first sign of a map that was read or saved wrongly."""
    heights = topography.with_gaps()
    if heights.ndim == 1:
        return ""
    warning = _broken(heights)
    if warning or min(heights.shape) < MIN_POINTS:
        return warning
    warning = _noise(heights) or _wrapped(heights)
    for lines, along in ((heights, "x"), (heights.T, "y")):
        warning = warning or _disordered(lines, along) or _displaced(lines, along)
        warning = warning or _sheared(lines, along)
    return warning


def interpolated(topography: Topography) -> str:
    """Heights that were interpolated between fewer points, along x and along y.

    Interpolated heights vary more, or less, near the points between which they lie than half-way.
    Those of a surface vary equally everywhere, also those of a smooth or a blurred one.
    """
    heights = topography.with_gaps()
    if heights.ndim == 1 or min(heights.shape) < MIN_INTERPOLATED_POINTS:
        return ""
    along_x, along_y = _period(heights), _period(heights.T)
    if not (along_x and along_y):
        return ""
    return (
        f"the curvature of the heights has a period of {along_x} points along x and {along_y} "
        "along y: was the map interpolated to more points than were measured? Then it lacks short "
        "waves, so that the contact area at light load is too large: use the measured points"
    )


def _period(lines: Field) -> int:
    """The period of the second or third differences along lines, 0 without one."""
    above = (period for period, fraction in extrema(lines) if fraction > MIN_EXTREMA)
    return next(above, 0)


def extrema(lines: Field) -> Iterator[tuple[int, float]]:
    """Periods, and the fraction of the points one period apart at which differences are extreme.

    Extreme: the mean of the absolute differences across the lines is larger than at both points
    beside, or smaller. Of the points in the period, those with the largest fraction count.
    """
    some = lines[_sample(len(lines))]
    # Of bilinear heights at 1/4 and 3/4 between measured points only the third differences differ.
    for order, period in product((2, 3), PERIODS):
        differences = np.abs(np.diff(some, order, axis=1))
        number = np.isfinite(differences).sum(axis=0)
        mean = np.nansum(differences, axis=0) / np.maximum(number, 1)
        for one in (mean, -mean):
            is_peak = (one[1:-1] > one[:-2]) & (one[1:-1] > one[2:])
            positions = is_peak[: is_peak.size // period * period].reshape(-1, period)
            parts = np.array_split(positions, len(mean) // PART)
            yield period, float(np.mean([part.mean(axis=0).max() for part in parts]))


def _mean(differences: Field) -> float:
    """Mean absolute value of the known differences, NaN if there is none."""
    known = np.abs(differences[np.isfinite(differences)])
    return float(known.mean()) if known.size else np.nan


def _size(differences: Field) -> float:
    """Square of the mean root of the known differences, to which spikes matter little."""
    return _mean(np.sqrt(np.abs(differences))) ** 2


def _median(differences: Field) -> float:
    """Median absolute value of the known differences, NaN if there is none."""
    known = np.abs(differences[np.isfinite(differences)])
    return float(np.median(known)) if known.size else np.nan


def _sample(lines: int) -> slice:
    """Some lines, even and odd ones, of all that have two lines after them."""
    return slice(0, lines - 2, 1 + 2 * (lines // (2 * SAMPLED_LINES)))


def _after(lines: Field, first: slice, later: int) -> Field:
    """The lines that come `later` than some lines."""
    return lines[first.start + later : first.stop + later : first.step]


def _wrapped(heights: Field) -> str:
    """Jumps by nearly the whole range, between heights that go on at its other end.

    The heights at the jumps of a wrapped map are closer to the ends of the range than others; those
    at the edges of steps are not.
    """
    bottom, top = float(np.nanmin(heights)), float(np.nanmax(heights))
    jumps, counts, pairs, first = [], np.zeros(2, int), 0, (0, 0)
    for rows in row_blocks(heights):
        block = heights[rows.start : rows.stop + 1]
        for axis in range(2):
            steps = np.abs(np.diff(block, axis=axis))[: rows.stop - rows.start]
            is_jump = steps > (top - bottom) / 2
            number = int(np.count_nonzero(is_jump))
            if number and not counts.any():
                row, column = np.argwhere(is_jump)[0]
                first = int(column), rows.start + int(row)
            counts[axis] += number
            jumps.append(steps[is_jump])
        pairs += int(np.count_nonzero(is_jump[:, 1:] & is_jump[:, :-1]))
    if counts.max() < MIN_JUMPS or counts.min() < MIN_JUMPS_ACROSS * counts.max():
        return ""
    if 2 * pairs > MAX_SINGLE * counts[1]:
        return ""
    is_high = heights > (bottom + top) / 2
    low, high = heights[~is_high & np.isfinite(heights)], heights[is_high]
    spread = np.sqrt((low.size * low.var() + high.size * high.var()) / (low.size + high.size))
    gap = top - bottom - float(np.median(np.concatenate(jumps)))
    if not ROUNDING * (top - bottom) < spread or gap > MAX_WRAP_GAP * spread:
        return ""
    return (
        f"{counts.sum()} neighbouring heights differ by nearly the whole range of the map, "
        f"{top - bottom:g}, and lie at its ends, first at the point x, y = {first[0]}, {first[1]}: "
        "wrapped around at the limit of an integer type, or read as another type (int16 as "
        "uint16)? Save the map with a larger type, or read it with the right one"
    )


def _disordered(lines: Field, along: str) -> str:
    """Lines in the wrong order, or every second one reversed, or two images line by line."""
    first, some = _sample(len(lines)), 1 + lines.shape[1] // (2 * SAMPLED_LINES)
    backwards, lines = lines[:, ::-some], lines[:, ::some]
    own = lines[first]
    usual = _mean(_after(lines, first, 1) - own)
    if not usual > 0:
        return ""
    in_reverse = _mean(_after(backwards, first, 1) - own) / usual
    if in_reverse < MAX_REVERSED:
        return (
            f"the lines along {along} fit the next line better in reverse, with "
            f"{percent(in_reverse)} of the difference: was every second line saved "
            "backwards? Reverse these lines"
        )
    next_one, next_but_one = (_size(_after(lines, first, later) - own) for later in (1, 2))
    if next_one > MIN_ALTERNATION * next_but_one:
        return (
            f"the lines along {along} differ more from the next line than from the next but "
            "one: two images line by line, or numbers that were read as two each? Read the file "
            "with the right type, or save every second line"
        )
    for half in {len(lines) // 2, -(-len(lines) // 2)}:
        jump = _mean(lines[half] - lines[half - 1])
        pairs = slice(0, len(lines) - half - 1, first.step)
        one, other = lines[pairs], _after(lines, pairs, half)
        after = min(
            _mean(one - _after(lines, pairs, half + 1)), _mean(_after(lines, pairs, 1) - other)
        )
        between = max(_mean(one - other), after)
        if jump < MIN_HALVES_JUMP * usual or between > MAX_INTERLACED * usual:
            continue
        distant = [
            _mean(lines[: len(lines) - half - each : first.step] - lines[half + each :: first.step])
            for each in range(MIN_DISTANCE, len(lines) - half - MIN_DISTANCE)
        ]
        if min(distant) > usual:  # else a grating
            return (
                f"the lines {half} to {len(lines) - 1} along {along} fit between those before "
                f"them, with {percent(between / usual)} of the difference of neighbouring lines: "
                "an interlaced image, all even lines and then all odd ones? Put the lines in order"
            )
    return ""


def _displaced(lines: Field, along: str) -> str:
    """Every second line displaced along itself, as where both directions of a scan are mixed.

    The other lines then fit their next lines better displaced by one point in opposite directions.
    """
    first, points = _sample(len(lines)), lines.shape[1] - 2
    own, following = lines[first, 1:-1], _after(lines, first, 1)
    back, same, on = (following[:, shift : shift + points] - own for shift in range(3))
    usual = _mean(same)
    alternating = (np.vstack([one[::2], other[1::2]]) for one, other in ((back, on), (on, back)))
    fitted = min(map(_mean, alternating))
    if not fitted < MAX_DISPLACED * usual:
        return ""
    return (
        f"every second line along {along} is displaced: shifted back by one point, it differs from "
        f"the lines beside it by {percent(fitted / usual)} of the present difference; are both "
        "directions of the scan mixed? Align the lines, or use one direction"
    )


def _broken(heights: Field) -> str:
    """Short lines, each of which goes on in the next one."""
    number, points = heights.shape
    if number < max(MIN_BROKEN_LINES, NARROW * points):
        return ""
    on = _median(heights[1:, 0] - heights[:-1, -1])
    usual = _median(np.diff(heights, axis=0))
    if not on < MAX_CONTINUED * usual:
        return ""
    return (
        f"each line of {points} heights seems to continue in the next one: the step from its end "
        f"to the next beginning is {percent(on / usual)} of the usual difference of neighbouring "
        "lines; if each line of the map was saved in several lines, save it in one"
    )


def _sheared(lines: Field, along: str) -> str:
    """Lines that are shifted by one point each: they were read with a wrong number of points.

    The borders of the scan then meet within the map, along a diagonal from a corner.
    """
    number, points = lines.shape
    first, some = _sample(number), _sample(points)
    own, following = lines[first], _after(lines, first, 1)
    middle = _after(own.T, some, 1).T
    usual = _median(middle - own[:, some])
    shifted = [_median(_after(following.T, some, each).T - middle) for each in range(3)]
    for wrong, shift in ((1, shifted[0]), (-1, shifted[2])):
        right = points - wrong
        row, column = np.arange(number), -wrong * np.arange(number) % right
        inside = (column > 0) & (column < points)
        row, column = row[inside], column[inside]
        seam = _median(lines[row, column] - lines[row, column - 1])
        if seam > MIN_SEAM * usual > 0 and shift < MAX_SHEARED * shifted[1]:
            return (
                f"each line along {along} is shifted by one point against the line before, and "
                f"steps of {seam / usual:.2g} times the usual difference lie on a diagonal: read "
                f"the file with {right} instead of {points} points per line"
            )
    return ""


def _noise(heights: Field) -> str:
    """Neighbouring heights that have nothing to do with each other."""
    rows, columns = (_sample(points) for points in heights.shape)
    some = heights[rows, columns]
    values = np.sort(some[np.isfinite(some)])
    if not values.size:
        return ""
    low, high = values[values.size // TAIL], values[-1 - values.size // TAIL]
    values = values[:: 1 + values.size // LEVELS].clip(low, high)
    distant = _mean(values - values[:, None])
    along_y = _after(heights, rows, 1)[:, columns]
    along_x = _after(heights.T, columns, 1)[:, rows].T
    near = [_mean(each.clip(low, high) - some.clip(low, high)) for each in (along_y, along_x)]
    if not min(near) > MIN_NOISE * distant > 0:
        return ""
    return (
        f"neighbouring heights differ as much as distant ones, {min(near) / distant:.0%}: read "
        "with a wrong type or byte order, or roughness that the map does not resolve? Contact then "
        "depends on the distance of the points"
    )
