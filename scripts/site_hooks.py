"""Hooks of mkdocs: pages that live at the root of the repository, links between them, comments."""

import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[1]
AT_ROOT = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "SECURITY.md": "security.md",
    "CHANGELOG.md": "changelog.md",
}
"""Files at the root of the repository, and what they are called on the site."""


def on_files(files: Files, config: Any) -> Files:
    """Add the files at the root, their links as seen from docs/."""
    for name, page in AT_ROOT.items():
        text = (ROOT / name).read_text(encoding="utf-8").replace("](docs/", "](")
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Send links to files at the root to their pages; leave out comments."""
    for name, page in AT_ROOT.items():
        markdown = re.sub(rf"\]\((\.\./)?{re.escape(name)}(?=[)#])", f"]({page}", markdown)
    return re.sub(r"^<!--.*?-->\n", "", markdown, flags=re.MULTILINE)
