"""The generated parts of the reference: keys of the run spec, commands, columns of a study.

    python scripts/reference_pages.py

A page keeps what is written by hand; between `<!-- generated: NAME -->` and `<!-- end -->` stands
what NAME makes. The JSON Schema of the run spec is written too. With --check the files are
compared instead.
"""

import argparse
import inspect
import json
import re
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click
from click.testing import CliRunner

from gfmd_cli.cli import main
from gfmd_cli.spec.check import DEFAULT_KINDS, MODELS, REQUIRED, kinds_of
from gfmd_cli.spec.models import SWEPT, GeometricSequence
from gfmd_cli.spec.schema import spec_schema
from gfmd_cli.study.column import Column
from gfmd_cli.study.columns import (
    AUTOCORRELATIONS,
    DETAIL_COLUMNS,
    FIELDS,
    HISTOGRAMS,
    MAIN_COLUMNS,
    PARAMETER_COLUMNS,
    SHELLS,
    SPECTRA,
    WEIGHTS,
)

DOCS = Path(__file__).parents[1] / "docs"
CONFIGS = DOCS.parent / "configs"
SCHEMA = DOCS.parent / "gfmd_cli" / "run-spec.schema.json"
PAGES = ("configuration.md", "commands.md", "study-file.md")
WIDTH = "100"  # columns of a help text
PART = re.compile(r"(<!-- generated: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
NAMES = {
    "number": "number",
    "integer": "whole number",
    "string": "text",
    "boolean": "true or false",
}
LIMITS = (
    ("exclusiveMinimum", "> {}"),
    ("minimum", "≥ {}"),
    ("exclusiveMaximum", "< {}"),
    ("maximum", "≤ {}"),
    ("multipleOf", "a multiple of {}"),
)


def escaped(text: str) -> str:
    """Text that Markdown prints as it is, on one line and in a table."""
    plain = " ".join(text.split()).replace("&", "&amp;").replace("<", "&lt;")
    parts = re.split(r"(`[^`]*`)", plain)
    shown = [part if part[:1] == "`" else re.sub(r"([*_\[\]])", r"\\\1", part) for part in parts]
    return "".join(shown).replace("|", "\\|")


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table of cells that are Markdown already."""
    lines = [list(head), *map(list, rows)]
    lines.insert(1, ["---"] * len(lines[0]))
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def toml(value: Any) -> str:
    """A default as it is written in TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, float):
        return f"{value:g}"
    return str(value)


def allowed(schema: dict[str, Any], shared: dict[str, Any]) -> str:
    """What a key takes, in words."""
    if "$ref" in schema:
        return allowed(shared[schema["$ref"].rpartition("/")[2]], shared)
    if "anyOf" in schema or "oneOf" in schema:
        forms = schema.get("anyOf", schema.get("oneOf", []))
        options = [allowed(form, shared) for form in forms if form.get("type") != "null"]
        return "; or ".join(dict.fromkeys(options))
    if "const" in schema:
        return f"`{toml(schema['const'])}`"
    if "enum" in schema:
        return ", ".join(f"`{toml(value)}`" for value in schema["enum"])
    if schema.get("type") == "array":
        return f"list of: {allowed(schema['items'], shared)}"
    if schema.get("type") == "object":
        return f"`{{ {', '.join(schema['properties'])} }}`"
    if schema.get("format") == "path":
        return "path"
    kind = NAMES[schema["type"]]
    if "pattern" in schema:
        return f"{kind}: letters, digits, `.`, `_`, `-`"
    limits = [options.format(amount(schema[key])) for key, options in LIMITS if key in schema]
    return escaped(", ".join([kind, *limits]))


def amount(limit: float) -> str:
    """A limit, large powers of two as such."""
    power = int(limit).bit_length() - 1
    return f"2^{power}" if power > 16 and limit == 2**power else f"{limit:.10g}"


def keys(model: Any, shared_by: Any = None) -> str:
    """The keys of one model, without those of a kind whose keys all other kinds have."""
    schema = model.model_json_schema()
    shared, rows = schema.get("$defs", {}), []
    for name, key in schema["properties"].items():
        if name == "kind" or (shared_by and name in shared_by.model_fields):
            continue
        field = next(f for n, f in model.model_fields.items() if name in (n, f.alias))
        value = field.get_default(call_default_factory=True)
        default = "required" if field.is_required() else "" if value is None else f"`{toml(value)}`"
        meaning = escaped(key.get("description", ""))
        rows.append((f"`{name}`", allowed(key, shared), default, meaning))
    if shared_by:
        known = f"The keys of solver `{shared_by.model_fields['kind'].default}`"
        if not rows:
            return f"{known}."
        return f"{known}, and:\n\n" + table(("key", "value", "default", "meaning"), rows)
    return table(("key", "value", "default", "meaning"), rows) if rows else "No keys but `kind`."


def about(model: Any) -> str:
    """The docstring of a class, as paragraphs."""
    return "\n\n".join(escaped(part) for part in inspect.cleandoc(model.__doc__).split("\n\n"))


def configuration() -> str:
    """Every table of the run spec."""
    parts = []
    for name, model in MODELS.items():
        needed = "Required." if name in REQUIRED else "Optional."
        swept = " A list in the place of a value makes a sweep." if name in SWEPT else ""
        default = f' Default `kind`: "{kind}".' if (kind := DEFAULT_KINDS.get(name)) else ""
        parts.append(f"## [{name}]\n\n{needed}{swept}{default}")
        shared = kinds_of(name).get(DEFAULT_KINDS.get(name, ""))
        for kind, choice in kinds_of(name).items():
            listed = keys(choice) if choice is shared else keys(choice, shared)
            parts += [f'### {name}: "{kind}"', about(choice), listed]
        if not kinds_of(name):
            text = re.sub(r"^Table \\\[\w+\\\](: |\.)", "", about(model))
            parts += [text[:1].upper() + text[1:], keys(model)]
        if name == "load":
            parts += [
                "### load: a geometric sequence",
                about(GeometricSequence),
                keys(GeometricSequence),
            ]
    return "\n\n".join(part for part in parts if part)


def commands() -> str:
    """The help of every command."""
    parts = []
    for words in ([], *([name] for name in main.list_commands(click.Context(main)))):
        title, command = " ".join(["gfmd", *words]), [*words, "--help"]
        done = CliRunner().invoke(main, command, env={"COLUMNS": WIDTH}, prog_name="gfmd")
        parts.append(f"## {title}\n\n```console\n$ {title} --help\n{done.output.rstrip()}\n```")
    return "\n\n".join(parts)


def examples() -> str:
    """The specs of configs/ and their descriptions, the comments in their first lines."""
    rows = []
    for path in sorted(CONFIGS.glob("*.toml")):
        text = path.read_text(encoding="utf-8").partition("[study]")[0]
        comments = " ".join(line.lstrip("# ") for line in text.splitlines())
        rows.append((f"`configs/{path.name}`", escaped(comments)))
    return table(("spec", "content"), rows)


KINDS = {str: "text", int: "whole number", float: "number"}


def columns(listed: Iterable[Column]) -> str:
    """Columns with their units."""
    rows = [
        (f"`{c.name}`", KINDS[c.kind], escaped(c.units or "-"), escaped(c.meaning)) for c in listed
    ]
    return table(("name", "type", "unit", "meaning"), rows)


def parameters() -> str:
    """The columns of keys of a run spec, with these keys."""
    rows = [
        (f"`{c.name}`", KINDS[c.kind], escaped(c.units or "-"), f"`{c.meaning.partition(':')[0]}`")
        for c in PARAMETER_COLUMNS
    ]
    return table(("name", "type", "unit", "key"), rows)


def distributions() -> str:
    """Densities in bins, and the fractions outside the bins."""
    rows = [
        (
            f"`{h.name}`",
            f"`{h.axis}`",
            f"`{h.output_key}`",
            escaped(h.meaning),
            escaped(h.axis_meaning),
        )
        for h in HISTOGRAMS
    ]
    densities = table(
        ("name", "bins", "key of `[output]`", "meaning", "coordinate of the bins"), rows
    )
    return f"{densities}\n\n{columns(c for weights in WEIGHTS.values() for c in weights)}"


MAKERS = {
    "configuration": configuration,
    "examples": examples,
    "commands": commands,
    "contract": lambda: columns(MAIN_COLUMNS),
    "details": lambda: columns(DETAIL_COLUMNS),
    "parameters": parameters,
    "distributions": distributions,
    "scenes": lambda: columns(SHELLS),
    "fields": lambda: columns(FIELDS),
    "spectra": lambda: columns(SPECTRA),
    "autocorrelations": lambda: columns(AUTOCORRELATIONS),
}


def renewed(text: str) -> str:
    """A page with its generated parts made anew."""
    return PART.sub(lambda part: f"{part[1]}\n{MAKERS[part[2]]()}\n\n{part[3]}", text)


def generated() -> dict[Path, str]:
    """What each generated file is to hold: the pages, and the JSON Schema of the run spec."""
    pages = {DOCS / name: renewed((DOCS / name).read_text(encoding="utf-8")) for name in PAGES}
    return pages | {SCHEMA: json.dumps(spec_schema(), indent=2) + "\n"}


def run(check: bool) -> int:
    """Write the files, or name those that are out of date; the exit status."""
    stale = 0
    for path, text in generated().items():
        name = path.relative_to(DOCS.parent)
        if path.read_text(encoding="utf-8") == text:
            continue
        if check:
            print(f"{name}: out of date; python scripts/reference_pages.py writes it")
            stale = 1
        else:
            path.write_text(text, encoding="utf-8")
            print(f"{name}: written")
    return stale


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true")
    sys.exit(run(parser.parse_args().check))
