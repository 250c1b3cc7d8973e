"""Files that appear whole or not at all, and folders that one process at a time may change."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from secrets import token_hex

from gfmd_cli.errors import SpaceError


def beside(path: Path) -> Path:
    """A name to write a file under before it is renamed, used by no other process or machine."""
    return path.with_name(f".{path.name}.{token_hex(4)}")


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that it appears whole or not at all, even where the power fails.

    Raises SpaceError where it cannot be written.
    """
    fresh = beside(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with fresh.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        fresh.replace(path)
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
    except OSError as error:
        with suppress(OSError):
            fresh.unlink(missing_ok=True)
        raise SpaceError(f"{path}: cannot be written: {error.strerror}") from error


def make_folder(path: Path) -> None:
    """Make a folder where it is missing. Raises SpaceError."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SpaceError(f"{path}: cannot be made: {error.strerror}") from error


@contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Keep others out of a folder; the kernel drops the lock of a process that dies.

    Who holds it may remove the folder: who waited for it then makes it anew. Raises SpaceError.
    """
    with ExitStack() as stack:
        while not _locked(folder, stack):
            pass
        yield


def _locked(folder: Path, stack: ExitStack) -> bool:
    """Wait for the lock; false where the folder was removed in the meantime."""
    path = folder / "lock"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = stack.enter_context(path.open("w"))
        fcntl.flock(lock, fcntl.LOCK_EX)
        return os.path.samestat(os.fstat(lock.fileno()), path.stat())
    except FileNotFoundError:
        return False
    except OSError as error:
        raise SpaceError(f"{folder}: cannot be locked: {error.strerror}") from error
