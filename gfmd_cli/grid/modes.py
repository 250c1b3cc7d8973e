"""Modes of a real field along one axis: how often each counts, and which of them two grids have."""

from dataclasses import dataclass

import numpy as np

from gfmd_cli.grid.arrays import Field


def multiplicity(points: int) -> Field:
    """How often each q >= 0 of a real field of so many points counts in a sum over all q."""
    count = np.full(points // 2 + 1, 2.0)
    count[0] = 1.0
    if points % 2 == 0:  # the highest wavenumber stands for +q and -q alike
        count[-1] = 1.0
    return count


@dataclass(frozen=True)
class SharedModes:
    """Wavenumbers along an axis that a field keeps on a grid of another number of points."""

    positive: int
    """Number of wavenumbers q >= 0."""
    negative: int
    """Number of wavenumbers q < 0."""
    halved: bool
    """Whether the last of both is the Nyquist wavenumber, which stands for +q and -q alike."""

    @property
    def slices(self) -> tuple[slice, slice]:
        """Their places in the order of a transform."""
        return slice(self.positive), slice(-self.negative, None)


def shared_modes(source: int, target: int) -> SharedModes:
    """The modes of `source` points; if `target` is less, those below its Nyquist wavenumber."""
    if target < source:
        return SharedModes((target + 1) // 2, (target - 1) // 2, False)
    return SharedModes(source // 2 + 1, source // 2, target > source and source % 2 == 0)
