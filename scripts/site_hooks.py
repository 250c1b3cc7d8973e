"""Hooks of mkdocs: pages at the root of the repository, their links, and a site without network.

The build fails if a page of the site would load anything from another host.
"""

import re
from pathlib import Path
from typing import Any

from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[1]
AT_ROOT = {
    "CONTRIBUTING.md": "contributing.md",
    "SECURITY.md": "security.md",
    "CHANGELOG.md": "changelog.md",
}
"""Files at the root of the repository, and their names on the site."""
OUTSIDE = re.compile(
    r"<(?!a\b)[a-z]+\b[^>]*\s(?:src|srcset|href|data|poster)\s*=\s*[\"']?\s*(?:https?:)?//[^\s>]*"
    r"|(?:url\(|@import)\s*[\"']?\s*(?:https?:)?//[^\s)]*",
    re.IGNORECASE,
)
"""What a browser loads from another host, in HTML and CSS; links (<a>) load nothing."""


def on_files(files: Files, config: Any) -> Files:
    """Add the files at the root, their links as seen from docs/."""
    for name, page in AT_ROOT.items():
        text = (ROOT / name).read_text(encoding="utf-8").replace("](docs/", "](")
        files.append(File.generated(config, page, content=text))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Send links to files at the root to their pages; leave out comments."""
    for name, page in {**AT_ROOT, "README.md": "index.md"}.items():
        markdown = re.sub(rf"\]\((\.\./)?{re.escape(name)}(?=[)#])", f"]({page}", markdown)
    return re.sub(r"^<!--.*?-->\n", "", markdown, flags=re.MULTILINE)


def outside(text: str) -> list[str]:
    """The parts of a page or a style sheet that load something from another host."""
    return [match[0] for match in OUTSIDE.finditer(text)]


def on_post_build(config: Any) -> None:
    """Fail if any file of the site loads something from another host."""
    for path in Path(config["site_dir"]).rglob("*"):
        if path.suffix in (".html", ".css"):
            for part in outside(path.read_text(encoding="utf-8")):
                raise PluginError(f"{path}: loads from another host: {part}")
