"""Reading a study file: what it claims is checked before it is believed."""

import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from gfmd_cli.errors import InputError, StudyError
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.hdf5 import has, take
from gfmd_cli.physics.persson import Shells
from gfmd_cli.study.layout import (
    BENCH,
    COLUMNS,
    DISTRIBUTION,
    DISTRIBUTIONS,
    FIELDS,
    LAYOUTS,
    SHELLS,
    Column,
    empty_row,
)

ATTRIBUTES_SUM = "attributes_sha256"
DAMAGE = (
    KeyError, IndexError, TypeError, AttributeError, ValueError, OverflowError,
    OSError, RuntimeError, MemoryError,
)  # fmt: skip
"""What HDF5 and NumPy raise of a damaged file."""


@contextmanager
def open_study(path: Path) -> Iterator[Any]:
    """The study file, for reading. Raises InputError or StudyError where it is none."""
    if not path.exists():
        raise InputError(f"{path}: no such study")
    if not path.is_file():
        raise StudyError(f"{path}: no study, but a directory or device")
    try:
        file = h5py.File(path, "r", locking=False)
    except OSError as error:
        raise StudyError(f"{path}: no readable HDF5 file: {error}") from error
    with file:
        try:
            _check_layout(path, file)
            yield file
        except DAMAGE as error:
            raise StudyError(f"{path}: damaged study: {error}") from error


def _check_layout(path: Path, file: Any) -> None:
    layout = file.attrs.get("layout")
    if BENCH in file.attrs:
        raise StudyError(f"{path}: a bench, no study; `gfmd bench` prints its table")
    if layout is None:
        raise StudyError(f"{path}: no study")
    if int(layout) not in LAYOUTS:
        writer = file.attrs.get("software_version", "?")
        raise StudyError(
            f"{path}: a study of layout {int(layout)}, which gfmd {writer} reads; this version "
            f"reads layouts {LAYOUTS[0]} to {LAYOUTS[-1]}"
        )
    if int(layout) >= 2 and file.attrs[ATTRIBUTES_SUM] != attributes_sum(file):
        raise StudyError(f"{path}: damaged study: its attributes are not those written")


def attributes_sum(file: Any) -> str:
    """SHA-256 of all other attributes of a file, which HDF5 gives no checksum."""
    told = {name: str(value) for name, value in file.attrs.items() if name != ATTRIBUTES_SUM}
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()


def read_rows(path: Path) -> list[dict[str, Any]]:
    """The rows of a study, one a task, with `task`, `scene` and the distributions stored.

    A column that the version which wrote the study did not have yet is blank. Raises
    InputError, StudyError.
    """
    with open_study(path) as file:
        return rows_of(file)


def rows_of(file: Any) -> list[dict[str, Any]]:
    """The same of an open study."""
    size = take(file, "task").size
    known = [c for c in (*COLUMNS, *DISTRIBUTION) if has(file, c.name)]
    known += [Column(name, int, "", "") for name in ("task", "scene")]
    columns = {column.name: column_of(file, column) for column in known}
    for distribution in DISTRIBUTIONS:
        if has(file, distribution.name):
            columns[distribution.name] = take(file, distribution.name)[()]
    for name, values in columns.items():
        if len(values) != size:
            raise ValueError(f"{name} has {len(values)} rows, not {size}")
    blank = empty_row()
    return [
        blank | {name: _plain(values[i]) for name, values in columns.items()} for i in range(size)
    ]


def column_of(file: Any, column: Column) -> Field:
    """The values of a column, of its kind."""
    data = take(file, column.name)
    values: Field = data.asstr()[()] if column.kind is str else data[()]
    expected = {str: "O", int: "i", float: "f"}[column.kind]
    if values.ndim != 1 or values.dtype.kind != expected:
        raise ValueError(f"{column.name} is no column of {column.kind.__name__}")
    return values


def texts_of(file: Any, name: str) -> list[str]:
    """The values of a column of text."""
    return list(column_of(file, Column(name, str, "", "")))


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def stored_spec(path: Path) -> Any:
    """The resolved spec of a study, as plain data. Raises InputError, StudyError."""
    with open_study(path) as file:
        return spec_of(file)


def spec_of(file: Any) -> Any:
    """The same of an open study."""
    return json.loads(file.attrs["spec"])


def read_shells(path: Path, scene: int) -> Shells:
    """The binned spectrum of one scene. Raises InputError, StudyError."""
    with open_study(path) as file:
        return shells_of(file, scene)


def shells_of(file: Any, scene: int) -> Shells:
    """The same of an open study."""
    names = [column.name for column in SHELLS if has(file[f"scenes/{scene}"], column.name)]
    return Shells(**{name: take(file, f"scenes/{scene}/{name}")[()] for name in names})


def fields_of(file: Any, place: str, columns: tuple[Column, ...] = FIELDS) -> dict[str, Field]:
    """The fields of a group of an open study, none where there is no such group."""
    folder, _, task = place.partition("/")
    if not (has(file, folder) and has(file[folder], task)):
        return {}
    names = [column.name for column in columns if has(file[place], column.name)]
    return {name: take(file, f"{place}/{name}")[()] for name in names}
