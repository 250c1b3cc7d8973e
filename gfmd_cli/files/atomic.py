"""Files that appear whole or not at all."""

import io
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any
from uuid import uuid4

from gfmd_cli.errors import SpaceError


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


@contextmanager
def new_file(path: Path, aside: Path | None = None) -> Iterator[NewFile]:
    """A file that appears at `path` if the block ends without an error: written aside and renamed.

    `aside` is the folder to write it in, on the same file system; by default that of `path`.
    Raises SpaceError where it cannot be written.
    """
    fresh = (aside or path.parent) / f".{path.name}.{uuid4().hex}"
    file: NewFile | None = None
    try:
        fresh.parent.mkdir(parents=True, exist_ok=True)
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


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that it appears whole or not at all, even where the power fails.

    Raises SpaceError where it cannot be written.
    """
    with new_file(path) as file:
        file.write(content)


def check_place(path: Path) -> None:
    """Raise SpaceError where no file can be written at `path`, before the work for it begins."""
    folder = next(folder for folder in path.absolute().parents if folder.exists())
    try:
        TemporaryFile(dir=folder).close()
    except OSError as error:
        raise SpaceError(f"{path}: cannot be written: {error.strerror}") from error


def make_folder(path: Path) -> None:
    """Make a folder where it is missing. Raises SpaceError."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SpaceError(f"{path}: cannot be made: {error.strerror}") from error


def _sync_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
