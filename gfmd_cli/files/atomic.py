"""Files that appear whole or not at all."""

import io
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from glob import escape
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any
from uuid import uuid4

from gfmd_cli.errors import SpaceError

WRITABLE = stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH


class NewFile(io.FileIO):
    """A new file that keeps its first error: HDF5 crashes at exit if a write fails."""

    error: OSError | None = None

    def write(self, content: Any) -> int:
        """Write all of the content; keep the first error and write nothing after it."""
        view = memoryview(content).cast("B")
        size = len(view)
        try:
            while view and self.error is None:
                view = view[super().write(view) :]
        except OSError as error:
            self.error = error
        return size

    def readinto(self, buffer: Any) -> int:
        """Read; after an error, with zeros for what is not there: HDF5 would take what it gets."""
        view = memoryview(buffer).cast("B")
        count = super().readinto(view)
        if self.error is not None:
            view[count:] = bytes(len(view) - count)
        return count


@contextmanager
def new_file(path: Path, aside: Path | None = None) -> Iterator[NewFile]:
    """A file that appears at `path` if the block ends without an error: written aside and renamed.

    `aside` is the folder to write it in, on the same file system; by default that of `path`. A
    symbolic link at `path` is replaced, see `target_of`.

    Raises SpaceError where it cannot be written.
    """
    fresh = (aside or path.parent) / temporary_name(path)
    file: NewFile | None = None
    try:
        _check_target(path)
        fresh.parent.mkdir(exist_ok=True)
        with NewFile(fresh, "w+b") as file:
            yield file
            if file.error is not None:
                raise file.error
            with suppress(FileNotFoundError):  # a file that is replaced keeps its mode
                os.fchmod(file.fileno(), stat.S_IMODE(path.stat().st_mode))
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


def target_of(path: Path) -> Path:
    """The file that a user names by a path: of a symbolic link, the file that it leads to."""
    return Path(os.path.realpath(path)) if os.path.islink(path) else path


def exists(path: Path) -> bool:
    """Whether there is something at `path`. Raises OSError where that cannot be found out.

    From Python 3.14 on, `Path.exists` answers False there.
    """
    try:
        path.stat()
    except (FileNotFoundError, NotADirectoryError, ValueError):  # ValueError: a null character
        return False
    return True


def temporary_name(path: Path) -> str:
    """A name that no other file has, for a file that is being written or removed."""
    return f".{path.name}.{uuid4().hex}"


def remove_temporary(path: Path) -> None:
    """Remove what killed processes were writing for `path`; no other process may write there."""
    for old in path.parent.glob(f".{escape(path.name)}.*"):
        with suppress(OSError):
            old.unlink()


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that it appears whole or not at all, even where the power fails.

    Raises SpaceError where it cannot be written.
    """
    with new_file(path) as file:
        file.write(content)


def check_place(path: Path) -> None:
    """Raise SpaceError where no file can be written at `path`, before the work for it begins."""
    try:
        _check_target(path)
        if len(os.fsencode(temporary_name(path))) > os.pathconf(path.parent, "PC_NAME_MAX"):
            raise SpaceError(f"{path}: cannot be written: the name is too long")
        TemporaryFile(dir=path.parent).close()
    except OSError as error:
        raise SpaceError(f"{path}: cannot be written: {error.strerror}") from error


def _check_target(path: Path) -> None:
    """Raise SpaceError for a path in a folder that does not exist, and for a read-only file.

    A file that nobody may write is kept, although it could be replaced, and root could write it.
    Raises OSError where the folder cannot be searched.
    """
    if not (exists(path.parent) and path.parent.is_dir()):
        raise SpaceError(f"{path}: cannot be written: there is no folder {path.parent}")
    with suppress(FileNotFoundError):
        if not path.stat().st_mode & WRITABLE:
            raise SpaceError(f"{path}: cannot be written: it is read-only (see chmod)")


def make_folder(path: Path) -> None:
    """Make a folder where it is missing, not the folders around it. Raises SpaceError."""
    try:
        _check_target(path)
        path.mkdir(exist_ok=True)
    except OSError as error:
        raise SpaceError(f"{path}: cannot be written: {error.strerror}") from error


def _sync_folder(folder: Path) -> None:
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except PermissionError:  # it can be written, but not read
        return
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
