"""HTML from the templates: every value is escaped unless it is markup already.

The page runs its own scripts and no others.
"""

import base64
import hashlib
import re
from functools import cache
from html import unescape
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from gfmd_cli.analysis.table import Table
from gfmd_cli.analysis.wording import RAISED

SCRIPTS = ("plotly-basic.min.js", "report.js")
"""Files of gfmd_cli/report/assets, in the order in which they run."""
CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\ufffe\uffff]")
"""Characters that neither HTML nor XML may contain, and carriage returns."""
SYMBOLS = {
    "-dp/du_g": "−d<var>p</var>/d<var>u</var><sub>g</sub>",
    "Delta_sigma": "Δ<var>σ</var>",
    "Pr(sigma)": "Pr(<var>σ</var>)",
    "C(q)": "<var>C</var>(<var>q</var>)",
    "h(q)": "<var>h</var>(<var>q</var>)",
    "sigma_p": "<var>σ</var><sub>p</sub>",
    "lambda_r": "<var>λ</var><sub>r</sub>",
    "lambda_s": "<var>λ</var><sub>s</sub>",
    "q_r": "<var>q</var><sub>r</sub>",
    "q_s": "<var>q</var><sub>s</sub>",
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
"""Symbols in headings, captions and labels, as they are set in HTML."""
SYMBOL = re.compile(
    "|".join(
        (r"(?<![\w/.=])" if symbol[0].isalpha() else "")
        + re.escape(symbol)
        + (r"(?![\w=]|\.\w)" if symbol[-1].isalnum() else "")
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
    return Markup(SYMBOL.sub(lambda symbol: SYMBOLS[symbol[0]], str(escape(clean(text)))))


def html_label(label: str) -> str:
    """A label that matplotlib typesets, in the few elements of HTML that plotly.js knows."""
    return "<br>".join(map(_html_line, label.split("\n")))


def _html_line(line: str) -> str:
    text = line.replace(r"\Delta\sigma", "Delta_sigma").replace("^*", "*")
    text = re.sub(r"\^\{?(-?\d)\}?", lambda power: power[1].translate(RAISED), text)
    text = re.sub(r"\\[,;]|\s+", " ", re.sub(r"\\mathrm\{(.*?)\}", r"\1", text))
    text = re.sub(r"(?<!\\)\$|\\(?=[$A-Za-z])", "", text)  # delimiters, and begins of names
    return re.sub(r"(?<=[</])var>", "i>", typeset(text))


def plain_label(label: str) -> str:
    """A label in one line without any markup; subscripts follow an underscore."""
    line = label.replace("\n", " ")
    return unescape(re.sub("<[^>]+>", "", html_label(line).replace("<sub>", "_")))


def table(content: Table) -> Markup:
    """A table with typeset headings and titles."""
    return Markup(clean(content.as_html(typeset)))


@cache
def environment() -> Environment:
    """The templates of this package."""
    result = Environment(
        loader=PackageLoader("gfmd_cli.report"),
        autoescape=True,
        finalize=clean,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    result.policies["json.dumps_kwargs"] = {"separators": (",", ":")}
    result.filters |= {"typeset": typeset, "table": table}
    result.globals |= {"policy": policy, "scripts": scripts}
    return result


def render(template: str, **values: Any) -> Markup:
    """A template filled in."""
    return Markup(environment().get_template(template).render(**values))


@cache
def scripts() -> tuple[Markup, ...]:
    """The text of each script."""
    folder = files("gfmd_cli.report") / "assets"
    return tuple(Markup((folder / name).read_text("utf-8")) for name in SCRIPTS)


@cache
def policy() -> str:
    """Content security policy: nothing is fetched, and no script runs but these.

    Scripts are named by their hashes, so that none that a study contains can run.
    """
    digests = (hashlib.sha256(text.encode()).digest() for text in scripts())
    hashes = " ".join(f"'sha256-{base64.b64encode(digest).decode()}'" for digest in digests)
    return (
        f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data: blob:"
    )
