"""Heights in the memory of a Python program: arrays, nested lists, objects of xarray and others."""

from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.errors import INSTALL, InputError
from gfmd_cli.files.atomic import new_file
from gfmd_cli.files.hdf5 import new_hdf5, write_scale
from gfmd_cli.maps.array_coordinates import UNIT_NAMES
from gfmd_cli.maps.height_map import CODING, LIMITS, MARKS, check_layout, check_type, first_line
from gfmd_cli.maps.microscope_files import heights_and_sides
from gfmd_cli.maps.topography import AXES

READ = *UNIT_NAMES, *MARKS, *LIMITS, *CODING
"""Attributes of an array of xarray that the reader of netCDF files understands."""


def write_heights(path: Path, heights: Any) -> dict[str, Any]:
    """Write heights, and the positions of their points, to an HDF5 file for `read_topography`.

    Parameters
    ----------
    path : the new file
    heights : an array, masked where heights are unknown, an array of xarray, whose coordinates and
        units are kept, or a topography in any unit

    Returns the keys of the table [surface] that go with the heights. Raises InputError for anything
    but real numbers in rows of equal length, and for an array that xarray cannot write.
    """
    # topographies have to_netcdf, too
    is_labelled = hasattr(heights, "to_netcdf") and hasattr(heights, "dims")
    try:
        return (_write_netcdf if is_labelled else _write_array)(path, heights)
    except InputError as error:
        raise InputError(f"heights: {error}") from error


def _write_array(path: Path, heights: Any) -> dict[str, Any]:
    """Write an array or a topography; see `write_heights`."""
    unit, keys = "", dict[str, Any]()
    sides: tuple[float, ...] = ()
    if hasattr(heights, "physical_sizes"):
        keys["periodic"] = bool(heights.is_periodic)
        unit = "" if heights.unit is None else "m"
        try:
            scan = heights.to_unit(unit) if unit else heights
            heights, sides = heights_and_sides(scan, rows_along_y=False)
        except ValueError as error:  # the unit is unknown, or not one of lengths
            raise InputError(first_line(error)) from error
    for name in UNIT_NAMES:  # a quantity of pint or astropy, whose unit NumPy drops
        if hasattr(heights, name):
            raise InputError(
                f"the array has the unit {getattr(heights, name)}; give plain numbers, "
                "in metres unless surface.scale states the unit"
            )
    try:
        values = np.ma.asarray(heights)
    except ValueError as error:
        raise InputError(f"rows of different lengths ({error})") from error
    if np.ma.is_masked(values):
        keys["missing"] = "void"
    check_layout(values.shape, values.dtype)
    with new_file(path) as fresh, new_hdf5(fresh) as file:
        data = file.create_dataset("heights", data=np.ma.filled(values.astype(float), np.nan))
        data.attrs["units"] = unit
        for axis, side in enumerate(sides):
            name, points = AXES[axis - len(sides)], values.shape[axis]
            positions = side / points * np.arange(points)
            scale = write_scale(file, name, positions, unit, f"position along {name}")
            data.dims[axis].attach_scale(scale)
    return keys


def _write_netcdf(path: Path, array: Any) -> dict[str, Any]:
    """Write an array of xarray with its axes and units as netCDF, which is HDF5."""
    if not hasattr(array, "dtype"):
        raise InputError("a data set of xarray; choose one of its arrays")
    check_type(array.dtype)
    try:
        bare = array.astype(np.float64).reset_coords(drop=True).drop_encoding().rename("heights")
        for each in (bare, *bare.coords.values()):
            each.attrs = {name: each.attrs[name] for name in READ if name in each.attrs}
        bare.to_netcdf(path, engine="h5netcdf")
    except ImportError as error:
        raise InputError(f"{first_line(error)}; {INSTALL.format('export')}") from error
    except (NotImplementedError, TypeError, ValueError) as error:
        message = f"an array of xarray is read as a netCDF file: {first_line(error)}"
        raise InputError(message) from error
    return {}
