"""Files in folders that others can write to: opened only where they are regular files.

A symbolic link, a FIFO or a device in the place of a file would make the program write to, or wait
for, something that the user did not name.
"""

import errno
import os
import stat
from pathlib import Path
from typing import BinaryIO


def open_regular(path: Path, flags: int = os.O_RDONLY, *, follow: bool = False) -> BinaryIO:
    """Open a regular file, without waiting for anything.

    Parameters
    ----------
    flags : as of `os.open`, to read or to read and write; truncate the file afterwards, not by a
        flag
    follow : whether the path may be a symbolic link, as those that users give

    Raises OSError for a link, a directory, a FIFO, a device or a socket, and for a file of several
    names (hard links) that is to be written.
    """
    guards = os.O_NONBLOCK | os.O_CLOEXEC | (0 if follow else os.O_NOFOLLOW)
    is_writable = bool(flags & os.O_RDWR)
    descriptor = os.open(path, flags | guards, 0o666)
    try:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            raise OSError(errno.EINVAL, "not a regular file", str(path))
        if is_writable and status.st_nlink > 1 and not follow:
            raise OSError(errno.EMLINK, "a file of several names (hard links)", str(path))
        return os.fdopen(descriptor, "r+b" if is_writable else "rb")
    except BaseException:
        os.close(descriptor)
        raise


def read_regular(path: Path, max_bytes: int) -> bytes:
    """The content of a small regular file. Raises OSError, also where it is larger."""
    with open_regular(path) as file:
        content = file.read(max_bytes + 1)
    if len(content) > max_bytes:
        raise OSError(errno.EFBIG, f"larger than {max_bytes} bytes", str(path))
    return content
