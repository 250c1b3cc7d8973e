"""A study in other shapes: rows of a CSV file, an xarray data set, a netCDF file."""

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.analysis.table import known
from gfmd_cli.errors import INSTALL, InputError
from gfmd_cli.files.atomic import new_file
from gfmd_cli.grid.arrays import Field
from gfmd_cli.study.column import Column
from gfmd_cli.study.columns import (
    CONTRACT,
    DETAILS,
    HISTOGRAMS,
    PARAMETER_COLUMNS,
    PARAMETERS,
    SCENE,
    SHELLS,
    TASK,
    TASK_GROUPS,
    HistogramColumn,
)
from gfmd_cli.study.reading import StudyFile, open_study, read_rows, solved_rows

Rows = list[dict[str, Any]]
FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""Characters with which a formula of a spreadsheet begins."""
COORDINATES = tuple(
    dict.fromkeys(("surface", "elastomer", *(each.column.name for each in PARAMETERS), "p_star"))
)
"""Columns that are coordinates of the data set: labels, parameters and the reduced pressure."""


def export_csv(path: Path) -> str:
    """A study as CSV: a header, and one row per solved pressure."""
    return csv_text(solved_rows(read_rows(path)))


def csv_text(rows: Rows) -> str:
    """The solved rows of a study as CSV, below a header."""
    names = [*(c.name for c in (*CONTRACT, *DETAILS)), *parameter_names(rows)]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([_cell(row[name]) for name in names] for row in rows)
    return text.getvalue()


def parameter_names(rows: Rows) -> list[str]:
    """Columns of parameters that some row has, without those of the contract."""
    return [
        column.name
        for column in PARAMETER_COLUMNS
        if not all(column.is_blank(row[column.name]) for row in rows)
    ]


def _cell(value: Any) -> str:
    """A value in CSV; text that a spreadsheet would take for a formula begins with '."""
    if not known(value):
        return ""
    if isinstance(value, str) and value.startswith(FORMULA):
        return f"'{value}"
    return repr(value) if isinstance(value, float) else str(value)


def as_dataset(path: Path) -> Any:
    """A study as an `xarray.Dataset`, all of it but the fields on the grid.

    Columns and histograms have the dimension `task`. The spectra of surface and elastomer
    (`scenes_q` and so on) have (scenes, scenes_shell); `scene` is the index of the scene of a task.
    Power spectra and autocorrelations (`spectra_u` and so on) have (task, shell or ring). Missing
    shells are NaN. Tasks are selected by their parameters: `data.sel(hurst=0.8, n=1)`.

    The path may be that of an exported netCDF file. Raises InputError where xarray is missing or
    there is no such study, StudyError.
    """
    data = _opened(path) if path.suffix == ".nc" else _labelled_study(path)
    from gfmd_cli.analysis.parameter_index import ParameterIndex

    return data.set_xindex([name for name in COORDINATES if name in data.coords], ParameterIndex)


def _opened(path: Path) -> Any:
    """An exported netCDF file. Raises InputError."""
    try:
        return _xarray().open_dataset(path, engine="h5netcdf")
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: no readable netCDF file: {error}") from error


def _xarray() -> Any:
    """The module xarray. Raises InputError where it is missing."""
    try:
        import xarray
    except ImportError as error:
        raise InputError(f"this needs xarray: {INSTALL.format('export')} ({error})") from error
    return xarray


def _labelled_study(path: Path) -> Any:
    """A study as a data set without an index over parameters."""
    with open_study(path) as study:
        rows = study.rows
        columns = (*study.columns, SCENE)
        variables = {c.name: _labelled(("task",), _values(rows, c), c) for c in columns}
        variables |= _histograms(rows) | _curves(study)
        coordinates = {"task": _values(rows, TASK)}
        coordinates |= {name: variables.pop(name) for name in COORDINATES if name in variables}
        coordinates |= {h.axis: _bins(h) for h in HISTOGRAMS if h.name in variables}
        return _xarray().Dataset(variables, coordinates, study.attributes)


def write_netcdf(path: Path, target: Path) -> None:
    """Write a study as netCDF 4. Raises InputError, StudyError, SpaceError."""
    made = _labelled_study(path)
    with new_file(target) as file:
        made.to_netcdf(file, engine="h5netcdf")


def _values(rows: Rows, column: Column) -> Any:
    return np.array([row[column.name] for row in rows], dtype=column.kind)


def _labelled(axes: Iterable[str], values: Any, column: Column) -> Any:
    units = {"units": column.units} if column.units else {}
    return tuple(axes), values, units | {"long_name": column.meaning}


def _histograms(rows: Rows) -> dict[str, Any]:
    """The histograms that are stored."""
    return {
        histogram.name: _labelled(
            ("task", histogram.axis),
            np.array([row[histogram.name] for row in rows]),
            histogram.column,
        )
        for histogram in HISTOGRAMS
        if rows and histogram.name in rows[0]
    }


def _bins(histogram: HistogramColumn) -> Any:
    attributes = {"units": "1", "long_name": histogram.axis_meaning, "edges": histogram.edges()}
    return (histogram.axis,), histogram.middles(), attributes


def _curves(study: StudyFile) -> dict[str, Any]:
    """The spectra of the scenes and the curves of the tasks."""
    solved = {row["scene"] for row in solved_rows(study.rows)}
    count = 1 + max((row["scene"] for row in study.rows), default=-1)
    scenes = [vars(study.shells(i)) if i in solved else {} for i in range(count)]
    variables = _padded("scenes", ("scenes", "shell"), SHELLS, scenes)
    for group in TASK_GROUPS:
        if group.axis:
            arrays = [study.arrays(group.name, row["task"]) for row in study.rows]
            variables |= _padded(group.name, ("task", group.axis), group.columns, arrays)
    return variables


def _padded(
    name: str,
    axes: tuple[str, str],
    columns: tuple[Column, ...],
    arrays: Sequence[Mapping[str, Field]],
) -> dict[str, Any]:
    """Curves side by side, NaN where one is shorter than another; none where there is none."""
    if not any(arrays):
        return {}
    over = (axes[0], f"{name}_{axes[1]}")
    return {
        f"{name}_{column.name}": _labelled(
            over, _side_by_side([curves.get(column.name, np.empty(0)) for curves in arrays]), column
        )
        for column in columns
    }


def _side_by_side(curves: list[Field]) -> Field:
    table = np.full((len(curves), max(curve.size for curve in curves)), np.nan)
    for row, curve in zip(table, curves, strict=True):
        row[: curve.size] = curve
    return table
