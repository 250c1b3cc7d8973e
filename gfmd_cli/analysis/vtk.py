"""The fields of one task as VTK ImageData, which ParaView and PyVista open.

The XML file format of VTK, version 1.0, with appended raw data: after an underscore each array, its
length in bytes before it (https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html).
"""

from pathlib import Path

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.files.atomic import new_file
from gfmd_cli.grid.arrays import Field
from gfmd_cli.study.columns import FIELDS
from gfmd_cli.study.reading import open_study

NAMES = {"u": "displacement", "sigma": "stress"}
"""Names of arrays that differ from those of the fields of a study."""


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
    with new_file(target) as fresh:
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
    columns = {column.name: column for column in FIELDS}
    arrays, offset = "", 0
    for name, values in fields.items():
        arrays += (
            f'<DataArray type="Float64" Name="{NAMES.get(name, name)}" '
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
