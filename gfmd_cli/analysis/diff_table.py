"""The differences of two studies: as tables, as records."""

import json
from typing import Any

from gfmd_cli.analysis.compare import Row
from gfmd_cli.analysis.diff import Deviation, Difference, Pair
from gfmd_cli.analysis.table import BLANK, Column, Record, Table, groups_of, known, plain
from gfmd_cli.physics.observables import QUANTITIES
from gfmd_cli.study.tasks import SYMBOLS

LEGEND = (
    "Relative differences (B - A) / max(|A|, |B|); in brackets: in units of the combined error bar."
)
NOTHING = "no contact in common"
DIFFERENCES = (
    Column("load", "load"),
    Column("points", "points"),
    *(Column(name, name) for name in QUANTITIES),
)
CONTACT = ("surface", "seed", "elastomer", "load", "load_value")
"""Keys that both rows of a pair share, unless the studies are paired by load."""


def diff_table(found: Difference) -> Table:
    """The pairs of contacts, grouped by what is compared."""
    groups = groups_of((_title(pair), _record(pair)) for pair in found.pairs)
    caption = f"{found.paired}. {LEGEND}" if found.paired else LEGEND
    return Table(caption, DIFFERENCES, groups)


def diff_text(found: Difference) -> str:
    """The table, the rows of one study only, and the keys of the specs that differ."""
    lists = ("\n".join([f"{title}:", *lines]) for title, lines in diff_lists(found).items())
    return "\n\n".join([diff_table(found).as_text() or NOTHING, *lists])


def diff_lists(found: Difference) -> dict[str, list[str]]:
    """Rows that one study alone has, and the keys of the specs that differ: lines by title."""
    lists = {
        f"only in {which}": _listed(rows) for which, rows in zip("AB", found.only, strict=True)
    }
    lists["specs, A -> B"] = [f"  {line}" for line in found.spec]
    return {title: lines for title, lines in lists.items() if lines}


def diff_json(found: Difference) -> str:
    """The same as JSON; what does not apply is null."""
    return json.dumps(
        {
            "rows": [_as_json(pair) for pair in found.pairs],
            "only_a": [_of_one_study(row) for row in found.only[0]],
            "only_b": [_of_one_study(row) for row in found.only[1]],
            "spec": found.spec,
            "paired": found.paired,
        },
        indent=1,
    )


def _title(pair: Pair) -> str:
    one, other = _name(pair.one), _name(pair.other)
    return one if one == other else f"A: {one}\nB: {other}"


def _record(pair: Pair) -> Record:
    cells = {name: _cell(pair.deviation(name)) for name in QUANTITIES}
    points = f"{pair.one['points']} -> {pair.other['points']}"
    return {"load": _load(pair.one), "points": points, **cells}


def _as_json(pair: Pair) -> dict[str, Any]:
    record = {key: plain(pair.one[key]) for key in CONTACT}
    for key in ("points", "p_star", *QUANTITIES):
        record |= {f"{key}_a": plain(pair.one[key]), f"{key}_b": plain(pair.other[key])}
    for name in QUANTITIES:
        deviation = pair.deviation(name)._asdict()
        record |= {f"{name}_{what}": plain(value) for what, value in deviation.items()}
    return record


def _of_one_study(row: Row) -> dict[str, Any]:
    return {key: plain(row[key]) for key in (*CONTACT, "points", "p_star")}


def _name(row: Row) -> str:
    return f"{row['elastomer']} on {row['surface']}"


def _listed(rows: list[Row]) -> list[str]:
    """Loads grouped by scene, a line for each grid."""
    scenes: dict[str, dict[int, list[str]]] = {}
    for row in rows:
        scenes.setdefault(_name(row), {}).setdefault(row["points"], []).append(_load(row))
    return [
        line
        for name, grids in scenes.items()
        for line in (f"  {name}", *(f"    {n}: {', '.join(loads)}" for n, loads in grids.items()))
    ]


def _cell(deviation: Deviation) -> str:
    relative, in_errors = deviation
    bars = f" ({in_errors:+.1f})" if known(in_errors) else ""
    return (f"{relative:+.2e}" if known(relative) else BLANK) + bars


def _load(row: Row) -> str:
    if not row["load"]:
        return f"p*={row['p_star']:.4g}"
    return f"{SYMBOLS.get(row['load'], row['load'])}={row['load_value']:.4g}"
