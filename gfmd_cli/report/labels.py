"""Labels of figures, which matplotlib typesets, as HTML and as plain text."""

import re
from html import escape, unescape

SYMBOLS = {"Delta": "Δ", "sigma": "σ", "lambda": "λ", "langle": "⟨", "rangle": "⟩"}
PART = r"\\mathrm\{[^}]*\}|\{[^}]*\}|\\[A-Za-z]+|."
"""What a sub- or superscript may be."""
TOKEN = re.compile(
    rf"(?P<script>[_^])(?P<part>{PART})|\\mathrm\{{(?P<upright>[^}}]*)\}}|\\(?P<name>[A-Za-z]+)"
    r"|(?P<space>\\[,;]|\s+)|(?P<letter>[A-Za-z])|(?P<other>.)"
)
DOLLAR = "\0"


def html_label(label: str) -> str:
    """A label with its mathematics between dollar signs in the few elements that figures know."""
    pieces = label.replace(r"\$", DOLLAR).split("$")
    text = "".join(_math(p) if i % 2 else escape(p) for i, p in enumerate(pieces))
    return re.sub(r"\s+", " ", text).replace(DOLLAR, "$").strip()


def plain_label(label: str) -> str:
    """A label without any markup; subscripts follow an underscore."""
    text = re.sub("<sub>", "_", html_label(label))
    return unescape(re.sub("<[^>]+>", "", text))


def _math(text: str) -> str:
    return "".join(_token(token) for token in TOKEN.finditer(text))


def _token(token: re.Match[str]) -> str:
    if token["script"]:
        part = token["part"]
        inside = _math(part[1:-1] if part.startswith("{") else part)
        name = "sub" if token["script"] == "_" else "sup"
        return inside if inside == "*" else f"<{name}>{inside}</{name}>"
    if token["upright"] is not None:
        return escape(token["upright"])
    if token["name"]:
        return SYMBOLS.get(token["name"], token["name"])
    if token["letter"]:
        return f"<i>{token['letter']}</i>"
    return " " if token["space"] else escape(token["other"].replace("-", "−"))
