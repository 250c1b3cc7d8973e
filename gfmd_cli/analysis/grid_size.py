"""Size and boundary of a grid in words."""

from collections.abc import Mapping, Sequence
from typing import Any


def grid_size(rows: Sequence[Mapping[str, Any]]) -> str:
    """Points of the grids of some rows, from the coarsest to the finest.

    "256 points a side"; of an oblong grid "256 x 128 points" along x and y; of a line "256 points".
    A free boundary is named before them, if all rows have it.
    """
    sizes = sorted({(int(row["points"]), int(row["points_y"])) for row in rows})
    is_line = all(points_y == 1 for _, points_y in sizes)
    is_square = all(points == points_y for points, points_y in sizes)
    texts = [str(x) if is_line or is_square else f"{x} x {y}" for x, y in sizes]
    size = texts[0] if len(texts) == 1 else f"{texts[0]} to {texts[-1]}"
    free = "free boundary, " if all(row.get("boundary") == "free" for row in rows) else ""
    return f"{free}{size} points{' a side' if is_square else ''}"
