"""The spread of a quantity over seeds: mean, standard error, confidence interval."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np
from scipy.special import stdtrit

from gfmd_cli.analysis.compare import Comparison, Row, of_study
from gfmd_cli.analysis.grid_size import grid_size
from gfmd_cli.study.columns import PARAMETERS

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Spread:
    """Statistics of one quantity over seeds."""

    mean: float
    standard_error: float
    """Of the mean: standard deviation (n - 1) over sqrt(n)."""
    half_width: float
    """The mean of all seeds lies within mean +- half_width with 95 % confidence (Student's t)."""


@dataclass(frozen=True)
class Ensemble:
    """One contact on surfaces that differ in their seed only."""

    rows: list[Row]
    """Rows of the study, one a seed."""
    study: str = ""
    """Name of the study where several are shown side by side."""

    @property
    def title(self) -> str:
        """Elastomer, surface without its seed, and the grid where that was given."""
        row = self.rows[0]
        grid = "" if row.get("grid") == "auto" else f", {grid_size([row])}"
        return of_study(self.study, f"{row['elastomer']} on {row['ensemble']}{grid}")

    def spread(self, name: str) -> Spread:
        """Of "a_r", "sigma_p" or "u_g": of the continuum values where all rows have one."""
        best = [row.get(f"{name}_continuum", np.nan) for row in self.rows]
        return spread_of(best if np.all(np.isfinite(best)) else [row[name] for row in self.rows])


def spread_of(values: Sequence[float]) -> Spread:
    """Statistics of two values or more."""
    numbers = np.asarray(values, np.float64)
    error = float(np.std(numbers, ddof=1)) / sqrt(numbers.size)
    wide = float(stdtrit(numbers.size - 1, 0.5 + 0.5 * CONFIDENCE))
    return Spread(float(numbers.mean()), error, wide * error)


def without_seed(row: Row) -> tuple[Any, ...]:
    """What contacts have in common that differ in seed and load only."""
    points = "auto" if row.get("grid") == "auto" else str(row["points"])
    words = [
        each.word(row) for each in PARAMETERS if each.key != "seed" and each.column.name != "points"
    ]
    return (points, row["surface_sha256"], *words)


def by_load(rows: Iterable[Row]) -> list[list[Row]]:
    """The rows of each load, one a seed."""
    groups: dict[tuple[Any, ...], dict[int, Row]] = {}
    for row in rows:
        groups.setdefault((row["load"], f"{row['load_value']:.12g}"), {})[row["seed"]] = row
    return [[*seeds.values()] for seeds in groups.values()]


def ensembles(comparison: Comparison) -> list[Ensemble]:
    """The contacts of a study that were solved for two seeds or more, pressure rising."""
    groups: dict[tuple[str, tuple[Any, ...]], list[Row]] = {}
    for curve in comparison.curves:
        groups.setdefault((curve.study, without_seed(curve.rows[0])), []).extend(curve.rows)
    return [
        Ensemble(rows, study)
        for (study, _), group in groups.items()
        for rows in sorted(by_load(group), key=lambda seeds: float(seeds[0]["p_star"]))
        if len(rows) > 1
    ]
