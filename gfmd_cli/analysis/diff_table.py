"""The differences of two studies: as tables, as records."""

import json
from functools import partial
from typing import Any

from gfmd_cli.analysis.compare import with_solvers
from gfmd_cli.analysis.diff import Difference, Pair
from gfmd_cli.analysis.selection import grouped
from gfmd_cli.analysis.table import BLANK, Record, Table, TableColumn, groups_of, known, plain
from gfmd_cli.analysis.wording import contact_title
from gfmd_cli.physics.observables import QUANTITIES
from gfmd_cli.spec.models import load_text
from gfmd_cli.study.column import Row

LEGEND = (
    "Relative differences (B - A) / max(|A|, |B|); in brackets: in units of the combined error bar."
)
NOTHING = "no contact in common"
CONTACT = ("surface", "seed", "elastomer", "load", "load_value")
"""Keys that both rows of a pair share, unless the studies are paired by load."""
ONE_STUDY = (*CONTACT, "boundary", "points", "p_star")
"""Keys of a row that one study alone has."""


def _load(record: Record) -> str:
    return load_text(record["load"], record["load_value"])


def _deviation(record: Record, name: str) -> str:
    relative, in_errors = record[f"{name}_relative"], record[f"{name}_in_errors"]
    bars = f" ({in_errors:+.1f})" if known(in_errors) else ""
    return (f"{relative:+.2e}" if known(relative) else BLANK) + bars


DIFFERENCES = (
    TableColumn("load", _load),
    TableColumn("points", lambda record: f"{record['points_a']} -> {record['points_b']}"),
    *(TableColumn(name, partial(_deviation, name=name)) for name in QUANTITIES),
)


def diff_table(difference: Difference) -> Table:
    """The pairs of contacts, grouped by what is compared."""
    pairs = difference.pairs
    titles = with_solvers(map(_title, pairs), [pair.one for pair in pairs])
    groups = groups_of(zip(titles, map(_record, pairs), strict=True))
    caption = f"{difference.paired}. {LEGEND}" if difference.paired else LEGEND
    return Table(caption, DIFFERENCES, groups)


def diff_text(difference: Difference) -> str:
    """The table, the rows of one study only, and the keys of the specs that differ."""
    lists = ("\n".join([f"{title}:", *lines]) for title, lines in diff_lists(difference).items())
    return "\n\n".join([diff_table(difference).as_text() or _nothing(difference), *lists])


def _nothing(difference: Difference) -> str:
    """That there is no pair, and the kinds of loads if they differ."""
    one, other = (sorted({str(row["load"]) for row in rows}) for rows in difference.only)
    if set(one) & set(other) or not (one and other):
        return NOTHING
    return (
        f"{NOTHING}: the loads of A are given by {', '.join(one)}, those of B by "
        f"{', '.join(other)}, and only loads of the same key are compared"
    )


def diff_lists(difference: Difference) -> dict[str, list[str]]:
    """Rows that one study alone has, and the keys of the specs that differ: lines by title."""
    lists = {
        f"only in {which}": _loads_by_contact(rows)
        for which, rows in zip("AB", difference.only, strict=True)
    }
    sides = [pair.one for pair in difference.pairs], [pair.other for pair in difference.pairs]
    for which, side in zip("AB", sides, strict=True):
        rows = [row for row in side if not row["status"].is_converged]
        lists[f"compared, but not converged in {which}"] = _loads_by_contact(rows)
    lists["specs, A -> B"] = [f"  {line}" for line in difference.spec]
    return {title: lines for title, lines in lists.items() if lines}


def diff_json(difference: Difference) -> str:
    """The same as JSON; what does not apply is null."""
    return json.dumps(
        {
            "rows": [_json_values(_record(pair)) for pair in difference.pairs],
            "only_a": [_json_values(row, *ONE_STUDY) for row in difference.only[0]],
            "only_b": [_json_values(row, *ONE_STUDY) for row in difference.only[1]],
            "spec": difference.spec,
            "paired": difference.paired,
        },
        indent=1,
    )


def _title(pair: Pair) -> str:
    one, other = _contact(pair.one), _contact(pair.other)
    return one if one == other else f"A: {one}\nB: {other}"


def _contact(row: Row) -> str:
    """Elastomer and surface of a contact, and its boundary where that is free."""
    return contact_title(row) + (", free boundary" if row["boundary"] == "free" else "")


def _record(pair: Pair) -> Record:
    """Both values of what is compared, as `a_r_a` and `a_r_b`, their unit, and how far apart."""
    record = {key: pair.one[key] for key in CONTACT}
    for key in ("boundary", "points", "p_star"):
        record |= {f"{key}_a": pair.one[key], f"{key}_b": pair.other[key]}
    for name in QUANTITIES:
        a, b = pair.values(name)
        record |= {f"{name}_a": a, f"{name}_b": b, f"{name}_unit": pair.unit(name)}
        deviation = pair.deviation(name)._asdict()
        record |= {f"{name}_{what}": value for what, value in deviation.items()}
    return record


def _json_values(record: Record, *keys: str) -> dict[str, Any]:
    """These keys of a record as JSON has them; without any all of them."""
    return {key: plain(record[key]) for key in keys or record}


def _loads_by_contact(rows: list[Row]) -> list[str]:
    """Loads grouped by scene, a line for each grid."""
    lines = []
    for name, scene in grouped(rows, _contact).items():
        grids = grouped(scene, lambda row: row["points"])
        loads = {points: ", ".join(map(_load, grid)) for points, grid in grids.items()}
        lines += [f"  {name}", *(f"    {points}: {text}" for points, text in loads.items())]
    return lines
