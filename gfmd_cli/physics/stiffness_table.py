"""A tabulated stiffness k(q): its file, its interpolation and its compliance."""

import warnings
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.grid.arrays import Field
from gfmd_cli.maps.interpolation import monotone_cubic
from gfmd_cli.physics.compliance_transforms import Compliance, separated

MAX_TABLE_BYTES = 2**20  # a choice, some 40000 rows
SEPARATORS = str.maketrans(",;", "  ")  # of columns, beside spaces and tabs


def read_table(path: Path) -> Field:
    """The columns q [1/m] and k [Pa/m], shape (rows, 2), from a text.

    Between them are spaces, tabs, commas or semicolons. Raises InputError for an invalid table.
    """
    try:
        # stat first: it says that there is no such file
        if path.stat().st_size > MAX_TABLE_BYTES or not path.is_file():
            raise ValueError(f"not a regular file of at most {MAX_TABLE_BYTES} bytes")
        lines = path.read_text("utf-8-sig").translate(SEPARATORS).splitlines()
        with warnings.catch_warnings(action="ignore", category=UserWarning):
            table = np.loadtxt(lines, ndmin=2)  # warns of an empty file, refused below
    except (OSError, ValueError) as error:
        raise InputError(
            f"{path}: elastomer.path: cannot be read: {error}; the file must be a text of two "
            "columns of numbers, q [1/m] and k [Pa/m], with # before words"
        ) from error
    if table.shape[0] < 2 or table.shape[1] != 2:
        raise InputError(
            f"{path}: elastomer.path: {table.shape[0]} rows, {table.shape[1]} columns; "
            "at least two rows of two columns, q and k, are needed"
        )
    is_positive = np.all(np.isfinite(table)) and np.all(table > 0)
    if not (is_positive and np.all(np.diff(table[:, 0]) > 0)):
        raise InputError(
            f"{path}: elastomer.path: q and k must be finite and positive; q must increase"
        )
    return table


def interpolated(table: Field) -> Callable[[Field], Field]:
    """k(q) [Pa/m] for q > 0 from the rows q, k of a table."""
    (x, y), (low, high) = np.log(table).T, end_exponents(table)
    cubic = monotone_cubic(x, y)

    def stiffness(q: Field) -> Field:
        log_q = np.log(q)
        beyond = low * np.minimum(log_q - x[0], 0.0) + high * np.maximum(log_q - x[-1], 0.0)
        return np.exp(cubic(np.clip(log_q, x[0], x[-1])) + beyond)

    return stiffness


def end_exponents(table: Field) -> tuple[float, float]:
    """Exponents of the power laws below and above a table."""
    slopes = np.diff(np.log(table[[0, 1, -2, -1]]), axis=0)
    return float(slopes[0, 1] / slopes[0, 0]), float(slopes[2, 1] / slopes[2, 0])


@lru_cache(maxsize=4)
def compliance_of_table(content: bytes) -> Compliance:
    """1/k(q) from the bytes of a table; cached, because its transforms serve all grids."""
    table = np.frombuffer(content).reshape(-1, 2)
    exponent = max(end_exponents(table)[0], 0.0)  # of rounded numbers it may be negative
    return Compliance(interpolated(table), separated(table[:, 0]), exponent)
