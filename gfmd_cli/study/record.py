"""Records: what one task found, as a small HDF5 file that appears whole or not at all."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from gfmd_cli.errors import StudyError
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.persson import Shells
from gfmd_cli.study.files import write_whole
from gfmd_cli.study.layout import COLUMNS, DISTRIBUTION, LAYOUT, SHELLS

SUFFIX = ".record"


@dataclass(frozen=True)
class Record:
    """What one task found."""

    task_id: str
    row: Mapping[str, Any]
    """One value for each column of the layout."""
    shells: Shells
    distribution: Mapping[str, Any] = field(default_factory=dict)
    """Pr(sigma): densities and weights, empty where none was asked for."""
    fields: Mapping[str, Field] = field(default_factory=dict)
    cross_section: Mapping[str, Field] = field(default_factory=dict)


def write_record(folder: Path, record: Record) -> Path:
    """Commit a record to the folder of unfinished work. Raises SpaceError."""
    with h5py.File("record", "w", driver="core", backing_store=False) as file:
        file.attrs["layout"] = LAYOUT
        file.attrs["task_id"] = record.task_id
        for column in COLUMNS:
            file.attrs[column.name] = column.kind(record.row[column.name])
        for name, value in record.distribution.items():
            file[f"distribution/{name}"] = value
        for column in SHELLS:
            _put(file, f"shells/{column.name}", getattr(record.shells, column.name))
        for group in ("fields", "cross_section"):
            for name, values in getattr(record, group).items():
                _put(file, f"{group}/{name}", values)
        file.attrs["complete"] = True
        file.flush()
        image = file.id.get_file_image()
    path = folder / f"{record.task_id}{SUFFIX}"
    write_whole(path, image)
    return path


def _put(file: Any, name: str, values: Field) -> None:
    """A dataset whose every chunk carries a checksum."""
    file.create_dataset(name, data=values, fletcher32=values.size > 0)


def read_record(path: Path) -> Record:
    """Read one record. Raises StudyError where it is damaged or of another layout."""
    with _opened(path) as file:
        groups = {
            group: {name: data[()] for name, data in file.get(group, {}).items()}
            for group in ("distribution", "fields", "cross_section")
        }
        return Record(
            task_id=file.attrs["task_id"],
            row={c.name: c.kind(file.attrs[c.name]) for c in COLUMNS},
            shells=Shells(*(file[f"shells/{c.name}"][()] for c in SHELLS)),
            **groups,
        )


def read_status(path: Path) -> tuple[str, str]:
    """Task and status of a record, without its arrays. Raises StudyError as `read_record` does."""
    with _opened(path) as file:
        return str(file.attrs["task_id"]), str(file.attrs["status"])


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    try:
        with h5py.File(path, "r", locking=False) as file:
            if file.attrs["layout"] != LAYOUT or not file.attrs["complete"]:
                raise StudyError(f"{path}: written with layout {file.attrs['layout']}")
            yield file
    except (OSError, KeyError, RuntimeError, ValueError) as error:
        raise StudyError(f"{path}: damaged record: {error}") from error


def empty_row() -> dict[str, Any]:
    """A row that says nothing yet."""
    blank: dict[type, Any] = {str: "", int: -1, float: np.nan}
    return {column.name: blank[column.kind] for column in (*COLUMNS, *DISTRIBUTION)}
