"""Figures inside a page: the SVG of a sheet, with the colours of the page."""

import re
from xml.etree import ElementTree

from gfmd_cli.analysis.report.markup import Html, clean, tag
from gfmd_cli.analysis.report.theme import variable
from gfmd_cli.analysis.sheet import Page

COMMENT = re.compile("<!--.*?-->", re.DOTALL)
COLOUR = re.compile(r"#[0-9a-fA-F]{6}\b")
NUMBER = re.compile(r"-?\d+\.\d{3,}")
DROPPED = ("metadata", "style")  # of an SVG; what the style says stands in that of the page
PLACES = {"points", "x", "y", "d"}  # attributes in points, of which a hundredth is enough


def figure(sheet: Page, name: str, label: str, caption: object, *, scrolls: bool = False) -> Html:
    """A figure.

    Parameters
    ----------
    name : sets its parts apart in the page
    label : says it to who cannot see
    scrolls : whether it is wider than a phone, and then moved by fingers and keys
    """
    box = {"tabindex": 0, "role": "group", "aria_label": "Figure"} if scrolls else {}
    drawing = tag("div", inline(sheet.svg(), name, label), class_="drawing", **box)
    return tag("figure", drawing, tag("figcaption", caption))


def inline(svg: str, name: str, label: str) -> Html:
    """An SVG file as an element of a page: no namespaces, names of its own, colours by variable."""
    svg = COMMENT.sub("", svg)  # they repeat what is written in the figure
    root = ElementTree.fromstring(svg)
    used = {value[1:] for part in root.iter() for value in part.attrib.values() if value[:1] == "#"}
    used |= set(re.findall(r"url\(#([^)]+)\)", svg))
    for part in root.iter():
        part.tag = _local(part.tag)
        for child in [child for child in part if _local(child.tag) in DROPPED]:
            part.remove(child)
        attributes = {_local(key): value for key, value in part.attrib.items()}
        if attributes.get("id") not in used:
            attributes.pop("id", None)
        part.attrib.clear()
        part.attrib.update({key: _rewritten(key, v, name) for key, v in attributes.items()})
        part.text, part.tail = (part.text or "").strip(), None
    box = root.attrib["viewBox"]
    root.attrib.clear()
    root.attrib.update({"viewBox": box, "role": "img", "aria-label": clean(label)})
    told = ElementTree.tostring(root, encoding="unicode")
    return Html(told)


def _rewritten(key: str, value: str, name: str) -> str:
    if key == "id":
        return f"{name}-{value}"
    if key == "href" and value.startswith("#"):
        return f"#{name}-{value[1:]}"
    if key in PLACES:
        return NUMBER.sub(lambda found: f"{float(found[0]):.2f}", value).replace("\n", "")
    value = value.replace("url(#", f"url(#{name}-")
    return value if key == "href" else COLOUR.sub(lambda f: variable(f[0].lower()), value)


def _local(name: str) -> str:
    return name.rpartition("}")[2]
