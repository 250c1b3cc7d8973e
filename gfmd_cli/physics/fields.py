"""Array types shared by the whole package."""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Field: TypeAlias = NDArray[np.floating[Any]]
"""Real values on the grid (or over wavenumbers, bins, pressures)."""

Modes: TypeAlias = NDArray[np.complexfloating[Any, Any]]
"""Fourier coefficients in the half-spectrum layout of a real transform."""

Marks: TypeAlias = NDArray[np.int8]
"""How each grid point stands to the indenter, see `sweeps`."""

Mask: TypeAlias = NDArray[np.bool_]
"""A choice of grid points."""
