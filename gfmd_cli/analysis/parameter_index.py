"""Selection of the tasks of an `xarray.Dataset` by their parameters."""

from collections.abc import Hashable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
import xarray
from xarray.core.indexing import IndexSelResult

from gfmd_cli.grid.arrays import Mask

Labels = Mapping[Any, Any]
ROUNDING = 1e-9  # relative; numbers that are closer are the same parameter


class ParameterIndex(xarray.Index):  # type: ignore[misc]
    """Index over all parameters together: `data.sel(hurst=0.8, n=[1, 2])` keeps the tasks that fit.

    A label is a value, a list of values or a slice with both ends included. With
    `method="nearest"` a number stands for the nearest one that is there. Floating-point numbers
    are compared up to their rounding, also at the ends of a slice.
    """

    def __init__(self, variables: Mapping[Any, xarray.Variable]) -> None:
        self.variables = dict(variables)

    @classmethod
    def from_variables(
        cls, variables: Mapping[Any, xarray.Variable], *, options: Mapping[str, Any]
    ) -> "ParameterIndex":
        """The index of these coordinates over `task`."""
        return cls(variables)

    def create_variables(
        self, variables: Mapping[Any, xarray.Variable] | None = None
    ) -> dict[Hashable, xarray.Variable]:
        """The coordinates."""
        return dict(self.variables)

    def isel(self, indexers: Mapping[Any, Any]) -> "ParameterIndex | None":
        """The index of some of the tasks; None of a single one, which has no dimension left."""
        selected = {name: each.isel(indexers) for name, each in self.variables.items()}
        return type(self)(selected) if all(each.ndim for each in selected.values()) else None

    def rename(
        self, name_dict: Mapping[Any, Hashable], dims_dict: Mapping[Any, Hashable]
    ) -> "ParameterIndex":
        """The index of coordinates with other names, or over a dimension with another name."""
        renamed = {}
        for name, each in self.variables.items():
            dims = [dims_dict.get(dim, dim) for dim in each.dims]
            variable = xarray.Variable(dims, each.data, each.attrs, each.encoding)
            renamed[name_dict.get(name, name)] = variable
        return type(self)(renamed)

    @classmethod
    def concat(
        cls, indexes: Sequence["ParameterIndex"], dim: Hashable, positions: Any = None
    ) -> "ParameterIndex":
        """The index of the tasks of several data sets, one after the other."""
        joined = {}
        for name in indexes[0].variables:
            parts = [each.variables[name] for each in indexes]
            joined[name] = xarray.Variable.concat(parts, dim, positions)
        return cls(joined)

    def equals(self, other: xarray.Index, **_: Any) -> bool:
        """Whether all parameters of all tasks are the same."""
        return (
            isinstance(other, ParameterIndex)
            and self.variables.keys() == other.variables.keys()
            and all(each.equals(other.variables[name]) for name, each in self.variables.items())
        )

    def sel(self, labels: Labels, method: Any = None, tolerance: Any = None) -> IndexSelResult:
        """The tasks whose parameters are those given. Raises KeyError where there is none."""
        if method not in (None, "nearest") or tolerance is not None:
            raise ValueError(
                f"method={method!r}, tolerance={tolerance!r}: only method='nearest' is "
                "available; select the parameter `tolerance` by sel({'tolerance': ...})"
            )
        fits = [_fits(self.variables[n].values, label, method) for n, label in labels.items()]
        places = np.flatnonzero(np.logical_and.reduce(fits))
        if places.size == 0:
            raise KeyError(f"no task with {', '.join(f'{n} = {v}' for n, v in labels.items())}")
        (dimension,) = next(iter(self.variables.values())).dims
        return IndexSelResult({dimension: places})


def _fits(values: Any, label: Any, method: Literal["nearest"] | None) -> Mask:
    """Which values are those of a label; blank ones neither lie in a range nor are nearest."""
    blank = {"f": np.nan, "i": -1}.get(values.dtype.kind, "")  # as in `Column.blank`
    given = (values != blank) & (values == values)
    if isinstance(label, slice):
        if label.step is not None:
            raise ValueError(f"{label}: a range of parameters has no step")
        if label.start is not None:
            given &= (values >= label.start) | _equal(values, label.start)
        if label.stop is not None:
            given &= (values <= label.stop) | _equal(values, label.stop)
        return given
    if method == "nearest" and values.dtype.kind in "if" and given.any():
        known, labels = values[given], np.atleast_1d(np.asarray(label))
        label = known[np.abs(known - labels[:, np.newaxis]).argmin(axis=1)]
    return _equal(values, label)


def _equal(values: Any, label: Any) -> Mask:
    """Which values are one of those of a label; floating-point numbers but for rounding."""
    labels = np.atleast_1d(np.asarray(label))
    if values.dtype.kind != "f":
        return np.isin(values, labels)
    return np.isclose(values, labels[:, np.newaxis], rtol=ROUNDING, atol=0.0).any(axis=0)
