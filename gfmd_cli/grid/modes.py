"""Modes of a real field along one axis: how often each counts, and which of them two grids have."""

import numpy as np
from numpy.typing import NDArray

from gfmd_cli.grid.arrays import Field


def multiplicity(points: int) -> Field:
    """How often each q >= 0 of a real field of so many points counts in a sum over all q."""
    count = np.full(points // 2 + 1, 2.0)
    count[0] = 1.0
    if points % 2 == 0:  # the highest wavenumber stands for +q and -q alike
        count[-1] = 1.0
    return count


def shared_modes(source: int, target: int) -> tuple[NDArray[np.int64], bool]:
    """Numbers m, in rising order, of the modes that a field keeps on another number of points.

    On more points these are all modes, on fewer those below their Nyquist wavenumber. Also returned
    is whether the first and the last are -q and +q of the Nyquist wavenumber, for which `source`
    points have only one coefficient. As an index, m is the place of a mode in a transform.
    """
    if target < source:
        return np.arange(-((target - 1) // 2), (target + 1) // 2), False
    return np.arange(-(source // 2), source // 2 + 1), target > source and source % 2 == 0
