"""HTML from Python: every text is escaped unless it is markup already."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\ufffe\uffff]")
"""What neither HTML nor XML may hold, and carriage returns."""
NUMERIC = re.compile(r"[-–]?(\d|$)")
NONE = "–"


class Html(str):
    """Markup: it goes into a page as it is."""

    __slots__ = ()


def clean(value: object) -> str:
    """A text without what no page may hold."""
    plain = str(value).replace("\r\n", "\n").encode(errors="replace").decode()
    return CONTROL.sub("\ufffd", plain)


def markup(value: object) -> Html:
    """Markup as it is, anything else as text."""
    return value if isinstance(value, Html) else Html(escape(clean(value)))


def join(*parts: object) -> Html:
    """Parts one after another; None is nothing."""
    return Html("".join(markup(part) for part in parts if part is not None))


def tag(name: str, *children: object, **attributes: object) -> Html:
    """An element; `class_` is the attribute class, `aria_label` is aria-label."""
    told = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{markup(value)}"'
        for key, value in attributes.items()
    )
    return Html(f"<{name}{told}>{join(*children)}</{name}>")


def number(value: float, digits: int = 4) -> str:
    """A number of so many digits, for people."""
    return f"{value:.{digits}g}" if math.isfinite(value) else NONE


@dataclass(frozen=True)
class Group:
    """Rows of a table under a title of their own, which may be empty."""

    title: str
    rows: Sequence[Sequence[object]]


def table(caption: object, header: Sequence[object], groups: Sequence[Group]) -> Html:
    """A table that scrolls in its own box; the first cell of a row is its head."""
    first = next((row for group in groups for row in group.rows), [])
    told = zip(header, map(_side, first), strict=True) if first else ((h, {}) for h in header)
    head = tag("tr", *(tag("th", title, scope="col", **side) for title, side in told))
    bodies = []
    for group in groups:
        title = tag("th", tag("span", group.title), scope="rowgroup", colspan=len(header))
        above = tag("tr", title, class_="group") if group.title else None
        bodies.append(tag("tbody", above, *(_row(row) for row in group.rows)))
    above = tag("caption", tag("span", caption))
    whole = tag("table", above, tag("thead", head), *bodies)
    return tag("div", whole, class_="scroll", tabindex=0, role="group", aria_label="Table")


def _row(cells: Sequence[object]) -> Html:
    first, *others = cells
    head = tag("th", _cell(first), scope="row", **_side(first))
    return tag("tr", head, *(tag("td", _cell(cell), **_side(cell)) for cell in others))


def _side(cell: object) -> dict[str, str]:
    """Numbers stand to the right, words to the left."""
    return {"class_": "t"} if isinstance(cell, str) and not NUMERIC.match(cell) else {}


def _cell(cell: object) -> object:
    return number(cell) if isinstance(cell, float) else cell


def details(summary: object, *content: object) -> Html:
    """Content that opens at a click or a key."""
    return tag("details", tag("summary", summary), *content)


def code(text: object) -> Html:
    """Text as it is typed."""
    return tag("code", text)
