"""Files that appear whole or not at all."""

import os
from contextlib import suppress
from pathlib import Path

from gfmd_cli.errors import SpaceError


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that it appears whole or not at all, even where the power fails.

    Raises SpaceError where it cannot be written.
    """
    fresh = path.with_name(f".{path.name}.{os.getpid()}")
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
