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
from typing import Any

import numpy as np

from gfmd_cli.errors import SpaceError
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.grid import Grid
from gfmd_cli.physics.ranks import Ranks, leads, together
from gfmd_cli.solvers.cascade import Resume
from gfmd_cli.solvers.loop import State
from gfmd_cli.study.files import write_whole

CHUNK = 2**26  # bytes that a checkpoint maps at a time


class Checkpoint:
    """The checkpoint of one task, a folder of its own.

    Where processes share the task, each writes its rows into a slot of its own, and the first
    writes the pointer to all of them. Any number of processes can go on from there.
    """

    def __init__(self, folder: Path, ranks: Ranks | None = None) -> None:
        self.folder = folder
        self.ranks = ranks
        self.pointer = folder / "pointer.json"

    def save(self, contact: Contact, state: State, spent: float, notes: Any = None) -> None:
        """Write the state; `spent` are the transforms of coarser grids.

        `notes` are plain data that go with it. Raises SpaceError.
        """
        fields = {"u": state.u, "sigma": state.sigma, **state.fields}
        slot = "a" if self._read_pointer().get("slot") == "b" else "b"
        with together(self.ranks):
            part = self._write_part(slot, contact.grid, fields)
        parts = [part] if self.ranks is None else self.ranks.comm.gather(part)
        with together(self.ranks):
            if parts is not None:
                self._point_to(slot, parts, contact, state, fields, spent, notes)

    def _write_part(self, slot: str, grid: Grid, fields: dict[str, Field]) -> dict[str, Any]:
        """Write the rows that this process holds; what the pointer says of them."""
        first = grid.own.start or 0
        name = slot if grid.whole else f"{slot}{first}"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            sums = _write_slot(self.folder / name, list(fields.values()))
        except OSError as error:
            raise SpaceError(f"{self.folder}: cannot be written: {error.strerror}") from error
        return {"file": name, "first": first, "rows": len(fields["u"]), "sums": sums}

    def _point_to(
        self,
        slot: str,
        parts: list[dict[str, Any]],
        contact: Contact,
        state: State,
        fields: dict[str, Field],
        spent: float,
        notes: Any,
    ) -> None:
        try:
            pointer = {
                "slot": slot,
                "parts": parts,
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
                "fields": {name: field.dtype.str for name, field in fields.items()},
            }
            write_whole(self.pointer, json.dumps(pointer).encode())
        except OSError as error:
            raise SpaceError(f"{self.folder}: cannot be written: {error.strerror}") from error

    def load(self, grid: Grid) -> Resume | None:
        """The saved state of a solve on `grid`, or None where there is none that is whole."""
        pointer = self._read_pointer()
        if pointer.get("points") == grid.points:
            level = grid
        elif isinstance(pointer.get("points"), int):
            level = grid.coarser(pointer["points"])
        else:
            return None
        resume = self._resume(pointer, level)
        if self.ranks is not None and self.ranks.total(int(resume is None)):
            return None
        return resume

    def _resume(self, pointer: dict[str, Any], level: Grid) -> Resume | None:
        if self.ranks is not None and level.whole:
            return None
        try:
            fields = _read_parts(self.folder, pointer["parts"], level, pointer["fields"])
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

    def notes(self) -> Any:
        """The notes of the saved state, None where there are none."""
        return self._read_pointer().get("notes")

    def remove(self) -> None:
        """Forget the state: the task is done."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _read_pointer(self) -> dict[str, Any]:
        """What the pointer says; the first process reads it for all."""
        if self.ranks is None:
            return self._pointer()
        return self.ranks.agree(self._pointer() if leads(self.ranks) else {})

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


def _read_parts(
    folder: Path, parts: list[dict[str, Any]], grid: Grid, kinds: dict[str, str]
) -> dict[str, Field]:
    """The rows of a grid that this process holds, from the slots where they lie.

    Raises ValueError where a field is not what was written.
    """
    first, last, _ = grid.own.indices(grid.points)
    fields = {name: np.empty(grid.shape, kind) for name, kind in kinds.items()}
    missing = last - first
    for part in parts:
        begin, rows = part["first"], part["rows"]
        low, high = max(first, begin), min(last, begin + rows)
        if low >= high:
            continue
        missing -= high - low
        offset, shape = 0, (rows, *grid.shape[1:])
        for (name, field), expected in zip(fields.items(), part["sums"], strict=True):
            stored = np.memmap(folder / part["file"], field.dtype, "r", offset, shape)
            if zlib.crc32(stored.data.cast("B")) != expected:
                raise ValueError(f"{part['file']}: field {name} is damaged")
            field[low - first : high - first] = stored[low - begin : high - begin]
            offset += stored.nbytes
    if missing:
        raise ValueError(f"{folder}: rows are missing")
    return fields
