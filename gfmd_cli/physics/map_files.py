"""Height maps and line profiles in files: .npy, HDF5 and netCDF 4 arrays, formats of microscopes.

The files are not trusted: their size, type and layout are checked before any height is read.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.physics.array_files import read_hdf5, read_npy
from gfmd_cli.physics.height_map import REMEDY, HeightMap, first_line
from gfmd_cli.physics.microscope_files import read_microscope_file

MAX_BYTES = 2**33  # 32768 x 32768 heights in double precision


def read_map(path: Path, dataset: str | None, max_bytes: int) -> HeightMap:
    """Read the height map or the line profile of a file.

    `.npy` and HDF5 arrays (netCDF 4 is HDF5) are taken as they are, indexed [y, x], without unit.
    SurfaceTopography reads all other formats; its height channel [x, y] is transposed to [y, x]
    and converted to metres.

    Raises InputError where the file cannot be read as a height map.
    """
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if not path.is_file():
        kind = "a directory" if path.is_dir() else "not a regular file"
        raise InputError(f"{path}: {kind}; a height map file is needed")
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty")
    try:
        return _reader(path)(path, dataset, max_bytes)
    except (InputError, MemoryError):
        raise
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error}") from error
    except Exception as error:  # the reader of a damaged file can raise any exception
        raise InputError(
            f"{path}: cannot be read ({first_line(error)}): damaged, or no height map? {REMEDY}"
        ) from error


def _reader(path: Path) -> Callable[[Path, str | None, int], HeightMap]:
    """The function that reads a file, by its suffix or its first bytes."""
    with path.open("rb") as file:
        signature = file.read(len(np.lib.format.MAGIC_PREFIX))
    if path.suffix.lower() == ".npy" or signature == np.lib.format.MAGIC_PREFIX:
        return read_npy
    import h5py

    if path.suffix.lower() in (".h5", ".hdf5") or h5py.is_hdf5(path):
        return read_hdf5
    return read_microscope_file
