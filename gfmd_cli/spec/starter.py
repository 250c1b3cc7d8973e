"""Commented run specs that `gfmd init` writes from templates; they run in seconds."""

import json
from math import log10
from os.path import relpath
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from gfmd_cli.physics.contact import build_scene
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.spec.boundary import with_boundary
from gfmd_cli.spec.parse import read_elastomer, read_text
from gfmd_cli.spec.template_keys import with_keys

E_STAR = 2e9  # Pa, a stiff polymer


def starter(path: Path, overrides: tuple[str, ...] = ()) -> str:
    """The spec of a random surface, for the file `path`, with "table.key=value" each.

    Raises InputError where the result is no valid spec.
    """
    text = with_keys(_render("study.toml", path.name, remarks=[]), overrides)
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
        level=surface.treatment()[0],
        sides=" x ".join(sides),
        h_std=scene.h_std,
        delta_sigma=scene.delta_sigma,
        E_star=E_STAR,
        points=points,
        is_finer=points > surface.smallest_grid() // surface.copies,
        low=low,
        high=high,
        remarks=surface.remarks(),
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
    environment.globals["key"] = _key
    return environment.get_template(template).render(file=file, name=Path(file).stem, **values)


def _key(name: str, value: Any, comment: str) -> str:
    """A line of TOML; JSON has the same strings, numbers and truth values."""
    return f"{f'{name} = {json.dumps(value, ensure_ascii=False)}':27} # {comment}"
