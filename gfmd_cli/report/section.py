"""A section of the page: what a template fills in."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
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
    """A part of the page under a heading."""

    title: str
    notes: Sequence[str] = ()
    """Paragraphs above the figures."""
    drawings: Sequence[Drawing] = ()
    tables: Mapping[str, Table] = field(default_factory=dict)
    """By the summary of the disclosure that holds the table; an empty one: always visible."""
    template: str = "section.html"
    content: Any = None
    """What the template needs besides."""

    @property
    def anchor(self) -> str:
        """Its identifier in the page."""
        return self.title.lower().replace(" ", "-")

    def of(self, letter: str) -> "Section":
        """The same, of one of two studies."""
        return replace(self, title=f"{self.title} of {letter}") if letter else self
