"""Heights that a Python program has in memory: arrays, nested lists, SurfaceTopography objects."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.grid.arrays import Field

SAME_SIDE = 1e-6  # relative difference of two sides that are meant to be equal


@dataclass(frozen=True)
class GivenHeights:
    """Heights as the caller has them."""

    values: Field
    """Heights, indexed [y, x], NaN where they are masked."""
    keys: dict[str, Any]
    """Keys of the table [surface] that the heights themselves state; points with masked
    heights never touch unless the table says otherwise."""

    def surface(self, table: dict[str, Any]) -> dict[str, Any]:
        """The table [surface] of these heights, without its path. Raises InputError."""
        for name in ("kind", "path"):
            if table.get(name, "file") != "file":
                raise InputError(
                    f"surface.{name} = {table[name]!r} and the argument heights both give a "
                    "surface; leave one out"
                )
        given, stated = table.get("length"), self.keys.get("length")
        if given and stated and not math.isclose(given, stated, rel_tol=SAME_SIDE):
            raise InputError(
                f"surface.length = {given:g}: the topography in the argument heights is "
                f"{stated:g} m wide; leave out surface.length"
            )
        return {**self.keys, **table, "kind": "file"}


def given_heights(heights: Any) -> GivenHeights:
    """Heights in memory: an array, masked where heights are unknown, or a topography in any unit.

    Raises InputError for anything but real numbers in rows of equal length.
    """
    if hasattr(heights, "physical_sizes"):
        return _topography(heights)
    keys = {"missing": "void"} if np.ma.is_masked(heights) else {}
    return GivenHeights(_as_floats(heights), keys)


def _as_floats(heights: Any) -> Field:
    try:
        values = np.ma.asarray(heights)
    except ValueError as error:
        raise InputError(f"heights: rows of different lengths ({error})") from error
    if values.dtype.kind not in "iuf":
        raise InputError(f"heights: data of type {values.dtype}; real numbers are needed")
    return np.ma.filled(values.astype(np.float64), np.nan)


def _topography(topography: Any) -> GivenHeights:
    """A topography of SurfaceTopography; its arrays are indexed [x, y]."""
    metric = topography.to_unit("m") if topography.unit is not None else topography
    keys = {"length": float(metric.physical_sizes[0]), "periodic": bool(metric.is_periodic)}
    given = given_heights(metric.heights())
    return GivenHeights(np.ascontiguousarray(given.values.T), given.keys | keys)
