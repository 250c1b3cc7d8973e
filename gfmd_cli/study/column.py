"""A column of a study: one value of each task."""

from math import nan
from typing import Any, NamedTuple

Row = dict[str, Any]
"""Columns of one task by name."""


class Column(NamedTuple):
    """Name, type and meaning of a value that every task has."""

    name: str
    meaning: str
    units: str = "1"
    """Unit as in the CF conventions; "1" for a pure number, "" for text and mixed units."""
    kind: type = float
    """`str`, `int` or `float`."""

    @property
    def blank(self) -> Any:
        """The value of a row to which the column does not apply: "", -1 or NaN."""
        return {str: "", int: -1, float: nan}[self.kind]

    def is_blank(self, value: Any) -> bool:
        """Whether a value is the blank one."""
        return bool(value != value if self.kind is float else value == self.blank)
