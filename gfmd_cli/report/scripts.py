"""The scripts of the page, and the policy under which they and no others run."""

import base64
import hashlib
from functools import cache
from importlib.resources import files

from markupsafe import Markup

NAMES = ("plotly-basic.min.js", "report.js")
"""Files of gfmd_cli/report/assets, in the order in which they run."""


@cache
def scripts() -> tuple[Markup, ...]:
    """The text of each script."""
    folder = files("gfmd_cli.report") / "assets"
    return tuple(Markup((folder / name).read_text("utf-8")) for name in NAMES)


@cache
def policy() -> str:
    """Content security policy: nothing is fetched, and no script runs but these.

    Scripts are named by their hashes, so that none that a study contains can run.
    """
    hashes = " ".join(f"'sha256-{_digest(text)}'" for text in scripts())
    return (
        f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data: blob:"
    )


def _digest(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
