"""Measured surfaces: read a height map from a file.

Array index [i, j] is [y, x]. A file is data from elsewhere: its size, type and storage are
looked at before any height is read, and nothing in it is ever unpickled.
"""

import math
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.preparation import fill_missing

SMALLEST_SIDE = 8  # points; below it there is no roughness to resolve
LARGEST_HEIGHT = 1e30  # in any unit; the usual marks of no data are 9.97e36 (netCDF) and 3.4e38
MAX_BYTES = 2**33  # 32768 x 32768 heights in double precision
MAX_COMPRESSION = 1032  # the limit of deflate, https://zlib.net/zlib_tech.html
SQUARENESS = 1e-6  # relative: sides are stored in single precision or with some six digits
REMEDY = "Heights that other programs read can be saved by numpy.save as a .npy file."
MOST_MISSING = 0.2  # share of the points; beyond it the filling would be the surface


@dataclass(frozen=True)
class Topography:
    """A square height map as it stands in a file."""

    heights: Field
    """(N, N) in metres where the file states its unit, else in the unit of the file."""
    length: float | None
    """Side of the square cell, None where the file does not say."""
    metres: bool
    """Whether the side is in metres; else in the unknown unit of the heights."""
    periodic: bool | None
    """None for a bare array, which does not say; a scan is not, unless its file says otherwise."""
    source: str
    """Format and dataset or channel."""
    shape: tuple[int, int]
    """Rows and columns in the file, before it was cropped."""
    filled: int = 0
    """Missing heights that were filled in."""


class _Map(NamedTuple):
    """A height map as a reader gives it."""

    heights: np.ndarray[Any, Any]
    """(rows, columns), masked where the file says that a height is missing."""
    sides: tuple[float, float] | None
    """Extent along y and x."""
    metres: bool
    """Whether the sides are in metres, not in a unit that the file does not say."""
    periodic: bool | None
    source: str


def read_topography(
    path: Path,
    dataset: str | None = None,
    max_bytes: int = MAX_BYTES,
    *,
    crop: bool = False,
    fill: bool = False,
) -> Topography:
    """Read a height map from a .npy, HDF5, netCDF or microscope file.

    `.npy` and HDF5 arrays (netCDF 4 is HDF5) are taken as they are, indexed [y, x], without unit.
    All else goes through SurfaceTopography, whose height channel [x, y] is transposed to [y, x]
    and converted to metres.

    Parameters
    ----------
    path : the file
    dataset : name of the HDF5 dataset or microscope channel, by default the only 2-D dataset
        or the default height channel
    max_bytes : largest map to read, counted in double precision
    crop : cut the largest square of even side out of the middle of a map that is none
    fill : fill missing heights in, see `fill_missing`

    Raises InputError, which names the file, what was found and what is needed.
    """
    read = _read(path, dataset, max_bytes)
    shape = read.heights.shape[0], read.heights.shape[1]
    side = min(shape) // 2 * 2
    if shape != (side, side) and not crop:
        raise InputError(
            f"{path}: {shape[0]} x {shape[1]} points; a square map of even side is needed: "
            f"surface.crop = true takes {side} x {side} from its middle"
        )
    length = _length(path, read, side)
    rows, columns = ((size - side) // 2 for size in shape)
    part = read.heights[rows : rows + side, columns : columns + side]
    heights, missing = _checked(path, part, fill)
    return Topography(heights, length, read.metres, read.periodic, read.source, shape, missing)


def _read(path: Path, dataset: str | None, max_bytes: int) -> _Map:
    """The map of a file. Raises InputError."""
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if not path.is_file():
        kind = "a directory" if path.is_dir() else "not a regular file"
        raise InputError(f"{path}: {kind}; a height map file is needed")
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty")
    try:
        if path.suffix.lower() == ".npy" or _begins_with(path, np.lib.format.MAGIC_PREFIX):
            return _read_npy(path, dataset, max_bytes)
        if path.suffix.lower() in (".h5", ".hdf5") or _is_hdf5(path):
            return _read_hdf5(path, dataset, max_bytes)
        return _read_scan(path, dataset, max_bytes)
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error}") from error
    except Exception as error:  # a damaged file can raise anything in its reader
        reason = f"{type(error).__name__}: {error}".partition("\n")[0].rstrip(": ")
        raise InputError(
            f"{path}: cannot be read ({reason}): damaged, or no height map? {REMEDY}"
        ) from error


def _read_npy(path: Path, dataset: str | None, max_bytes: int) -> _Map:
    """A mapped `.npy` array: the map fails where the header claims more than the file holds."""
    if dataset is not None:
        raise InputError(f"{path}: a .npy file holds one array; leave out dataset {dataset!r}")
    mapped = np.lib.format.open_memmap(path, mode="r")  # knows neither pickles nor archives
    _check_layout(path, mapped.shape, mapped.dtype, max_bytes)
    return _Map(mapped, None, False, None, f"npy, {mapped.dtype}")


def _read_hdf5(path: Path, dataset: str | None, max_bytes: int) -> _Map:
    """One dataset of an HDF5 file, reached by hard links and stored in the file itself."""
    import h5py

    from gfmd_cli.physics.hdf5 import take

    found: dict[str, Any] = {}

    def note(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            found[name] = item

    with h5py.File(path, "r") as file:
        file.visititems(note)  # follows hard links only
        name = _choose_dataset(path, found, dataset)
        _check_layout(path, found[name].shape or (), found[name].dtype, max_bytes)
        data = take(file, name, MAX_COMPRESSION)
        packed = {"scale_factor", "add_offset"} & set(data.attrs)
        if packed:
            raise InputError(
                f"{path}: dataset {name!r} is packed ({', '.join(sorted(packed))}); "
                "store the heights themselves"
            )
        values = np.ma.asarray(data[()])
        for mark in {"_FillValue", "missing_value"} & set(data.attrs):
            values = np.ma.masked_where(values == data.attrs[mark], values)
        return _Map(values, None, False, None, f"HDF5, {name}, {data.dtype}")


def _choose_dataset(path: Path, found: dict[str, Any], dataset: str | None) -> str:
    """The named dataset, or the only one that can be a height map."""
    if dataset is not None and dataset.strip("/") in found:
        return dataset.strip("/")
    maps = [name for name, item in found.items() if item.ndim == 2 and item.dtype.kind in "iuf"]
    if dataset is None and len(maps) == 1:
        return maps[0]
    asked = (
        "name one dataset" if dataset is None else f"no dataset {dataset!r} (links do not count)"
    )
    raise InputError(f"{path}: {asked}; its 2-D numeric datasets: {', '.join(maps) or 'none'}")


def _read_scan(path: Path, dataset: str | None, max_bytes: int) -> _Map:
    """A microscope file, read by SurfaceTopography."""
    if path.stat().st_size > max_bytes:
        raise InputError(f"{path}: {path.stat().st_size} bytes; at most {max_bytes} are read")
    with path.open("rb") as file, warnings.catch_warnings():
        for category in (DeprecationWarning, FutureWarning, ImportWarning):  # of other packages
            warnings.simplefilter("ignore", category)
        try:
            from SurfaceTopography.IO import CannotDetectFileFormat, open_topography
        except ImportError as error:
            raise InputError(
                f"{path}: not .npy or HDF5; other formats need SurfaceTopography: "
                "pip install gfmd-cli[topography]"
            ) from error
        try:
            reader = open_topography(file)  # some readers would leave a file open
        except CannotDetectFileFormat as error:
            raise InputError(
                f"{path}: no known topography format; .npy, HDF5 and the formats of "
                f"SurfaceTopography can be read. {REMEDY}"
            ) from error
        with reader:
            return _read_channel(path, reader, dataset, max_bytes)


def _read_channel(path: Path, reader: Any, dataset: str | None, max_bytes: int) -> _Map:
    """One height channel of an open microscope file, in metres."""
    if reader.format() == "hgt" and path.suffix.lower() != ".hgt":  # any 2 n^2 bytes would pass
        raise InputError(f"{path}: no known topography format")
    if reader.format() == "npz":
        raise InputError(f"{path}: an archive of NumPy arrays; save the map as a .npy file")
    heights = {
        channel.channel_id: channel  # the name, and "name#2" where a scan goes there and back
        for channel in reader.channels
        if channel.data_kind.value == "height" and not isinstance(channel.unit, tuple)
    }  # a pair of units is that of a phase or an error signal over a length
    name = reader.default_channel.channel_id if dataset is None else dataset
    if name not in heights:
        known = ", ".join(heights) or "none"
        raise InputError(f"{path}: no height channel {name!r}; its height channels: {known}")
    channel = heights[name]
    _check_layout(path, (channel.nb_grid_pts or ())[::-1], np.dtype(float), max_bytes)
    unsized = channel.physical_sizes is None
    scan = channel.topography(physical_sizes=(1.0, 1.0) if unsized else None)
    if scan.unit is not None:
        scan = scan.to_unit("m")
    width, height = map(float, scan.physical_sizes)
    return _Map(
        heights=scan.heights().T,
        sides=None if unsized else (height, width),
        metres=scan.unit is not None,
        periodic=bool(scan.is_periodic),
        source=f"{reader.format()}, {name}",
    )


def _length(path: Path, read: _Map, side: int) -> float | None:
    """Extent of a square of `side` points. Raises InputError where pixels are no squares."""
    if read.sides is None:
        return None
    y, x = (extent / size for extent, size in zip(read.sides, read.heights.shape, strict=True))
    if not math.isclose(y, x, rel_tol=SQUARENESS) or not x > 0:
        raise InputError(
            f"{path}: a point of the scan is {y:g} x {x:g} wide (relative difference "
            f"{abs(x - y) / max(x, y):.1e}); square ones are needed: resample it"
        )
    return float(side * x)


def _begins_with(path: Path, mark: bytes) -> bool:
    with path.open("rb") as file:
        return file.read(len(mark)) == mark


def _is_hdf5(path: Path) -> bool:
    """Whether it is HDF5 by content, so that no other reader opens such a file."""
    import h5py

    return bool(h5py.is_hdf5(path))


def _check_layout(path: Path, shape: tuple[int, ...], dtype: np.dtype[Any], max_bytes: int) -> None:
    """Refuse what is no map of real numbers, or too small or large, before it is read."""
    if dtype.kind not in "iuf":
        raise InputError(f"{path}: data of type {dtype}; heights are real numbers (int or float)")
    if len(shape) != 2:
        raise InputError(f"{path}: data of shape {shape}; a height map has two dimensions")
    rows, columns = shape
    if min(rows, columns) < SMALLEST_SIDE:
        raise InputError(
            f"{path}: {rows} x {columns} points; at least {SMALLEST_SIDE} a side are needed"
        )
    needed = rows * columns * np.dtype(np.float64).itemsize
    if needed > max_bytes:
        raise InputError(
            f"{path}: {rows} x {columns} heights take {needed} bytes; at most {max_bytes} are "
            "allowed: crop or resample the map"
        )


def _checked(path: Path, values: np.ndarray[Any, Any], fill: bool) -> tuple[Field, int]:
    """The heights in double precision, each of them known, and how many were filled in."""
    heights = np.ma.filled(np.ma.asarray(values).astype(np.float64), np.nan)
    bad = ~(np.abs(heights) < LARGEST_HEIGHT)
    missing = int(np.count_nonzero(bad))
    if missing and fill and missing <= MOST_MISSING * bad.size:
        return fill_missing(heights, bad), missing
    if missing:
        row, column = np.unravel_index(np.argmax(bad), bad.shape)
        remedy = 'surface.missing = "fill" fills them in'
        if missing > MOST_MISSING * bad.size:
            remedy = f"at most {MOST_MISSING:.0%} can be filled in"
        raise InputError(
            f"{path}: {missing} of {bad.size} heights are NaN, infinite or marked as missing, the "
            f"first at row {row}, column {column}; {remedy}"
        )
    return np.ascontiguousarray(heights), 0
