"""Folders for files that can be made again: FFTW's plans and compiled code."""

import os
import stat
import tempfile
from contextlib import suppress
from pathlib import Path


def cache_folder() -> Path:
    """The user's cache for this program; without a home directory, a temporary folder.

    A relative path in XDG_CACHE_HOME is ignored, as the XDG base directory specification requires.
    """
    if os.path.isabs(home := os.environ.get("XDG_CACHE_HOME", "")):
        return Path(home) / "gfmd"
    try:
        return Path.home() / ".cache" / "gfmd"
    except RuntimeError:  # no HOME, and the system does not know the user id
        return private_folder() or Path(os.devnull) / "gfmd"


def private_folder() -> Path | None:
    """A folder for temporary files that no other user can write to; None where there is none."""
    with suppress(OSError):
        folder = Path(tempfile.gettempdir()) / f"gfmd-{os.getuid()}"
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        status = folder.lstat()
        if stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid():
            folder.chmod(0o700)
            return folder
    return None
