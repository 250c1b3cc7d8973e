"""The contact state of the grid points, which the solvers and their preconditioners share."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from gfmd_cli.grid.arrays import Mask
from gfmd_cli.physics.contact import Contact

ContactState: TypeAlias = NDArray[np.int8]
"""FREE, TENSILE or PRESSED for each grid point."""

FREE, TENSILE, PRESSED = 0, 1, 2
"""A point is not in contact; in contact, but under tension; or in contact under pressure.

A kernel holds the points whose state is at least its `threshold`: PRESSED, or TENSILE where points
under tension are not released.
"""
PENETRATING = TENSILE
"""The same value; where the stress is the unknown: no stress and a negative gap."""


def refined(touching: Mask, contact: Contact) -> Mask:
    """The points of a finer grid that are nearest to points in contact, or between two of them.

    A point is between two if they are the next ones along x, along y or along a diagonal. Masks
    have two axes, as of `Grid.as_rows`; that of the coarser grid is `touching`.
    """
    sizes = list(zip(contact.grid.as_rows(contact.height).shape, touching.shape, strict=True))
    before = [np.arange(n) * m // n for n, m in sizes]
    after = [-(-np.arange(n) * m // n) % m for n, m in sizes]
    nearest = [(2 * np.arange(m) * n + m) // (2 * m) % n for n, m in sizes]
    left, right = (touching.take(ends[1], axis=1) for ends in (before, after))
    near = left.take(before[0], axis=0) & right.take(after[0], axis=0)
    near |= right.take(before[0], axis=0) & left.take(after[0], axis=0)
    near[np.ix_(*nearest)] |= touching
    return contact.clear_untouchable(near)
