"""Two studies side by side: what differs in their specs, and by how much their results do."""

import json
import math
from collections import defaultdict
from collections.abc import Hashable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from gfmd_cli.analysis.compare import Row
from gfmd_cli.analysis.export import plain
from gfmd_cli.physics.observables import QUANTITIES
from gfmd_cli.study.layout import MISSING
from gfmd_cli.study.reading import read_rows, stored_spec
from gfmd_cli.study.spec import differences
from gfmd_cli.study.tasks import SYMBOLS


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

    def deviation(self, name: str) -> Deviation:
        """How far a column of the second study lies from that of the first."""
        a, b = self.one[name], self.other[name]
        if math.isnan(a) or math.isnan(b):
            return Deviation(math.nan if math.isnan(a) and math.isnan(b) else math.inf, math.nan)
        error = math.hypot(self.one[f"{name}_error"], self.other[f"{name}_error"])
        in_errors = (b - a) / error if error > 0 else math.nan
        return Deviation((b - a) / max(abs(a), abs(b)) if a != b else 0.0, in_errors)


@dataclass(frozen=True)
class Difference:
    """Two studies, row by row."""

    spec: list[str]
    """Keys of the specs that differ, a line each."""
    pairs: list[Pair]
    only: tuple[list[Row], list[Row]]
    """Rows that one of them alone has: of the first, of the second."""

    def exceeds(self, tolerance: float) -> bool:
        """Whether some relative difference is larger; also where nothing can be compared."""
        apart = (abs(p.deviation(name).relative) for p in self.pairs for name in QUANTITIES)
        return not self.pairs or any(value > tolerance for value in apart)


def diff(one: Path, other: Path) -> Difference:
    """Match the rows of two studies by surface, seed, elastomer and load.

    Grids and solvers may differ; of several rows, those of the same grid and solver belong
    together, then those of the same grid. Raises InputError, StudyError.
    """
    only = _solved(one), _solved(other)
    pairs: list[Pair] = []
    for alike in (("points", "solver", "tolerance"), ("points",), ()):
        pairs += _match(*only, alike)
    pairs.sort(key=lambda pair: int(pair.one["task"]))
    return Difference(differences(stored_spec(one), stored_spec(other)), pairs, only)


def _solved(path: Path) -> list[Row]:
    return [row for row in read_rows(path) if row["status"] != MISSING]


def _contact(row: Row) -> tuple[Hashable, ...]:
    """What is pressed together, and how hard."""
    asked = (row["load"], row["asked"]) if row["load"] else ("p_star", row["p_star"])
    return row["surface"], row["seed"], row["elastomer"], asked[0], f"{asked[1]:.12g}"


def _match(one: list[Row], other: list[Row], alike: tuple[str, ...]) -> list[Pair]:
    """Pairs of the same contact with these columns alike, in order; taken from both lists."""
    waiting: dict[Hashable, list[Row]] = defaultdict(list)

    def waiting_for(row: Row) -> list[Row]:
        return waiting[(*_contact(row), *(row[name] for name in alike))]

    for row in other:
        waiting_for(row).append(row)
    pairs = [Pair(row, waiting_for(row).pop(0)) for row in one if waiting_for(row)]
    taken = {id(row) for pair in pairs for row in (pair.one, pair.other)}
    for rows in (one, other):
        rows[:] = [row for row in rows if id(row) not in taken]
    return pairs


def diff_text(found: Difference) -> str:
    """The comparison for people."""
    blocks: dict[str, list[str]] = {}
    for pair in found.pairs:
        head = f"{pair.one['elastomer']} on {pair.one['surface']}"
        title = f"{'':28}" + "".join(f"{name:>20}" for name in QUANTITIES)
        cells = "".join(f"{_cell(pair.deviation(name)):>20}" for name in QUANTITIES)
        sizes = f"{pair.one['points']} -> {pair.other['points']}"
        blocks.setdefault(head, [head, title]).append(f"{_load(pair.one):>14}{sizes:>14}{cells}")
    told = ["\n".join(lines) for lines in blocks.values()]
    for name, rows in zip("AB", found.only, strict=True):
        lines = [f"  {r['elastomer']} on {r['surface']}, {r['points']}, {_load(r)}" for r in rows]
        told += ["\n".join([f"only in {name}:", *lines])] if lines else []
    if found.spec:
        told.append("\n".join(["specs, A -> B:", *(f"  {line}" for line in found.spec)]))
    legend = "relative: (B - A) / max(|A|, |B|); in brackets in units of the combined error bar"
    return "\n\n".join([legend, *told] if found.pairs else ["no contact in common", *told])


def _cell(found: Deviation) -> str:
    bars = "" if math.isnan(found.in_errors) else f" ({found.in_errors:+.1f})"
    return ("-" if math.isnan(found.relative) else f"{found.relative:+.2e}") + bars


def _load(row: Row) -> str:
    if not row["load"]:
        return f"p*={row['p_star']:.4g}"
    return f"{SYMBOLS.get(row['load'], row['load'])}={row['asked']:.4g}"


def diff_json(found: Difference) -> str:
    """The same as JSON; what does not apply is null."""
    keys = ("surface", "seed", "elastomer", "load", "asked", "points", "p_star")
    rows = [
        {key: plain(pair.one[key]) for key in keys[:5]}
        | {f"{key}_{which}": plain(row[key]) for key in (*keys[5:], *QUANTITIES)
           for which, row in (("a", pair.one), ("b", pair.other))}
        | {f"{name}_{what}": value if math.isfinite(value) else None for name in QUANTITIES
           for what, value in pair.deviation(name)._asdict().items()}
        for pair in found.pairs
    ]  # fmt: skip
    only = [[{key: plain(row[key]) for key in keys} for row in rows] for rows in found.only]
    told: dict[str, Any] = {"rows": rows, "only_a": only[0], "only_b": only[1], "spec": found.spec}
    return json.dumps(told, indent=1)
