"""Laying out a study file: attributes, columns, distributions, scenes, fields."""

from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.study.labelled import dataset, scale
from gfmd_cli.study.layout import (
    COLUMNS,
    CURVES,
    DISTRIBUTIONS,
    FIELDS,
    LAYOUT,
    MISSING,
    SHELLS,
    WEIGHTS,
    Column,
    empty_row,
)
from gfmd_cli.study.provenance import origin
from gfmd_cli.study.reading import (
    ATTRIBUTES_SUM,
    attributes_sum,
    fields_of,
    rows_of,
    shells_of,
    texts_of,
)
from gfmd_cli.study.record import Record, read_record, record_path
from gfmd_cli.study.spec import Spec
from gfmd_cli.study.tasks import Task


def write_study(
    file: Any,
    spec: Spec,
    tasks: list[Task],
    text: str,
    found: dict[str, Record],
    parts: Path,
    old: Any,
) -> None:
    """Lay out the whole study: attributes, columns, distributions, scenes, fields.

    Parameters
    ----------
    file : the new file
    text : the spec as it was given
    found, parts : records by task id, without fields, and the folder that has them whole
    old : the study so far, open, or None; it gives what no record does

    Fields are read and written one task at a time. Raises SpaceError, StudyError.
    """
    file.attrs.update({"layout": LAYOUT, **origin(spec, text)})
    file.attrs[ATTRIBUTES_SUM] = attributes_sum(file)
    kept = _old_rows(old, {task.id for task in tasks} - set(found))
    rows = [_row(task, found, kept) for task in tasks]
    scenes = _scene_numbers(tasks)
    task = scale(file, "task", np.arange(len(tasks)), "1", "index of the task")
    asked = {name for name, value in spec.output if value}
    weights = [column for name in WEIGHTS if name in asked for column in WEIGHTS[name]]
    for column in (*COLUMNS, *weights):
        dataset(file, column, [row[column.name] for row in rows], [task])
    dataset(file, Column("task_id", str, "", "task by its content"), [t.id for t in tasks], [task])
    dataset(file, Column("scene", int, "1", "group of /scenes"), scenes, [task])
    _write_distributions(file, asked, task, rows)
    for solved, scene, row in zip(tasks, scenes, rows, strict=True):
        if solved.id in found:
            record = found[solved.id]
            if spec.output.fields:
                record = read_record(record_path(parts, solved.id))
            _write_extras(file, solved.index, scene, record)
        elif old is not None and row["status"] != MISSING:
            _write_extras(file, solved.index, scene, _old_record(old, solved.id, row))


def _row(task: Task, records: dict[str, Record], kept: dict[str, dict[str, Any]]) -> dict[str, Any]:
    if task.id in records:
        return empty_row() | dict(records[task.id].row) | dict(records[task.id].distribution)
    return kept.get(task.id) or empty_row() | {"status": MISSING}


def _old_rows(old: Any, wanted: set[str]) -> dict[str, dict[str, Any]]:
    """Rows of the former study file by task id."""
    if old is None:
        return {}
    rows = zip(texts_of(old, "task_id"), rows_of(old), strict=True)
    return {i: row for i, row in rows if i in wanted}


def _old_record(old: Any, task_id: str, row: dict[str, Any]) -> Record:
    """What the former study file holds of a task, at its place there."""
    index, scene = row["task"], row["scene"]
    return Record(
        task_id=task_id,
        row=row,
        shells=shells_of(old, scene),
        fields=fields_of(old, f"fields/{index}"),
        cross_section=fields_of(old, f"cross_sections/{index}"),
        **{
            place: fields_of(old, f"{place}/{index}", columns)
            for place, (_, columns) in CURVES.items()
        },
    )


def _scene_numbers(tasks: list[Task]) -> list[int]:
    """Tasks that share surface, elastomer and grid share a scene."""
    numbers: dict[Any, int] = {}
    return [
        numbers.setdefault(
            (task.surface, task.elastomer, "auto" if task.auto else task.points), len(numbers)
        )
        for task in tasks
    ]


def _write_distributions(file: Any, asked: set[str], task: Any, rows: list[dict[str, Any]]) -> None:
    for made in DISTRIBUTIONS:
        if made.option in asked:
            edges = made.edges()
            labels = scale(file, made.axis, made.middles(), "1", made.labels)
            labels.attrs["edges"] = edges
            blank = np.full(edges.size - 1, np.nan)
            density = np.array([row.get(made.name, blank) for row in rows])
            dataset(file, Column(made.name, float, "1", made.meaning), density, [task, labels])


def _write_extras(file: Any, index: int, scene: int, record: Record) -> None:
    """The scene's spectrum, the fields, the cross-section and the curves of one task."""
    if f"scenes/{scene}" not in file:
        group = file.create_group(f"scenes/{scene}")
        shell = scale(group, "shell", np.arange(record.shells.q.size), "1", "shell")
        for column in SHELLS:
            if (values := getattr(record.shells, column.name)) is not None:
                dataset(group, column, values, [shell])
    for place, values in (("fields", record.fields), ("cross_sections", record.cross_section)):
        if values:
            group = file.create_group(f"{place}/{index}")
            _write_fields(group, dict(values), record.row["length"])
    for place, (axis, columns) in CURVES.items():
        if values := getattr(record, place):
            group = file.create_group(f"{place}/{index}")
            number = scale(group, axis, np.arange(values[columns[0].name].size), "1", axis)
            for column in columns:
                dataset(group, column, values[column.name], [number])


def _write_fields(group: Any, fields: dict[str, Any], length: float) -> None:
    first = next(iter(fields.values()))
    axes = [
        scale(group, name, np.arange(size) * (length / size), "m", f"position along {name}")
        for name, size in zip(("y", "x")[-first.ndim :], first.shape, strict=True)
    ]
    for column in FIELDS:
        if column.name in fields:
            dataset(group, column, fields[column.name], axes)
