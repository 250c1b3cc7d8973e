"""The spread of a quantity over seeds: mean, standard error, confidence interval."""

import re
from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np
from scipy.stats import t as student

from gfmd_cli.analysis.compare import Comparison, Row

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Spread:
    """Statistics of one quantity over seeds."""

    count: int
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

    @property
    def label(self) -> str:
        """Body and surface, in words."""
        return f"{self.rows[0]['elastomer']} on {without_seed(self.rows[0])}"

    @property
    def title(self) -> str:
        """The same with the grid, where that was given."""
        auto = self.rows[0].get("grid") == "auto"
        return self.label + ("" if auto else f", {self.rows[0]['points']} points a side")

    def spread(self, name: str) -> Spread:
        """Of "a_r", "sigma_p" or "u_g": of the continuum values where all rows have one."""
        best = [row.get(f"{name}_continuum", np.nan) for row in self.rows]
        values = np.array(best if np.all(np.isfinite(best)) else [row[name] for row in self.rows])
        error = float(np.std(values, ddof=1)) / sqrt(values.size)
        wide = float(student.ppf(0.5 + 0.5 * CONFIDENCE, values.size - 1))
        return Spread(values.size, float(values.mean()), error, wide * error)


def without_seed(row: Row) -> str:
    """The surface of a row in words, without its seed."""
    return re.sub(r" seed=\d+", "", str(row["surface"]))


def ensembles(comparison: Comparison) -> list[Ensemble]:
    """The contacts of a study that were solved for two seeds or more."""
    groups: dict[tuple[Any, ...], dict[int, list[Row]]] = {}
    for curve in comparison.curves:
        row = curve.rows[0]
        points = None if row.get("grid") == "auto" else row["points"]
        key = (without_seed(row), row["elastomer"], points, row["solver"], row["tolerance"])
        groups.setdefault(key, {})[row["seed"]] = curve.rows
    found = []
    for seeds in groups.values():
        lengths = {len(rows) for rows in seeds.values()}
        if len(seeds) > 1 and len(lengths) == 1:
            found += [Ensemble(list(rows)) for rows in zip(*seeds.values(), strict=True)]
    return found
