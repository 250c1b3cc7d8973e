"""A result in a few lines: names and values, as text and as HTML."""

from collections.abc import Mapping
from html import escape

import tabulate

Summary = Mapping[str, str]
"""Values in words, by name."""


def summary_text(summary: Summary) -> str:
    """Names and values in two columns."""
    return tabulate.tabulate(summary.items(), tablefmt="plain", disable_numparse=True)


def summary_html(summary: Summary) -> str:
    """The same as an HTML table."""
    rows = (f"<tr><th>{escape(k)}</th><td>{escape(v)}</td></tr>" for k, v in summary.items())
    return f"<table>{''.join(rows)}</table>"
