"""Height maps and line profiles as files store them, and the readers of plain arrays.

The layout of an array in a .npy, HDF5 or netCDF 4 file is checked before any of it is read. Nothing
in the files is unpickled.
"""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.files.checksums import MAX_COMPRESSION
from gfmd_cli.maps.array_coordinates import (
    AXIS_NAMES,
    axis_of,
    checked_metres_per_unit,
    stated_unit,
)
from gfmd_cli.units import count, left_out

MAX_MAP_BYTES = 2**33  # 32768 x 32768 heights in double precision
MAX_HEIGHT = 1e30  # in any unit; the usual values for no data are 9.97e36 (netCDF) and 3.4e38
HEIGHT_NAMES = "h", "height", "heights", "height_map", "z", "topography", "topo", "elevation"
MARKS = "_FillValue", "missing_value"
"""Attributes of netCDF whose values are missing heights."""
POINT_LIST = "Position_Indices"
"""Attribute of a dataset of USID, the format of pycroscopy, whose rows belong to single points."""
CODING = {"scale_factor": 1, "add_offset": 0}
"""Attributes of packed numbers, with the values that change nothing."""
LIMITS: dict[str, list[np.ufunc]] = {
    "valid_min": [np.less],
    "valid_max": [np.greater],
    "valid_range": [np.less, np.greater],
}
"""What lies beyond each limit of an attribute of netCDF."""
MAX_LISTED = 20  # names in a message
SMALLEST_MAP = 2  # points per side; fewer have no roughness
REMEDY = "Heights that other programs read can be saved by numpy.save as a .npy file."


@dataclass(frozen=True, kw_only=True)
class HeightMap:
    """A height map, or the profile along a line, as stored in a file."""

    heights: np.ndarray[Any, Any]
    """Heights, shape (rows, columns) or (points,), masked where the file marks one as missing."""
    sides: tuple[float, ...] | None = None
    """Extent along each axis, None where the file does not state it."""
    source: str
    """Format, and dataset or channel."""
    metric_sides: bool = False
    """Whether the sides are in metres, not in an unknown unit."""
    metric_heights: bool = False
    """Whether the heights are in metres, not in an unknown unit."""
    periodic: bool | None = None
    """Whether the map is periodic, None where the file does not state it."""
    notes: tuple[str, ...] = ()
    """Warnings of the reader, "" for none."""


def check_type(dtype: np.dtype[Any]) -> None:
    """Raise InputError for anything but real numbers."""
    if dtype.kind not in "iuf":
        raise InputError(f"data of type {dtype}; heights are real numbers (int or float)")


def check_layout(shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
    """Raise InputError for anything but real numbers on a map or a line, within the limits."""
    check_type(dtype)
    if len(shape) not in (1, 2):
        raise InputError(
            f"data of shape {shape}; a height map has two dimensions, a line profile one"
        )
    if min(shape) < SMALLEST_MAP:
        profile = "; save a line profile as an array of one dimension" if len(shape) == 2 else ""
        raise InputError(
            f"{shape_text(shape)} points; at least {SMALLEST_MAP} along each axis are "
            f"needed{profile}"
        )
    needed = math.prod(shape) * np.dtype(np.float64).itemsize
    if needed > MAX_MAP_BYTES:
        raise InputError(
            f"{shape_text(shape)} heights take {needed} bytes; at most {MAX_MAP_BYTES} are "
            "allowed: resample the map, or save a part of it"
        )


def shape_text(shape: Sequence[int]) -> str:
    """Numbers of points along x and y as text, from the shape of an array [y, x]."""
    return " x ".join(map(str, reversed(shape)))


def first_line(error: Exception) -> str:
    """Type and first line of an exception, for messages."""
    return f"{type(error).__name__}: {error}".partition("\n")[0].rstrip(": ")


def read_npy(path: Path, dataset: str | None) -> HeightMap:
    """Map a `.npy` array into memory, which fails where the header states more than is stored."""
    if dataset is not None:
        raise InputError(f"a .npy file holds one array; leave out dataset {dataset!r}")
    mapped = np.lib.format.open_memmap(path, mode="r")  # reads neither pickles nor archives
    check_layout(mapped.shape, mapped.dtype)
    return HeightMap(heights=mapped, source=f"npy, {mapped.dtype}")


def read_hdf5(path: Path, dataset: str | None) -> HeightMap:
    """Read one dataset of an HDF5 file, reached by hard links and stored in the file itself."""
    from gfmd_cli.files.hdf5 import open_hdf5, take

    with open_hdf5(path) as file:
        name = _dataset_name(file, dataset)
        if POINT_LIST in file[name].attrs:
            raise InputError(
                f"dataset {name!r} has points in the order of their measurement, each with a row "
                f"of values (attribute {POINT_LIST}), as files of JPK and pycroscopy have; save "
                "the map as an array [y, x]"
            )
        shape = _map_shape(file[name].shape or ())
        check_layout(shape, file[name].dtype)
        data = take(file, name, MAX_COMPRESSION)
        packed = {key for key in CODING.keys() & data.attrs if data.attrs[key] != CODING[key]}
        if packed:
            raise InputError(
                f"dataset {name!r} is packed ({', '.join(sorted(packed))}); "
                "store the heights themselves"
            )
        values = np.ma.asarray(data[()]).reshape(shape)
        if "MATLAB_class" in data.attrs:  # columns first; MATLAB plots rows along y
            values = values.T
        for mark in set(MARKS) & set(data.attrs):
            missing = np.asarray(data.attrs[mark])
            if missing.dtype.kind == values.dtype.kind == "f":  # perhaps of another precision
                missing = missing.astype(values.dtype)
            values = np.ma.masked_where(np.isin(values, missing), values)
        values = _valid(name, data.attrs, values)
        bare = HeightMap(heights=values, source=f"HDF5, {name}, {data.dtype}")
        height_map = _with_coordinates(file, data, bare)
        if "spec_text" in file.attrs and name.startswith("fields/"):  # a study
            boundary = take(file, "boundary")[int(name.split("/")[1])]
            return replace(height_map, periodic=boundary != b"free")
        return height_map


def _valid(name: str, attributes: Any, values: Any) -> Any:
    """Heights, masked beyond the limits that the netCDF conventions name.

    Raises InputError for limits that are not numbers.
    """
    for key, beyond in LIMITS.items():
        if key not in attributes:
            continue
        limits = np.ravel(attributes[key])
        if limits.dtype.kind not in "iuf" or len(limits) != len(beyond):
            raise InputError(
                f"dataset {name!r}: {key} must be {count(len(beyond), 'number')}, got "
                f"{limits[:3].tolist()}"
            )
        if limits.dtype.kind == values.dtype.kind == "f":  # perhaps of another precision
            limits = limits.astype(values.dtype)
        for is_beyond, limit in zip(beyond, limits, strict=True):
            values = np.ma.masked_where(is_beyond(values, limit), values)
    return values


def _map_shape(shape: tuple[int, ...]) -> tuple[int, ...]:
    """The shape of an array without leading axes of one point beyond two, such as one time."""
    while len(shape) > 2 and shape[0] == 1:
        shape = shape[1:]
    return shape


def _with_coordinates(file: Any, data: Any, bare: HeightMap) -> HeightMap:
    """A map with the order of its axes, sides and units by its dimension scales.

    With units of heights and positions it is in metres and not periodic, as a microscope scan.
    Without positions it is a bare array, whose unit is not read. Raises InputError where the
    positions of one axis alone state a unit.
    """
    heights = bare.heights
    axes = [axis_of(file, each) for each in data.dims][-heights.ndim :]
    if [AXIS_NAMES.get(axis.name.lower()) for axis in axes] == ["x", "y"]:
        heights, axes = heights.T, axes[::-1]
    steps = [axis.step for axis in axes if axis.step is not None]
    if len(steps) < len(axes):
        note = "the heights state a unit, which is not read: set surface.scale"
        return replace(bare, heights=heights, notes=(note,) if stated_unit(data) else ())
    heights = heights[tuple(slice(None, None, -1 if step < 0 else None) for step in steps)]
    sides = [abs(step) * points for step, points in zip(steps, heights.shape, strict=True)]
    metres = checked_metres_per_unit(repr(data.name), stated_unit(data))
    metric = [axis.metres_per_unit for axis in axes if axis.metres_per_unit]
    if 0 < len(metric) < len(axes):
        bare_name = next(axis.name for axis in axes if not axis.metres_per_unit)
        raise InputError(
            f"the positions {bare_name!r} state no unit, those of the other axis do: add it"
        )
    if metres is not None:
        is_height = np.abs(heights) < MAX_HEIGHT  # in the unit of the file
        heights = np.ma.masked_where(~is_height, metres * heights.astype(np.float64))
    if metric:
        sides = [side * metre for side, metre in zip(sides, metric, strict=True)]
    return replace(
        bare,
        heights=heights,
        sides=tuple(sides) if metric or metres is None else None,
        metric_sides=bool(metric),
        periodic=False if metric and metres is not None else None,
        metric_heights=metres is not None,
    )


def _dataset_name(file: Any, name: str | None) -> str:
    """Path of the named dataset, or of the only map, or of the only line. Raises InputError."""
    from gfmd_cli.files.hdf5 import datasets_below, take

    chosen = (name or "").strip("/")
    if chosen:
        with suppress(KeyError, ValueError):
            take(file, chosen, MAX_COMPRESSION)
            return chosen
    try:
        datasets = datasets_below(file)
    except ValueError as error:
        raise InputError(f"{error}; choose one by surface.dataset") from error
    if is_study := "spec_text" in file.attrs:  # its other arrays are distributions
        datasets = {key: item for key, item in datasets.items() if key.startswith("fields/")}
    maps = _maps(datasets)
    if chosen in datasets:
        return chosen
    if name is not None:
        raise InputError(
            f"no dataset {name!r} (links are not followed); its height maps: {listed(maps)}"
        )
    if is_study and not maps:
        raise InputError(
            'a study that stores no heights; give fields = ["height"] in [output] of its '
            "spec, and run that again"
        )
    if not maps:
        raise InputError("no numeric dataset with one or two dimensions")
    return only_map(maps)


def only_map(names: Sequence[str]) -> str:
    """The only name, or the only one that means heights. Raises InputError if there are several."""
    heights = [name for name in names if name.rpartition("/")[-1].lower() in HEIGHT_NAMES]
    if len(names) == 1 or len(heights) == 1:
        return (heights or names)[0]
    raise InputError(
        "several datasets: choose one by surface.dataset; its height maps: "
        f"{listed(heights or names)}"
    )


def listed(names: Sequence[str]) -> str:
    """Names for a message, `MAX_LISTED` of them at most."""
    return ", ".join([*names[:MAX_LISTED], *left_out(len(names), MAX_LISTED)]) or "none"


def _maps(datasets: dict[str, Any]) -> list[str]:
    """The names of the maps among some datasets; without maps those of the lines.

    Arrays with one row or column are positions or numbers, as MATLAB stores them.
    """
    numbers = {key: item for key, item in datasets.items() if item.dtype.kind in "iuf"}
    maps = [key for key, item in numbers.items() if len(_map_shape(item.shape or ())) == 2]
    maps = [key for key in maps if min(_map_shape(numbers[key].shape)) >= SMALLEST_MAP] or maps
    return maps or [key for key, item in numbers.items() if item.ndim == 1]


def at_equal_distances(x: Any, heights: Any) -> tuple[Any, tuple[float]]:
    """Linear interpolation of a line profile at as many points, and the length of their cell.

    Raises InputError for positions that neither increase nor decrease.
    """
    if x[-1] < x[0]:
        x, heights = x[::-1], heights[::-1]
    wrong = np.flatnonzero(np.diff(x) <= 0)
    if wrong.size:
        raise InputError(
            "the positions along a profile must increase or decrease; "
            f"{x[wrong[0]]:.6g} is followed by {x[wrong[0] + 1]:.6g}"
        )
    points = len(x)
    spacing = float(x[-1] - x[0]) / (points - 1)
    return np.interp(x[0] + spacing * np.arange(points), x, heights), (points * spacing,)
