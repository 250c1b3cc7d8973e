"""A study in other shapes: rows of a CSV file, records, an xarray data set, netCDF, VTK.

ParaView and PyVista open the fields of a task as VTK ImageData: the XML file format of VTK, version
1.0, with appended raw data: after an underscore each array, its length in bytes before it
(https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html).
"""

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.analysis.compare import VARIANTS, Comparison
from gfmd_cli.analysis.ensemble import ensembles
from gfmd_cli.analysis.table import known, plain
from gfmd_cli.errors import INSTALL, InputError
from gfmd_cli.files.atomic import exists, new_file, target_of
from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.observables import MAIN_OBSERVABLES
from gfmd_cli.study import columns as layout
from gfmd_cli.study.column import Column, Row
from gfmd_cli.study.reading import StudyFile, open_study, read_rows, solved_rows

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""Characters with which a formula of a spreadsheet begins."""
THEORY_COLUMNS = (*(f"{name}_persson" for name in MAIN_OBSERVABLES), "p_star_persson_at_u_g")
EINSTEIN_COLUMNS = tuple(f"{name}_einstein" for name in MAIN_OBSERVABLES)
_PARAMETER_NAMES = (each.column.name for each in layout.PARAMETERS)
COORDINATES = tuple(dict.fromkeys(("surface", "elastomer", *_PARAMETER_NAMES, "p_star")))
"""Columns that are coordinates of the data set: labels, parameters and the reduced pressure."""
VTK_NAMES = {"u": "displacement", "sigma": "stress"}
"""Names of arrays of an image that differ from those of the fields of a study."""


def export_csv(path: Path) -> str:
    """A study as CSV: a header, and one row per solved pressure."""
    return csv_text(solved_rows(read_rows(path)))


def csv_text(rows: list[Row]) -> str:
    """The solved rows of a study as CSV, below a header."""
    names = column_names(rows)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    writer.writerows([_cell(row[name]) for name in names] for row in rows)
    return text.getvalue()


def column_names(rows: list[Row]) -> list[str]:
    """All columns, without the parameters that no row has."""
    parameters = (
        column
        for column in layout.PARAMETER_COLUMNS
        if not all(column.is_blank(row[column.name]) for row in rows)
    )
    return [column.name for column in (*layout.MAIN_COLUMNS, *layout.DETAIL_COLUMNS, *parameters)]


def as_records(comparison: Comparison) -> list[dict[str, Any]]:
    """One record for each solved pressure, as JSON has it; what does not apply is None.

    The keys are the columns of `gfmd export`, then theory and the means over seeds where they
    apply.
    """
    means = {
        row["task"]: {key: plain(value) for key, value in ensemble.means().items()}
        for ensemble in ensembles(comparison)
        for row in ensemble.rows
    }
    records = []
    names = column_names(comparison.records)
    for curve in comparison.curves:
        keys = [*names, *(THEORY_COLUMNS if curve.has_theory else ())]
        for optional in (EINSTEIN_COLUMNS, VARIANTS.values()):
            if curve.stores(optional):
                keys += optional
        for row in curve.records:
            record = {key: plain(row[key]) for key in keys}
            records.append(record | means.get(row["task"], {}))
    return records


def _cell(value: Any) -> str:
    """A value in CSV; text that a spreadsheet would take for a formula begins with '."""
    if not known(value):
        return ""
    if isinstance(value, str) and value.startswith(FORMULA):
        return f"'{value}"
    return str(value)


def as_dataset(path: Path) -> Any:
    """A study as an `xarray.Dataset`, all of it but the fields on the grid.

    Columns and histograms have the dimension `task`. The spectra of surface and elastomer
    (`scenes_q` and so on) have (scenes, scenes_shell); `scene` is the index of the scene of a task.
    Power spectra and autocorrelations (`spectra_u` and so on) have (task, shell or ring). Missing
    shells are NaN. Tasks are selected by their parameters: `data.sel(hurst=0.8, n=1)`.

    The path may be that of an exported netCDF file. Raises InputError where xarray is missing or
    there is no such study, StudyError.
    """
    if path.suffix == ".nc":
        try:
            if not exists(path):
                raise InputError(f"{path}: no such netCDF file")
            data = _xarray().open_dataset(path, engine="h5netcdf")
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: not a readable netCDF file: {error}") from error
    else:
        data = _labelled_study(path)
    from gfmd_cli.analysis.parameter_index import ParameterIndex

    return data.set_xindex([name for name in COORDINATES if name in data.coords], ParameterIndex)


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
        variables = {c.name: _of_tasks(rows, c) for c in (*study.columns, layout.SCENE)}
        coordinates: dict[str, Any] = {"task": _of_tasks(rows, layout.TASK)}
        coordinates |= {name: variables.pop(name) for name in COORDINATES if name in variables}
        for bins in layout.HISTOGRAMS:
            if rows and bins.name in rows[0]:
                variables[bins.name] = _of_tasks(rows, bins.column, bins.axis)
                about = {"units": "1", "long_name": bins.axis_meaning, "edges": bins.edges}
                coordinates[bins.axis] = (bins.axis,), bins.middles(), about
        variables |= _curves(study)
        return _xarray().Dataset(variables, coordinates, study.attributes)


def write_netcdf(path: Path, target: Path) -> None:
    """Write a study as netCDF 4. Raises InputError, StudyError, SpaceError."""
    dataset = _labelled_study(path)
    with new_file(target_of(target)) as file:
        dataset.to_netcdf(file, engine="h5netcdf")


def _of_tasks(rows: list[Row], column: Column, *axis: str) -> Any:
    """A column of the rows; `axis`: that of the values that each row has."""
    values: Any = np.array([row[column.name] for row in rows], dtype=column.kind)
    return _labelled(("task", *axis), values, column)


def _labelled(axes: tuple[str, ...], values: Any, column: Column) -> Any:
    units = {"units": column.units} if column.units else {}
    return axes, values, units | {"long_name": column.meaning}


def _curves(study: StudyFile) -> dict[str, Any]:
    """The spectra of the scenes and the curves of the tasks."""
    solved = {row["scene"] for row in solved_rows(study.rows)}
    count = 1 + max((row["scene"] for row in study.rows), default=-1)
    scenes = [vars(study.shells(i)) if i in solved else {} for i in range(count)]
    variables = _padded("scenes", ("scenes", "shell"), layout.SHELLS, scenes)
    for group in layout.TASK_GROUPS:
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
    variables: dict[str, Any] = {}
    for column in columns if any(arrays) else ():
        curves = [each.get(column.name, np.empty(0)) for each in arrays]
        table = np.full((len(curves), max(curve.size for curve in curves)), np.nan)
        for row, curve in zip(table, curves, strict=True):
            row[: curve.size] = curve
        over = (axes[0], f"{name}_{axes[1]}")
        variables[f"{name}_{column.name}"] = _labelled(over, table, column)
    return variables


def write_image(study: Path, task: int | None, target: Path) -> None:
    """Write heights, displacement and stress of a task [m, Pa], as far as they are stored.

    Without `task` the only one that has fields. Raises InputError, StudyError, SpaceError.
    """
    with open_study(study) as stored:
        index = _choose(study, stored.tasks_with("fields"), task)
        arrays = stored.arrays("fields", index)
        fields = {name: np.ascontiguousarray(values, "<f8") for name, values in arrays.items()}
        sides = [float(stored.rows[index][name]) for name in ("length", "length_y")]
        first = float(stored.rows[index]["x_first"])
    with new_file(target_of(target)) as fresh:
        fresh.write(_head(fields, sides, first).encode())
        for values in fields.values():
            fresh.write(np.uint64(values.nbytes).astype("<u8").tobytes())
            fresh.write(values)
        fresh.write(b"\n</AppendedData>\n</VTKFile>\n")


def _choose(study: Path, tasks: list[int], task: int | None) -> int:
    """The task to write. Raises InputError where it has no fields, or many do and none is named."""
    if not tasks:
        raise InputError(f'{study}: contains no fields; store them with fields = ["u"] in [output]')
    allowed = ", ".join(map(str, tasks))
    if task is None and len(tasks) > 1:
        raise InputError(
            f"{study}: {len(tasks)} tasks have fields; choose --task, one of {allowed}"
        )
    if task is not None and task not in tasks:
        raise InputError(f"--task: {task} has no fields in {study}; allowed: {allowed}")
    return tasks[0] if task is None else task


def _head(fields: dict[str, Field], sides: list[float], first: float) -> str:
    """All before the arrays. Values lie [y, x], x fastest, as VTK has them.

    `sides` are those of the cell along x and y [m], `first` the position of its first point along
    each of them, as a share of the side.
    """
    shape = next(iter(fields.values())).shape[::-1]
    missing = 3 - len(shape)  # axes of an image that the fields lack
    steps = [side / count for side, count in zip(sides, shape, strict=False)]
    extent = " ".join(f"0 {count - 1}" for count in (*shape, *[1] * missing))
    spacing = " ".join(map(repr, [*steps, *[steps[0]] * missing]))
    corner = " ".join([*(repr(first * side) for side in sides[: len(shape)]), *["0"] * missing])
    columns = {column.name: column for column in layout.FIELDS}
    arrays, offset = "", 0
    for name, values in fields.items():
        arrays += (
            f'<DataArray type="Float64" Name="{VTK_NAMES.get(name, name)}" '
            f'format="appended" offset="{offset}">'
            f'<InformationKey name="UNITS_LABEL" location="vtkDataArray">{columns[name].units}'
            "</InformationKey></DataArray>\n"
        )
        offset += values.nbytes + 8
    return f"""\
<?xml version="1.0"?>
<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt64">
<ImageData WholeExtent="{extent}" Origin="{corner}" Spacing="{spacing}">
<Piece Extent="{extent}">
<PointData>
{arrays}</PointData>
</Piece>
</ImageData>
<AppendedData encoding="raw">
_"""
