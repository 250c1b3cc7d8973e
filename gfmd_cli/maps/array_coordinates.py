"""Axes and units of an array in an HDF5 or netCDF 4 file: its dimension scales and attributes.

A dimension scale of HDF5, which is a coordinate variable of netCDF, has the positions of the points
along one axis. An array without scales is a bare one.
"""

from typing import Any, NamedTuple

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.files.checksums import MAX_COMPRESSION

AXIS_NAMES = {
    **dict.fromkeys(("x", "lon", "longitude"), "x"),
    **dict.fromkeys(("y", "lat", "latitude"), "y"),
}
EVEN_TOLERANCE = 1e-3  # deviation of equal distances, over their mean; a choice
NO_VARIABLE = "This is a netCDF dimension but not a netCDF variable"  # begins the attribute NAME
UNIT_NAMES = ("units", "unit")
NO_UNITS = ("", "1")
LENGTHS = {
    1e3: "km",
    1.0: "m metre metres meter meters",
    1e-2: "cm",
    1e-3: "mm millimetre millimetres millimeter millimeters",
    1e-6: "um \N{MICRO SIGN}m \N{GREEK SMALL LETTER MU}m micron microns "
    "micrometre micrometres micrometer micrometers",
    1e-9: "nm nanometre nanometres nanometer nanometers",
    1e-10: "\N{ANGSTROM SIGN} \N{LATIN CAPITAL LETTER A WITH RING ABOVE} angstrom Angstrom",
    1e-12: "pm",
    0.0254: "inch inches in",
}
METRES_PER_UNIT = {name: metres for metres, names in LENGTHS.items() for name in names.split()}
"""Metres per unit; Unicode has two letters for micro and two for angstrom."""
KNOWN_UNITS = [names.split()[0] for names in LENGTHS.values()]


class Axis(NamedTuple):
    """One axis of an array."""

    name: str
    """Name of its dimension scale, "" where it has none."""
    step: float | None
    """Signed distance of neighbouring points, None where no positions are stored."""
    metres_per_unit: float | None
    """Metres per unit of the positions, None where they state no unit."""


def stated_unit(data: Any) -> str:
    """The unit that a dataset states, "" where it states none."""
    units = (_text(data.attrs.get(name, "")) for name in UNIT_NAMES)
    return next((unit for unit in units if unit not in NO_UNITS), "")


def _text(value: Any) -> str:
    """An attribute as text; many programs write an array of one element."""
    if getattr(value, "shape", ()) is None:  # h5py.Empty
        return ""
    words = np.ravel(value).tolist()
    texts = (each.decode(errors="replace") if isinstance(each, bytes) else each for each in words)
    return " ".join(map(str, texts)).strip()


def metres_per_unit(unit: str) -> float | None:
    """Metres per unit of a text such as "nm" or "[um]"; None where the unit is not known."""
    return METRES_PER_UNIT.get(unit.strip().strip("[]()").strip())


def checked_metres_per_unit(name: str, unit: str) -> float | None:
    """Metres per unit, None without a unit. Raises InputError for an unknown one."""
    metres = metres_per_unit(unit)
    if unit and metres is None:
        raise InputError(
            f"{name} states the unit {unit!r}; known are {', '.join(KNOWN_UNITS)}: convert it"
        )
    return metres


def axis_of(file: Any, dimension: Any) -> Axis:
    """One axis of a dataset. Raises InputError for uneven positions, or an unknown unit."""
    from gfmd_cli.files.hdf5 import take

    if not len(dimension):
        return Axis("", None, None)
    scale = dimension[0]  # `dimension.values()` crashes on a scale that is damaged
    name = scale.name.strip("/")
    label = name.rpartition("/")[-1]
    is_empty = _text(scale.attrs.get("NAME", "")).startswith(NO_VARIABLE)
    if is_empty or scale.dtype.kind not in "iuf" or scale.ndim != 1 or scale.size < 2:
        return Axis(label, None, None)
    stored = take(file, name, MAX_COMPRESSION)[()]
    positions = np.asarray(stored, dtype=np.float64)
    steps = np.diff(positions)
    step = float(positions[-1] - positions[0]) / steps.size
    rounding = np.spacing(np.abs(stored).max()) if stored.dtype.kind == "f" else 0.0
    if not (np.abs(steps - step) <= EVEN_TOLERANCE * abs(step) + rounding).all() or step == 0:
        raise InputError(
            f"the positions {label!r} are not evenly spaced: resample the map, or save it "
            "without them"
        )
    return Axis(label, step, checked_metres_per_unit(repr(label), stated_unit(scale)))
