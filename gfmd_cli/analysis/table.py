"""A table, declared once: its columns say where values are found and how they are printed."""

import math
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from typing import Any

import tabulate

from gfmd_cli.analysis.selection import grouped

Record = Mapping[str, Any]
Value = str | Callable[[Record], Any]
"""A key of a record, or a function of the record."""
BLANK = "-"
tabulate.MIN_PADDING = 0  # a column is as wide as its content
WIDTH = 98  # characters of a line of the caption


@dataclass(frozen=True)
class TableColumn:
    """One column of a table."""

    heading: str
    """Plain text; symbols written as in `gfmd export`, such as a_r."""
    value: Value
    format: str = "#.4g"
    unit: str = ""
    error: Value = ""
    """The error that is printed after the value, where it is known."""
    otherwise: str = ""
    """Key of the text that stands in the place of an unknown value."""
    optional: bool = False
    """Whether the column is left out of a table where no record has a value."""
    remark: Value = ""
    """What is printed after a value whose error is not known."""

    @property
    def title(self) -> str:
        """Heading with unit."""
        if not self.unit:
            return self.heading
        gap = "" if self.heading.endswith("\n") else " "
        return f"{self.heading}{gap}[{self.unit}]"

    def cell(self, record: Record) -> str:
        """The value of a record as it is printed."""
        value = value_in(record, self.value)
        if not known(value):
            return str(record.get(self.otherwise) or BLANK)
        if isinstance(value, bool):
            return "yes" if value else "no"
        if isinstance(value, str):
            return value
        error = value_in(record, self.error)
        if known(error):
            return plus_minus(value, abs(error))
        return f"{value:{self.format}}{value_in(record, self.remark) or ''}"


@dataclass(frozen=True)
class Group:
    """Records under a title of their own, which may be empty."""

    title: str
    records: Sequence[Record]
    notes: Sequence[str] = ()
    """Lines below the title, in the text only."""


def records_of(**columns: Any) -> list[Record]:
    """Records from arrays with their values."""
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    return [dict(zip(columns, row, strict=True)) for row in rows]


def groups_of(titled: Iterable[tuple[str, Record]]) -> list[Group]:
    """Records by their titles, in the order in which these occur."""
    groups = grouped(titled, lambda pair: pair[0])
    return [Group(title, [record for _, record in pairs]) for title, pairs in groups.items()]


@dataclass(frozen=True)
class Table:
    """Groups of records with the same columns."""

    caption: str
    declared: Sequence[TableColumn]
    groups: Sequence[Group]

    @cached_property
    def records(self) -> list[Record]:
        """The records of all groups."""
        return [record for group in self.groups for record in group.records]

    @cached_property
    def columns(self) -> list[TableColumn]:
        """The columns without the optional ones that are blank."""
        return [
            column
            for column in self.declared
            if not column.optional
            or any(known(value_in(record, column.value)) for record in self.records)
        ]

    @cached_property
    def alignments(self) -> list[str]:
        """The side of each column to which its cells are aligned: words left, numbers right."""
        cells = ([value_in(row, column.value) for row in self.records] for column in self.columns)
        is_text = (any(isinstance(value, str | bool) for value in values) for values in cells)
        return ["left" if words else "right" for words in is_text]

    def as_text(self) -> str:
        """The table in plain text, group by group; an empty string where there is no record."""
        blocks = [self._block(group) for group in self.groups if group.records]
        caption = textwrap.fill(self.caption, WIDTH).replace("\u00a0", " ")  # after the lines break
        return "\n\n".join([caption, *blocks] if caption and blocks else blocks)

    def as_html(self, typeset: Callable[[str], str] = escape) -> str:
        """The table in HTML; `typeset` escapes headings and titles and sets their symbols."""
        columns, size = self.columns, len(self.columns)
        sides = [' class="t"' if side == "left" else "" for side in self.alignments]
        html = f"<caption><span>{typeset(self.caption)}</span></caption>" if self.caption else ""
        if any(column.title for column in columns):
            heads = (typeset(column.title) for column in columns)
            tags = ['th scope="col"'] * size
            html += f"<thead>{_html_row(tags, sides, heads)}</thead>"
        for group in self.groups:
            title = f'colspan="{size}"><span>{typeset(group.title)}</span></th></tr>\n'
            html += "<tbody>\n"
            html += f'<tr class="group"><th scope="rowgroup" {title}' if group.title else ""
            for record in group.records:
                cells = (_html_cell(column.cell(record)) for column in columns)
                html += _html_row(['th scope="row"', *["td"] * (size - 1)], sides, cells)
            html += "</tbody>"
        return f"<table>{html}</table>"

    def _block(self, group: Group) -> str:
        lines = tabulate.tabulate(
            [[column.cell(record) for column in self.columns] for record in group.records],
            [column.title for column in self.columns],
            tablefmt="plain",
            disable_numparse=True,
            colalign=self.alignments,
        ).splitlines()
        indented = [f"  {line}".rstrip() for line in lines]
        return "\n".join([*filter(None, [group.title]), *group.notes, *indented])


def _html_row(tags: Iterable[str], sides: Iterable[str], cells: Iterable[str]) -> str:
    rows = zip(tags, sides, cells, strict=True)
    return f"<tr>{''.join(f'<{tag}{side}>{cell}</{tag[:2]}>' for tag, side, cell in rows)}</tr>\n"


def _html_cell(text: str) -> str:
    """A cell with the signs of typeset text."""
    return "–" if text == BLANK else escape(text.replace("+-", "±"))


def value_in(record: Record, value: Value) -> Any:
    """The value of a record: that of a key, or that of a function of the record."""
    return value(record) if callable(value) else record.get(value)


def known(value: Any) -> bool:
    """Whether a value applies: neither None nor the blank of a column of numbers, NaN or -1."""
    if isinstance(value, float):
        return not math.isnan(value)
    return value is not None and value != -1


def plain(value: Any) -> Any:
    """A value as JSON has it: None for what does not apply and for infinity."""
    infinite = isinstance(value, float) and math.isinf(value)
    return value if known(value) and not infinite else None


DECIMAL = 1e-4, 1e6
"""Absolute values from which and up to which a number with an error, or its error, is decimal."""


def plus_minus(value: float, error: float) -> str:
    """A value and its error, both down to the second digit of the error."""
    if not error > 0:
        return f"{value:.6g}"
    digits = 1 - math.floor(math.log10(float(f"{error:.1e}"))) if math.isfinite(error) else 3
    least, largest = DECIMAL
    if value == 0 or least <= abs(value) < largest:
        digits = min(max(digits, 0), 12)
        error_format = f".{digits}f" if least <= error < largest else ".1e"
        return f"{value:z.{digits}f} +- {error:{error_format}}"
    digits += math.floor(math.log10(abs(value)))
    return f"{value:.{min(max(digits, 0), 12)}e} +- {error:.1e}"


def ratio(value: str, reference: str) -> Callable[[Record], float]:
    """One value over another; NaN where either is unknown or the other is zero."""
    return lambda record: record[value] / record[reference] if record[reference] else math.nan


def product(value: str, unit: str) -> Callable[[Record], float]:
    """A reduced value in its physical unit."""
    return lambda record: float(record[value] * record[unit])
