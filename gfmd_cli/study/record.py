"""Records: what one task found, as a small sealed HDF5 file that appears whole or not at all."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py

from gfmd_cli.errors import StudyError
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.persson import Shells
from gfmd_cli.study.files import check_seal, new_file, new_hdf5, seal
from gfmd_cli.study.layout import COLUMNS, LAYOUT, SHELLS

SUFFIX = ".record"
GROUPS = ("distribution", "cross_section", "spectra", "autocorrelations", "fields")


@dataclass(frozen=True)
class Record:
    """What one task found."""

    task_id: str
    row: Mapping[str, Any]
    """One value for each column of the layout."""
    shells: Shells
    distribution: Mapping[str, Any] = field(default_factory=dict)
    """Densities of the distributions asked for, and their weights."""
    fields: Mapping[str, Field] = field(default_factory=dict)
    cross_section: Mapping[str, Field] = field(default_factory=dict)
    spectra: Mapping[str, Field] = field(default_factory=dict)
    autocorrelations: Mapping[str, Field] = field(default_factory=dict)


def record_path(folder: Path, task_id: str) -> Path:
    """Where the record of a task lies."""
    return folder / f"{task_id}{SUFFIX}"


def write_record(folder: Path, record: Record) -> Path:
    """Commit a record to the folder of unfinished work. Raises SpaceError."""
    path = record_path(folder, record.task_id)
    with new_file(path) as fresh:
        with new_hdf5(fresh) as file:
            file.attrs["layout"] = LAYOUT
            file.attrs["task_id"] = record.task_id
            row = {column.name: column.kind(record.row[column.name]) for column in COLUMNS}
            file.attrs["row"] = json.dumps(row)
            for group in GROUPS:
                for name, values in getattr(record, group).items():
                    file[f"{group}/{name}"] = values
            for column in SHELLS:
                if (values := getattr(record.shells, column.name)) is not None:
                    file[f"shells/{column.name}"] = values
        seal(fresh)
    return path


def read_status(path: Path) -> str:
    """Status of the task that a record is of. Raises StudyError."""
    return str(read_record(path, with_fields=False).row["status"])


def read_record(path: Path, *, with_fields: bool = True) -> Record:
    """Read one record, or all of it but its fields.

    Raises StudyError where a bit of it has changed or it is of another layout.
    """
    groups = GROUPS if with_fields else GROUPS[:-1]
    try:
        check_seal(path)
        with h5py.File(path, "r", locking=False) as file:
            if file.attrs["layout"] != LAYOUT:
                raise StudyError(f"{path}: a record of layout {file.attrs['layout']}, not {LAYOUT}")
            read = {
                group: {name: data[()] for name, data in file.get(group, {}).items()}
                for group in groups
            }
            return Record(
                task_id=file.attrs["task_id"],
                row=json.loads(file.attrs["row"]),
                shells=Shells(
                    **{c.name: data[()] for c in SHELLS if (data := file["shells"].get(c.name))}
                ),
                **read,
            )
    except (OSError, KeyError, RuntimeError, ValueError) as error:
        raise StudyError(f"{path}: damaged record: {error}") from error
