"""Labelled datasets: units, a long name, and dimension scales, so that xarray knows the axes."""

from typing import Any

import h5py
import numpy as np

from gfmd_cli.study.layout import Column


def scale(group: Any, name: str, values: Any, units: str, meaning: str) -> Any:
    """A dimension scale: the labels along one axis of other datasets."""
    axis = group.create_dataset(name, data=values)
    axis.make_scale(name)
    axis.attrs.update({"units": units, "long_name": meaning})
    return axis


def dataset(group: Any, column: Column, values: Any, scales: list[Any]) -> None:
    """A labelled dataset; every chunk of numbers carries a checksum."""
    strings = column.kind is str
    dtype = h5py.string_dtype() if strings else None
    checked = not strings and np.size(values) > 0
    made = group.create_dataset(column.name, data=values, dtype=dtype, fletcher32=checked)
    if column.units:
        made.attrs["units"] = column.units
    made.attrs["long_name"] = column.meaning
    for axis, labels in enumerate(scales):
        made.dims[axis].attach_scale(labels)
