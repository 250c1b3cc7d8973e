"""Every code block of the documentation does what the page says.

Blocks of a page run in their order, in one folder that has `configs/`: `python` in one namespace,
`toml` through the reader of run specs, `console` through the command line, its output compared with
the page. A comment right before a block says what is special about it:

    <!-- not run: REASON -->   left alone, and counted
    <!-- slow -->              in `make validate` only, with what needs it
    <!-- needs: PACKAGE -->    run where this package is installed
    <!-- status: N -->         the exit status that the last command ends with
    <!-- file: NAME -->        the file NAME has, or gets, these contents

In output a line of `...` stands for any lines, and numbers may differ in their last digits.
"""

import ast
import importlib.util
import io
import json
import re
import shlex
import shutil
import tomllib
from contextlib import redirect_stdout
from pathlib import Path
from typing import NamedTuple

import pytest
from click.testing import CliRunner

import gfmd_cli
from gfmd_cli.cli import main
from gfmd_cli.spec.parse import read_spec, read_tables

ROOT = Path(__file__).parents[1]
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md", "CHANGELOG.md")),
    *sorted((ROOT / "docs").glob("*.md")),
]
SCRIPTS = sorted((ROOT / "scripts").rglob("*.py"))
INDENTED = re.compile(r"^(?![ ]|[-*] |\d+\. |\|).*\n\n {4}(?![-*] )\S", re.MULTILINE)
FENCE = re.compile(r"^( *)```(\S*)\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
COMMENT = re.compile(r"<!-- ([a-z ]+)(?:: (.*?))? -->\s*$")
NUMBER = re.compile(r"[+-]?\d+\.?\d*(?:e[+-]?\d+)?")
MAX_LINE = 125
PATHS = re.compile(
    r"(?<![\w./$-])((?:gfmd_cli|docs|scripts|tests|configs|solvers|physics|study|spec|analysis|report"
    r"|bench|grid|files|cli)/[\w./-]*[\w/])"
)
"""Names of files and folders in the running text of a page."""
LINK = re.compile(r"\]\((?!https?:)([^)#\s]*)(?:#([^)\s]*))?\)")
LAST_DIGITS = 3  # in units of the last one that the page has
RELATIVE = 2e-3  # or this, where rounding sends two solves different ways
SMALL = 1e-5  # below it, numbers of two digits are residuals: as large as they happen to be
BASE = {
    "surface": {"kind": "self-affine", "cutoff": 0.05},
    "elastomer": {"kind": "half-space"},
    "grid": {"points": 64},
    "load": {"p_star": 0.1},
}


class Block(NamedTuple):
    """A fenced block of a page."""

    page: Path
    line: int
    language: str
    text: str
    said: dict[str, str]
    """The comments before it."""

    @property
    def place(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def blocks(page: Path) -> list[Block]:
    text = page.read_text(encoding="utf-8")
    result = []
    for fence in FENCE.finditer(text):
        options, before = {}, text[: fence.start()].rstrip(" ").removesuffix("\n")
        while comment := COMMENT.search(before.rpartition("\n")[2]):
            options[comment[1]] = comment[2] or ""
            before = before.rpartition("\n")[0]
        line = text[: fence.start()].count("\n") + 1
        inner = re.sub(rf"^{fence[1]}", "", fence[3], flags=re.MULTILINE)
        result.append(Block(page, line, fence[2], inner, options))
    return result


def same_token(shown: str, printed: str) -> bool:
    """Whether two words agree, numbers in them up to their last digits."""
    if shown == printed:
        return True
    if NUMBER.sub("#", shown) != NUMBER.sub("#", printed):
        return False
    return all(map(same_number, NUMBER.findall(shown), NUMBER.findall(printed)))


def same_number(shown: str, printed: str) -> bool:
    if shown.lstrip("+-").isdigit():
        return shown == printed
    a, b = float(shown), float(printed)
    mantissa, _, exponent = shown.partition("e")
    digit = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    if "e" in shown and len(mantissa.strip("+-")) <= 3 and max(abs(a), abs(b)) < SMALL:
        return True
    return abs(a - b) <= max(LAST_DIGITS * digit * 1.001, RELATIVE * abs(a))


def same_line(shown: str, printed: str) -> bool:
    one, other = shown.split(), printed.split()
    return len(one) == len(other) and all(map(same_token, one, other))


def matches(shown: list[str], printed: list[str]) -> bool:
    """Whether the lines of a page are what was printed, `...` standing for any lines."""
    if not shown:
        return not printed
    if shown[0].strip() == "...":
        return any(matches(shown[1:], printed[skip:]) for skip in range(len(printed) + 1))
    return bool(printed) and same_line(shown[0], printed[0]) and matches(shown[1:], printed[1:])


def run_console(block: Block) -> None:
    """Run the commands of a block one by one and compare what they print."""
    commands: list[tuple[str, list[str]]] = []
    for line in block.text.replace(" \\\n    ", " ").splitlines():
        if line.startswith("$ "):
            commands.append((line[2:], []))
        else:
            assert commands, f"{block.place}: begins without a command"
            commands[-1][1].append(line)
    for number, (command, shown) in enumerate(commands):
        words = shlex.split(command, comments=True)
        assert words[0] == "gfmd", f"{block.place}: cannot run {command!r}; say why: not run"
        done = CliRunner().invoke(main, words[1:], prog_name="gfmd", env={"COLUMNS": "100"})
        if done.exception is not None and not isinstance(done.exception, SystemExit):
            raise done.exception
        wanted = int(block.said.get("status", 0)) if number == len(commands) - 1 else 0
        lines = [line.rstrip() for line in done.output.strip("\n").splitlines()]
        while shown and not shown[-1].strip():
            shown.pop()
        transcript = f"{block.place}: $ {command}\n{done.output}"
        assert done.exit_code == wanted, transcript
        assert matches(shown, lines), transcript


def run_toml(block: Block) -> None:
    """Read a spec, or a part of one laid over a small one."""
    data = tomllib.loads(block.text)
    if name := block.said.get("file"):
        file = Path(name)
        if not file.exists():
            file.write_text(block.text)
        there = file.read_text()
        assert tomllib.loads(there) == data, f"{block.place}: not what {file} has"
        if there.startswith("#:schema"):  # by gfmd init: the comments are a part of it
            assert there.partition("\n")[2] == block.text, f"{block.place}: not what {file} has"
        read_spec(file)
        return
    whole = dict(BASE)
    for table, keys in data.items():
        laid_over = isinstance(keys, dict) and "kind" not in keys and table != "load"
        whole[table] = BASE.get(table, {}) | keys if laid_over else keys
    read_tables(whole)


def run_block(block: Block, namespace: dict) -> None:
    if block.language == "console":
        run_console(block)
    elif block.language == "toml":
        run_toml(block)
    elif block.language == "python":
        code = compile("\n" * block.line + block.text, str(block.page), "exec")
        with redirect_stdout(io.StringIO()):
            exec(code, namespace)
    else:
        pytest.fail(f"{block.place}: {block.language or 'no language'}: cannot be run; say why")


def can_run(block: Block, *, slow: bool) -> bool:
    needs = block.said.get("needs")
    installed = needs is None or importlib.util.find_spec(needs) is not None
    return "not run" not in block.said and (slow or "slow" not in block.said) and installed


def run_page(page: Path, folder: Path, *, slow: bool) -> None:
    shutil.copytree(ROOT / "configs", folder / "configs")
    namespace: dict = {"__name__": page.stem}
    for block in blocks(page):
        if can_run(block, slow=slow):
            run_block(block, namespace)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("notebook", sorted((ROOT / "docs").glob("*.ipynb")), ids=lambda p: p.stem)
def test_cells_of_the_notebook_run(notebook, folder):
    pytest.importorskip("matplotlib")
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    namespace: dict = {"__name__": notebook.stem}
    for cell in cells:
        assert cell.get("outputs", []) == [], f"{cell['id']}: output that may be outdated"
        if cell["cell_type"] == "code":
            exec(
                compile("".join(cell["source"]), f"{notebook.name}:{cell['id']}", "exec"), namespace
            )


def name(page: Path) -> str:
    return page.stem


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_blocks_of_the_page_run(page, folder):
    if any("docs" in str(page) and b.language == "python" for b in blocks(page)):
        pytest.importorskip("xarray")
    run_page(page, folder, slow=False)


@pytest.mark.validation
@pytest.mark.parametrize(
    "page", [p for p in PAGES if any("slow" in b.said for b in blocks(p))], ids=name
)
def test_slow_blocks_of_the_page_run(page, folder):
    run_page(page, folder, slow=True)


def test_blocks_that_are_not_run_say_why(capsys):
    every = [block for page in PAGES for block in blocks(page)]
    left = [block for block in every if "not run" in block.said]
    slow = [block for block in every if "slow" in block.said and "not run" not in block.said]
    with capsys.disabled():
        print(f"\n{len(every)} blocks in the documentation, {len(left)} not run:")
        for block in left:
            print(f"  {block.place} ({block.language}): {block.said['not run']}")
        print(f"{len(slow)} run in `make validate` only")
        for block in every:
            if "needs" in block.said:
                print(f"  {block.place}: run where {block.said['needs']} is installed")
    for block in every:
        assert block.language, f"{block.place}: no language"
        assert block.said.get("not run", "because") != "", f"{block.place}: no reason"
    for page in PAGES:  # an indented block has no language to be run by
        indented = INDENTED.search(FENCE.sub("", page.read_text(encoding="utf-8")))
        assert indented is None, f"{page.name}: {indented}"
    assert len(every) == sum(len(re.findall(r"^ *```\S", p.read_text(), re.M)) for p in PAGES)


def test_the_generated_pages_are_up_to_date(capsys):
    spec = importlib.util.spec_from_file_location("pages", ROOT / "scripts" / "reference_pages.py")
    pages = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(pages)
    assert pages.run(check=True) == 0, capsys.readouterr().out


def written_by_hand(page: Path) -> list[str]:
    """The lines of a page without blocks, tables, formulas and generated parts."""
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    for part in (r"<!-- generated.*?<!-- end -->", r"^\$\$$.*?^\$\$$"):
        text = re.sub(part, "", text, flags=re.DOTALL | re.MULTILINE)
    return [line for line in text.splitlines() if not line.startswith(("|", "<!--"))]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_lines_of_the_page_are_short_enough_to_compare_versions(page):
    assert [line for line in written_by_hand(page) if len(line) > MAX_LINE] == []


@pytest.mark.parametrize(
    ("text", "loads"),
    [
        ('<script src="https://example.org/a.js">', True),
        ("<link rel=stylesheet href=//example.org/a.css>", True),
        ('@import "https://example.org/a.css";', True),
        ('<a href="https://example.org">', False),
        ('<img src="figures/a.png">', False),
        ("url(data:image/svg+xml;utf8,<svg xmlns='http://www.w3.org/2000/svg'/>)", False),
    ],
)
def test_the_site_build_finds_what_is_loaded_from_another_host(text, loads, monkeypatch):
    pytest.importorskip("mkdocs")
    monkeypatch.syspath_prepend(ROOT / "scripts")
    site_hooks = importlib.import_module("site_hooks")
    assert bool(site_hooks.outside(text)) is loads


@pytest.mark.parametrize("script", SCRIPTS, ids=name)
def test_every_name_that_a_script_imports_exists(script):
    for node in ast.walk(ast.parse(script.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("gfmd_cli"):
            module = importlib.import_module(node.module)
            for alias in node.names:
                if not hasattr(module, alias.name):
                    importlib.import_module(f"{node.module}.{alias.name}")
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("paper."):
            there = ROOT / "scripts" / f"{node.module.replace('.', '/')}.py"
            for alias in node.names:
                assert re.search(rf"\b{alias.name}\b", there.read_text(encoding="utf-8"))


def test_every_name_that_the_page_on_the_api_lists_exists():
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    lists = re.findall(r"^::: (\S+)\n(?: {4}.*\n)*? +members: \[(.*)\]", page, re.MULTILINE)
    assert lists
    for module, members in lists:
        for member in members.split(", "):
            assert hasattr(importlib.import_module(module), member), f"{module}.{member}"


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_file_that_the_page_names_exists(page):
    quoted = re.findall(r"`([^`\n]+)`", FENCE.sub("", page.read_text(encoding="utf-8")))
    named = {path for text in quoted for path in PATHS.findall(text)}
    folders = (ROOT, ROOT / "gfmd_cli")
    assert {path for path in named if not any((f / path).exists() for f in folders)} == set()


def anchors(page: Path) -> set[str]:
    """The anchors of the headings of a page, as GitHub forms them; mkdocs checks its own."""
    titles = re.findall(r"^#+ (.*)$", FENCE.sub("", page.read_text(encoding="utf-8")), re.M)
    return {re.sub(r"[^a-z0-9_ -]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_link_of_the_page_leads_to_a_file_and_a_heading(page):
    for path, anchor in LINK.findall(FENCE.sub("", page.read_text(encoding="utf-8"))):
        file = page.parent / path if path else page
        assert file.exists(), path
        assert not anchor or anchor in anchors(file), f"{path}#{anchor}"


def test_every_page_that_the_code_names_exists():
    code = [*(ROOT / "gfmd_cli").rglob("*.py"), *SCRIPTS, *(ROOT / "tests").rglob("*.py")]
    texts = [file.read_text(encoding="utf-8") for file in code]
    named = {page for text in texts for page in re.findall(r"\bdocs/[\w-]+\.md\b", text)}
    assert {page for page in named if not (ROOT / page).exists()} == set()


def test_every_test_file_that_the_makefile_names_exists():
    text = (ROOT / "Makefile").read_text(encoding="utf-8").replace("\\\n", " ")
    (words,) = re.findall(r"^SOLVING := (.*)$", text, re.MULTILINE)
    named = set(words.split())
    assert {word for word in named if not (ROOT / f"tests/test_{word}.py").exists()} == set()


@pytest.mark.parametrize(
    ("shown", "printed", "same"),
    [
        ("0.1234", "0.1236", True),
        ("0.1234", "0.1244", False),
        ("7.2e-07", "4.0e-06", True),
        ("6.1035e-05", "9.1035e-05", False),
        ("p*=0.1", "p*=0.1", True),
        ("n=1", "n=3", False),
        ("converged", "missing", False),
    ],
)
def test_numbers_are_compared_to_their_last_digits(shown, printed, same):
    assert same_token(shown, printed) is same


def test_dots_stand_for_any_lines():
    assert matches(["a", "...", "d"], ["a", "b", "c", "d"])
    assert not matches(["a", "...", "e"], ["a", "b", "c", "d"])
    assert not matches(["a"], ["a", "b"])


def test_the_citation_names_this_version():
    version = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    assert version is not None
    assert version[1] == gfmd_cli.__version__
