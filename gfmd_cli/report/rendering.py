"""HTML from the templates: every value is escaped unless it is markup already."""

import re
from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\ufffe\uffff]")
"""Characters that neither HTML nor XML may contain, and carriage returns."""
SYMBOLS = {
    "-dp/du_g": "−d<var>p</var>/d<var>u</var><sub>g</sub>",
    "Delta_sigma": "Δ<var>σ</var>",
    "Pr(sigma)": "Pr(<var>σ</var>)",
    "C(q)": "<var>C</var>(<var>q</var>)",
    "h(q)": "<var>h</var>(<var>q</var>)",
    "sigma_p": "<var>σ</var><sub>p</sub>",
    "h_std": "<var>h</var><sub>std</sub>",
    "sigma": "<var>σ</var>",
    "a_r": "<var>a</var><sub>r</sub>",
    "u_g": "<var>u</var><sub>g</sub>",
    "p*": "<var>p</var>*",
    "+-": "±",
    "^2": "²",
    "p": "<var>p</var>",
    "q": "<var>q</var>",
    "L": "<var>L</var>",
}
"""Symbols in headings and captions, as they are set in HTML."""
SYMBOL = re.compile(
    "|".join(
        (r"(?<![\w/])" if symbol[0].isalpha() else "")
        + re.escape(symbol)
        + (r"(?!\w)" if symbol[-1].isalnum() else "")
        for symbol in SYMBOLS
    )
)


def clean(value: Any) -> Any:
    """A value without the characters that no page may contain; markup is left as it is."""
    if isinstance(value, Markup):
        return value
    text = str(value).replace("\r\n", "\n").encode(errors="replace").decode()
    return CONTROL.sub("\ufffd", text)


def typeset(text: object) -> Markup:
    """A text with the symbols of SYMBOLS set in HTML."""
    return Markup(SYMBOL.sub(lambda found: SYMBOLS[found[0]], str(escape(clean(text)))))


def cell(text: str) -> str:
    """A cell of a text table with the signs of typeset text."""
    return "–" if text == "-" else text.replace("+-", "±")


@cache
def environment() -> Environment:
    """The templates of this package."""
    made = Environment(
        loader=PackageLoader("gfmd_cli.report"),
        autoescape=True,
        finalize=clean,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.policies["json.dumps_kwargs"] = {"separators": (",", ":")}
    made.filters |= {"typeset": typeset, "cell": cell}
    return made


def render(template: str, **values: Any) -> Markup:
    """A template filled in."""
    return Markup(environment().get_template(template).render(**values))
