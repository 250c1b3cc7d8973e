"""Commented run specs that `gfmd init` writes from templates; they run in seconds."""

import json
import re
import tomllib
from math import log10
from os.path import relpath
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from gfmd_cli.errors import InputError, typed
from gfmd_cli.maps.map_warnings import unresolved
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.surface_spectrum import short_wave_factor
from gfmd_cli.spec.check import Check, kinds_of
from gfmd_cli.spec.models import Spec, with_boundary
from gfmd_cli.spec.parse import set_override, split_override
from gfmd_cli.spec_table import SpecTable

E_STAR = 2e9  # Pa, a stiff polymer
COMMENT = "as given on the command line"
COLUMN = 27  # characters before a comment


def starter(path: Path, overrides: tuple[str, ...]) -> str:
    """The spec of a random surface, for the file `path`, with overrides "table.key=value".

    Raises InputError where the result is not a valid spec.
    """
    text = with_keys(_render("study.toml", path.name, warnings=[]), overrides)
    _checked(text, path, overrides)
    return text


def starter_of_scan(
    path: Path, surface: FileSurface, overrides: tuple[str, ...]
) -> tuple[str, str, list[str]]:
    """The spec of a measured surface, for the file `path`.

    Also returned are how its runs prepare the map, and their warnings about it. The pressures run
    from p* = 0.003 to 0.3. Raises InputError if the scan cannot be used.
    """
    repeated = surface.within("periodic")
    sides = dict.fromkeys(f"{side / surface.copies:.4g}" for side in reversed(surface.sides))
    points = surface.own_points()

    def text(h_std: float, delta_sigma: float, elastomers: int, warnings: list[str]) -> str:
        low, high = (round(log10(p_star * delta_sigma)) for p_star in (0.003, 0.3))
        rendered = _render(
            "scan.toml",
            path.name,
            scan="".join(c if c.isprintable() else "?" for c in surface.path.name),  # one line
            path=relpath(surface.path, path.parent),
            dataset=surface.dataset,
            missing_count=surface.missing_count(),
            missing=surface.missing,
            level=surface.level or (None if surface.levelling() == "none" else surface.levelling()),
            sides=" x ".join(sides),
            h_std=h_std,
            delta_sigma=delta_sigma,
            elastomers=elastomers,
            E_star=E_STAR,
            points=points,
            is_finer=points > surface.smallest_grid() // surface.copies,
            low=low,
            high=high,
            warnings=warnings,
        )
        return with_keys(rendered, overrides)

    spec = _checked(text(1.0, 1.0, 1, []), path, overrides)
    used, grid = with_boundary(spec.surface[0], spec.elastomer[0], spec.grid[0], spec.solver[0])
    assert grid.boundary is not None
    warnings = used.warnings(grid.boundary)
    scene = build_scene(repeated, spec.elastomer[0], repeated.smallest_grid())
    finished = text(scene.h_std, scene.delta_sigma, len(spec.elastomer), warnings)
    _checked(finished, path, overrides)
    waves = unresolved(short_wave_factor(used, spec.elastomer[0]), used.period_limit())
    return finished, used.preparation(grid.boundary), [*warnings, *filter(None, [waves])]


def _checked(text: str, path: Path, overrides: tuple[str, ...]) -> Spec:
    """The spec of a text with overrides, by which messages name places: no file has it yet."""
    return Check(str(path), overrides=overrides, folder=path.parent).spec(tomllib.loads(text))


def _render(template: str, file: str, **values: Any) -> str:
    """A template filled in, for a spec of the name `file`."""
    environment = Environment(  # TOML, where HTML is not to be escaped
        loader=PackageLoader("gfmd_cli.spec"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.globals["key"] = _line
    name = re.sub(r"[^a-zA-Z0-9._-]+", "-", Path(file).stem).strip("-._")[:100]
    return environment.get_template(template).render(
        file=typed(file), name=name or "study", **values
    )


def _line(key: str, value: Any, comment: str) -> str:
    return f"{f'{key} = {_as_toml(value)}':{COLUMN}} # {comment}"


def with_keys(text: str, overrides: tuple[str, ...]) -> str:
    """The text of a spec with overrides "key.name=value", as `gfmd run --set` takes them.

    A key takes the place of the line that has it, or of the line where it is commented out; keys
    that do not go with it are removed. A whole table takes the place of all its keys; the tables
    [[sweep]] become a list before all others. Raises InputError for any other form.
    """
    data = tomllib.loads(text)
    given: dict[str, set[str]] = {}
    for override in overrides:
        set_override(data, override)
        (table, *keys), _ = split_override(override)
        if table == "sweep" and not keys:
            continue
        if not isinstance(data[table], dict):
            raise InputError(f"--set {override}: write table.key=value, such as grid.points=128")
        given.setdefault(table, set()).update(keys[:1] or data[table])
    first, *sections = re.split(r"^(?=#?\[\w+\]$)", text, flags=re.MULTILINE)
    if "sweep" in data and "sweep" not in given:
        first += f"sweep = {_as_toml(data['sweep'])} # {COMMENT}\n\n"
    by_table = {section[: section.index("]")].strip("#["): section for section in sections}
    for table, of_table in given.items():
        section = by_table.get(table, f"\n[{table}]\n").removeprefix("#")
        by_table[table] = _with_values(section, data[table], of_table, kinds_of(table))
    return first + "".join(by_table.values())


def _with_values(
    section: str, values: dict[str, Any], given: set[str], kinds: dict[str, type[SpecTable]]
) -> str:
    """The lines of a table with its values, those of the given keys in the place of others."""
    new = {key: _line(key, values[key], COMMENT) for key in values if key in given}
    kind = values.get("kind") if "kind" in given else None
    keys = kinds[kind].model_fields if isinstance(kind, str) and kind in kinds else None
    lines = []
    for line in section.rstrip().splitlines():
        match = re.match(r"(#?)(\w+) = ", line)
        if match and match[2] in new:
            lines.append(new.pop(match[2]))
        elif match is None or (
            (match[1] or match[2] in values) and (keys is None or match[2] in keys)
        ):
            lines.append(line)
    end = section[len(section.rstrip()) :]
    return "\n".join([*lines, *new.values()]) + end


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
    return json.dumps(value, ensure_ascii=False, default=str)  # the same in JSON and TOML
