"""HDF5 files from elsewhere: a dataset is looked at before it is read."""

from typing import Any

import h5py

PLAIN = "iufS"  # kinds of values that are read: numbers and text


def has(group: Any, name: str) -> bool:
    """Whether the group itself holds something of this name; a link to elsewhere is not followed.

    Raises ValueError for such a link.
    """
    link = group.get(name, getlink=True)
    if link is not None and not isinstance(link, h5py.HardLink):
        raise ValueError(f"{name!r} is a link to elsewhere; links do not count")
    return link is not None


def take(group: Any, name: str, compression: float = 1.0) -> Any:
    """The dataset `name`, reached by hard links, kept in the file itself, of numbers or text.

    Parameters
    ----------
    name : path below the group
    compression : how many times larger than on the disk it may be

    Raises KeyError where there is none, ValueError where it is not what it seems.
    """
    found = group
    for part in name.split("/"):
        if not isinstance(found, h5py.Group) or not has(found, part):
            raise KeyError(f"no dataset {name!r}")
        found = found[part]
    if not isinstance(found, h5py.Dataset):
        raise ValueError(f"{name!r} is no dataset")
    if found.shape is None:
        raise ValueError(f"dataset {name!r} is empty")
    if found.external or found.is_virtual:
        raise ValueError(f"dataset {name!r} is kept in other files; copy it into one")
    if found.dtype.kind not in PLAIN and h5py.check_string_dtype(found.dtype) is None:
        raise ValueError(f"dataset {name!r} has type {found.dtype}; numbers or text are read")
    stored = min(found.id.get_storage_size(), found.file.id.get_filesize())
    if found.nbytes > compression * stored:
        raise ValueError(
            f"dataset {name!r} claims {found.nbytes} bytes, but hardly any are stored ({stored})"
        )
    return found
