"""Keys that are set in the text of a commented run spec, which keeps its order and comments."""

import json
import re
import tomllib

from gfmd_cli.errors import InputError
from gfmd_cli.spec.models import LOADS
from gfmd_cli.spec.parse import kinds_of

COMMENT = "as given on the command line"
OPTIONAL = ("accuracy",)  # tables that are commented out as a whole
COLUMN = 27  # characters before a comment


def with_keys(text: str, overrides: tuple[str, ...]) -> str:
    """The text of a spec with "table.key=value" each, the value in TOML or a bare word.

    A key takes the place of the line that has it, or of the line where it is commented out; keys
    that do not go with it are removed. Raises InputError for any other form.
    """
    lines = text.splitlines()
    for override in overrides:
        name, _, value = override.partition("=")
        table, _, key = name.strip().partition(".")
        if not re.fullmatch(r"\w+", table) or not re.fullmatch(r"\w+", key):
            raise InputError(f"--set {override}: write table.key=value, such as grid.points=128")
        _set_key(lines, table, key, _as_toml(value.strip()))
    return "\n".join(lines) + "\n"


def _as_toml(value: str) -> str:
    """A value as it stands in TOML, a bare word in quotes."""
    try:
        tomllib.loads(f"value = {value}")
    except tomllib.TOMLDecodeError:
        return json.dumps(value, ensure_ascii=False)
    return value


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
