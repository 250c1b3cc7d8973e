"""Two studies side by side: what differs in their specs, and by how much their results do."""

import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from gfmd_cli.analysis.compare import load_of
from gfmd_cli.analysis.selection import grouped
from gfmd_cli.physics.observables import QUANTITIES
from gfmd_cli.spec.differences import differences
from gfmd_cli.spec.models import LOADS
from gfmd_cli.study.column import Row
from gfmd_cli.study.reading import open_study, solved_rows, tell_files_apart

SURFACE = ("surface", "surface_sha256", "seed")
"""Columns of a surface: two files may have the same name."""
ALIKE = (
    ("boundary", "points", "solver", "tolerance"), ("boundary", "points"),
    ("boundary",), ("points",), (),
)  # fmt: skip
"""Columns in which the rows of a pair are alike, in the order in which they are tried."""


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

    def unit(self, name: str) -> str:
        """Unit in which a quantity is compared."""
        return (self.physical and QUANTITIES[name].si) or "1"

    def values(self, name: str, suffix: str = "") -> tuple[float, float]:
        """A quantity in both studies, in the unit in which it is compared; "_error": its error."""
        scale = QUANTITIES[name].scale if self.physical else ""
        a, b = (
            float(row[name + suffix] * (row[scale] if scale else 1.0))
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

    def exceeds(self, tolerance: float) -> bool:
        """Whether some relative difference is larger; also where nothing can be compared."""
        differing = (abs(p.deviation(name).relative) for p in self.pairs for name in QUANTITIES)
        return not self.pairs or any(value > tolerance for value in differing)


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
    return f"{' and '.join(differing)} differ: paired by {load}, {units}"
