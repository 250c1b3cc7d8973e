"""Selection of the tasks of an `xarray.Dataset` by their parameters."""

from collections.abc import Hashable, Mapping
from typing import Any, Literal

import numpy as np
import xarray
from xarray.core.indexing import IndexSelResult

from gfmd_cli.grid.arrays import Mask

Labels = Mapping[Any, Any]
ROUNDING = 1e-9  # relative; numbers that are closer are the same parameter
DIMENSION = "task"


class ParameterIndex(xarray.Index):  # type: ignore[misc]
    """Index over all parameters together: `data.sel(hurst=0.8, n=[1, 2])` keeps the tasks that fit.

    A label is a value, a list of values or a slice with both ends included. With
    `method="nearest"` a number stands for the nearest one that is there.
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

    def isel(self, indexers: Mapping[Any, Any]) -> "ParameterIndex":
        """The index of some of the tasks."""
        return type(self)({name: each.isel(indexers) for name, each in self.variables.items()})

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
            raise ValueError(f"method={method!r}, tolerance={tolerance!r}: only method='nearest'")
        fits = [_fits(self.variables[n].values, label, method) for n, label in labels.items()]
        places = np.flatnonzero(np.logical_and.reduce(fits))
        if places.size == 0:
            raise KeyError(f"no task with {', '.join(f'{n} = {v}' for n, v in labels.items())}")
        return IndexSelResult({DIMENSION: places})


def _fits(values: Any, label: Any, method: Literal["nearest"] | None) -> Mask:
    """Which values are those of a label."""
    if isinstance(label, slice):
        low, high = (-np.inf if label.start is None else label.start), label.stop
        return (values >= low) & (values <= (np.inf if high is None else high))
    labels = np.atleast_1d(np.asarray(label))
    if values.dtype.kind not in "if":
        return np.isin(values, labels)
    if method == "nearest":
        distance = np.abs(values - labels[:, np.newaxis])
        labels = values[np.nanargmin(distance, axis=1)]
    close = np.isclose(values, labels[:, np.newaxis], rtol=ROUNDING, atol=0.0)
    return close.any(axis=0)
