"""HDF5 files: new ones, and those from elsewhere, whose datasets are checked before reading."""

import re
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from math import prod
from pathlib import Path
from struct import unpack_from
from typing import Any, BinaryIO

import h5py
import numpy as np

from gfmd_cli.files.atomic import NewFile
from gfmd_cli.files.regular import open_regular

MAGIC = b"\x89HDF\r\n\x1a\n"  # first bytes of an HDF5 file
PLAIN = "iufS"  # kinds of values that are read: numbers and text
MAX_OBJECTS = 10_000  # in all groups that are searched for datasets; a scan has some tens
MAX_DEPTH = 32  # of nested groups that are searched; paths of 20000 names take minutes
HEAP = b"GCOL\x01\0\0\0"  # first bytes of a global heap
HEADER = 16  # bytes at the beginning of a heap and of each object in it
MAX_HEAP = 2**26  # bytes of a heap that are checked, in a second; usual are 4096
VERSION = ("v110", "v110")  # of HDF5: the first whose metadata all carry checksums


def new_hdf5(file: NewFile) -> Any:
    """HDF5 written into a new file, of any size, without a copy of it in memory."""
    return h5py.File(file, "w", libver=VERSION)


@contextmanager
def open_hdf5(source: Path | BinaryIO) -> Iterator[Any]:
    """An HDF5 file for reading, without locks. Raises OSError where it is none.

    `source` is a path, which may be a link to a regular file, or a file that is open already.
    """
    raw = open_regular(source, follow=True) if isinstance(source, Path) else nullcontext(source)
    with raw as opened, h5py.File(_CheckedHeaps(opened), "r") as file:
        yield file


class _CheckedHeaps:
    """A file for HDF5 that refuses damaged global heaps, in which HDF5 (2.0) can loop without end.

    These heaps contain the values of variable length. After a header of 16 bytes come objects with
    headers of 16 bytes each: number, references and size. Number 0 is the free space
    (specification of the file format, Sect. III.E).
    """

    def __init__(self, file: Any) -> None:
        self._file = file
        self.read, self.seek, self.tell = file.read, file.seek, file.tell

    def readinto(self, buffer: memoryview) -> int:
        """Read at the current position. Raises OSError if a damaged heap begins in what is read."""
        position = self._file.tell()
        count = int(self._file.readinto(buffer))
        for heap in re.finditer(HEAP, buffer):
            self._check_heap(position + heap.start())
        return count

    def _check_heap(self, position: int) -> None:
        self._file.seek(position + len(HEAP))
        size = int.from_bytes(self._file.read(8), "little") - HEADER
        objects = self._file.read(max(0, min(size, MAX_HEAP)))
        at = 0
        while at + HEADER <= len(objects):
            number, _, _, used = unpack_from("<HHIQ", objects, at)
            step = HEADER + -(-used // 8) * 8 if number else used
            if step < HEADER or at + step > size:
                raise OSError(f"damaged: a heap of texts and lists at byte {position}")
            at += step


def is_hdf5(path: Path) -> bool:
    """Whether a file is HDF5, perhaps behind a user block."""
    return bool(h5py.is_hdf5(path))


def has(group: Any, name: str) -> bool:
    """Whether the group itself holds something of this name; a link to elsewhere is not followed.

    Raises ValueError for such a link.
    """
    links, key = group.id.links, name.encode()
    if not links.exists(key):
        return False
    if links.get_info(key).type != h5py.h5l.TYPE_HARD:
        raise ValueError(f"{name!r} is a link to another place; links are not followed")
    return True


def datasets_below(group: Any) -> dict[str, Any]:
    """All datasets below a group by their paths, reached by hard links only.

    Raises ValueError where there are more than `MAX_OBJECTS` objects or deeper groups than
    `MAX_DEPTH`.
    """
    datasets: dict[str, Any] = {}
    queue, visited, count = [("", group, 1)], {h5py.h5o.get_info(group.id).addr}, 0
    for path, parent, depth in queue:  # which grows meanwhile, level by level
        if depth > MAX_DEPTH:
            raise ValueError(f"groups are nested deeper than {MAX_DEPTH}")
        count += len(parent)
        if count > MAX_OBJECTS:
            raise ValueError(f"holds more than {MAX_OBJECTS} objects")
        for name in parent:
            if not isinstance(parent.get(name, getlink=True), h5py.HardLink):
                continue
            item = parent[name]
            if isinstance(item, h5py.Dataset):
                datasets[path + name] = item
            elif (address := h5py.h5o.get_info(item.id).addr) not in visited:
                visited.add(address)
                if isinstance(item, h5py.Group):
                    queue.append((f"{path}{name}/", item, depth + 1))
    return datasets


def find(group: Any, path: str) -> Any:
    """The group at a path below a group, reached by hard links only, or None.

    Raises ValueError for other links.
    """
    for name in path.split("/"):
        if not has(group, name):
            return None
        group = h5py.Group(h5py.h5g.open(group.id, name.encode()))
    return group


def take(group: Any, path: str, compression: float = 1.0) -> Any:
    """The dataset at a path, reached by hard links, stored in the file, of numbers or text.

    Parameters
    ----------
    path : below the group
    compression : how many times larger than on the disk it may be

    Text is of a fixed length. Raises KeyError where there is no dataset, ValueError where it is
    stored elsewhere, has another type, or claims more data than are stored.
    """
    return h5py.Dataset(_checked(group, path, compression))


def read_dataset(group: Any, path: str) -> Any:
    """The values of such a dataset, without the overhead of `h5py.Dataset`."""
    dataset = _checked(group, path, 1.0)
    values = np.empty(dataset.shape, dataset.dtype)
    if values.size:
        dataset.read(h5py.h5s.ALL, h5py.h5s.ALL, values, dataset.get_type())
    return values


def as_utf8(values: Any) -> Any:
    """Text as it is stored: UTF-8 of a fixed length."""
    encoded = np.char.encode(np.asarray(values, str), "utf-8")
    return encoded.astype(h5py.string_dtype("utf-8", max(encoded.itemsize, 1)))


def create_dataset(group: Any, name: str, values: Any) -> None:
    """A dataset without checksums and labels, without the overhead of `h5py.Dataset`."""
    kind = h5py.h5t.py_create(values.dtype, logical=True)
    space = h5py.h5s.create_simple(values.shape)
    dataset = h5py.h5d.create(group.id, name.encode(), kind, space)
    if values.size:
        dataset.write(h5py.h5s.ALL, h5py.h5s.ALL, np.ascontiguousarray(values))


def write_checked(group: Any, name: str, values: Any) -> Any:
    """A dataset whose every chunk has a checksum: a changed one cannot be read."""
    return group.create_dataset(name, data=values, fletcher32=values.size > 0)


def write_scale(group: Any, name: str, values: Any, units: str, meaning: str) -> Any:
    """A dimension scale: the labels along one axis of other datasets."""
    scale = write_checked(group, name, np.asarray(values))
    scale.make_scale(name)
    scale.attrs.update({"units": units, "long_name": meaning})
    return scale


def _checked(group: Any, path: str, compression: float) -> Any:
    folder, _, name = path.rpartition("/")
    parent = find(group, folder) if folder else group
    if parent is None or not has(parent, name):
        raise KeyError(f"no dataset {path!r}")
    dataset = h5py.h5o.open(parent.id, name.encode())
    if not isinstance(dataset, h5py.h5d.DatasetID):
        raise ValueError(f"{path!r} is not a dataset")
    if dataset.shape is None:
        raise ValueError(f"dataset {path!r} is empty")
    storage = dataset.get_create_plist()
    if storage.get_external_count() or storage.get_layout() == h5py.h5d.VIRTUAL:
        raise ValueError(f"dataset {path!r} is stored in other files; copy it into one file")
    kind = dataset.dtype
    if kind.kind not in PLAIN:
        raise ValueError(f"dataset {path!r} has type {kind}; only numbers and text can be read")
    claimed_bytes = prod(dataset.shape) * kind.itemsize
    stored_bytes = min(dataset.get_storage_size(), h5py.h5i.get_file_id(dataset).get_filesize())
    if claimed_bytes > compression * stored_bytes:
        raise ValueError(
            f"dataset {path!r} claims {claimed_bytes} bytes, but hardly any are stored "
            f"({stored_bytes})"
        )
    return dataset
