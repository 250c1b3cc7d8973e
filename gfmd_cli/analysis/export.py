"""A study in other shapes: rows of a CSV file, an xarray data set, a netCDF file."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.hdf5 import has
from gfmd_cli.study.files import new_file
from gfmd_cli.study.layout import (
    COLUMNS,
    CURVES,
    DISTRIBUTION,
    DISTRIBUTIONS,
    MISSING,
    SHELLS,
    Column,
)
from gfmd_cli.study.reading import ATTRIBUTES_SUM, fields_of, open_study, read_rows, rows_of

SCENE = Column("scene", int, "1", "index of the scene")
Rows = list[dict[str, Any]]


def export_rows(path: Path) -> tuple[list[str], list[list[str]]]:
    """Header and rows of the CSV of a study: one row per solved pressure."""
    names = [column.name for column in COLUMNS]
    rows = [row for row in read_rows(path) if row["status"] != MISSING]
    return names, [[_cell(row[name]) for name in names] for row in rows]


def _cell(value: Any) -> str:
    told = plain(value)
    return "" if told is None else repr(told) if isinstance(told, float) else str(told)


def plain(value: Any) -> Any:
    """None for what does not apply: NaN, the seed -1."""
    if isinstance(value, float) and np.isnan(value):
        return None
    return None if isinstance(value, int) and value == -1 else value


def as_dataset(path: Path) -> Any:
    """A study as an `xarray.Dataset`, all of it but the fields on the grid.

    Columns and distributions go over `task`; the spectra of surface and body, `scenes_q` and so on,
    over (scenes, scenes_shell), where `scene` says which is that of a task; power spectra and
    autocorrelations, `spectra_u` and so on, over (task, shell or ring). Where one has fewer
    shells than another NaN follows. Raises InputError where xarray is missing or there is no such
    study, StudyError.
    """
    try:
        import xarray
    except ImportError as error:
        raise InputError(f"this needs xarray: pip install gfmd-cli[export] ({error})") from error
    with open_study(path) as file:
        rows = rows_of(file)
        held = [c for c in (*COLUMNS, *DISTRIBUTION) if has(file, c.name)]
        variables = {c.name: _labelled(("task",), _values(rows, c), c) for c in (*held, SCENE)}
        variables |= _distributions(rows)
        places = [f"scenes/{scene}" for scene in sorted({row["scene"] for row in rows})]
        variables |= _curves(file, "scenes", places, ("scenes", "shell"), SHELLS)
        for name, (axis, columns) in CURVES.items():
            places = [f"{name}/{row['task']}" for row in rows]
            variables |= _curves(file, name, places, ("task", axis), columns)
        attributes = {k: v for k, v in file.attrs.items() if k != ATTRIBUTES_SUM}
        coordinates = {"task": _values(rows, Column("task", int, "", ""))}
        coordinates |= {d.axis: _bins(d) for d in DISTRIBUTIONS if d.name in variables}
        return xarray.Dataset(variables, coordinates, attributes)


def write_netcdf(path: Path, target: Path) -> None:
    """Write a study as netCDF 4. Raises InputError, StudyError, SpaceError."""
    made = as_dataset(path)
    with new_file(target) as file:
        made.to_netcdf(file, engine="h5netcdf")


def _values(rows: Rows, column: Column) -> Any:
    return np.array([row[column.name] for row in rows], dtype=column.kind)


def _labelled(axes: Iterable[str], values: Any, column: Column) -> Any:
    units = {"units": column.units} if column.units else {}
    return tuple(axes), values, units | {"long_name": column.meaning}


def _distributions(rows: Rows) -> dict[str, Any]:
    """The distributions that are stored."""
    return {
        made.name: _labelled(
            ("task", made.axis),
            np.array([row[made.name] for row in rows]),
            Column(made.name, float, "1", made.meaning),
        )
        for made in DISTRIBUTIONS
        if rows and made.name in rows[0]
    }


def _bins(made: Any) -> Any:
    attributes = {"units": "1", "long_name": made.labels, "edges": made.edges()}
    return (made.axis,), made.middles(), attributes


def _curves(
    file: Any, name: str, places: list[str], axes: tuple[str, str], columns: tuple[Column, ...]
) -> dict[str, Any]:
    """Curves of many groups side by side, NaN where one is shorter; none where there is none."""
    found = [fields_of(file, place, columns) for place in places]
    if not any(found):
        return {}
    over = (axes[0], f"{name}_{axes[1]}")
    return {
        f"{name}_{column.name}": _labelled(
            over, _side_by_side([group.get(column.name, np.empty(0)) for group in found]), column
        )
        for column in columns
    }


def _side_by_side(curves: list[Field]) -> Field:
    table = np.full((len(curves), max(curve.size for curve in curves)), np.nan)
    for row, curve in zip(table, curves, strict=True):
        row[: curve.size] = curve
    return table
