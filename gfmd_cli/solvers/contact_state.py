"""The contact state of the grid points, which the solvers and their preconditioners share."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

ContactState: TypeAlias = NDArray[np.int8]
"""FREE, TENSE or PRESSED for each grid point."""

FREE, TENSE, PRESSED = 0, 1, 2
"""A point is not in contact; in contact, but under tension; or in contact under pressure.

A kernel holds the points whose state is at least its `threshold`: PRESSED, or TENSE where points
under tension are not released.
"""
