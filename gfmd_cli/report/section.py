"""A section of the page: what a template fills in, its figures as inline SVG."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple
from xml.etree import ElementTree

from markupsafe import Markup

from gfmd_cli.analysis.curve_styles import without_escapes
from gfmd_cli.analysis.plotting import ColumnFigure, LegendFigure
from gfmd_cli.analysis.table import Table
from gfmd_cli.report.interactive import interactive
from gfmd_cli.report.rendering import clean
from gfmd_cli.report.theme import variable

COLOUR = re.compile(r"#[0-9a-fA-F]{6}\b")
NUMBER = re.compile(r"-?\d+\.\d{3,}")
DROPPED = ("metadata", "style")  # elements; style.css has the rules of the latter
COORDINATES = {"points", "x", "y", "d"}  # attributes; rounded to a hundredth of a point


class Drawing(NamedTuple):
    """A figure of the page."""

    svg: Markup
    name: str
    """Name of its files and prefix of the identifiers in it."""
    caption: str
    data: dict[str, Any] | None
    """Data from which scripts draw it, see `interactive`; None for a picture."""


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


def with_curves(label: str, figure: ColumnFigure) -> str:
    """An alternative text followed by the legend of the figure."""
    entries = map(without_escapes, filter(None, (figure.heading, *figure.named_entries)))
    return f"{label}: {', '.join(entries)}"


def drawing(figure: LegendFigure, name: str, label: str, caption: str) -> Drawing:
    """A figure for the page.

    Parameters
    ----------
    name : prefix of the identifiers inside the drawing, unique in the page
    label : alternative text for screen readers
    """
    data = interactive(figure) if isinstance(figure, ColumnFigure) else None
    return Drawing(_inline(figure.svg(), name, label), name, caption, data)


def _inline(svg: str, name: str, label: str) -> Markup:
    """An SVG file as an element of the page, with colours as variables and prefixed identifiers."""
    svg = svg.replace(' xmlns="http://www.w3.org/2000/svg"', "").replace("xlink:href", "href")
    root = ElementTree.fromstring(svg)  # without comments
    used = {value[1:] for part in root.iter() for value in part.attrib.values() if value[:1] == "#"}
    used |= set(re.findall(r"url\(#([^)]+)\)", svg))
    for part in root.iter():
        for child in [child for child in part if child.tag in DROPPED]:
            part.remove(child)
        if part.attrib.get("id") not in used:
            part.attrib.pop("id", None)
        for key, value in part.attrib.items():
            part.attrib[key] = _rewritten(key, value, name)
        part.text, part.tail = (part.text or "").strip(), None
    box = root.attrib["viewBox"]
    root.attrib.clear()
    root.attrib.update({"viewBox": box, "role": "img", "aria-label": clean(label)})
    return Markup(ElementTree.tostring(root, encoding="unicode"))


def _rewritten(key: str, value: str, name: str) -> str:
    if key == "id":
        return f"{name}-{value}"
    if key == "href" and value.startswith("#"):
        return f"#{name}-{value[1:]}"
    if key in COORDINATES:
        return NUMBER.sub(lambda number: f"{float(number[0]):.2f}", value).replace("\n", "")
    value = value.replace("url(#", f"url(#{name}-")
    return value if key == "href" else COLOUR.sub(lambda f: variable(f[0].lower()), value)
