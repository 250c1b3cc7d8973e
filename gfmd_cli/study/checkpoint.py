"""The state of an unfinished solve on disk: two slots and a pointer that names the newer one first.

A slot holds the fields as they lie in memory (mapped, space reserved first). The pointer holds the
checksums of both and all scalars, is sealed itself, and is replaced as a whole once a slot is on
the disk. So whatever happens while one slot is written, the other still stands.
"""

import json
import mmap
import os
import shutil
import zlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np

from gfmd_cli.errors import SpaceError
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.grid import Grid
from gfmd_cli.physics.ranks import Ranks, agree, leads, together
from gfmd_cli.solvers.cascade import Resume
from gfmd_cli.solvers.loop import State
from gfmd_cli.study.files import check_seal, locked, sealed, write_whole

CHUNK = 2**26  # bytes that a checkpoint maps at a time
LAYOUT = 3  # raised whenever an older state must not be gone on with
SCALARS = ("exact", "residual", "step", "misses", "least", "transforms", "scalars")


class Saved(NamedTuple):
    """Where a saved state stands."""

    points: int
    step: int
    residual: float
    time: float
    """When it was saved, in seconds since 1970."""


class Checkpoint:
    """The checkpoint of one task, a folder of its own.

    Where processes share the task, each writes its rows into a file of its own, and the first
    writes the pointer to all of them. Any number of processes can go on from there.
    """

    def __init__(self, folder: Path, ranks: Ranks | None = None) -> None:
        self.folder, self.ranks = folder, ranks
        self.pointer = folder / "pointer"
        self.mine = True
        self.slots: list[dict[str, Any]] = []
        """What the pointer says of the slots that are whole, the newer one first."""

    @classmethod
    @contextmanager
    def held(cls, folder: Path, ranks: Ranks | None = None) -> Iterator[Self]:
        """The checkpoint for one run alone: a second one neither reads nor writes it."""
        checkpoint = cls(folder, ranks)
        with ExitStack() as stack:
            with together(ranks):
                if leads(ranks):
                    checkpoint.mine = stack.enter_context(locked(folder / "lock", wait=False))
            checkpoint.mine = agree(ranks, checkpoint.mine)
            yield checkpoint

    def restore(self) -> str | None:
        """Take up what is saved and whole; say what is not, and set aside what cannot be used."""
        note = None
        with together(self.ranks):
            if self.mine and leads(self.ranks):
                note = self._restore()
        self.slots = agree(self.ranks, self.slots)
        return note

    def _restore(self) -> str | None:
        if not self.pointer.exists():
            return None
        said = self._said()
        self.slots = [slot for slot in said if all(map(self._is_whole, slot["parts"]))]
        if self.slots and self.slots[0] is said[0]:
            return None
        if self.slots:
            return f"{self.folder}: the newest state is damaged; going on from the one before"
        for path in (self.pointer, *self.folder.glob("[ab]*")):
            path.replace(f"{self.folder}.{path.name}.bad")
        return f"{self.folder}: no whole state; set aside as .bad, the task starts anew"

    def _said(self) -> list[dict[str, Any]]:
        """What the pointer says of the slots; nothing where it is missing or damaged."""
        with suppress(OSError, ValueError, KeyError):
            size = check_seal(self.pointer)
            data = json.loads(self.pointer.read_bytes()[:size])
            return list(data["slots"]) if data["layout"] == LAYOUT else []
        return []

    def saved(self) -> Saved | None:
        """Where the newest state stands, without loading it; None where there is none."""
        with suppress(OSError):
            when = self.pointer.stat().st_mtime
            for slot in self._said():
                state = slot["state"]
                return Saved(slot["points"], state["step"], state["residual"], when)
        return None

    def save(self, contact: Contact, state: State, spent: float, notes: Any = None) -> None:
        """Write the state; `spent` are the transforms of coarser grids.

        `notes` are plain data that go with it. Raises SpaceError.
        """
        if not self.mine:
            return
        fields = {"u": state.u, "sigma": state.sigma, **state.fields}
        name = "a" if self.slots and self.slots[0]["name"] == "b" else "b"
        with together(self.ranks):
            part = self._write_part(name, contact.grid, fields)
        parts = [part] if self.ranks is None else self.ranks.comm.allgather(part)
        slot = {
            "name": name,
            "parts": parts,
            "points": contact.grid.points,
            "spent": spent,
            "notes": notes,
            "state": {name: getattr(state, name) for name in SCALARS},
            "fields": {name: field.dtype.str for name, field in fields.items()},
        }
        slots = [slot, *(old for old in self.slots[:1] if old["name"] != name)]
        with together(self.ranks):
            if leads(self.ranks):
                text = json.dumps({"layout": LAYOUT, "slots": slots})
                write_whole(self.pointer, sealed(text.encode()))
        self.slots = slots

    def _write_part(self, name: str, grid: Grid, fields: dict[str, Field]) -> dict[str, Any]:
        """Write the rows that this process holds; what the pointer says of them."""
        first = grid.own.start or 0
        file = name if grid.whole else f"{name}{first}"
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            crc = _write_slot(self.folder / file, list(fields.values()))
        except OSError as error:
            raise SpaceError(f"{self.folder}: cannot be written: {error.strerror}") from error
        size = sum(field.nbytes for field in fields.values())
        return {"file": file, "first": first, "rows": len(fields["u"]), "crc": crc, "bytes": size}

    def load(self, grid: Grid) -> Resume | None:
        """The saved state of a solve on `grid`, or None where there is none for it."""
        if not self.slots:
            return None
        slot, size = self.slots[0], 1 if self.ranks is None else self.ranks.size
        level = grid if slot["points"] == grid.points else grid.coarser(slot["points"])
        if self.ranks is not None and level.whole:
            return None
        fields = _read_parts(self.folder, slot["parts"], level, slot["fields"])
        state = State(fields.pop("u"), fields.pop("sigma"), fields=fields, **slot["state"])
        return Resume(slot["points"], state, slot["spent"], moved=len(slot["parts"]) != size)

    def notes(self) -> Any:
        """The notes of the saved state, None where there are none."""
        return self.slots[0]["notes"] if self.slots else None

    def remove(self) -> None:
        """Forget the state: the task is done."""
        if self.mine and leads(self.ranks):
            shutil.rmtree(self.folder, ignore_errors=True)

    def _is_whole(self, part: dict[str, Any]) -> bool:
        """Whether a file of a slot is as it was written."""
        total, size = 0, 0
        try:
            with (self.folder / part["file"]).open("rb") as file:
                while chunk := file.read(CHUNK):
                    total, size = zlib.crc32(chunk, total), size + len(chunk)
        except OSError:
            return False
        return bool(total == part["crc"] and size == part["bytes"])


def _write_slot(path: Path, fields: list[Field]) -> int:
    """Lay the fields one after the other into a mapped file; return the checksum of it."""
    total = offset = 0
    with path.open("w+b") as file:
        os.posix_fallocate(file.fileno(), 0, sum(field.nbytes for field in fields))
        with mmap.mmap(file.fileno(), 0) as memory:
            for field in fields:
                content = np.ascontiguousarray(field).data.cast("B")
                for start in range(0, field.nbytes, CHUNK):
                    chunk = content[start : start + CHUNK]
                    memory[offset : offset + len(chunk)] = chunk
                    offset += len(chunk)
                    total = zlib.crc32(chunk, total)
                    memory.madvise(mmap.MADV_DONTNEED)  # the file has it: memory need not
            memory.flush()
        os.fsync(file.fileno())
    return total


def _read_parts(
    folder: Path, parts: list[dict[str, Any]], grid: Grid, kinds: dict[str, str]
) -> dict[str, Field]:
    """The rows of a grid that this process holds, from the files where they lie."""
    first, last, _ = grid.own.indices(grid.points)
    fields = {name: np.empty(grid.shape, kind) for name, kind in kinds.items()}
    for part in parts:
        begin, rows = part["first"], part["rows"]
        low, high = max(first, begin), min(last, begin + rows)
        if low >= high:
            continue
        offset, shape = 0, (rows, *grid.shape[1:])
        for field in fields.values():
            stored = np.memmap(folder / part["file"], field.dtype, "r", offset, shape)
            field[low - first : high - first] = stored[low - begin : high - begin]
            offset += stored.nbytes
    return fields
