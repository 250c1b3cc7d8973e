"""A height map or a line profile as it is stored in a file, and what a file may hold."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gfmd_cli.errors import InputError

SMALLEST_MAP = 2  # points per side; fewer have no roughness
REMEDY = "Heights that other programs read can be saved by numpy.save as a .npy file."


class HeightMap(NamedTuple):
    """A height map, or the profile along a line, as stored in a file."""

    heights: np.ndarray[Any, Any]
    """Heights, shape (rows, columns) or (points,), masked where the file marks one as missing."""
    sides: tuple[float, ...] | None
    """Extent along each axis, None where the file does not state it."""
    metres: bool
    """Whether the sides are in metres, not in an unknown unit."""
    periodic: bool | None
    """Whether the map is periodic, None where the file does not state it."""
    source: str
    """Format, and dataset or channel."""


def check_layout(path: Path, shape: tuple[int, ...], dtype: np.dtype[Any], max_bytes: int) -> None:
    """Raise InputError for anything but real numbers on a map or a line, within the limits."""
    if dtype.kind not in "iuf":
        raise InputError(f"{path}: data of type {dtype}; heights are real numbers (int or float)")
    if len(shape) not in (1, 2):
        raise InputError(
            f"{path}: data of shape {shape}; a height map has two dimensions, a line profile one"
        )
    if min(shape) < SMALLEST_MAP:
        raise InputError(
            f"{path}: {extent(shape)} points; at least {SMALLEST_MAP} along each axis are needed"
        )
    needed = math.prod(shape) * np.dtype(np.float64).itemsize
    if needed > max_bytes:
        raise InputError(
            f"{path}: {extent(shape)} heights take {needed} bytes; at most {max_bytes} are "
            "allowed: resample the map, or save a part of it"
        )


def extent(shape: Sequence[int]) -> str:
    """Numbers of points along x and y as text, from the shape of an array [y, x]."""
    return " x ".join(map(str, reversed(shape)))


def first_line(error: Exception) -> str:
    """Type and first line of an exception, for messages."""
    return f"{type(error).__name__}: {error}".partition("\n")[0].rstrip(": ")
