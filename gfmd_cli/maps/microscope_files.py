"""Files of microscopes and tables of numbers, by the readers of SurfaceTopography."""

import re
import struct
import warnings
from codecs import BOM_UTF8
from contextlib import suppress
from dataclasses import replace
from io import BytesIO
from math import inf, log2
from pathlib import Path
from threading import Lock
from typing import Any, BinaryIO

import numpy as np

from gfmd_cli.errors import INSTALL, InputError
from gfmd_cli.grid.arrays import Field
from gfmd_cli.maps import text_tables
from gfmd_cli.maps.array_coordinates import EVEN_TOLERANCE, metres_per_unit
from gfmd_cli.maps.height_map import (
    MAX_HEIGHT,
    MAX_MAP_BYTES,
    REMEDY,
    SMALLEST_MAP,
    HeightMap,
    at_equal_distances,
    check_layout,
    first_line,
    only_map,
    shape_text,
)
from gfmd_cli.maps.point_tables import NO_GRID, read_points
from gfmd_cli.maps.text_tables import MATRIX_COLUMNS, OF_SIDES, is_height, is_number

COMPRESSED = {".gz", ".bz2", ".xz", ".zst", ".7z", ".zip"}
TABLE_FORMATS = {"xyz", "asc"}  # formats of SurfaceTopography that are tables of numbers
IN_TEXT = "in text, whose header is not read; save it as a table of x, y and height"
SDF_IN_TEXT = f"an SDF file {IN_TEXT}, or in the binary form of ISO 25178-71 (bISO-1.0)"
ZYGO_IN_TEXT = f"a file of Zygo {IN_TEXT}, or in binary form"
REFUSED = {
    b"aBCR-": SDF_IN_TEXT,
    b"aISO-": SDF_IN_TEXT,
    b"aNIST-": SDF_IN_TEXT,
    b"DSAA": f"a grid of Surfer {IN_TEXT}",
    b"Zygo XYZ Data File": ZYGO_IN_TEXT,
    b"Zygo ASCII Data File": ZYGO_IN_TEXT,
    b"DSCOMPRESSED": "a compressed file of MountainsMap; save it without compression",
    b"Binary TrueMap Data File\r": "a file of TrueMap before version 2.0; save it in version 2.0",
}
"""Files by their first bytes; the readers of tables would take heights without their scales."""
REASONS = {
    "x3p: KeyError: 'DataLink'": "an X3P file with its heights in main.xml, which are not read; "
    "save them in a binary part (DataLink)",
}
"""Reasons of refusals, by the error of the reader, which does not say them."""
TRUEMAP, TRUEMAP_MAGIC_BYTES, TRUEMAP_COMMENT_BYTES = b"Binary TrueMap Data File v2.0", 32, 24
MOUNTAINSMAP, MICROMETRES = b"DIGITAL SURF", re.compile(rb"(?:\xc2\xb5|\xce\xbc|\xec)m[\0 ]")
"""Micrometres in the header of MountainsMap: in UTF-8, and with the Greek letter of Windows.

Zeros or blanks fill the rest of the field."""
NANOFOCUS_DISTANCES = 1376  # byte of a file of NanoFocus, where its two distances of points begin
SMALL_FILE = 2**14  # bytes, which the readers of tables parse in a second
SORTED_ROWS = 20  # heights of so many rows are not sorted by chance; a choice
SIGNATURE_BYTES = 512  # at the beginning of a file, by which readers recognise their format
MAX_POINT_COLUMNS = 10  # of a table of points: x, y, z with colours and normals; a choice
SIGNALS = re.compile("error|deflection|amplitude|phase|intensity", re.IGNORECASE)
"""Names of channels whose lengths are those of a signal."""
HEIGHTS = re.compile(r"height|topograph|^z\b", re.IGNORECASE)
"""Names of channels that hold heights, whatever else they say."""
NOVA = re.compile(rb"^[ \t]*(Scale Data|Unit X|Unit Y)[ \t]*=[ \t]*(\S+)", re.MULTILINE)
"""Header lines of Nova: two that the reader ignores, and "Unit X" to compare with."""
MANY_VALUES = 8  # in a row, for which rounding may make the steps uneven; a choice
MAX_UNEVENNESS = 0.25  # of rounded positions, over their distance; a choice
MAX_OFF_SQUARE = 0.02  # octaves by which pixels differ from square or 2:1, 4:1, ...; a choice
_filter_lock = Lock()
"""One thread at a time: with two, the filters of warnings of the process could stay changed."""


def read_microscope_file(path: Path, dataset: str | None) -> HeightMap:
    """Read a microscope file by SurfaceTopography."""
    if path.stat().st_size > MAX_MAP_BYTES:
        raise InputError(f"{path.stat().st_size} bytes; at most {MAX_MAP_BYTES} are read")
    with path.open("rb") as file, _filter_lock, warnings.catch_warnings():
        ignored = (DeprecationWarning, FutureWarning, ImportWarning, RuntimeWarning)
        for category in ignored:  # of other packages
            warnings.simplefilter("ignore", category)
        try:
            from SurfaceTopography.IO import readers
        except ImportError as error:
            raise InputError(
                "not .npy or HDF5; other formats need SurfaceTopography: "
                f"{INSTALL.format('topography')}"
            ) from error
        start = text_tables.part(file, 0, SIGNATURE_BYTES).removeprefix(BOM_UTF8)
        for signature, what in REFUSED.items():
            if start.startswith(signature):
                raise InputError(what)
        table, warning = text_tables.with_blanks(text_tables.in_utf8(file))
        width = text_tables.columns(table)
        height_map = read_points(table, width)
        if height_map is None:
            table = text_tables.without_size(table, width)
            with _open_scan(path, table, width, readers) as reader:
                height_map = _read_channel(path, table, reader, dataset)
        elif dataset is not None:
            raise InputError(f"a table of positions holds one map; leave out dataset {dataset!r}")
    return replace(height_map, notes=(*height_map.notes, warning))


def _open_scan(path: Path, file: BinaryIO, width: int, readers: list[Any]) -> Any:
    """Open a file, a table of so many columns or 0, by the first reader that accepts it.

    Readers of tables parse any file to its end, which can take minutes, so they get files that look
    like tables, and small files.

    Raises InputError where none does, with the reason of the reader that recognises the format.
    """
    start, is_small = text_tables.part(file, 0, SIGNATURE_BYTES), path.stat().st_size <= SMALL_FILE
    file = _in_known_form(file, start)
    tables = text_tables.table_formats(file, width)
    reasons = []
    for reader in readers:
        answer = reader.can_read(start).name
        is_guess = reader.format() in TABLE_FORMATS - tables
        is_read_here = reader.format() == "xyz" and not start.startswith(text_tables.OWN_HEADERS)
        if answer == "NO" or is_read_here or (is_guess and not is_small):
            continue
        if reader.format() == "asc":
            reader = _with_fast_rows(reader)
        file.seek(0)
        try:
            return reader(file)
        except Exception as error:  # a reader can raise any exception at other formats
            if is_guess:
                continue
            is_likely = answer == "YES" or reader.format() in tables
            if is_likely or path.suffix[1:].lower() in reader.file_extensions():
                row = text_tables.shorter_or_longer_row(file) if reader.format() == "asc" else ""
                reason = f"{reader.format()}: {row or first_line(error)}"
                if reason in REASONS:
                    raise InputError(f"{REASONS[reason]}. {REMEDY}") from error
                reasons.append(reason)
    is_compressed = path.suffix.lower() in COMPRESSED
    if reasons and not is_compressed:
        raise InputError(
            "SurfaceTopography recognises the format but cannot read the file "
            f"({'; '.join(reasons)}): damaged, or a variant of the format? {REMEDY}"
        )
    if is_compressed:
        what = "a compressed file: unpack it"
    elif width == 3:
        what = NO_GRID
    else:
        row = text_tables.shorter_or_longer_row(file) if b"\0" not in start else ""
        what = f"not in a known topography format{f' (as a matrix: {row})' if row else ''}"
    raise InputError(
        f"{what}; .npy, HDF5 and the formats of SurfaceTopography can be read. {REMEDY}"
    )


def _with_fast_rows(reader: Any) -> Any:
    """The reader of matrices, with a faster function for rows of numbers."""

    def parse_data(self: Any, line: str) -> list[float]:
        if "inf" not in line.lower():  # a mark for this reader, a number for Python
            with suppress(ValueError):
                return list(map(float, line.split()))
        row: list[float] = reader.parse_data(self, line)
        return row

    return type("FastReader", (reader,), {"parse_data": parse_data})


def _in_known_form(file: BinaryIO, start: bytes) -> BinaryIO:
    """A file of TrueMap or MountainsMap in the form that its reader knows; others as they are.

    The comment of TrueMap ends with a zero, but the reader takes one of 24 bytes for granted.
    """
    if start.startswith(TRUEMAP) and (end := start.find(b"\0", TRUEMAP_MAGIC_BYTES) + 1):
        header = start[:TRUEMAP_MAGIC_BYTES] + bytes(TRUEMAP_COMMENT_BYTES)
        return BytesIO(header + text_tables.part(file, end))
    if start.startswith(MOUNTAINSMAP) and MICROMETRES.search(start):
        header = MICROMETRES.sub(lambda unit: b"\xb5m".ljust(len(unit[0]), unit[0][-1:]), start)
        return BytesIO(header + text_tables.part(file, len(start)))
    return file


def _read_channel(path: Path, file: BinaryIO, reader: Any, dataset: str | None) -> HeightMap:
    """Read one height channel of an open microscope file, in metres."""
    kind = reader.format()
    if kind == "hgt" and path.suffix.lower() != ".hgt":  # accepts any 2 n^2 bytes
        raise InputError("not in a known topography format")
    if kind == "npz":
        raise InputError("an archive of NumPy arrays; save the map as a .npy file")
    channel = _height_channel(reader, dataset)
    rows_along_y = kind == "mat"  # bare arrays; those of all other formats are [x, y]
    shape: tuple[int, ...] = (channel.nb_grid_pts or ())[:: 1 if rows_along_y else -1]
    check_layout(shape, np.dtype(float))
    unsized = channel.physical_sizes is None
    if kind == "ibw" and len(shape) == 1 and len(reader.channels) > 1:
        raise InputError(
            "an Igor wave of two dimensions with different numbers of points is read as "
            f"curves, not as a map; save it with a third dimension of 1. {REMEDY}"
        )
    if len(shape) == 2:
        _check_sides(channel)
    elif len(channel.physical_sizes or ()) > len(shape):
        raise InputError(
            "the header states two sides, but the table has one column, which is read as "
            "the profile along a line; remove the second side, or save the rows of a map"
        )
    if kind == "nc":
        _check_is_own_netcdf(reader)
    stored = channel.topography(physical_sizes=(1.0,) * len(shape) if unsized else None)
    scan = stored if stored.unit is None else stored.to_unit("m")
    lines = text_tables.lines_above(file, (1, *shape[1:])[-1]) if kind == "asc" else []
    if kind == "asc" and len(shape) == 2:
        _check_matrix(file, scan, unsized)
        _check_nova(lines)
        _check_wyko(_metadata(channel))
    heights, sides = heights_and_sides(scan, rows_along_y)
    if kind == "nms":
        sides = _nanofocus_sides(file, shape)
    has_unit = scan.unit is not None
    if has_unit:  # a mark can be a height in metres, -3.4e38 in nm
        in_unit_of_file, _ = heights_and_sides(stored, rows_along_y)
        heights = np.ma.masked_where(np.abs(in_unit_of_file) >= MAX_HEIGHT, heights)
    metric_sides = None if has_unit or unsized else _sides_with_unit(channel, sides)
    note, sides = "", metric_sides or sides
    if kind == "gwy" and (masked := int(np.ma.getmaskarray(heights).sum())):
        note = f"{masked} points are masked in the file; they count as missing heights"
    elif unsized:
        note = text_tables.unread_units(lines, of_sides=has_unit)
    elif has_unit or metric_sides:
        _check_stated_sides(lines, sides)
        note = _cut_off(heights.shape, sides) if kind == "asc" and len(shape) == 2 else ""
    return HeightMap(
        notes=(note,),
        heights=heights,
        sides=None if unsized else sides,
        metric_sides=has_unit or metric_sides is not None,
        periodic=None if rows_along_y else bool(scan.is_periodic),
        source=f"{kind}, {channel.channel_id}"
        + ("" if scan.is_uniform else ", interpolated at equal distances"),
        metric_heights=has_unit,
    )


def heights_and_sides(scan: Any, rows_along_y: bool) -> tuple[Any, tuple[float, ...]]:
    """Heights and sides, indexed [y, x], of a topography; `rows_along_y` if its heights are.

    A profile with uneven distances is interpolated. Raises InputError for positions that neither
    increase nor decrease.
    """
    if not getattr(scan, "is_uniform", True):
        return at_equal_distances(*scan.positions_and_heights())
    heights, sides = scan.heights(), tuple(map(float, scan.physical_sizes))[::-1]
    if len(sides) == 1 and sides[0] < 0:  # recorded backwards
        return heights[::-1], (-sides[0],)
    return heights if rows_along_y else heights.T, sides


def _nanofocus_sides(file: BinaryIO, shape: tuple[int, ...]) -> tuple[float, ...]:
    """Sides [m] along y and x of a file of NanoFocus, which has the distances of points in nm.

    The reader takes them as mm, so that a side of 160 um becomes 160 m. The unit follows from two
    files of 512 x 512 points and a distance of 312.5, which cannot be mm; surfalize 0.19.2 agrees.
    """
    along_x, along_y = struct.unpack("<2d", text_tables.part(file, NANOFOCUS_DISTANCES, 16))
    return 1e-9 * along_y * shape[0], 1e-9 * along_x * shape[1]


def _check_matrix(file: BinaryIO, scan: Any, unsized: bool) -> None:
    """Raise InputError for a matrix that is not one of heights, or was not read to its end."""
    if unsized and scan.nb_grid_pts[0] < MATRIX_COLUMNS:
        raise InputError(
            f"{NO_GRID}; a matrix of heights has at least {MATRIX_COLUMNS} columns, or "
            f"a header that states its sides. {REMEDY}"
        )
    _check_all_rows_read(file, *scan.nb_grid_pts)
    check_all_are_heights(scan.heights().T, unsized=unsized)


def _check_nova(lines: list[bytes]) -> None:
    """Raise InputError for a header of Nova with a factor, or with different units of the sides."""
    nova = dict(NOVA.findall(b"".join(lines)))
    factor = nova.get(b"Scale Data", b"1").replace(b",", b".")
    units = [nova[key].decode(errors="replace") for key in (b"Unit X", b"Unit Y") if key in nova]
    if not (is_number(factor) and float(factor) == 1.0):
        raise InputError(
            f"the header states 'Scale Data = {factor.decode(errors='replace')}', which is "
            "not applied: are the heights those of the table, or to be multiplied? Save them "
            "multiplied, with a factor of 1"
        )
    if len(set(map(metres_per_unit, units))) > 1:
        raise InputError("'Unit Y' is not 'Unit X'; save both sides in the same unit")


def _check_wyko(header: dict[str, Any]) -> None:
    """Raise InputError for a Wyko table of heights in wavelengths that are not converted.

    The reader takes them as nm unless it finds "Wavelength" and "Mult", both of type 7.
    """
    is_wyko = header.get("format_flavor") == "wyko" and not header.get("wyko_real_units")
    if is_wyko and not {"wyko_wavelength", "wyko_mult"} <= header.keys():
        raise InputError(
            "the heights of this Wyko table are in units of the wavelength, and its "
            "header has no 'Wavelength' or no 'Mult' of type 7, so that they are not converted; "
            "export the heights in nm"
        )


def _check_stated_sides(lines: list[bytes], sides: tuple[float, ...]) -> None:
    """Raise InputError where the two sides that a header states are not those that were read.

    The reader takes every line with such a word as a side, for example "Max Height".
    """
    of_sides = [line for line in lines if OF_SIDES.match(line.decode(errors="replace"))]
    stated = text_tables.sides_in(of_sides)
    if len(stated) == 2 and not np.allclose(sorted(stated), sorted(sides), rtol=1e-6):
        raise InputError(
            f"the header states two sides, {stated[0]:g} m and {stated[1]:g} m, but "
            f"another line makes them {sides[-1]:g} m and {sides[0]:g} m; remove that line"
        )


def _cut_off(shape: tuple[int, ...], sides: tuple[float, ...]) -> str:
    """A warning where the stated sides make pixels that are not square: lines may be missing.

    Scans may have fewer lines than points per line, but then a half, a quarter, ... of them.
    """
    if not all(0 < side < inf for side in sides):
        return ""  # refused later
    along_y, along_x = (side / points for side, points in zip(sides, shape, strict=True))
    octaves = log2(along_y / along_x)
    if abs(octaves - round(octaves)) < MAX_OFF_SQUARE:
        return ""
    return (
        f"the sides in the header and {shape_text(shape)} heights make pixels of {along_x:.3g} m x "
        f"{along_y:.3g} m: is the table cut off?"
    )


def _metadata(channel: Any) -> dict[str, Any]:
    """The keys and values of the header of a text table."""
    header = (channel.info or {}).get("raw_metadata")
    return header if isinstance(header, dict) else {}


def _check_is_own_netcdf(reader: Any) -> None:
    """Raise InputError for a classic netCDF file that SurfaceTopography has not written.

    The reader takes any map as [x, y], and reads neither positions nor the attribute `units`.
    """
    variables = [reader._heights_var, *filter(None, (reader._x_var, reader._y_var))]
    dimensions = variables[0].dimensions
    if dimensions == ("y", "x") or any(hasattr(each, "units") for each in variables):
        raise InputError(
            "a classic netCDF file (version 3), whose units and order of axes are not "
            "read; save it as netCDF 4"
        )


def _check_sides(channel: Any) -> None:
    """Raise InputError where the header of a table states only one side, or sides without unit.

    The reader takes the unit of the heights as that of the sides, which is seldom true.
    """
    sides, header = channel.physical_sizes or (), _metadata(channel)
    is_bare = "xunit" in header and not header["xunit"] and not header.get("yunit")
    if len(sides) == 2 and is_bare and header.get("zunit"):
        raise InputError(
            f"the header states the unit of the heights, {header['zunit']}, but not of the "
            "sides; add it, as in '# Width: 20 um', or remove them and set surface.length"
        )
    if len(sides) == 1 or (not sides and "physical_size_y" in header):
        stated, other = ("Width", "Height") if sides else ("Height", "Width")
        raise InputError(
            f"the header states the side along {'x' if sides else 'y'} ({stated}) alone; "
            f"add a line such as '# {other}: 20 um', or remove both and set surface.length"
        )


def _sides_with_unit(channel: Any, sides: tuple[float, ...]) -> tuple[float, ...] | None:
    """The sides [m] of a text table whose header states units of them but not of the heights."""
    header = _metadata(channel)
    unit_x = header.get("xunit") or ""  # which is not a known unit
    units = (header.get("yunit") or unit_x, unit_x)[-len(sides) :]
    factors = [factor for factor in map(metres_per_unit, units) if factor is not None]
    if len(factors) < len(units):
        return None
    return tuple(factor * side for factor, side in zip(factors, sides, strict=True))


def check_all_are_heights(table: Field, *, unsized: bool) -> None:
    """Raise InputError where a row or column of a table seems to be positions or numbers.

    The first value of such a row may be that of a corner. Where the header states the sides, only
    exact positions count.
    """
    table = np.ma.filled(table, np.nan)
    for word, values in (("row", table), ("column", table.T)):
        is_rounded = unsized and values.shape[1] > MANY_VALUES
        largest = MAX_UNEVENNESS if is_rounded else EVEN_TOLERANCE
        for first, second in (values[:2, 1:], values[:-3:-1, 1:]):
            if _largest_deviation(first) <= largest and _usual_deviation(second) > 4 * largest:
                raise InputError(
                    f"a {word} of the table is ..., {first[0]:g}, {first[1]:g}, "
                    f"{first[2]:g}, ...: positions or numbers, not heights? Remove it from the file"
                )
    if unsized and table.shape[1] <= MAX_POINT_COLUMNS and len(table) > SORTED_ROWS:
        steps = np.diff(table, axis=0)
        is_sorted = np.all(steps >= 0, axis=0) | np.all(steps <= 0, axis=0)
        if table.shape[1] > MATRIX_COLUMNS:  # lines of points: most steps along y are zero
            is_sorted &= np.mean(steps == 0, axis=0) > 0.5
        if np.any(is_sorted & np.any(steps, axis=0)):
            raise InputError(
                f"one of {table.shape[1]} columns is sorted: positions, not heights? Save "
                "the columns x, y and height alone, or a matrix of heights"
            )


def _largest_deviation(values: Field) -> float:
    """Largest deviation of values from even spacing, over the mean step; infinite without one."""
    if len(values) < 3 or not np.isfinite(values).all() or values[0] == values[-1]:
        return np.inf
    step = (values[-1] - values[0]) / (len(values) - 1)
    return float(np.abs(values - values[0] - step * np.arange(len(values))).max() / abs(step))


def _usual_deviation(values: Field) -> float:
    """Median deviation of the known values from even spacing, over their median step."""
    place = np.flatnonzero(np.isfinite(values))
    if len(place) < 3:
        return np.inf
    step = float(np.median(np.diff(values[place]) / np.diff(place)))
    rest = values[place] - step * place
    return float(np.median(np.abs(rest - np.median(rest))) / abs(step)) if step else np.inf


def _check_all_rows_read(file: BinaryIO, columns: int, rows: int) -> None:
    """Raise InputError where a table has more rows than were read, or is two tables.

    The reader skips lines with words, also in the table, where they would shift all rows below.
    """
    file.seek(0)
    lengths = np.array([len(line.split()) for line in file])
    first, last = int(np.argmax(lengths == columns)), np.flatnonzero(lengths)[-1]
    empty = first + np.flatnonzero(lengths[first:last] == 0)
    if 0 < empty.size < rows - 1:
        raise InputError(
            f":{empty[0] + 1}: an empty line in the table: several maps? Save each in its own file"
        )
    is_row = lengths == columns
    is_one_map, all_read = np.count_nonzero(is_row) <= rows, np.count_nonzero(is_row) == rows
    rows_above = 0
    file.seek(0)
    for number, line in enumerate(file, 1):
        if b"\0" in line:
            raise InputError(
                f":{number}: zero bytes in the table: the file is damaged, or not text"
            )
        if all_read and is_row[number - 1] and b"_" not in line:
            rows_above += 1
            continue
        words = line.split()
        marks = [word for word in words if not is_height(word)]
        if not marks:
            rows_above += len(words) == columns
            continue
        if len(words) >= (columns / 2 if rows_above else columns) and (
            len(marks) <= len(words) / 2 or (len(words) == columns and len(set(marks)) == 1)
        ):
            raise InputError(
                f":{number}: {marks[0].decode(errors='replace')!r} in a row of the table "
                "is not a number; write NaN for a missing height"
            )
        if is_one_map and 0 < rows_above < rows:
            raise InputError(
                f":{number}: words between two rows of the table: several maps? Save each in "
                "its own file"
            )


def _height_channel(reader: Any, name: str | None) -> Any:
    """The named height channel of an open file, or its default one.

    Where the default channel holds no heights, the first one that does. Raises InputError.
    """
    channels = {
        channel.channel_id: channel  # the name, and "name#2" for the second scan direction
        for channel in reader.channels
        if channel.data_kind.value == "height" and not isinstance(channel.unit, tuple)
    }  # a channel with a pair of units holds phases or error signals over lengths
    if not channels:
        raise InputError(f"no height channel, as in an image of grey values. {REMEDY}")
    if name is None and reader.format() == "mat":  # arrays without a meaning
        maps = [key for key, item in channels.items() if min(item.nb_grid_pts) >= SMALLEST_MAP]
        name = only_map(maps or list(channels))
    elif name is None:
        default, maps = reader.default_channel.channel_id, list(channels)
        if len(maps) > 1:
            maps = [key for key in maps if HEIGHTS.search(key) or not SIGNALS.search(key)]
        if not maps:
            raise InputError(
                f"its channels seem to be signals: {', '.join(channels)}; if one holds "
                "heights, name it in surface.dataset"
            )
        name = default if default in maps else maps[0]
    if name not in channels:
        known = ", ".join(channels)
        raise InputError(f"no height channel {name!r}; its height channels: {known}")
    return channels[name]
