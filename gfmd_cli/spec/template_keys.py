"""Keys that are set in the text of a commented run spec, which keeps its order and comments."""

import json
import re
import tomllib
from typing import Any

from gfmd_cli.errors import InputError
from gfmd_cli.spec.models import LOADS
from gfmd_cli.spec.parse import kinds_of, set_override, split_override

COMMENT = "as given on the command line"
COLUMN = 27  # characters before a comment


def with_keys(text: str, overrides: tuple[str, ...]) -> str:
    """The text of a spec with "key.name=value" each, as `gfmd run --set` takes them.

    A key takes the place of the line that has it, or of the line where it is commented out; keys
    that do not go with it are removed. A whole table takes the place of all its keys; the tables
    [[sweep]] become a list before all others. Raises InputError for any other form.
    """
    lines = text.splitlines()
    for override in overrides:
        (table, *keys), _ = split_override(override)
        data = tomllib.loads("\n".join(lines))
        set_override(data, override)
        values = data[table]
        if table == "sweep" and not keys:
            lines = [line for line in lines if not line.startswith("sweep = ")]
            first = min(i for i, line in enumerate(lines) if _header(line))
            lines[first:first] = [f"sweep = {_as_toml(values)} # {COMMENT}", ""]
            continue
        if not isinstance(values, dict):
            raise InputError(f"--set {override}: write table.key=value, such as grid.points=128")
        if not keys:
            first, last = _span(lines, table)
            lines[first:last] = [line for line in lines[first:last] if not _key(line)]
        for key in keys[:1] or values:
            _set_key(lines, table, key, _as_toml(values[key]))
    return "\n".join(lines) + "\n"


def _as_toml(value: Any) -> str:
    """A value as it stands in TOML."""
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {_as_toml(inner)}' for key, inner in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(_as_toml, value))}]"
    if isinstance(value, float):
        short = f"{value:g}"
        text = short if float(short) == value else repr(value)
        return re.sub(r"e\+?(-?)0*", r"e\1", text)  # 7e10 and not 7e+10
    return json.dumps(value, ensure_ascii=False, default=str)


def _set_key(lines: list[str], table: str, key: str, value: str) -> None:
    """Set one key of a table, which is made where it is missing."""
    first, last = _span(lines, table)
    for place in reversed(range(first, last)):
        if _does_not_go_with(table, key, value, _key(lines[place])):
            del lines[place]
    first, last = _span(lines, table)
    line = f"{f'{key} = {value}':{COLUMN}} # {COMMENT}"
    places = [i for i in range(first, last) if key in (_key(lines[i]), _key(lines[i].lstrip("#")))]
    if places:
        lines[places[0]] = line
    else:
        while last > first and not lines[last - 1].strip():
            last -= 1
        lines.insert(last, line)


def _span(lines: list[str], table: str) -> tuple[int, int]:
    """First line after the header of a table, and the first line beyond the table."""
    headers = [(i, match[1]) for i, line in enumerate(lines) if (match := _header(line))]
    for (place, name), (end, _) in zip(headers, [*headers[1:], (len(lines), "")], strict=True):
        if name == table:
            lines[place] = f"[{table}]"
            return place + 1, end
    lines += ["", f"[{table}]"]
    return len(lines), len(lines)


def _header(line: str) -> "re.Match[str] | None":
    """The name of the table that a line begins, commented out or not."""
    return re.match(r"#?\[(\w+)\]\s*$", line)


def _key(line: str) -> str:
    """The key of a line, "" where it has none."""
    match = re.match(r"(\w+) = ", line)
    return match[1] if match else ""


def _does_not_go_with(table: str, key: str, value: str, other: str) -> bool:
    """Whether the key `other` of a table has to go when `key` is set to a value."""
    if other in ("", key):
        return False
    if table == "load":
        return key in LOADS and other in LOADS
    kinds = kinds_of(table) if key == "kind" else {}
    chosen = kinds.get(value.strip("'\""))
    return chosen is not None and other not in chosen.model_fields
