"""Commented run specs that `gfmd init` writes from templates; they run in seconds."""

import json
import re
import shlex
import tomllib
from math import log10
from os.path import relpath
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from gfmd_cli.errors import InputError
from gfmd_cli.physics.contact import build_scene
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.spec.check import kinds_of
from gfmd_cli.spec.models import LOADS, with_boundary
from gfmd_cli.spec.parse import read_elastomer, read_text, set_override, split_override

E_STAR = 2e9  # Pa, a stiff polymer
COMMENT = "as given on the command line"
COLUMN = 27  # characters before a comment


def starter(path: Path, overrides: tuple[str, ...] = ()) -> str:
    """The spec of a random surface, for the file `path`, with "table.key=value" each.

    Raises InputError where the result is no valid spec.
    """
    text = with_keys(_render("study.toml", path.name, warnings=[]), overrides)
    read_text(text, path, overrides)
    return text


def starter_of_scan(
    path: Path, surface: FileSurface, overrides: tuple[str, ...] = ()
) -> tuple[str, str]:
    """The spec of a measured surface, for the file `path`, and how the map is prepared.

    The pressures run from p* = 0.003 to 0.3. Raises InputError if the scan cannot be used.
    """
    elastomer = read_elastomer({"kind": "half-space", "E_star": E_STAR}, overrides)
    repeated = surface.within("periodic")
    scene = build_scene(repeated, elastomer, repeated.smallest_grid())
    sides = dict.fromkeys(f"{side / surface.copies:.4g}" for side in reversed(surface.sides))
    low, high = (round(log10(p_star * scene.delta_sigma)) for p_star in (0.003, 0.3))
    points = surface.own_points()
    text = _render(
        "scan.toml",
        path.name,
        scan="".join(c if c.isprintable() else "?" for c in surface.path.name),  # one comment line
        path=relpath(surface.path, path.parent),
        dataset=surface.dataset,
        holes=surface.holes(),
        missing=surface.missing,
        level=surface.level or (None if surface.levelling() == "none" else surface.levelling()),
        sides=" x ".join(sides),
        h_std=scene.h_std,
        delta_sigma=scene.delta_sigma,
        E_star=E_STAR,
        points=points,
        is_finer=points > surface.smallest_grid() // surface.copies,
        low=low,
        high=high,
        warnings=surface.warnings(),
    )
    text = with_keys(text, overrides)
    spec = read_text(text, path, overrides)
    used, grid = with_boundary(spec.surface[0], spec.elastomer[0], spec.grid[0], spec.solver[0])
    return text, used.preparation(grid.boundary or "")


def _render(template: str, file: str, **values: Any) -> str:
    """A template filled in, for a spec of the name `file`."""
    environment = Environment(  # TOML, where HTML is not to be escaped
        loader=PackageLoader("gfmd_cli.spec"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.globals["key"] = lambda name, value, comment: _line(name, _json(value), comment)
    name = re.sub(r"[^a-zA-Z0-9._-]+", "-", Path(file).stem).strip("-._")[:100]
    return environment.get_template(template).render(
        file=shlex.quote(file), name=name or "study", **values
    )


def _line(key: str, value: str, comment: str) -> str:
    return f"{f'{key} = {value}':{COLUMN}} # {comment}"


def _json(value: Any) -> str:
    """Strings, numbers and truth values are the same in JSON and TOML."""
    return json.dumps(value, ensure_ascii=False, default=str)


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
    return _json(value)


def _set_key(lines: list[str], table: str, key: str, value: str) -> None:
    """Set one key of a table, which is made where it is missing."""
    first, last = _span(lines, table)
    for place in reversed(range(first, last)):
        if _does_not_go_with(table, key, value, _key(lines[place])):
            del lines[place]
    first, last = _span(lines, table)
    line = _line(key, value, COMMENT)
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
    model = kinds.get(value.strip("'\""))
    return model is not None and other not in model.model_fields
