"""Measured surfaces: a height map or a line profile from a file, with every height checked.

The files are not trusted: their size, type and layout are checked before any height is read. Array
index [i, j] is [y, x].
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field as Key
from pydantic import Strict, model_validator

from gfmd_cli.errors import InputError
from gfmd_cli.files.atomic import exists
from gfmd_cli.grid.arrays import Field, Mask
from gfmd_cli.maps.esri_grid import SIGNATURE, read_esri_grid
from gfmd_cli.maps.height_map import (
    MAX_HEIGHT,
    REMEDY,
    SMALLEST_MAP,
    HeightMap,
    first_line,
    read_hdf5,
    read_npy,
    shape_text,
)
from gfmd_cli.maps.microscope_files import (
    SIGNATURE_BYTES,
    check_all_are_heights,
    read_microscope_file,
)
from gfmd_cli.maps.text_tables import MATRIX_COLUMNS, UTF_16
from gfmd_cli.spec_table import SpecTable
from gfmd_cli.units import SCALE_RANGE

MANY_POINTS = 8  # along one axis; a choice: no map has so many beside so few rows or columns
SPACING_TOLERANCE = 1e-6  # relative: files store sides in single precision or with six digits
AXES = ("y", "x")

Interval = Annotated[tuple[Annotated[float, Key(ge=0)], float], Strict(False)]


class Region(SpecTable):
    """Part of a map, such as { x = [10, 110], y = [0, 90] }, by default in pixels."""

    x: Interval | None = None
    """First and last position along x, the last excluded; by default all of the map."""
    y: Interval | None = None
    """First and last position along y, likewise."""
    unit: Literal["pixels", "m"] = "pixels"
    """Unit of the positions, which are counted from the first point of the map."""

    @model_validator(mode="after")
    def _has_extent(self) -> Self:
        for name in AXES:
            interval = getattr(self, name)
            if interval is not None and not interval[0] < interval[1]:
                raise ValueError(f"{name} = {list(interval)}: the lower position comes first")
        return self

    def __str__(self) -> str:
        parts = [
            f"{name} {interval[0]:g} to {interval[1]:g}"
            for name in reversed(AXES)
            if (interval := getattr(self, name)) is not None
        ]
        return f"{' and '.join(parts) or 'all'} {self.unit}"

    def slices(self, shape: tuple[int, ...], spacing: tuple[float, ...] | None) -> Any:
        """The part of an array of this shape. Raises InputError where it leaves the map."""
        steps = spacing if self.unit == "m" else (1.0,) * len(shape)
        if steps is None:
            raise InputError(
                "surface.region: the file does not state its sides: give the region in pixels"
            )
        parts = []
        for name, points, step in zip(AXES[-len(shape) :], shape, steps, strict=True):
            bounds = getattr(self, name)
            first, last = (0, points) if bounds is None else (round(each / step) for each in bounds)
            if last > points or last - first < SMALLEST_MAP:
                raise InputError(
                    f"surface.region: {name} = {list(bounds or ())} {self.unit}: the map has "
                    f"{name} = 0 to {points * step:g} {self.unit}, {points} points; a region has "
                    f"at least {SMALLEST_MAP} of them"
                )
            parts.append(slice(first, last))
        if len(shape) == 1 and self.y is not None:
            raise InputError("surface.region: a line profile has no y")
        return tuple(parts)


@dataclass(frozen=True, kw_only=True)
class Topography(HeightMap):
    """A height map or a line profile, with every height checked."""

    heights: Field
    """Heights, shape (rows, columns) or (points,), zero where missing; in metres where the file
    states its unit, else in the file's unit. Read-only."""
    missing: Mask | None
    """Mask of the missing heights; None where there is none."""
    spacing: tuple[float, ...] | None
    """Distance between neighbouring points along each axis, None where the file does not state
    it. Equal where the file says so to `SPACING_TOLERANCE`."""
    shape: tuple[int, ...]
    """Shape of the map in the file."""
    precision: float
    """Distance of the numbers next to 1 in the type of the heights in the file."""

    @property
    def missing_count(self) -> int:
        """Number of missing heights."""
        return 0 if self.missing is None else int(np.count_nonzero(self.missing))

    def with_gaps(self, part: Any = ...) -> Field:
        """The heights of a part of the map, such as a slice of rows, NaN where they are missing."""
        heights = self.heights[part]
        return heights if self.missing is None else np.where(self.missing[part], np.nan, heights)


def read_topography(
    path: Path,
    dataset: str | None = None,
    *,
    region: Region | None = None,
    flip: bool = False,
    crop: bool = False,
) -> Topography:
    """Read a height map or a line profile from a .npy, HDF5, netCDF or microscope file.

    `.npy` and HDF5 arrays (netCDF 4 is HDF5) are taken as they are, indexed [y, x], without unit,
    unless dimension scales give the order, the positions and the unit.
    SurfaceTopography reads all other formats; its height channel [x, y] is transposed to [y, x]
    and converted to metres.

    Parameters
    ----------
    path : the file
    dataset : name of the HDF5 dataset or microscope channel; by default the only 2-D dataset, the
        only one with a name such as "height", or the default height channel
    region : the part of the map to read
    flip : change the sign of the heights
    crop : of a map, use the largest square of an even number of points in the middle

    Raises InputError, which states the file, its content, and what is needed.
    """
    try:
        return _checked(_reader(path)(path, dataset), region, flip, crop)
    except InputError as error:
        where = path if str(error).startswith(":") else f"{path}: "  # ":12: ..." names a line
        raise InputError(f"{where}{error}") from error
    except MemoryError as error:
        raise InputError(f"{path}: too large for the memory that is available") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error}") from error
    except Exception as error:  # the reader of a damaged file can raise any exception
        is_unit = str(error).startswith("Unknown unit")
        what = (
            "save it with lengths in m, um or nm." if is_unit else "damaged, or not a height map?"
        )
        raise InputError(
            f"{path}: cannot be read ({first_line(error)}): {what} {REMEDY}"
        ) from error


def _reader(path: Path) -> Callable[[Path, str | None], HeightMap]:
    """The function that reads a file, by its suffix or its first bytes. Raises InputError."""
    if not exists(path):
        raise InputError("no such file")
    if not path.is_file():
        kind = "a directory" if path.is_dir() else "not a regular file"
        raise InputError(f"{kind}; a height map file is needed")
    if path.stat().st_size == 0:
        raise InputError("the file is empty")
    with path.open("rb") as file:
        start = file.read(SIGNATURE_BYTES)
    if path.suffix.lower() == ".npy" or start.startswith(np.lib.format.MAGIC_PREFIX):
        return read_npy
    if start.startswith(UTF_16):
        start = start.decode("utf-16", "replace").encode()
    if SIGNATURE.match(start):
        return read_esri_grid
    from gfmd_cli.files.hdf5 import is_hdf5

    if path.suffix.lower() in (".h5", ".hdf5") or is_hdf5(path):
        return read_hdf5
    return read_microscope_file


def _checked(data: HeightMap, region: Region | None, flip: bool, crop: bool) -> Topography:
    """The chosen part of a map, with every height checked. Raises InputError."""
    shape = tuple(map(int, data.heights.shape))
    spacing = _spacing(data, shape)
    part = data.heights
    if region is not None:
        part = part[region.slices(shape, spacing if data.metric_sides else None)]
    if crop and part.ndim == 2:
        side = min(part.shape) // 2 * 2
        first = [(points - side) // 2 for points in part.shape]
        part = part[tuple(slice(a, a + side) for a in first)]
    heights = np.ma.filled(np.ma.asarray(part).astype(np.float64), np.nan)
    if data.sides is None and heights.ndim == 2:
        if min(shape) < MATRIX_COLUMNS <= MANY_POINTS < max(shape):
            raise InputError(
                f"an array of {shape_text(shape)} numbers: positions and heights, not a map? Save "
                "the heights as a matrix, or a line profile as an array of one dimension"
            )
        check_all_are_heights(heights, unsized=False)
    missing: Mask = ~(np.abs(heights) < MAX_HEIGHT)
    if missing.all():
        raise InputError(
            f"all of the {missing.size} heights are NaN, infinite or marked as missing"
        )
    notes = tuple(filter(None, data.notes))
    if heights.ndim == 1 and data.sides is not None and data.periodic is False:
        first, last = np.flatnonzero(~missing)[[0, -1]]
        if SMALLEST_MAP <= last + 1 - first < heights.size:
            ends = first, heights.size - 1 - last
            heights, missing = heights[first : last + 1], missing[first : last + 1]
            notes += (f"{ends_without_heights(*ends)}: only the other {heights.size} are used",)
    heights = np.ascontiguousarray(np.where(missing, 0.0, -heights if flip else heights))
    heights.flags.writeable = False
    kind = data.heights.dtype if data.heights.dtype.kind == "f" else float
    return Topography(
        **vars(data) | {"heights": heights, "notes": notes},
        missing=missing if missing.any() else None,
        spacing=spacing,
        shape=shape,
        precision=float(np.finfo(kind).eps),
    )


def ends_without_heights(first: int, last: int) -> str:
    """The numbers of missing heights at both ends of a profile, in words."""
    ends = (f"{number} at the {end}" for end, number in (("start", first), ("end", last)) if number)
    return f"heights of the profile are missing, {' and '.join(ends)}"


def _spacing(data: HeightMap, shape: tuple[int, ...]) -> tuple[float, ...] | None:
    """Distance between neighbouring points along each axis, None where the file does not state it.

    Raises InputError where it is not positive, or out of range: the format was not recognised.
    """
    if data.sides is None:
        return None
    steps = [side / points for side, points in zip(data.sides, shape, strict=True)]
    low, high = SCALE_RANGE
    if not all(low <= step <= high for step in steps):
        raise InputError(
            f"the sides of the map are {data.sides}; they must be positive, and spacings from "
            f"{low:g} to {high:g}"
        )
    if max(steps) - min(steps) <= SPACING_TOLERANCE * max(steps):
        steps = [steps[-1]] * len(steps)
    return tuple(map(float, steps))
