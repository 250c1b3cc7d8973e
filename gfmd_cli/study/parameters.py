"""Parameters of surface, elastomer, grid and solver as columns of a study.

The columns follow from the models of the run spec: a key gives its column the name, the docstring
of the key gives meaning and unit. Where another table or a measured column has the same
name, the name of the table is prepended: `surface_kind`, `elastomer_path`, `surface_h_std`.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import NoneType
from typing import Any, Literal, NamedTuple, get_args, get_origin

from gfmd_cli.spec.check import MODELS, kinds_of
from gfmd_cli.spec.models import SWEPT
from gfmd_cli.spec_table import UNIT, as_text
from gfmd_cli.study.column import Column

SHARED = (
    "surface.seed", "surface.length_y", "elastomer.n", "elastomer.thickness", "grid.points",
    "grid.points_y", "solver.tolerance",
)  # fmt: skip
"""Parameters whose columns are defined explicitly, for their description or position."""


class Parameter(NamedTuple):
    """A key of a table that accepts parameter sweeps, and its column."""

    table: str
    key: str
    column: Column

    def cell(self, values: Mapping[str, Any]) -> Any:
        """The cell of the column for the values of a table; blank where the key is missing."""
        value = values.get(self.key)
        if value is None or (value == "auto" and self.column.kind is not str):
            return self.column.blank
        return value.name if isinstance(value, Path) else self.column.kind(value)

    def word(self, row: Mapping[str, Any]) -> str:
        """Text of the parameter of a row in a label; "" where the cell is blank."""
        value = row[self.column.name]
        if self.column.is_blank(value):
            return ""
        if self.key == "kind":
            return as_text(value)
        return f"{self.key}={as_text(value, self.column.units)}"


def parameters(columns: Sequence[Column]) -> tuple[Parameter, ...]:
    """All parameters in the order of the tables; `columns` are those defined explicitly."""
    by_name = {column.name: column for column in columns}
    fields = {table: _fields(table) for table in SWEPT}
    uses = Counter(key for keys in fields.values() for key in keys)
    result = []
    for table, keys in fields.items():
        for key, alternatives in keys.items():
            address = f"{table}.{key}"
            if address in SHARED:
                column = by_name[key]
            else:
                clashes = uses[key] > 1 or key in by_name
                column = _column(f"{table}_{key}" if clashes else key, address, alternatives)
            result.append(Parameter(table, key, column))
    return tuple(result)


def _fields(table: str) -> dict[str, list[Any]]:
    """The pydantic fields of each key, one for each kind that has the key."""
    fields: dict[str, list[Any]] = {}
    for model in kinds_of(table).values() or [MODELS[table]]:
        for key, field in model.model_fields.items():
            fields.setdefault(key, []).append(field)
    return fields


def _column(name: str, address: str, alternatives: list[Any]) -> Column:
    """The column of one key, with the different descriptions of its kinds joined."""
    kind = _type_of(field.annotation for field in alternatives)
    texts = [" ".join((field.description or "").split()).rstrip(".") for field in alternatives]
    units = {""}
    if kind is not str:
        units = {match[1] if (match := UNIT.search(text)) else "1" for text in texts}
        texts = [UNIT.sub("", text) for text in texts]
    meaning = "; ".join(dict.fromkeys(filter(None, texts)))
    unit = units.pop() if len(units) == 1 else ""
    return Column(name, f"{address}: {meaning}" if meaning else address, unit, kind)


def _type_of(annotations: Iterable[Any]) -> type:
    """`int` for integers and booleans, `float` for other numbers, `str` for any other type."""
    types = {leaf for annotation in annotations for leaf in _leaves(annotation)}
    if types <= {int, bool}:
        return int
    return float if types <= {int, bool, float} else str


def _leaves(annotation: Any) -> set[type]:
    """The types in a union, without None."""
    if get_origin(annotation) is Literal:
        return {type(value) for value in get_args(annotation)}
    parts = [part for part in get_args(annotation) if isinstance(part, type) or get_args(part)]
    if not parts:
        return {annotation} - {NoneType}
    return {leaf for part in parts for leaf in _leaves(part)}
