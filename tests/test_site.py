"""The built documentation site: what its search finds."""

import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def search_index(tmp_path_factory):
    """The search index of the site, built as `make docs` builds it."""
    pytest.importorskip("material")
    from mkdocs.commands.build import build
    from mkdocs.config import load_config

    folder = tmp_path_factory.mktemp("site")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("NO_MKDOCS_2_WARNING", "1")
        patch.chdir(ROOT)
        build(load_config(str(ROOT / "mkdocs.yml"), site_dir=str(folder)))
    return json.loads((folder / "search" / "search_index.json").read_text(encoding="utf-8"))


def words(text: str, separator: str) -> set[str]:
    """The words of a section as the search of the site sees them."""
    return {word.lower() for word in re.split(separator, re.sub("<[^>]*>", " ", text))}


def pages_with(query: str, index) -> set[str]:
    """The pages with a section that contains a word with this beginning."""
    separator = index["config"]["separator"]
    return {
        section["location"].partition("#")[0]
        for section in index["docs"]
        for word in words(f"{section['title']} {section['text']}", separator)
        if word.startswith(query.lower())
    }


@pytest.mark.filterwarnings("ignore")  # those of mkdocs and its extensions
@pytest.mark.parametrize(
    ("query", "pages"),
    [
        ("AFM", {"index.html", "gallery.html", "tutorial.html"}),
        ("leak", {"gallery.html", "observables.html", "tutorial.html"}),
        ("stiffness", {"gallery.html", "physics.html", "study-file.html", "symbols.html"}),
        ("conductance", {"gallery.html", "observables.html"}),
        ("percolates_x", {"observables.html", "study-file.html"}),
        ("p_star", {"configuration.html", "symbols.html"}),
        ("tamaas", {"coming_from.html"}),
    ],
)
def test_the_search_finds_pages_by_words_of_users(query, pages, search_index):
    first = re.split(search_index["config"]["separator"], query)[0]
    assert pages <= pages_with(first, search_index)
