"""The state of an unfinished solve on disk: two slots and a pointer that names the newer one first.

A slot holds the fields as they lie in memory (mapped, space reserved first). The pointer holds the
checksums of both and all scalars, is sealed itself, and is replaced as a whole once a slot is on
the disk. So whatever happens while one slot is written, the other still stands.
"""

import mmap
import os
import zlib
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from copy import deepcopy
from pathlib import Path
from typing import Any, BinaryIO, Literal, NamedTuple, Self

import numpy as np

from gfmd_cli.errors import SpaceError, StudyError
from gfmd_cli.files.checksums import check_stored, crc32
from gfmd_cli.files.locks import locked
from gfmd_cli.files.regular import open_regular
from gfmd_cli.grid.arrays import Field, row_blocks
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.grid.ranks import Ranks, is_root, on_root, shared_errors
from gfmd_cli.physics.contact import Contact
from gfmd_cli.solvers.loop import Solver, State
from gfmd_cli.solvers.nested_grids import Resume, solved_shapes
from gfmd_cli.study.history import TaskHistory
from gfmd_cli.study.pointer import Part, Scalars, Slot, read_pointer, write_pointer
from gfmd_cli.study.unfinished_work import delete_checkpoint, set_aside

CHUNK = 2**26  # bytes that a checkpoint maps at a time


class SavedProgress(NamedTuple):
    """How far a task had come when its state was saved."""

    points: int
    """Along x."""
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
        self.slots: list[Slot] = []
        """The intact slots as the pointer describes them, the newer one first."""

    @classmethod
    @contextmanager
    def exclusive(cls, folder: Path, ranks: Ranks | None = None) -> Iterator[Self]:
        """The checkpoint for one run alone: a second one neither reads nor writes it.

        Where no state was saved, nothing is left of the folder.
        """
        if os.path.islink(folder):
            raise StudyError(f"{folder}: a link in the place of a checkpoint; remove it")
        checkpoint, lock = cls(folder, ranks), locked(folder / "lock", wait=False)
        with ExitStack() as stack:
            checkpoint.mine = on_root(ranks, lambda: stack.enter_context(lock))
            try:
                yield checkpoint
            finally:
                if not checkpoint.exists():
                    checkpoint.remove()

    def restore(self) -> str | None:
        """Read the intact states; return a message on damaged ones, set aside if none is intact."""
        if not self.mine:
            return None
        self.slots, note = on_root(self.ranks, self._restore)
        return note

    def _restore(self) -> tuple[list[Slot], str | None]:
        if not self.exists():
            return [], None
        slots = read_pointer(self.pointer)
        intact = [slot for slot in slots if all(map(self._is_whole, slot.parts))]
        if not intact:
            return [], self.set_aside()
        note = f"{self.folder}: the newest state is damaged; the one before it is resumed"
        return intact, None if intact[0] is slots[0] else note

    def exists(self) -> bool:
        """Whether a state is saved, whole or not."""
        return os.path.lexists(self.pointer)

    def set_aside(self) -> str:
        """Rename all files of a state that cannot be resumed; return a message."""
        self.slots = []
        if self.mine and is_root(self.ranks):
            for path in (self.pointer, *self.folder.glob("[ab]*")):
                set_aside(path, self.folder.with_name(f"{self.folder.name}.{path.name}.bad"))
        return f"{self.folder}: no state to resume; set aside as .bad, the task starts anew"

    def saved(self) -> SavedProgress | None:
        """Progress of the newest saved state, without loading it; None without one."""
        with suppress(OSError):
            when = self.pointer.lstat().st_mtime
            for slot in read_pointer(self.pointer):
                return SavedProgress(slot.shape[-1], slot.state.step, slot.state.residual, when)
        return None

    def save(self, contact: Contact, state: State, history: TaskHistory) -> None:
        """Write the state and the history that goes with it. Raises SpaceError."""
        if not self.mine:
            return
        fields = {name: v for name, v in vars(state).items() if isinstance(v, np.ndarray)}
        name: Literal["a", "b"] = "a" if self.slots and self.slots[0].name == "b" else "b"
        with shared_errors(self.ranks):
            part = self._write_part(name, contact.grid, fields)
        parts = [part] if self.ranks is None else self.ranks.comm.allgather(part)
        slot = Slot(
            name=name,
            parts=parts,
            shape=contact.grid.whole_shape,
            history=deepcopy(history),
            state=Scalars(**{name: v for name, v in vars(state).items() if name not in fields}),
            fields={name: field.dtype.str for name, field in fields.items()},
        )
        slots = [slot, *(old for old in self.slots[:1] if old.name != name)]
        on_root(self.ranks, lambda: write_pointer(self.pointer, slots))
        self.slots = slots

    def _write_part(self, name: str, grid: Grid, fields: dict[str, Field]) -> Part:
        """Write the rows that this process holds; return their entry in the pointer."""
        first = grid.own.start or 0
        file = name if grid.whole else f"{name}{first}"
        try:
            self.folder.mkdir(exist_ok=True)
            crc = _write_slot(self.folder / file, list(fields.values()))
        except OSError as error:
            raise SpaceError(f"{self.folder}: cannot be written: {error.strerror}") from error
        size = sum(field.nbytes for field in fields.values())
        return Part(file=file, first=first, rows=len(fields["u"]), crc=crc, bytes=size)

    def load(self, grid: Grid, solver: Solver) -> Resume | None:
        """The saved state of a solve on `grid`, None without one.

        Raises StudyError where it is not the state of such a solve.
        """
        if not self.slots:
            return None
        slot, size = self.slots[0], 1 if self.ranks is None else self.ranks.size
        if slot.shape not in solved_shapes(solver, grid):
            raise StudyError(f"{self.folder}: the saved state is of another grid")
        level = grid if slot.shape == grid.whole_shape else grid.coarser(slot.shape)
        if not slot.holds(solver.state_type, level.shape) or slot.state.step > solver.max_steps:
            raise StudyError(f"{self.folder}: the saved state is of another solver")
        if self.ranks is not None and level.whole:
            return None
        fields = _read_parts(self.folder, slot.parts, level, slot.fields)
        if level.max(float(not all(map(_is_finite, fields.values())))):
            raise StudyError(f"{self.folder}: the saved state holds numbers that are not finite")
        state = solver.state_type(**slot.state.model_dump(), **dict[str, Any](fields))
        return Resume(slot.shape, state, len(slot.parts) != size)

    @property
    def history(self) -> TaskHistory:
        """The history of the saved state, an empty one without a state."""
        return deepcopy(self.slots[0].history) if self.slots else TaskHistory()

    def remove(self) -> None:
        """Forget the state: the task is done."""
        if self.mine and is_root(self.ranks):
            delete_checkpoint(self.folder)

    def _is_whole(self, part: Part) -> bool:
        """Whether a file of a slot is as it was written."""
        with suppress(OSError, ValueError), open_regular(self.folder / part.file) as file:
            status = os.fstat(file.fileno())
            check_stored(status)
            return status.st_size == part.bytes and crc32(file, part.bytes) == part.crc
        return False


def _write_slot(path: Path, fields: list[Field]) -> int:
    """Write the fields one after the other into a mapped file; return its checksum."""
    total = offset = 0
    with open_regular(path, os.O_RDWR | os.O_CREAT) as file:
        _reserve(file, sum(field.nbytes for field in fields))
        with mmap.mmap(file.fileno(), 0) as memory:
            for field in fields:
                content = np.ascontiguousarray(field).data.cast("B")
                for start in range(0, field.nbytes, CHUNK):
                    chunk = content[start : start + CHUNK]
                    memory[offset : offset + len(chunk)] = chunk
                    offset += len(chunk)
                    total = zlib.crc32(chunk, total)
                    memory.madvise(mmap.MADV_DONTNEED)  # the chunk is in the file
            memory.flush()
        os.fsync(file.fileno())
    return total


def _reserve(file: BinaryIO, size: int) -> None:
    """Give a file its size and its place on the disk: writing to a mapped file cannot fail then."""
    file.truncate(size)
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(file.fileno(), 0, size)
        return
    for start in range(0, size, CHUNK):  # macOS
        file.write(bytes(min(CHUNK, size - start)))
    file.flush()


def _is_finite(field: Field) -> bool:
    """Whether all numbers are finite; in blocks, as the memory is forecast."""
    return all(bool(np.isfinite(field[rows]).all()) for rows in row_blocks(field))


def _read_parts(
    folder: Path, parts: list[Part], grid: Grid, kinds: Mapping[str, str]
) -> dict[str, Field]:
    """The rows of a grid that this process holds, from the files where they lie."""
    first, last, _ = grid.own.indices(grid.whole_shape[0])
    fields = {name: np.empty(grid.shape, kind) for name, kind in kinds.items()}
    for part in parts:
        begin, rows = part.first, part.rows
        low, high = max(first, begin), min(last, begin + rows)
        if low >= high:
            continue
        offset, shape = 0, (rows, *grid.shape[1:])
        for field in fields.values():
            with open_regular(folder / part.file) as file:
                stored = np.memmap(file, field.dtype, "r", offset, shape)
            field[low - first : high - first] = stored[low - begin : high - begin]
            offset += stored.nbytes
    return fields
