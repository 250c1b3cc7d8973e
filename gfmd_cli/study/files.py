"""Files that appear whole or not at all, seals that tell a changed one, and locks."""

import fcntl
import io
import os
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO
from uuid import uuid4

import h5py

from gfmd_cli.errors import SpaceError

SEAL = b"gfmd"  # and four bytes, the crc32 of all before
CHUNK = 2**24  # bytes that are summed at a time
VERSION = ("v110", "v110")  # of HDF5: the first whose metadata all carry checksums


class Fresh(io.FileIO):
    """A file being written whose first error waits: HDF5 crashes at exit if a write fails."""

    error: OSError | None = None

    def write(self, content: Any) -> int:
        """Write all of it, or note why not and drop it and all that follows."""
        view = memoryview(content).cast("B")
        size = len(view)
        try:
            while view and self.error is None:
                view = view[super().write(view) :]
        except OSError as error:
            self.error = error
        return size


@contextmanager
def new_file(path: Path, aside: Path | None = None) -> Iterator[Fresh]:
    """A file that is at `path` once the block has ended well: written aside, synced, renamed.

    `aside` is the folder to write it in, on the same file system; by default that of `path`.
    Raises SpaceError where it cannot be written.
    """
    fresh = (aside or path.parent) / f".{path.name}.{uuid4().hex}"
    file: Fresh | None = None
    try:
        fresh.parent.mkdir(parents=True, exist_ok=True)
        with Fresh(fresh, "w+b") as file:
            yield file
            if file.error is not None:
                raise file.error
            os.fsync(file.fileno())
        fresh.replace(path)
        _sync_folder(path.parent)
    except Exception as error:
        reason = error if file is None or file.error is None else file.error
        if isinstance(reason, OSError):
            raise SpaceError(f"{path}: cannot be written: {reason.strerror or reason}") from error
        raise
    finally:
        with suppress(OSError):
            fresh.unlink(missing_ok=True)


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that it appears whole or not at all, even where the power fails.

    Raises SpaceError where it cannot be written.
    """
    with new_file(path) as file:
        file.write(content)


def check_place(path: Path) -> None:
    """Raise SpaceError where no file can be written at `path`, before the work for it begins."""
    folder = next(folder for folder in path.absolute().parents if folder.exists())
    if not (folder.is_dir() and os.access(folder, os.W_OK)):
        raise SpaceError(f"{path}: cannot be written")


def make_folder(path: Path) -> None:
    """Make a folder where it is missing. Raises SpaceError."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SpaceError(f"{path}: cannot be made: {error.strerror}") from error


@contextmanager
def new_hdf5(file: Fresh) -> Iterator[Any]:
    """HDF5 written into a new file, of any size, without a copy of it in memory."""
    with h5py.File(file, "w", libver=VERSION) as made:
        yield made


def seal(file: Fresh) -> None:
    """End a new file with the checksum of all that is in it."""
    file.seek(0)
    content_sum = _sum(file, os.fstat(file.fileno()).st_size)
    file.seek(0, os.SEEK_END)
    file.write(SEAL + content_sum)


def sealed(content: bytes) -> bytes:
    """Content with its seal."""
    return content + SEAL + zlib.crc32(content).to_bytes(4, "little")


def check_seal(path: Path) -> int:
    """Size of the content before the seal. Raises ValueError where a bit of it has changed."""
    with path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size - len(SEAL) - 4
        if size < 0:
            raise ValueError("cut short")
        content_sum = _sum(file, size)
        if file.read() != SEAL + content_sum:
            raise ValueError("its checksum is wrong")
    return size


def _sum(file: BinaryIO | Fresh, size: int) -> bytes:
    """The crc32 of the next `size` bytes."""
    total = 0
    while size > 0 and (chunk := file.read(min(size, CHUNK))):
        total = zlib.crc32(chunk, total)
        size -= len(chunk)
    return total.to_bytes(4, "little")


@contextmanager
def locked(path: Path, *, shared: bool = False, wait: bool = True) -> Iterator[bool]:
    """Inside, this process has a lock file; the kernel takes it from a process that dies.

    Its holder may delete the file: who waited for it then takes the one that is there now.
    Yields whether it was got, always true where `wait` is. Raises SpaceError where the file
    system has no locks or cannot be written.
    """
    how = (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | (0 if wait else fcntl.LOCK_NB)
    while True:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            file = path.open("a")
        except FileNotFoundError:  # the folder was deleted just now
            continue
        except OSError as error:
            raise SpaceError(f"{path}: cannot be written: {error.strerror}") from error
        with file:
            try:
                fcntl.flock(file, how)
            except BlockingIOError:
                yield False
                return
            except OSError as error:
                reason = f"this file system has no locks ({error.strerror}); take another one"
                raise SpaceError(f"{path}: {reason}") from error
            if _is_at(file.fileno(), path):
                yield True
                return


def _is_at(descriptor: int, path: Path) -> bool:
    """Whether an open file is the one that has this name."""
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except FileNotFoundError:
        return False


def _sync_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
