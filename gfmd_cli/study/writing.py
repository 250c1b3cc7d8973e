"""Writing a study file: loops over what `columns` declares.

Numbers have units, a long name and dimension scales, so that xarray and netCDF know the axes; every
chunk has a checksum.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple
from typing import Any, NamedTuple

import numpy as np

from gfmd_cli.files.hdf5 import as_utf8, create_dataset, write_checked, write_scale
from gfmd_cli.study import columns as layout
from gfmd_cli.study.column import Column
from gfmd_cli.study.reading import ATTRIBUTES_SUM, KINDS, PACKED, attributes_sum
from gfmd_cli.study.result import Entry, TaskResult

AXES = (("y", "length_y"), ("x", "length"))
"""Axes of a field, with the columns of the sides of the cell."""


def write_study(
    file: Any,
    attributes: Mapping[str, str],
    entries: Sequence[Entry],
    result_of: Callable[[int], TaskResult],
    *,
    labelled: bool = True,
) -> None:
    """Write a whole study: attributes, columns, histograms, scenes and the arrays of the tasks.

    Parameters
    ----------
    file : the new HDF5 file
    entries : the tasks in order
    result_of : the result of a solved task by its index; one is held at a time
    labelled : whether users open it; without, as in a record, the columns of a kind share a
        dataset and there are no labels: a tenth of the time
    """
    file.attrs.update({"layout": layout.LAYOUT, **attributes})
    file.attrs[ATTRIBUTES_SUM] = attributes_sum(file)
    rows = [entry.row for entry in entries]
    writer = _Writer(labelled)
    axis = layout.TASK
    task = writer.scale(file, axis.name, np.arange(len(rows)), axis.units, axis.meaning)
    options = {name.partition(".")[0] for entry in entries for name in entry.stored}
    scenes = {name: i for i, name in enumerate(dict.fromkeys(e.scene_id for e in entries))}
    weights = [c for name, group in layout.WEIGHTS.items() if name in options for c in group]
    values = {column: [row[column.name] for row in rows] for column in (*layout.COLUMNS, *weights)}
    values[layout.TASK_ID] = [entry.task_id for entry in entries]
    values[layout.SCENE_ID] = [entry.scene_id for entry in entries]
    values[layout.STORED] = [" ".join(sorted(entry.stored)) for entry in entries]
    values[layout.SCENE] = [scenes[entry.scene_id] for entry in entries]
    writer.columns(file, values, task)
    for histogram in layout.HISTOGRAMS:
        if histogram.output_key in options:
            writer.histogram(file, histogram, task, rows)
    with_arrays = {group.output_key for group in layout.TASK_GROUPS}
    described = _on_finest_grids(entries)
    for index, entry in enumerate(entries):
        describes = described.get(entry.scene_id) == index
        if describes or any(name.partition(".")[0] in with_arrays for name in entry.stored):
            result = result_of(index)
            if describes:
                writer.scene(file, f"scenes/{scenes[entry.scene_id]}", result)
            writer.arrays(file, index, result)


def _on_finest_grids(entries: Sequence[Entry]) -> dict[str, int]:
    """The task that describes each scene: the first one on the finest of its grids.

    The tasks of a scene have several grids if its grid is "auto". The choice depends neither on
    their order nor on when they were solved.
    """
    finest: dict[str, int] = {}
    for index, entry in enumerate(entries):
        if entry.row["status"].is_solved:
            best = finest.setdefault(entry.scene_id, index)
            if entry.row["points"] > entries[best].row["points"]:
                finest[entry.scene_id] = index
    return finest


class _Writer(NamedTuple):
    """Writes the parts of a study, labelled or plain."""

    labelled: bool

    def scale(self, group: Any, name: str, values: Any, units: str, meaning: str) -> Any:
        """A dimension scale, in a labelled study."""
        return write_scale(group, name, values, units, meaning) if self.labelled else None

    def column(self, group: Any, column: Column, values: Any, scales: list[Any]) -> None:
        """A dataset as a column declares it."""
        if self.labelled:
            write_column(group, column, values, scales)
        else:
            create_dataset(group, column.name, _array(column.kind, values))

    def columns(self, file: Any, values: Mapping[Column, list[Any]], task: Any) -> None:
        """The columns: a dataset each, or one for all of a kind; none for parameters all blank."""
        columns = {
            column: of_column
            for column, of_column in values.items()
            if column not in layout.PARAMETER_COLUMNS or not all(map(column.is_blank, of_column))
        }
        if self.labelled:
            for column, of_column in columns.items():
                write_column(file, column, of_column, [task])
            return
        for kind in KINDS:
            of_kind = [column for column in columns if column.kind is kind]
            group = file.create_group(f"{PACKED}/{kind.__name__}")
            create_dataset(group, "names", _array(str, [column.name for column in of_kind]))
            create_dataset(group, "values", _array(kind, [columns[column] for column in of_kind]))

    def histogram(
        self, file: Any, histogram: layout.HistogramColumn, task: Any, rows: list[Mapping[str, Any]]
    ) -> None:
        """The densities of all tasks over the bins."""
        edges, middles = histogram.edges, histogram.middles()
        bins = self.scale(file, histogram.axis, middles, "1", histogram.axis_meaning)
        if bins is not None:
            bins.attrs["edges"] = edges
        blank = np.full(edges.size - 1, np.nan)
        densities = np.array([row.get(histogram.name, blank) for row in rows])
        self.column(file, histogram.column, densities, [task, bins])

    def scene(self, file: Any, name: str, result: TaskResult) -> None:
        """Spectrum and pictures of a scene."""
        group = file.create_group(name)
        shell = self.scale(group, "shell", np.arange(result.shells.q.size), "1", "shell")
        for column in layout.SHELLS:
            self.column(group, column, getattr(result.shells, column.name), [shell])
        if result.map_spectrum:
            bands = group.create_group(layout.MAP_SPECTRUM)
            band = self.scale(bands, "band", np.arange(result.map_spectrum.q.size), "1", "band")
            for column in layout.bands(result.entry.row["dimension"]):
                self.column(bands, column, getattr(result.map_spectrum, column.name), [band])
            fit = result.map_spectrum.fit
            write_checked(bands, "fit", np.array(astuple(fit) if fit else []))
        for kind, picture in result.pictures.items():
            shown = group.require_group(layout.PICTURES)
            write_checked(shown, kind, picture.heights.astype(np.float32))
            write_checked(shown, f"{kind}_sides", np.array(picture.sides))

    def arrays(self, file: Any, index: int, result: TaskResult) -> None:
        """The arrays of one task."""
        for declared in layout.TASK_GROUPS:
            if arrays := result.arrays.get(declared.name):
                group = file.create_group(f"{declared.name}/{index}")
                shape = next(iter(arrays.values())).shape
                scales = self._axes(group, declared, shape, result.entry.row)
                for column in declared.columns:
                    if column.name in arrays:
                        self.column(group, column, arrays[column.name], scales)

    def _axes(
        self, group: Any, declared: layout.TaskGroup, shape: tuple[int, ...], row: Mapping[str, Any]
    ) -> list[Any]:
        """The axes of the arrays of a group: an index, or positions [m] on the grid."""
        if declared.axis:
            return [self.scale(group, declared.axis, np.arange(*shape), "1", declared.axis)]
        scales = []
        for (name, side), size in zip(AXES[-len(shape) :], shape, strict=True):
            positions = (np.arange(size) / size + row["x_first"]) * row[side]
            scales.append(self.scale(group, name, positions, "m", f"position along {name}"))
        return scales


def write_column(group: Any, column: Column, values: Any, scales: list[Any]) -> None:
    """A labelled dataset."""
    dataset = write_checked(group, column.name, _array(column.kind, values))
    if column.kind is str:
        dataset.attrs["_Encoding"] = "utf-8"
    if column.units:
        dataset.attrs["units"] = column.units
    dataset.attrs["long_name"] = column.meaning
    for axis, scale in enumerate(scales):
        dataset.dims[axis].attach_scale(scale)


def _array(kind: type, values: Any) -> Any:
    """The values as they are stored: numbers, or text in UTF-8 of a fixed length."""
    return as_utf8(values) if kind is str else np.asarray(values, kind)
