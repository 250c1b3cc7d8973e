"""Checksums at the end of a file show whether it has changed; digests are names of contents."""

import hashlib
import json
import os
import zlib
from pathlib import Path
from typing import Any, BinaryIO

from gfmd_cli.errors import InputError
from gfmd_cli.files.atomic import NewFile, exists

Version = tuple[int, ...]
"""Numbers that tell a file from one that replaces it, see `file_version`."""

SEAL = b"gfmd"  # followed by four bytes, the crc32 of all before
CHUNK = 2**24  # bytes that are read at a time
MAX_COMPRESSION = 1032  # of files and data: the limit of deflate, https://zlib.net/zlib_tech.html
MIN_BLOCK = 4096  # bytes that a file takes at least; small ones may be stored in its inode


def seal(file: NewFile) -> None:
    """End a new file with the checksum of its content."""
    file.seek(0)
    file.write(_mark(crc32(file, os.fstat(file.fileno()).st_size)))


def sealed(content: bytes) -> bytes:
    """Content with its checksum."""
    return content + _mark(zlib.crc32(content))


def _mark(crc: int) -> bytes:
    return SEAL + crc.to_bytes(4, "little")


def check_seal(file: BinaryIO) -> int:
    """Size of the content before the checksum; the file stands at its beginning afterwards.

    Raises ValueError where the content has changed, or where the file claims far more than is
    stored on the disk.
    """
    status = os.fstat(file.fileno())
    size = status.st_size - len(SEAL) - 4
    if size < 0:
        raise ValueError("cut short")
    check_stored(status)
    crc = crc32(file, size)
    if file.read(len(SEAL) + 5) != _mark(crc):
        raise ValueError("its checksum is wrong")
    file.seek(0)
    return size


def check_stored(status: os.stat_result) -> None:
    """Raise ValueError where a file claims far more bytes than the disk holds of it."""
    if status.st_size > MAX_COMPRESSION * max(512 * status.st_blocks, MIN_BLOCK):
        raise ValueError("a sparse file")


def crc32(file: BinaryIO | NewFile, size: int) -> int:
    """The crc32 of the next `size` bytes."""
    total = 0
    while size > 0 and (chunk := file.read(min(size, CHUNK))):
        total = zlib.crc32(chunk, total)
        size -= len(chunk)
    return total


def file_version(path: Path, *, follow: bool = True) -> Version:
    """Numbers that tell a file from one that replaces it. Raises OSError where there is none.

    `follow` says whether a symbolic link stands for the file that it leads to.
    """
    status = path.stat(follow_symlinks=follow)
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


def file_digest(path: Path) -> str:
    """SHA-256 of a file's content. Raises InputError where it cannot be read."""
    try:
        if not (exists(path) and path.is_file()):
            raise InputError(f"{path}: no such file, or not a regular one")
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error


def digest(data: Any) -> str:
    """Short name of plain data by its content."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:16]
