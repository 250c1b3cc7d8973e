"""Heights that a Python program has in memory: arrays, nested lists, SurfaceTopography objects."""

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from pydantic import ValidationError

from gfmd_cli.errors import INSTALL, InputError
from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.array_coordinates import UNIT_NAMES
from gfmd_cli.physics.height_map import at_equal_distances, first_line
from gfmd_cli.physics.topography import Region, middle_square

SAME_SIDE = 1e-6  # relative difference of two sides that are meant to be equal


class GivenHeights(NamedTuple):
    """Heights in memory, and what they state themselves."""

    values: Field
    """Heights, indexed [y, x], NaN where they are masked."""
    keys: dict[str, Any]
    """Keys of the table [surface]."""
    spacing: tuple[float, ...] | None = None
    """Distance of the points along each axis; None for a bare array."""
    metres: bool = False
    """Whether heights and spacing are in metres; else they are in the same unknown unit."""


def given_heights(heights: Any) -> GivenHeights:
    """Heights in memory: an array, masked where heights are unknown, or a topography in any unit.

    Raises InputError for anything but real numbers in rows of equal length.
    """
    if hasattr(heights, "physical_sizes"):
        return _topography(heights)
    keys = {"missing": "void"} if np.ma.is_masked(heights) else {}
    try:
        values = np.ma.asarray(heights)
    except ValueError as error:
        raise InputError(f"heights: rows of different lengths ({error})") from error
    if values.dtype.kind not in "iuf":
        raise InputError(f"heights: data of type {values.dtype}; real numbers are needed")
    return GivenHeights(np.ma.filled(values.astype(np.float64), np.nan), keys)


def write_heights(folder: Path, heights: Any, values: Field) -> Path:
    """Write heights as a file; those of an array of xarray with its axes and units.

    Raises InputError if xarray cannot write them.
    """
    if not hasattr(heights, "to_netcdf"):
        path = folder / "heights.npy"
        np.save(path, values)
        return path
    path = folder / "heights.nc"
    bare = heights.astype(np.float64).reset_coords(drop=True).drop_encoding().rename("heights")
    bare.attrs = {name: unit for name, unit in heights.attrs.items() if name in UNIT_NAMES}
    try:
        bare.to_netcdf(path, engine="h5netcdf")
    except (ImportError, TypeError, ValueError) as error:
        raise InputError(
            f"heights: an array of xarray is read as a netCDF file: {first_line(error)}; "
            f"{INSTALL.format('export')}"
        ) from error
    return path


def _topography(topography: Any) -> GivenHeights:
    """A topography of SurfaceTopography; its arrays are indexed [x, y]."""
    has_unit = topography.unit is not None
    metric = topography.to_unit("m") if has_unit else topography
    if getattr(metric, "is_uniform", True):
        array, sides = metric.heights().T, tuple(map(float, metric.physical_sizes))[::-1]
    else:
        array, sides = at_equal_distances(*metric.positions_and_heights())
    values, keys, *_ = given_heights(array)
    spacing = tuple(side / points for side, points in zip(sides, values.shape, strict=True))
    stated = {"periodic": bool(metric.is_periodic)}
    return GivenHeights(np.ascontiguousarray(values), keys | stated, spacing, has_unit)


def surface_table(heights: GivenHeights, table: dict[str, Any]) -> dict[str, Any]:
    """The table [surface] of heights, without their path. Raises InputError."""
    for name in ("kind", "path"):
        if table.get(name, "file") != "file":
            raise InputError(
                f"surface.{name} = {table[name]!r} and the argument heights both give a "
                "surface; leave one out"
            )
    part = _part(heights, table)
    for name in ("length", "length_y"):
        given, side = table.get(name), part.get(name)
        if not isinstance(given, int | float) or not side:
            continue  # what is no number is refused by the spec
        if not math.isclose(given, side, rel_tol=SAME_SIDE):
            raise InputError(
                f"surface.{name} = {given:g}: the topography in the argument heights has a side of "
                f"{side:g} m; leave out surface.{name}"
            )
    return {**heights.keys, **table, **part, "kind": "file"}


def _part(heights: GivenHeights, table: dict[str, Any]) -> dict[str, Any]:
    """Region in pixels, and sides, of the part of a topography that a table chooses."""
    if heights.spacing is None:
        return {}
    spacing, shape, keys = heights.spacing, heights.values.shape, {}
    if "region" in table:
        try:
            region = Region.model_validate(table["region"])
            parts = region.slices(shape, spacing if heights.metres else None)
        except ValidationError:
            return {}  # the spec refuses it, by the name of its key
        except ValueError as error:
            raise InputError(f"heights: surface.region: {error}") from error
        names = ("x",) if len(shape) == 1 else ("y", "x")
        keys["region"] = {n: [part.start, part.stop] for n, part in zip(names, parts, strict=True)}
        shape = tuple(part.stop - part.start for part in parts)
    if table.get("crop"):
        shape = middle_square(shape)
    scale = 1.0 if heights.metres else table.get("scale", 1.0)
    if not isinstance(scale, int | float):
        return {}  # likewise
    sides = [scale * points * step for points, step in zip(shape, spacing, strict=True)]
    return keys | dict(zip(("length", "length_y"), reversed(sides), strict=False))
