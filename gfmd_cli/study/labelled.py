"""Labelled datasets: units, a long name, and dimension scales, so that xarray knows the axes."""

from typing import Any

import h5py
import numpy as np

from gfmd_cli.study.layout import Column


def scale(group: Any, name: str, values: Any, units: str, meaning: str) -> Any:
    """A dimension scale: the labels along one axis of other datasets."""
    axis = _checked(group, name, np.asarray(values))
    axis.make_scale(name)
    axis.attrs.update({"units": units, "long_name": meaning})
    return axis


def dataset(group: Any, column: Column, values: Any, scales: list[Any]) -> None:
    """A labelled dataset, text in UTF-8 of a fixed length."""
    if column.kind is str:
        encoded = [value.encode() for value in values]
        longest = max(map(len, encoded), default=1) or 1
        made = _checked(group, column.name, np.array(encoded, h5py.string_dtype("utf-8", longest)))
        made.attrs["_Encoding"] = "utf-8"
    else:
        made = _checked(group, column.name, np.asarray(values, column.kind))
    if column.units:
        made.attrs["units"] = column.units
    made.attrs["long_name"] = column.meaning
    for axis, labels in enumerate(scales):
        made.dims[axis].attach_scale(labels)


def _checked(group: Any, name: str, values: Any) -> Any:
    """A dataset whose every chunk carries a checksum: what has changed cannot be read."""
    return group.create_dataset(name, data=values, fletcher32=values.size > 0)
