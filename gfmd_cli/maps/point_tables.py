"""Tables of positions and heights: points (x, y, height) on a full grid, profiles (x, height)."""

import re
from collections.abc import Iterator
from decimal import Decimal
from typing import Any, BinaryIO

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.grid.arrays import Field
from gfmd_cli.maps.array_coordinates import NO_UNITS, checked_metres_per_unit, metres_per_unit
from gfmd_cli.maps.height_map import (
    HEIGHT_NAMES,
    MAX_HEIGHT,
    HeightMap,
    at_equal_distances,
    check_layout,
)
from gfmd_cli.maps.text_tables import (
    OWN_HEADERS,
    is_height,
    is_number,
    is_unit,
    part,
    sides_in,
    table_formats,
)

NO_GRID = "three columns that are not the points (x, y, height) of a grid"
MAX_DEVIATION = 0.05  # of positions, over their distance, beside their rounding; a choice
MAX_ROUNDING = 0.25  # of positions, likewise: neighbours differ by 2 of the last digit; a choice
SAME_POSITION = 0.0, 0.5
"""Gaps between equal positions, over the largest gap: of tables, and of stages that jitter."""
MIN_PRESENT = 0.5  # fraction of the points of a grid, without which they are scattered; a choice
MIN_STEPS = 8  # all of one sign, that heights do not have by chance; a choice
NAMES = {"x", "y", *HEIGHT_NAMES}
COLUMN_LINES = 2  # of a header, that state names and units of columns: the last ones
WORDS = re.compile(r"[\[(]([^\])]*)[\])]|([^\W_]+)")
"""The text in brackets, or a word."""
UNITS_OF_GWYDDION = re.compile(r"(Lateral|Value) units:\s*(\S+)")


def read_points(file: BinaryIO, count: int) -> HeightMap | None:
    """Read a table of positions and heights of so many columns; None for any other file.

    The columns are x, y and height, or x and height, unless the header names another order. Raises
    InputError for points that are not those of a grid, and for units that are not clear.
    """
    content = part(file) if "xyz" in table_formats(file, count) else b""
    if not content or content.startswith(OWN_HEADERS):
        return None
    lines = content.replace(b",", b" ").replace(b";", b" ").splitlines()
    first = next((i for i, line in enumerate(lines) if _is_row(line.split(), count)), 0)
    is_sized = len(sides_in(lines[:first])) == 2
    try:
        table = _numbers(lines, first, count)
    except InputError:
        if is_sized:
            return None
        raise
    if is_sized and not _are_points(table):
        return None
    if count == 3 and _is_numbered(table):
        table, count = table[:, 1:], 2
    order, factors = _order_and_units(lines[:first], count)
    table = table[:, order]
    if not np.isfinite(table[:, :-1]).all():
        raise InputError("a position in the table is missing or infinite")
    table[np.abs(table[:, -1]) >= MAX_HEIGHT, -1] = np.nan  # a mark, in the unit of the file
    heights, sides, note = _grid(table) if count == 3 else _profile(table)
    if count == 3 and heights.size > len(table) and not content.endswith((b"\n", b"\r")):
        raise InputError(
            f"the table lacks {heights.size - len(table)} of the {heights.shape[1]} x "
            f"{heights.shape[0]} points of a grid, and its last line does not end with a line "
            "break: if the file is not cut off, add one"
        )
    *of_sides, of_heights = factors or [None] * count
    return HeightMap(
        heights=heights if of_heights is None else of_heights * heights,
        sides=tuple(side * (of or 1.0) for side, of in zip(sides, of_sides[::-1], strict=True)),
        metric_sides=bool(factors),
        metric_heights=of_heights is not None,
        periodic=False,
        source=f"positions and heights{note}",
    )


def _is_row(words: list[bytes], count: int) -> bool:
    """Whether the words of a line are a row of a table: numbers, or a mark as height."""
    return len(words) == count and all(map(is_number, words[:-1])) and is_height(words[-1])


def _numbers(lines: list[bytes], first: int, count: int) -> Field:
    """The table that begins in a line, NaN where heights are missing."""
    try:
        return np.loadtxt(lines[first:], comments=None, ndmin=2)
    except ValueError:  # a mark, or another line
        return np.loadtxt(_rows(lines, first, count), comments=None, ndmin=2)


def _rows(lines: list[bytes], first: int, count: int) -> Iterator[bytes]:
    """The rows of a table, with NaN in the place of marks. Raises InputError for other lines."""
    for number, line in enumerate(lines[first:], first + 1):
        words = [] if line.startswith(b"#") else line.split()
        if words and not _is_row(words, count):
            text = b" ".join(words).decode(errors="replace")
            raise InputError(
                f":{number}: {text!r} in a table of {count} columns of numbers; write NaN "
                "for a missing height"
            )
        if words:
            yield b" ".join([*words[:-1], words[-1] if is_number(words[-1]) else b"nan"])


def _are_points(table: Field) -> bool:
    """Whether a table below a header with two sides is one of positions, not a narrow matrix."""
    if table.shape[1] == 2:
        steps = np.diff(table[:, 0])
        return bool(steps.size >= MIN_STEPS and (np.all(steps > 0) or np.all(steps < 0)))
    try:
        heights, _, _ = _grid(table)
    except InputError:
        return False
    return heights.size == len(table)  # a matrix can look like a grid with missing points


def _is_numbered(table: Field) -> bool:
    """Whether the first of three columns numbers the points of a profile at equal distances."""
    if len(table) < 3 or not (np.diff(table[:, 0]) == 1).all():
        return False
    indices = table[:, :1] - table[0, 0]
    return bool(np.ptp(table[:, 1]) > 0 and _steps(table[:, 1:2], indices)[1] <= MAX_DEVIATION)


def _order_and_units(lines: list[bytes], count: int) -> tuple[list[int], list[float | None]]:
    """The places of x, y and height among the columns, and metres per unit of each of these.

    There are no factors if no unit is stated. Raises InputError for an unknown unit, and where some
    of the positions have none.
    """
    texts = [line.decode(errors="replace") for line in lines if line.strip()]
    order, units, is_unclear = list(range(count)), list[str](), False
    for text in texts[-COLUMN_LINES:]:  # one may have the names, the other the units
        names, of_columns = _columns_in(text, count)
        if names:
            axes = [names.index(axis) for axis in ("x", "y")[: count - 1]]
            order = [*axes, *set(range(count)).difference(axes)]
        is_complete = len(of_columns) == count
        if is_complete and any(of_columns):
            units = of_columns
        is_unclear |= not is_complete and any(metres_per_unit(unit) for unit in of_columns)
    units = [units[place] for place in order if units]
    if stated := dict(UNITS_OF_GWYDDION.findall("\n".join(texts))):
        units = [*[stated.get("Lateral", "")] * (count - 1), stated.get("Value", "")]
    if "" in units[:-1] or (is_unclear and not units):
        example = "x [um] y [um] z [nm]" if count == 3 else "x [um] z [nm]"
        raise InputError(
            f"the header of the table states units, but not one for each of the {count} "
            f"columns, as {example!r} does: add them, or remove the header"
        )
    return order, [checked_metres_per_unit("the header of the table", unit) for unit in units]


def _columns_in(text: str, count: int) -> tuple[list[str], list[str]]:
    """Names and units of the columns in a line of a header, "" where a column has no unit.

    Where the line does not name the columns, there are no names, and the units are all that it has.
    """
    words: list[tuple[str, bool]] = []  # and whether they are units
    for bracket, word in WORDS.findall(text):
        inside = re.findall(r"[^\W_]+", bracket)
        if word or NAMES.intersection(map(str.lower, inside)):
            words += [(each, is_unit(each)) for each in inside or [word]]
        elif bracket.strip() not in NO_UNITS:
            words.append((bracket.strip(), True))
    names = [word.lower() for word, of_unit in words if not of_unit]
    if len(names) != count:
        names = [name for name in names if name in NAMES]
    if len(names) != count or any(names.count(axis) != 1 for axis in ("x", "y")[: count - 1]):
        return [], [word for word, of_unit in words if of_unit]
    units, place = [""] * count, 0
    for word, of_unit in words:
        if of_unit:
            units[place] = word
        elif word.lower() in names:
            place = names.index(word.lower())
    return names, units


def _grid(table: Field) -> tuple[Field, tuple[float, ...], str]:
    """Heights [y, x] and sides of the points of a grid, NaN at those that are missing.

    Raises InputError for points that are not on a grid, or on one of which they are less than half.
    """
    positions = table[:, :2]
    candidates = []
    for same in SAME_POSITION:
        indices: Any = np.column_stack([_index(axis, same) for axis in positions.T])
        nx, ny = (int(last) + 1 for last in indices.max(axis=0))
        is_full = min(nx, ny) > 1 and len(table) >= MIN_PRESENT * nx * ny
        if is_full and np.bincount(indices @ [1, nx]).max() == 1:
            candidates.append((nx * ny - len(table), (ny, nx), indices))
    if not candidates:
        points, counts = np.unique(positions, axis=0, return_counts=True)
        x, y = points[counts.argmax()].tolist()
        times = f": the point x = {x:g}, y = {y:g} is given {counts.max()} times"
        raise InputError(f"{NO_GRID}{times if counts.max() > 1 else ''}")
    _, shape, indices = min(candidates, key=lambda candidate: candidate[0])
    steps, deviation = _steps(positions, indices)
    if deviation.max() > MAX_DEVIATION:
        raise InputError(
            f"the positions along {'xy'[int(deviation.argmax())]} are not evenly spaced: "
            f"they deviate by up to {deviation.max():.2g} of their distance, and at most "
            f"{MAX_DEVIATION:g} is allowed: save them with more digits, or resample the map"
        )
    heights = np.full(shape, np.nan)
    heights[indices[:, 1], indices[:, 0]] = table[:, 2]
    return heights, (float(steps[1] * shape[0]), float(steps[0] * shape[1])), ""


def _profile(table: Field) -> tuple[Field, tuple[float, ...], str]:
    """Heights and length of a profile, NaN at points of equal distance that are missing.

    Interpolated if the distances are not equal.
    """
    check_layout(table.shape[:1], table.dtype)
    x, heights = table.T if table[0, 0] <= table[-1, 0] else table[::-1].T
    gaps = np.diff(x)
    if gaps.min() > 0:
        numbered = np.append(0.0, np.cumsum(np.rint(gaps / np.median(gaps))))
        for index in (np.arange(float(x.size)), numbered):
            points, is_distinct = int(index[-1]) + 1, bool(np.diff(index).all())
            steps, deviation = _steps(x[:, None], index[:, None])
            if is_distinct and deviation[0] <= MAX_DEVIATION and x.size >= MIN_PRESENT * points:
                whole = np.full(points, np.nan)
                whole[index.astype(np.int64)] = heights
                return whole, (float(steps[0]) * points,), ""
    heights, sides = at_equal_distances(x, heights)
    return heights, sides, ", interpolated at equal distances"


def _index(positions: Field, part: float) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """The number of each position in increasing order, equal for positions less apart."""
    values, inverse = np.unique(positions, return_inverse=True)
    gaps = np.diff(values)
    return np.append(0, np.cumsum(gaps > part * gaps.max(initial=0.0)))[inverse]


def _steps(positions: Field, indices: Field) -> tuple[Field, Field]:
    """The best step of even positions along each axis, and the largest deviation in such steps.

    Where it is large, the rounding of the positions is subtracted.
    """
    from_mean = indices - indices.mean(axis=0), positions - positions.mean(axis=0)
    steps = (from_mean[0] * from_mean[1]).sum(axis=0) / (from_mean[0] ** 2).sum(axis=0)
    deviation = np.abs(from_mean[1] - steps * from_mean[0]).max(axis=0) / np.abs(steps)
    for axis in np.flatnonzero(deviation > MAX_DEVIATION):
        rounding = _rounding(positions[:, axis]) / abs(steps[axis])
        if rounding <= MAX_ROUNDING:
            deviation[axis] = max(0.0, deviation[axis] - rounding)
    return steps, deviation


def _rounding(positions: Field) -> float:
    """Half a unit of the last digit of the largest positions."""
    exact = [Decimal(repr(each)).normalize() for each in np.unique(np.abs(positions)).tolist()]
    digits = max(len(each.as_tuple().digits) for each in exact)
    return 0.5 * 10.0 ** (exact[-1].adjusted() + 1 - digits)
