"""Two studies side by side: what differs in their specs, and by how much their results do."""

import json
import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

from gfmd_cli.analysis.compare import load_of, with_solvers
from gfmd_cli.analysis.selection import grouped
from gfmd_cli.analysis.table import BLANK, Record, Table, TableColumn, groups_of, known, plain
from gfmd_cli.analysis.wording import contact_and_boundary, points_text
from gfmd_cli.physics.observables import MAIN_OBSERVABLES
from gfmd_cli.spec.differences import differences
from gfmd_cli.spec.models import LOADS, load_text
from gfmd_cli.study.column import Row
from gfmd_cli.study.reading import open_study, solved_rows, tell_files_apart
from gfmd_cli.units import count

SURFACE = ("surface", "surface_sha256", "seed")
"""Columns of a surface: two files may have the same name."""
ALIKE = (
    ("boundary", "points", "points_y", "solver", "tolerance"),
    ("boundary", "points", "points_y"), ("boundary", "points"), ("boundary",), ("points",), (),
)  # fmt: skip
"""Columns in which the rows of a pair are alike, in the order in which they are tried."""
LEGEND = (
    "Relative differences (B - A) / max(|A|, |B|); in brackets: in units of the combined error bar."
)
NOTHING = "no contact in common"
CONTACT = ("surface", "seed", "elastomer", "load", "load_value")
"""Keys that both rows of a pair share; of studies that are paired by load alone, those of A."""
OF_EACH = ("boundary", "points", "points_y", "p_star")
"""Keys that each row of a pair has for itself."""


class Deviation(NamedTuple):
    """How far two values lie apart."""

    relative: float
    """(B - A) / max(|A|, |B|); NaN where both are unknown, infinite where one is."""
    in_errors: float
    """(B - A) in units of the combined error bar; NaN where one of them has none."""


@dataclass(frozen=True)
class Pair:
    """One contact in both studies."""

    one: Row
    other: Row
    physical: bool = False
    """Whether stress and gap are compared in Pa and m: where the load is in SI units."""

    def values(self, name: str, suffix: str = "") -> tuple[float, float]:
        """A quantity in both studies, in the unit in which it is compared; "_error": its error."""
        unit_column = MAIN_OBSERVABLES[name].unit_column if self.physical else ""
        a, b = (
            float(row[name + suffix] * (row[unit_column] if unit_column else 1.0))
            for row in (self.one, self.other)
        )
        return a, b

    def deviation(self, name: str) -> Deviation:
        """How far a quantity of the second study lies from that of the first."""
        a, b = self.values(name)
        if math.isnan(a) or math.isnan(b):
            return Deviation(math.nan if math.isnan(a) and math.isnan(b) else math.inf, math.nan)
        error = math.hypot(*self.values(name, "_error"))
        in_errors = (b - a) / error if error > 0 else math.nan
        return Deviation((b - a) / max(abs(a), abs(b)) if a != b else 0.0, in_errors)

    @property
    def record(self) -> Record:
        """Both values of what is compared, as `a_r_a` and `a_r_b`, their unit, how far apart."""
        record = {key: self.one[key] for key in CONTACT}
        for key in OF_EACH:
            record |= {f"{key}_a": self.one[key], f"{key}_b": self.other[key]}
        for name, observable in MAIN_OBSERVABLES.items():
            a, b = self.values(name)
            unit = (self.physical and observable.si_unit) or "1"
            record |= {f"{name}_a": a, f"{name}_b": b, f"{name}_unit": unit}
            relative, in_errors = self.deviation(name)
            record |= {f"{name}_relative": relative, f"{name}_in_errors": in_errors}
        return record


@dataclass(frozen=True)
class Difference:
    """Two studies, row by row."""

    spec: list[str]
    """Keys of the specs that differ, a line each."""
    pairs: list[Pair]
    only: tuple[list[Row], list[Row]]
    """Rows that one of them alone has: of the first, of the second."""
    paired: str = ""
    """By what rows of different surfaces or elastomers are paired; empty where contacts match."""

    @property
    def largest(self) -> dict[str, float]:
        """The largest relative difference of each quantity; zero where nothing can be compared."""
        differing = {
            name: [abs(pair.deviation(name).relative) for pair in self.pairs]
            for name in MAIN_OBSERVABLES
        }
        return {name: max(filter(known, values), default=0.0) for name, values in differing.items()}

    def exceeds(self, tolerance: float) -> bool:
        """Whether some relative difference is larger; also where nothing can be compared."""
        return not self.pairs or max(self.largest.values()) > tolerance


def diff(one: Path, other: Path) -> Difference:
    """Match the rows of two studies by surface, seed, elastomer and load.

    Boundaries, grids and solvers may differ; of several rows, those of the same boundary, grid and
    solver belong together, then those that share fewer of these. If no rows match and each study
    presses one elastomer on one surface, rows belong together by their load alone. Raises
    InputError, StudyError.
    """
    with open_study(one) as a, open_study(other) as b:
        only = solved_rows(a.rows), solved_rows(b.rows)
        spec = differences(a.spec, b.spec)
    tell_files_apart([*only[0], *only[1]])
    pairs, paired = _matches(*only, _contact_of, load_of), ""
    if not pairs and all(len({_contact_of(row) for row in rows}) == 1 for rows in only):
        pairs = _matches(*only, load_of)
        paired = _pairing_note(pairs[0]) if pairs else ""
    return Difference(spec, pairs, only, paired)


def _contact_of(row: Row) -> tuple[Hashable, ...]:
    """Columns that identify surface and elastomer."""
    return (*(row[name] for name in SURFACE), row["elastomer"])


def _matches(one: list[Row], other: list[Row], *keys: Callable[[Row], Hashable]) -> list[Pair]:
    """Pairs of the same keys, alike in boundary, grid and solver if possible; from both lists."""
    pairs: list[Pair] = []
    paired_ids: set[int] = set()
    first, second = (
        sorted(rows, key=lambda row: not row["status"].is_converged) for rows in (one, other)
    )
    for alike in ALIKE:

        def key_of(row: Row, alike: tuple[str, ...] = alike) -> Hashable:
            return *(key(row) for key in keys), *(row[name] for name in alike)

        waiting = grouped((row for row in second if id(row) not in paired_ids), key_of)
        for row in first:
            if id(row) not in paired_ids and (partners := waiting.get(key_of(row))):
                partner = partners.pop(0)
                paired_ids |= {id(row), id(partner)}
                # Delta_sigma and h_std depend on surface, elastomer and, for an indenter, the grid
                pairs.append(Pair(row, partner, bool(LOADS[row["load"]].unit)))
    for rows in (one, other):
        rows[:] = [row for row in rows if id(row) not in paired_ids]
    return sorted(pairs, key=lambda pair: int(pair.one["task"]))


def _pairing_note(pair: Pair) -> str:
    """What sets the studies apart, and by what their rows are paired."""
    differing = [
        what
        for what, names in {"surfaces": SURFACE, "elastomers": ("elastomer",)}.items()
        if any(pair.one[name] != pair.other[name] for name in names)
    ]
    load = LOADS[pair.one["load"]].words
    units = "sigma_p in Pa, u_g in m" if pair.physical else "values in reduced units"
    return f"{' and '.join(differing).capitalize()} differ: paired by {load}, {units}"


def _load(record: Record) -> str:
    return load_text(record["load"], record["load_value"])


def _grids(record: Record) -> str:
    return " -> ".join(points_text(record[f"points_{s}"], record[f"points_y_{s}"]) for s in "ab")


def _deviation(record: Record, name: str) -> str:
    relative, in_errors = record[f"{name}_relative"], record[f"{name}_in_errors"]
    bars = f" ({in_errors:+.1f})" if known(in_errors) else ""
    return (f"{relative:+.2e}" if known(relative) else BLANK) + bars


DIFFERENCES = (
    TableColumn("load", _load),
    TableColumn("points", _grids),
    *(TableColumn(name, partial(_deviation, name=name)) for name in MAIN_OBSERVABLES),
)


def diff_table(difference: Difference) -> Table:
    """The pairs of contacts, grouped by what is compared."""
    pairs = difference.pairs
    titles = with_solvers(map(_title, pairs), [pair.one for pair in pairs])
    groups = groups_of(zip(titles, (pair.record for pair in pairs), strict=True))
    largest = ", ".join(f"{name} {value:.1e}" for name, value in difference.largest.items())
    caption = f"{LEGEND} Largest of {count(len(pairs), 'pair')}: {largest}."
    if difference.paired:
        caption = f"{difference.paired}. {caption}"
    return Table(caption, DIFFERENCES, groups)


def diff_text(difference: Difference) -> str:
    """The table, the rows of one study only, and the keys of the specs that differ."""
    lists = ("\n".join([f"{title}:", *lines]) for title, lines in diff_lists(difference).items())
    return "\n\n".join([diff_table(difference).as_text() or nothing_in_common(difference), *lists])


def nothing_in_common(difference: Difference) -> str:
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
    sides = [pair.one for pair in difference.pairs], [pair.other for pair in difference.pairs]
    lists, not_converged = {}, {}
    for which, compared, only in zip("AB", sides, difference.only, strict=True):
        rows = [*compared, *only]
        names = with_solvers(map(contact_and_boundary, rows), rows)  # that tell its rows apart
        named = list(zip(names, rows, strict=True))
        lists[f"only in {which}"] = _loads_by_contact(named[len(compared) :])
        not_converged[f"compared, but not converged in {which}"] = _loads_by_contact(
            [(name, row) for name, row in named[: len(compared)] if not row["status"].is_converged]
        )
    lists |= not_converged
    lists["specs, A -> B"] = [f"  {line}" for line in difference.spec]
    return {title: lines for title, lines in lists.items() if lines}


def diff_json(difference: Difference) -> str:
    """The same as JSON; what does not apply is null."""
    keys = (*CONTACT, *OF_EACH)
    only_a, only_b = (
        [{key: plain(row[key]) for key in keys} for row in rows] for rows in difference.only
    )
    records = [pair.record for pair in difference.pairs]
    content = {
        "rows": [{key: plain(value) for key, value in record.items()} for record in records],
        "only_a": only_a,
        "only_b": only_b,
        "spec": difference.spec,
        "paired": difference.paired,
    }
    return json.dumps(content, indent=1)


def _title(pair: Pair) -> str:
    one, other = contact_and_boundary(pair.one), contact_and_boundary(pair.other)
    return one if one == other else f"A: {one}\nB: {other}"


def _loads_by_contact(named: list[tuple[str, Row]]) -> list[str]:
    """Loads grouped by the names of the contacts, a line for each grid."""
    lines = []
    for name, contacts in grouped(named, lambda pair: pair[0]).items():
        rows = (row for _, row in contacts)
        grids = grouped(rows, lambda row: points_text(row["points"], row["points_y"]))
        loads = {points: ", ".join(map(_load, grid)) for points, grid in grids.items()}
        lines += [f"  {name}", *(f"    {points}: {text}" for points, text in loads.items())]
    return lines
