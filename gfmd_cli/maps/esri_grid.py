"""ESRI ASCII grids: number and size of the cells in a header, and rows from north to south.

The map has its rows from south to north, as y increases.
"""

import re
from contextlib import suppress
from itertools import accumulate, chain
from pathlib import Path

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.grid.arrays import Field
from gfmd_cli.maps.height_map import HeightMap, check_layout, shape_text
from gfmd_cli.maps.text_tables import in_utf8, is_number, with_blanks

SIGNATURE = re.compile(rb"(\xef\xbb\xbf)?\s*n(cols|rows)\s", re.IGNORECASE)
NO_DATA = -9999.0  # where the header does not state another value


def read_esri_grid(path: Path, dataset: str | None) -> HeightMap:
    """Read an ESRI ASCII grid, whose lengths have no unit. Raises InputError."""
    if dataset is not None:
        raise InputError(f"an ESRI grid holds one map; leave out dataset {dataset!r}")
    header: dict[str, float] = {}
    with path.open("rb") as binary:
        file, warning = with_blanks(in_utf8(binary))
        file.seek(0)
        for above, line in enumerate(file):
            words = line.lower().replace(b",", b".").split()
            key = words[0].decode(errors="replace") if words else ""
            if len(words) != 2 or not key.isidentifier():
                break
            header[key] = float(_numbers(words[1:], above + 1)[0])
        if absent := [key for key in ("ncols", "nrows", "cellsize") if key not in header]:
            raise InputError(f"the header of an ESRI grid has no {' and no '.join(absent)}")
        shape = int(header["nrows"]), int(header["ncols"])
        check_layout(shape, np.dtype(float))
        rows = enumerate(chain([line], file), above + 1)
        lines = list(filter(np.size, (_numbers(row.split(), number) for number, row in rows)))
    _check_rows([len(each) for each in lines], *shape)
    heights = np.concatenate(lines).reshape(shape)[::-1]
    sides = tuple(header["cellsize"] * points for points in shape)
    heights = np.ma.masked_equal(heights, header.get("nodata_value", NO_DATA))
    return HeightMap(
        heights=heights, sides=sides, source="ESRI grid", periodic=False, notes=(warning,)
    )


def _numbers(words: list[bytes], line: int) -> Field:
    """The numbers in a line of a file. Raises InputError for another word."""
    if b"_" not in b"".join(words):
        with suppress(ValueError):
            return np.array(list(map(float, words)))
    word = next(word for word in words if not is_number(word))
    raise InputError(f":{line}: {word.decode(errors='replace')!r} is not a number")


def _check_rows(counts: list[int], rows: int, columns: int) -> None:
    """Raise InputError where lines of so many heights are not the rows that the header states.

    A row may have several lines. Where rows and columns are interchanged, lines may seem to be such
    parts of rows.
    """
    ends, is_even = set(accumulate(counts)), len(set(counts)) == 1
    is_turned = is_even and (len(counts), counts[0]) == (columns, rows) != (rows, columns)
    if (
        is_turned
        or sum(counts) != rows * columns
        or not ends.issuperset(range(columns, sum(counts), columns))
    ):
        found = shape_text((len(counts), counts[0])) if is_even else f"{sum(counts)}"
        raise InputError(f"{found} heights, but the header states {shape_text((rows, columns))}")
