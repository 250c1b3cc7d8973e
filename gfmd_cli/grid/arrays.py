"""Array types shared by the whole package, how to walk over an array, and sums of products."""

from math import prod
from typing import Any, Literal, TypeAlias

import numpy as np
import pyfftw
from numpy.typing import NDArray

Field: TypeAlias = NDArray[np.floating[Any]]
"""Real values on the grid (or over wavenumbers, bins, pressures)."""

SingleField: TypeAlias = NDArray[np.float32]
"""Real values on the grid that are kept in single precision."""

Modes: TypeAlias = NDArray[np.complexfloating[Any, Any]]
"""Fourier coefficients in the half-spectrum layout of a real transform."""

Integers: TypeAlias = NDArray[np.integer[Any]]
"""Labels, counts, indices of points, displacements in cells."""

Mask: TypeAlias = NDArray[np.bool_]
"""True at chosen grid points."""

MaskedField: TypeAlias = "np.ma.MaskedArray[Any, Any]"
"""Real values, masked where they are not known."""

Precision = Literal["double", "single"]

BLOCK_POINTS = 2**15  # points of a block of rows: it and its temporaries stay in the cache


HUGE_PAGE = 2**21  # bytes; Linux can use pages of this size for large arrays


def aligned(shape: int | tuple[int, ...], dtype: Any) -> Any:
    """An array that is aligned for transforms, values undefined.

    A large array begins at the start of a huge page. Otherwise its ends would lie on up to 512
    small pages, and the system has to provide each of them at the first access.
    """
    count = shape if isinstance(shape, int) else prod(shape)
    is_large = count * np.dtype(dtype).itemsize >= HUGE_PAGE
    return pyfftw.empty_aligned(shape, dtype, n=HUGE_PAGE if is_large else None)


def row_blocks(field: Field | Modes, block: int = BLOCK_POINTS) -> list[slice]:
    """Slices of whole rows of about `block` values each."""
    step = max(1, block * len(field) // field.size)
    return [slice(start, start + step) for start in range(0, len(field), step)]


def dot(one: Any, other: Any) -> float:
    """Sum of the products of two arrays, which does not depend on the threads of BLAS."""
    return float(np.einsum("i,i->", one.ravel(), other.ravel()))
