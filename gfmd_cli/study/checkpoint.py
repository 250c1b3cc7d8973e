"""The state of an unfinished solve on disk: two slots, the newer one named by a pointer.

A slot holds the fields as they lie in memory (mapped, space reserved first); the pointer holds
their checksums and all scalars, and is replaced as a whole once the slot is on the disk. So
whatever happens while one slot is written, the other still stands.
"""

import json
import mmap
import os
import shutil
import zlib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gfmd_cli.errors import SpaceError
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.grid import Grid
from gfmd_cli.solvers.cascade import Resume
from gfmd_cli.solvers.loop import State
from gfmd_cli.study.files import write_whole

CHUNK = 2**26  # bytes that a checkpoint maps at a time


class Saved(NamedTuple):
    """Where a saved state stands."""

    points: int
    step: int
    residual: float
    time: float
    """When it was saved, in seconds since 1970."""


class Checkpoint:
    """The checkpoint of one task, a folder of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.pointer = folder / "pointer.json"

    def save(self, contact: Contact, state: State, spent: float, notes: Any = None) -> None:
        """Write the state; `spent` are the transforms of coarser grids.

        `notes` are plain data that go with it. Raises SpaceError.
        """
        fields = {"u": state.u, "sigma": state.sigma, **state.fields}
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            slot = "a" if self._pointer().get("slot") == "b" else "b"
            sums = _write_slot(self.folder / slot, list(fields.values()))
            pointer = {
                "slot": slot,
                "points": contact.grid.points,
                "spent": spent,
                "notes": notes,
                "exact": state.exact,
                "residual": state.residual,
                "step": state.step,
                "misses": state.misses,
                "least": state.least,
                "transforms": state.transforms,
                "scalars": state.scalars,
                "fields": {
                    name: [sum_, field.dtype.str]
                    for (name, field), sum_ in zip(fields.items(), sums, strict=True)
                },
            }
            write_whole(self.pointer, json.dumps(pointer).encode())
        except OSError as error:
            raise SpaceError(f"{self.folder}: cannot be written: {error.strerror}") from error

    def load(self, grid: Grid) -> Resume | None:
        """The saved state of a solve on `grid`, or None where there is none that is whole."""
        pointer = self._pointer()
        try:
            level = Grid(pointer["points"], grid.dimension, grid.length, grid.threads)
            fields = _read_slot(self.folder / pointer["slot"], level, pointer["fields"])
            state = State(
                u=fields.pop("u"),
                sigma=fields.pop("sigma"),
                exact=pointer["exact"],
                residual=pointer["residual"],
                step=pointer["step"],
                misses=pointer["misses"],
                least=pointer["least"],
                transforms=pointer["transforms"],
                scalars=pointer["scalars"],
                fields=fields,
            )
        except (KeyError, TypeError, ValueError, OSError):
            return None
        return Resume(pointer["points"], state, pointer["spent"])

    def saved(self) -> Saved | None:
        """Where the saved state stands, without loading it; None where there is none."""
        pointer = self._pointer()
        try:
            when = self.pointer.stat().st_mtime
            return Saved(pointer["points"], pointer["step"], pointer["residual"], when)
        except (KeyError, OSError):
            return None

    def notes(self) -> Any:
        """The notes of the saved state, None where there are none."""
        return self._pointer().get("notes")

    def remove(self) -> None:
        """Forget the state: the task is done."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _pointer(self) -> dict[str, Any]:
        try:
            data = json.loads(self.pointer.read_bytes())
        except (OSError, ValueError):
            return {}
        return data if isinstance(data, dict) else {}


def _write_slot(path: Path, fields: list[Field]) -> list[int]:
    """Lay the fields one after the other into a mapped file; return their checksums."""
    with path.open("w+b") as file:
        os.posix_fallocate(file.fileno(), 0, sum(field.nbytes for field in fields))
        with mmap.mmap(file.fileno(), 0) as memory:
            offset, sums = 0, []
            for field in fields:
                content = np.ascontiguousarray(field).data.cast("B")
                for start in range(0, field.nbytes, CHUNK):
                    chunk = content[start : start + CHUNK]
                    memory[offset : offset + len(chunk)] = chunk
                    offset += len(chunk)
                    memory.madvise(mmap.MADV_DONTNEED)  # the file has it: memory need not
                sums.append(zlib.crc32(content))
            memory.flush()
        os.fsync(file.fileno())
    return sums


def _read_slot(path: Path, grid: Grid, stored: dict[str, Any]) -> dict[str, Field]:
    """The fields of a slot. Raises ValueError where one is not what was written."""
    fields, offset = {}, 0
    for name, (expected, kind) in stored.items():
        field: Field = np.empty(grid.shape, kind)
        field[...] = np.memmap(path, kind, "r", offset, grid.shape)
        offset += field.nbytes
        if zlib.crc32(field.data.cast("B")) != expected:
            raise ValueError(f"{path}: field {name} is damaged")
        fields[name] = field
    return fields
