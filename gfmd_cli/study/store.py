"""The study file: all records of a spec in one HDF5 file, labelled, replaced as a whole.

While tasks run, each commits a record beside the study (in NAME.parts); collecting them
rewrites the study file under another name and renames it. A reader never meets a half-written
study and never stops a run.
"""

import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from gfmd_cli.errors import InputError, SpaceError, StudyError
from gfmd_cli.physics.observables import linear_edges, logarithmic_edges
from gfmd_cli.physics.persson import Shells
from gfmd_cli.study.files import alone, beside, write_whole
from gfmd_cli.study.labelled import dataset, scale
from gfmd_cli.study.layout import (
    BENCH,
    COLUMNS,
    DISTRIBUTION,
    FIELDS,
    LAYOUT,
    PR_LINEAR,
    PR_LOGARITHMIC,
    SHELLS,
    Column,
)
from gfmd_cli.study.provenance import provenance
from gfmd_cli.study.record import SUFFIX, Record, empty_row, read_record
from gfmd_cli.study.spec import Spec, digest, refuse_other
from gfmd_cli.study.tasks import Task

MISSING = "missing"
SLACK = 2**20  # bytes of HDF5's own structures, beyond the data, that a study may take


class Study:
    """A study file and the unfinished work beside it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.parts = path.with_suffix(".parts")

    def check_spec(self, spec: Spec) -> None:
        """Refuse, with the difference, a study that was made from another spec."""
        stored = self._stored_spec()
        message = "made from another spec; take another name (-o) or the old spec."
        if stored is not None:
            refuse_other(stored, spec, f"{self.path}: {message}")

    def begin(self, spec: Spec) -> None:
        """Make the folder of unfinished work, bound to this spec. Raises SpaceError."""
        write_whole(self.parts / "spec.json", json.dumps(spec.resolved()).encode())

    def held(self) -> dict[str, str]:
        """Status by task id of all that is solved, collected or not."""
        states = {}
        for path in self._record_paths():  # before the study, which may take them in meanwhile
            with suppress(StudyError):
                record = read_record(path)
                states[record.task_id] = str(record.row["status"])
        return self.collected() | states

    def collected(self) -> dict[str, str]:
        """Status by task id of all that the study file holds."""
        if not self.path.exists():
            return {}
        with open_study(self.path) as file:
            ids, states = file["task_id"].asstr()[()], file["status"].asstr()[()]
        return {i: s for i, s in zip(ids, states, strict=True) if s != MISSING}

    def collect(self, spec: Spec, tasks: list[Task], text: str) -> None:
        """Write all records into the study file, then drop them. Raises SpaceError.

        A damaged record is set aside as NAME.bad and its task is solved again by the next run.
        """
        with alone(self.parts):
            records = {}
            for path in self._record_paths():
                try:
                    records[path] = read_record(path)
                except StudyError:
                    path.replace(path.with_suffix(".bad"))
            found = {record.task_id: record for record in records.values()}
            self._write(spec, tasks, text, found)
            for path in records:
                path.unlink(missing_ok=True)
            complete = all(status != MISSING for status in self._statuses())
            if complete and not any(self.parts.glob("*.bad")):
                shutil.rmtree(self.parts, ignore_errors=True)
        with suppress(OSError):
            self.parts.rmdir()  # on NFS the folder keeps an open lock

    def _write(self, spec: Spec, tasks: list[Task], text: str, found: dict[str, Record]) -> None:
        fresh = beside(self.path)
        sources = [self.path, *self._record_paths()]
        size = sum(path.stat().st_size for path in sources if path.exists())
        size += SLACK + 2000 * len(tasks)
        try:
            if shutil.disk_usage(self.path.parent).free < size:
                raise OSError(28, "no space left")
            with h5py.File(fresh, "w", libver=("earliest", "v110")) as file:
                if self.path.exists():
                    with open_study(self.path) as old:
                        _write_study(file, spec, tasks, text, found, old)
                else:
                    _write_study(file, spec, tasks, text, found, None)
            with fresh.open("rb+") as written:
                os.fsync(written.fileno())
            fresh.replace(self.path)
        except (OSError, RuntimeError) as error:
            fresh.unlink(missing_ok=True)
            raise SpaceError(f"{self.path}: cannot be written: {error}") from error

    def _statuses(self) -> list[str]:
        with open_study(self.path) as file:
            return list(file["status"].asstr()[()])

    def _record_paths(self) -> list[Path]:
        return sorted(self.parts.glob(f"*{SUFFIX}"))

    def _stored_spec(self) -> Any:
        """The resolved spec of the study file, else of the unfinished work, else None."""
        if self.path.exists():
            with open_study(self.path) as file:
                return json.loads(file.attrs["spec"])
        with suppress(OSError, ValueError):
            return json.loads((self.parts / "spec.json").read_bytes())
        return None


@contextmanager
def open_study(path: Path) -> Iterator[Any]:
    """The study file, for reading. Raises InputError or StudyError where it is none."""
    if not path.exists():
        raise InputError(f"{path}: no such study")
    try:
        file = h5py.File(path, "r", locking=False)
    except OSError as error:
        raise StudyError(f"{path}: no readable HDF5 file: {error}") from error
    with file:
        layout = file.attrs.get("layout")
        if layout != LAYOUT:
            if BENCH in file.attrs:
                raise StudyError(f"{path}: a bench, no study; `gfmd bench` prints its table")
            what = "no study" if layout is None else f"a study of layout {layout}"
            raise StudyError(f"{path}: {what}; this version reads layout {LAYOUT}")
        try:
            yield file
        except (KeyError, OSError, RuntimeError, ValueError) as error:
            raise StudyError(f"{path}: damaged study: {error}") from error


def read_rows(path: Path) -> list[dict[str, Any]]:
    """The rows of a study, one a task, with `task`, `scene` and Pr(sigma) where it is stored."""
    with open_study(path) as file:
        size = len(file["task"])
        names = [c.name for c in (*COLUMNS, *DISTRIBUTION) if c.name in file]
        names += [name for name in (PR_LINEAR, PR_LOGARITHMIC) if name in file]
        columns = {
            name: file[name].asstr()[()] if file[name].dtype.kind == "O" else file[name][()]
            for name in (*names, "task", "scene")
        }
    return [{name: _plain(values[i]) for name, values in columns.items()} for i in range(size)]


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def read_shells(path: Path, scene: int) -> Shells:
    """The binned spectrum of one scene."""
    with open_study(path) as file:
        group = file[f"scenes/{scene}"]
        return Shells(*(group[column.name][()] for column in SHELLS))


def origin(spec: Spec, text: str) -> dict[str, str]:
    """Attributes of a file: the spec that it was made from, and by what, where and when."""
    resolved = spec.resolved()
    return {
        "Conventions": "CF-1.11",
        "title": spec.study.name,
        "spec": json.dumps(resolved),
        "spec_digest": digest(resolved),
        "spec_text": text,
        **provenance(),
    }


def _write_study(
    file: Any, spec: Spec, tasks: list[Task], text: str, found: dict[str, Record], old: Any
) -> None:
    """Lay out the whole study: attributes, columns, distributions, scenes, fields."""
    file.attrs.update({"layout": LAYOUT, **origin(spec, text)})
    kept = _old_rows(old, {task.id for task in tasks} - set(found))
    rows = [_row(task, found, kept) for task in tasks]
    scenes = _scene_numbers(tasks)
    task = scale(file, "task", np.arange(len(tasks)), "1", "index of the task")
    for column in (*COLUMNS, *(DISTRIBUTION if spec.output.histogram else ())):
        values = [row[column.name] for row in rows]
        kind = h5py.string_dtype() if column.kind is str else column.kind
        dataset(file, column, np.array(values, dtype=kind), [task])
    dataset(file, Column("task_id", str, "", "task by its content"), [t.id for t in tasks], [task])
    dataset(file, Column("scene", int, "1", "group of /scenes"), scenes, [task])
    if spec.output.histogram:
        _write_distributions(file, task, rows)
    for row_task, scene in zip(tasks, scenes, strict=True):
        record = found.get(row_task.id)
        _write_extras(file, row_task, scene, record, old)


def _row(task: Task, found: dict[str, Record], kept: dict[str, dict[str, Any]]) -> dict[str, Any]:
    if task.id in found:
        return empty_row() | dict(found[task.id].row) | dict(found[task.id].distribution)
    return kept.get(task.id) or empty_row() | {"status": MISSING}


def _old_rows(old: Any, wanted: set[str]) -> dict[str, dict[str, Any]]:
    """Rows of the former study file by task id."""
    if old is None:
        return {}
    rows = read_rows(Path(old.filename))
    ids = old["task_id"].asstr()[()]
    return {i: empty_row() | row for i, row in zip(ids, rows, strict=True) if i in wanted}


def _scene_numbers(tasks: list[Task]) -> list[int]:
    """Tasks that share surface, elastomer and grid share a scene."""
    numbers: dict[Any, int] = {}
    return [
        numbers.setdefault(
            (task.surface, task.elastomer, "auto" if task.auto else task.points), len(numbers)
        )
        for task in tasks
    ]


def _write_distributions(file: Any, task: Any, rows: list[dict[str, Any]]) -> None:
    linear, logarithmic = linear_edges(), logarithmic_edges()
    for name, axis, edges, middle in (
        (PR_LINEAR, "sigma", linear, 0.5 * (linear[1:] + linear[:-1])),
        (PR_LOGARITHMIC, "sigma_log", logarithmic, np.sqrt(logarithmic[1:] * logarithmic[:-1])),
    ):
        labels = scale(file, axis, middle, "1", "middle of the stress bin / Delta_sigma")
        labels.attrs["edges"] = edges
        blank = np.full(edges.size - 1, np.nan)
        density = np.array([row.get(name, blank) for row in rows])
        dataset(file, Column(name, float, "1", "Pr(sigma) Delta_sigma"), density, [task, labels])


def _write_extras(file: Any, task: Task, scene: int, record: Record | None, old: Any) -> None:
    """The scene's spectrum, the fields and the cross-section of one task."""
    places = {
        "shells": f"scenes/{scene}",
        "fields": f"fields/{task.index}",
        "cross_section": f"cross_sections/{task.index}",
    }
    if record is None:
        for place in places.values():
            if old is not None and place in old and place not in file:
                file.require_group(place.partition("/")[0])
                old.copy(place, file, name=place)
        return
    if places["shells"] not in file:
        group = file.create_group(places["shells"])
        shell = scale(group, "shell", np.arange(record.shells.q.size), "1", "shell")
        for column in SHELLS:
            dataset(group, column, getattr(record.shells, column.name), [shell])
    for kind in ("fields", "cross_section"):
        values = getattr(record, kind)
        if values:
            _write_fields(file.create_group(places[kind]), values, record.row["length"])


def _write_fields(group: Any, fields: dict[str, Any], length: float) -> None:
    first = next(iter(fields.values()))
    axes = [
        scale(group, name, np.arange(size) * (length / size), "m", f"position along {name}")
        for name, size in zip(("y", "x")[-first.ndim :], first.shape, strict=True)
    ]
    for column in FIELDS:
        if column.name in fields:
            dataset(group, column, fields[column.name], axes)
