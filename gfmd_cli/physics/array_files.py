"""Arrays of heights in .npy, HDF5 and netCDF 4 files: their layout is checked before any is read.

Nothing in the files is unpickled.
"""

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.physics.height_map import HeightMap, check_layout

MAX_COMPRESSION = 1032  # the limit of deflate, https://zlib.net/zlib_tech.html


def read_npy(path: Path, dataset: str | None, max_bytes: int) -> HeightMap:
    """Map a `.npy` array into memory, which fails where the header states more than is stored."""
    if dataset is not None:
        raise InputError(f"{path}: a .npy file holds one array; leave out dataset {dataset!r}")
    mapped = np.lib.format.open_memmap(path, mode="r")  # reads neither pickles nor archives
    check_layout(path, mapped.shape, mapped.dtype, max_bytes)
    return HeightMap(mapped, None, False, None, f"npy, {mapped.dtype}")


def read_hdf5(path: Path, dataset: str | None, max_bytes: int) -> HeightMap:
    """Read one dataset of an HDF5 file, reached by hard links and stored in the file itself."""
    import h5py

    from gfmd_cli.files.hdf5 import take

    with h5py.File(path, "r") as file:
        name = _dataset_name(path, file, dataset)
        check_layout(path, file[name].shape or (), file[name].dtype, max_bytes)
        data = take(file, name, MAX_COMPRESSION)
        packed = {"scale_factor", "add_offset"} & set(data.attrs)
        if packed:
            raise InputError(
                f"{path}: dataset {name!r} is packed ({', '.join(sorted(packed))}); "
                "store the heights themselves"
            )
        values = np.ma.asarray(data[()])
        for mark in {"_FillValue", "missing_value"} & set(data.attrs):
            values = np.ma.masked_where(values == data.attrs[mark], values)
        return HeightMap(values, None, False, None, f"HDF5, {name}, {data.dtype}")


def _dataset_name(path: Path, file: Any, name: str | None) -> str:
    """Path of the named dataset, or of the only map, or of the only line. Raises InputError."""
    from gfmd_cli.files.hdf5 import datasets_below, take

    if name is not None:
        with suppress(KeyError, ValueError):
            take(file, name.strip("/"), MAX_COMPRESSION)
            return name.strip("/")
    try:
        datasets = datasets_below(file)
    except ValueError as error:
        raise InputError(f"{path}: {error}; choose one by surface.dataset") from error
    maps = _maps(datasets)
    if name is not None and name.strip("/") in datasets:
        return name.strip("/")
    if name is None and len(maps) == 1:
        return maps[0]
    problem = (
        "several datasets: choose one by surface.dataset"
        if name is None and maps
        else f"no dataset {name!r} (links do not count)"
        if name is not None
        else "no numeric dataset with one or two dimensions"
    )
    raise InputError(f"{path}: {problem}; its height maps: {', '.join(maps) or 'none'}")


def _maps(datasets: dict[str, Any]) -> list[str]:
    """The names of the maps among some datasets; without maps those of the lines."""
    numbers = {key: item for key, item in datasets.items() if item.dtype.kind in "iuf"}
    maps = [key for key, item in numbers.items() if item.ndim == 2]
    return maps or [key for key, item in numbers.items() if item.ndim == 1]


def map_names(path: Path) -> list[str]:
    """The height maps of an HDF5 file, in its order; none for any other file, or a damaged one.

    Of a study these are its stored heights; its other arrays are no maps.
    """
    from gfmd_cli.files.hdf5 import datasets_below, open_hdf5

    try:
        with open_hdf5(path) as file:
            names = _maps(datasets_below(file))
            is_study = "spec_text" in file.attrs
            return [name for name in names if not is_study or name.endswith("/height")]
    except Exception:  # a damaged file can raise any; reading it will say what is wrong
        return []
