"""Heights that a Python program has in memory: arrays, nested lists, SurfaceTopography objects."""

import math
from typing import Any

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.grid.arrays import Field

SAME_SIDE = 1e-6  # relative difference of two sides that are meant to be equal


def given_heights(heights: Any) -> tuple[Field, dict[str, Any]]:
    """Heights in memory: an array, masked where heights are unknown, or a topography in any unit.

    Returns the heights, indexed [y, x], NaN where they are masked, and the keys of the table
    [surface] that they state themselves. Raises InputError for anything but real numbers in rows of
    equal length.
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
    return np.ma.filled(values.astype(np.float64), np.nan), keys


def _topography(topography: Any) -> tuple[Field, dict[str, Any]]:
    """A topography of SurfaceTopography; its arrays are indexed [x, y]."""
    metric = topography.to_unit("m") if topography.unit is not None else topography
    stated = {"length": float(metric.physical_sizes[0]), "periodic": bool(metric.is_periodic)}
    values, keys = given_heights(metric.heights())
    return np.ascontiguousarray(values.T), keys | stated


def surface_table(stated: dict[str, Any], table: dict[str, Any]) -> dict[str, Any]:
    """The table [surface] of heights that state some keys, without its path. Raises InputError."""
    for name in ("kind", "path"):
        if table.get(name, "file") != "file":
            raise InputError(
                f"surface.{name} = {table[name]!r} and the argument heights both give a "
                "surface; leave one out"
            )
    given, length = table.get("length"), stated.get("length")
    if given and length and not math.isclose(given, length, rel_tol=SAME_SIDE):
        raise InputError(
            f"surface.length = {given:g}: the topography in the argument heights is "
            f"{length:g} m wide; leave out surface.length"
        )
    return {**stated, **table, "kind": "file"}
