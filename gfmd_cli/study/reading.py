"""Reading a study file: everything that it claims is checked before it is used."""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from gfmd_cli.errors import InputError, StudyError, typed
from gfmd_cli.files.atomic import exists
from gfmd_cli.files.hdf5 import find, has, open_hdf5, read_dataset, take
from gfmd_cli.grid.arrays import Field
from gfmd_cli.maps.pictures import Picture
from gfmd_cli.physics.persson import Shells
from gfmd_cli.physics.spectrum_fit import SelfAffineFit
from gfmd_cli.physics.surface_spectrum import Spectrum
from gfmd_cli.status import Status
from gfmd_cli.study import columns as layout
from gfmd_cli.study.column import Column
from gfmd_cli.study.result import Entry, TaskResult

ATTRIBUTES_SUM = "attributes_sha256"
NETCDF = "_NCProperties"
"""Attribute of every netCDF 4 file; an export has the attribute `layout` of its study, too."""
KINDS = {str: "S", int: "i", float: "f"}
"""NumPy's kinds of the values of a column, as they are stored."""
PACKED = "columns"
"""Group of the columns of a record, by kind."""
MAX_DIMENSIONS = 2
FILE_MARK = " sha256="
"""Precedes the checksum in a label."""
FILE_LABELS = {"surface": "ensemble", "elastomer": "elastomer_short"}
"""Columns with labels of what files describe; each has a second label."""
FILE_DIGITS = 8  # of a checksum in a label
DAMAGE = (
    KeyError, IndexError, TypeError, AttributeError, ValueError, OverflowError,
    OSError, RuntimeError, MemoryError,
)  # fmt: skip
"""What HDF5 and NumPy raise of a damaged file; RuntimeError includes RecursionError."""


def check_column(column: Column, values: Any) -> None:
    """Raise ValueError for anything but one value of the kind of the column in each row."""
    if values.ndim != 1 or values.dtype.kind != KINDS[column.kind]:
        raise ValueError(f"{column.name} is not a column of {column.kind.__name__}")


class StudyFile:
    """An open study file: its attributes, rows and arrays.

    Each read raises one of `DAMAGE` where the file is not what it should be; `open_study` makes a
    StudyError of it.
    """

    def __init__(self, file: Any) -> None:
        self._file = file

    @cached_property
    def attributes(self) -> dict[str, str]:
        """All attributes but the checksum, as text."""
        return {k: str(v) for k, v in self._file.attrs.items() if k != ATTRIBUTES_SUM}

    @property
    def spec(self) -> Any:
        """The resolved spec, as plain data."""
        return json.loads(self.attributes["spec"])

    @cached_property
    def columns(self) -> list[Column]:
        """The columns with one value a task that are stored."""
        names = self._packed or set(self._file)
        return [column for column in layout.ROW_COLUMNS if column.name in names]

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """The rows, one a task, with `task`, `task_id`, `scene` and the histograms that are stored.

        A column that is not stored is blank.
        """
        size = len(self.task_ids)
        columns = {column.name: self.values(column) for column in (*self.columns, layout.SCENE)}
        columns[layout.TASK.name] = list(range(size))
        columns[layout.TASK_ID.name] = self.task_ids
        columns[layout.STATUS.name] = self.statuses
        for histogram in layout.HISTOGRAMS:
            if has(self._file, histogram.name):
                densities = read_dataset(self._file, histogram.name)
                if densities.shape[1:] != histogram.middles().shape or densities.dtype.kind != "f":
                    raise ValueError(f"{histogram.name} is not of the shape of its bins")
                columns[histogram.name] = list(densities)
        for name, values in columns.items():
            if len(values) != size:
                raise ValueError(f"{name} has {len(values)} rows, not {size}")
        blank = layout.empty_row()
        rows = [blank | {name: values[i] for name, values in columns.items()} for i in range(size)]
        tell_files_apart(rows)
        return rows

    @cached_property
    def task_ids(self) -> list[str]:
        """The id of each task."""
        return self.values(layout.TASK_ID)

    @cached_property
    def scene_ids(self) -> list[str]:
        """The id of the scene of each task."""
        return self.values(layout.SCENE_ID)

    @cached_property
    def stored(self) -> list[frozenset[str]]:
        """What [output] stored of each task."""
        return [frozenset(text.split()) for text in self.values(layout.STORED)]

    @cached_property
    def statuses(self) -> list[Status]:
        """The status of each task."""
        return [Status(text) for text in self.values(layout.STATUS)]

    def values(self, column: Column) -> list[Any]:
        """The values of a column, of its kind."""
        values = self._packed.get(column.name)
        if values is None:
            values = read_dataset(self._file, column.name)
        check_column(column, values)
        plain = values.tolist()
        return [text.decode() for text in plain] if column.kind is str else plain

    @cached_property
    def _packed(self) -> dict[str, Field]:
        """The columns of a record, where all of a kind share a dataset."""
        packed: dict[str, Field] = {}
        for kind in KINDS:
            group = find(self._file, f"{PACKED}/{kind.__name__}")
            if group is not None:
                names, values = read_dataset(group, "names"), read_dataset(group, "values")
                packed |= zip((name.decode() for name in names.tolist()), values, strict=True)
        return packed

    def shells(self, scene: int) -> Shells:
        """The binned spectrum of one scene."""
        place = f"scenes/{scene}"
        arrays = {c.name: read_dataset(self._file, f"{place}/{c.name}") for c in layout.SHELLS}
        _check_alike(place, arrays, 1)
        return Shells(**arrays)

    def map_spectrum(self, scene: int) -> Spectrum | None:
        """The spectrum of a map with borders, None of any other surface."""
        place = f"scenes/{scene}/{layout.MAP_SPECTRUM}"
        group = find(self._file, place)
        if group is None:
            return None
        arrays = {column.name: read_dataset(group, column.name) for column in layout.bands()}
        _check_alike(place, arrays, 1)
        numbers = read_dataset(group, "fit").tolist()
        return Spectrum(**arrays, fit=SelfAffineFit(*numbers) if numbers else None)

    def pictures(self, scene: int) -> dict[str, Picture]:
        """The pictures of a measured surface, none of any other."""
        group = find(self._file, f"scenes/{scene}/{layout.PICTURES}")
        if group is None:
            return {}
        pictures = {}
        for name in ("measured", "prepared"):
            heights, sides = read_dataset(group, name), read_dataset(group, f"{name}_sides")
            if sides.shape != (heights.ndim,) or {heights.dtype.kind, sides.dtype.kind} != {"f"}:
                raise ValueError(f"{layout.PICTURES}/{name} is not of the shape of its sides")
            pictures[name] = Picture(heights.astype(np.float64), tuple(map(float, sides)))
        return pictures

    def arrays(self, group: str, task: int) -> dict[str, Field]:
        """The arrays of a task by name, none where it has no such group."""
        return {name: data[()] for name, data in self._datasets(group, task).items()}

    def blocks(
        self, group: str, task: int, rows: int, names: Iterable[str]
    ) -> Iterator[dict[str, Field]]:
        """The named arrays of a task that are stored, at most `rows` of their rows at a time."""
        by_name = self._datasets(group, task)
        datasets = {name: by_name[name] for name in names if name in by_name}
        size = min((data.shape[0] for data in datasets.values()), default=0)
        for start in range(0, size, rows):
            yield {name: data[start : start + rows] for name, data in datasets.items()}

    def tasks_with(self, group: str) -> list[int]:
        """The indices of the tasks that have arrays in a group, rising."""
        indices = find(self._file, group)
        return [] if indices is None else sorted(map(int, indices))

    def entry(self, task: int) -> Entry:
        """All that is stored of one task but its arrays."""
        return Entry(self.task_ids[task], self.scene_ids[task], self.stored[task], self.rows[task])

    def result(self, task: int, *, in_memory: bool = True) -> TaskResult:
        """All that is stored of one task; its arrays, which are checked, perhaps not read yet."""
        scene = self.rows[task]["scene"]
        read = self.arrays if in_memory else self._datasets
        arrays = {group.name: read(group.name, task) for group in layout.TASK_GROUPS}
        of_scene = self.pictures(scene), self.map_spectrum(scene)
        return TaskResult(self.entry(task), self.shells(scene), arrays, *of_scene)

    def _datasets(self, group: str, task: int) -> dict[str, Any]:
        """The arrays of a task by name, not read yet: numbers, all of the same shape."""
        place, (declared,) = f"{group}/{task}", (g for g in layout.TASK_GROUPS if g.name == group)
        stored = find(self._file, place)
        if stored is None:
            return {}
        datasets = {c.name: take(stored, c.name) for c in declared.columns if has(stored, c.name)}
        _check_alike(place, datasets, 1 if declared.axis else MAX_DIMENSIONS)
        return datasets


def _check_alike(place: str, datasets: Mapping[str, Any], dimensions: int) -> None:
    """Raise ValueError for anything but numbers, all of the same shape."""
    shapes = {data.shape for data in datasets.values()}
    if len(shapes) > 1 or not all(1 <= len(shape) <= dimensions for shape in shapes):
        raise ValueError(f"{place} has arrays of shapes {sorted(map(str, shapes))}")
    for name, data in datasets.items():
        if data.dtype.kind not in "if":
            raise ValueError(f"{place}/{name} has type {data.dtype}")


@contextmanager
def damage_named(source: Path, kind: str = "study") -> Iterator[None]:
    """Inside, what HDF5 and NumPy raise of a damaged file is a StudyError that names it."""
    try:
        yield
    except DAMAGE as error:
        reason = getattr(error, "strerror", None) or error
        raise StudyError(f"{source}: not a readable {kind}, or damaged: {reason}") from error


@contextmanager
def open_study(source: Path, opened: BinaryIO | None = None) -> Iterator[StudyFile]:
    """The study file at a path, for reading; of `opened`, where that is the file.

    Raises InputError where there is none, StudyError where it is not a study or damaged.
    """
    if source.suffix == ".toml":
        raise InputError(
            f"{source}: a run spec, where a study (NAME.h5) is expected; "
            f"`gfmd run {typed(source)}` makes the study"
        )
    with damage_named(source):
        if opened is None and not exists(source):
            raise InputError(f"{source}: no such study")
        with open_hdf5(opened or source) as file:
            _check_layout(source, file)
            yield StudyFile(file)


def _check_layout(path: Path, file: Any) -> None:
    if layout.BENCH_ATTRIBUTE in file.attrs:
        raise StudyError(f"{path}: a bench file, not a study; `gfmd bench` prints its table")
    if NETCDF in file.attrs:
        raise StudyError(f"{path}: a netCDF file, as of `gfmd export`, not the study (NAME.h5)")
    version = file.attrs.get("layout")
    if version is None:
        raise StudyError(f"{path}: not a study")
    if int(version) != layout.LAYOUT:
        writer = file.attrs.get("software_version", "?")
        raise StudyError(
            f"{path}: a study of layout {int(version)}, written by gfmd {writer}; this version "
            f"reads layout {layout.LAYOUT}"
        )
    if file.attrs[ATTRIBUTES_SUM] != attributes_sum(file):
        raise StudyError(f"{path}: damaged study: its attributes are not those written")


def attributes_sum(file: Any) -> str:
    """SHA-256 of all other attributes of a file, which HDF5 gives no checksum."""
    texts = {name: str(value) for name, value in file.attrs.items() if name != ATTRIBUTES_SUM}
    return hashlib.sha256(json.dumps(texts, sort_keys=True).encode()).hexdigest()


def read_rows(path: Path) -> list[dict[str, Any]]:
    """The rows of a study, as `StudyFile.rows`. Raises InputError, StudyError."""
    with open_study(path) as study:
        return study.rows


def tell_files_apart(rows: Iterable[dict[str, Any]]) -> None:
    """Add checksums to the labels of surfaces and elastomers that different files share, in place.

    Files differ that have one name in two folders, or that have changed between two runs.
    """
    files: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in rows:
        for kind in FILE_LABELS:
            files.setdefault((kind, row[kind].partition(FILE_MARK)[0]), []).append(row)
    for (kind, _), alike in files.items():
        differ = len({row[f"{kind}_sha256"] for row in alike}) > 1
        for row in alike:
            mark = f"{FILE_MARK}{row[f'{kind}_sha256'][:FILE_DIGITS]}" if differ else ""
            for name in (kind, FILE_LABELS[kind]):
                row[name] = row[name].partition(FILE_MARK)[0] + mark


def solved_rows(rows: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rows that have a result, converged or not."""
    return [row for row in rows if row["status"].is_solved]
