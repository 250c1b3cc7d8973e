"""A section of the page: what a template fills in."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from markupsafe import Markup

from gfmd_cli.analysis.table import Table


class Drawing(NamedTuple):
    """A figure of the page."""

    svg: Markup
    name: str
    """Of its files; also the prefix of the identifiers in it."""
    caption: str
    data: dict[str, Any] | None = None
    """What scripts draw it from, as `interactive` makes it; None of a picture."""
    scrolls: bool = False
    """Whether it is wider than a phone, and then scrolled by touch and keys."""


@dataclass(frozen=True)
class Section:
    """A part of the page under a heading; tables without records are left out."""

    title: str
    notes: Sequence[str] = ()
    """Paragraphs above the figures."""
    tables: Sequence[Table] = ()
    """Tables that are always visible."""
    drawings: Sequence[Drawing] = ()
    disclosed: Mapping[str, Table] = field(default_factory=dict)
    """Tables by the summary of the disclosure that holds them."""
    template: str = "section.html"
    content: Any = None
    """What the template needs besides; None where it needs nothing."""

    @property
    def anchor(self) -> str:
        """Its identifier in the page."""
        return self.title.lower().replace(" ", "-")

    @property
    def is_blank(self) -> bool:
        """Whether the study has no data for it."""
        tables = [*self.tables, *self.disclosed.values()]
        has_records = any(table.records for table in tables)
        return not (self.drawings or has_records or self.content is not None)
