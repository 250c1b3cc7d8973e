"""The spread of a quantity over seeds: mean, standard error, confidence interval."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import hypot, isnan, nan, sqrt
from typing import Any

import numpy as np
from scipy.special import stdtrit

from gfmd_cli.analysis.compare import Comparison, best_of_all, load_of, of_study
from gfmd_cli.analysis.selection import grouped
from gfmd_cli.analysis.wording import contact_and_boundary, contact_title, grid_size
from gfmd_cli.physics.observables import MAIN_OBSERVABLES
from gfmd_cli.spec.models import LOADS
from gfmd_cli.study.column import Row
from gfmd_cli.study.columns import PARAMETERS

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Spread:
    """Statistics of one quantity over seeds."""

    mean: float
    standard_error: float
    """Standard error of the mean over n seeds: standard deviation (n - 1) over sqrt(n)."""
    half_width: float
    """The mean of all seeds lies within mean +- half_width with 95 % confidence: Student's t, and
    the mean error of the single values, in the root of the sum of the squares. NaN if all values
    are equal within their residuals and have no errors, such as the same number of points in
    contact: their scatter is then unknown, not zero."""


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
        if row.get("grid") == "auto":
            return of_study(self.study, contact_and_boundary(row, of_seeds=True))
        return of_study(self.study, f"{contact_title(row, of_seeds=True)}, {grid_size([row])}")

    def mean_load(self, name: str) -> float:
        """Mean "p_star" or "pressure"; the seeds differ in it where another load is prescribed."""
        return float(np.mean([row[name] for row in self.rows]))

    @property
    def not_converged(self) -> str | None:
        """The statuses of the rows that have not converged, with their numbers; None without."""
        counts = Counter(row["status"] for row in self.rows if not row["status"].is_converged)
        return ", ".join(f"{number} {status}" for status, number in counts.items()) or None

    def spread(self, name: str) -> Spread:
        """Spread of "a_r", "sigma_p" or "u_g", of the values of `best_of_all`."""
        values, errors = zip(*best_of_all(self.rows, name), strict=True)
        return spread_of(values, errors, residual_of(self.rows))

    def pressure_spread(self) -> Spread:
        """Spread of pressures that were searched. No interval if the error of one is unknown."""
        errors = [row["p_star_error"] for row in self.rows]
        pressures = [row["p_star"] for row in self.rows]
        spread = spread_of(pressures, errors, residual_of(self.rows))
        if LOADS[self.rows[0]["load"]].searched not in MAIN_OBSERVABLES:  # the load has no errors
            return spread
        has_unknown = any(map(isnan, errors)) and any(map(_has_errors, self.rows))
        return replace(spread, half_width=nan) if has_unknown else spread

    def means(self) -> dict[str, Any]:
        """Numbers of seeds, and the spread of each quantity, as the records of a study have them.

        The pressure is one of them where it was searched.
        """
        failed = sum(not row["status"].is_converged for row in self.rows)
        record: dict[str, Any] = {"seeds": len(self.rows), "seeds_not_converged": failed}
        spreads = {name: self.spread(name) for name in MAIN_OBSERVABLES}
        if LOADS[self.rows[0]["load"]].searched:
            spreads["p_star"] = self.pressure_spread()
        for name, spread in spreads.items():
            record |= {
                f"{name}_mean": spread.mean,
                f"{name}_standard_error": spread.standard_error,
                f"{name}_confidence": spread.half_width,
            }
        return record


def residual_of(rows: Sequence[Row]) -> float:
    """The largest residual of some contacts: smaller relative differences are not significant."""
    return max((row.get("residual", 0.0) for row in rows), default=0.0)


def spread_of(
    values: Sequence[float], errors: Sequence[float] = (), residual: float = 0.0
) -> Spread:
    """Statistics of two values or more.

    `errors` are those of the single values, NaN where unknown. They do not average out: on the same
    grid they may have the same sign for all seeds. `residual` is the relative difference up to
    which values are equal.
    """
    numbers = np.asarray(values, np.float64)
    error = float(np.std(numbers, ddof=1)) / sqrt(numbers.size)
    is_equal = np.ptp(numbers) <= max(1e-12, residual) * np.max(np.abs(numbers))  # rounding
    t_factor = 0.0 if is_equal else float(stdtrit(numbers.size - 1, 0.5 + 0.5 * CONFIDENCE))
    shared = float(np.abs(errors).sum() / numbers.size)
    half_width = hypot(t_factor * error, 0.0 if isnan(shared) else shared)
    return Spread(float(numbers.mean()), error, half_width or nan)


def without_seed(row: Row) -> tuple[Any, ...]:
    """What contacts have in common that differ in seed and load only."""
    auto = row["grid"] == "auto"  # with points of its own for each seed
    keys = {"seed", "points", "points_y"} if auto else {"seed"}
    files = row["surface_sha256"], row["elastomer_sha256"]
    return (auto, *files, *(e.word(row) for e in PARAMETERS if e.key not in keys))


def by_load(rows: Iterable[Row]) -> list[list[Row]]:
    """The rows of each load, one a seed: of several, one with errors and converged if possible."""

    def preference(row: Row) -> tuple[bool, bool]:
        return _has_errors(row), row["status"].is_converged

    groups = (sorted(group, key=preference) for group in grouped(rows, load_of).values())
    return [[*{row["seed"]: row for row in group}.values()] for group in groups]


def _has_errors(row: Row) -> bool:
    """Whether a row is one with [accuracy]."""
    return any(row.get(f"{name}_verdict") for name in MAIN_OBSERVABLES)


def ensembles(comparison: Comparison) -> list[Ensemble]:
    """The contacts of a study that were solved for two seeds or more, pressure rising."""
    groups = grouped(comparison.curves, lambda curve: (curve.study, without_seed(curve.rows[0])))
    return [
        Ensemble(rows, study)
        for (study, _), curves in groups.items()
        for rows in sorted(
            by_load(row for curve in curves for row in curve.rows),
            key=lambda seeds: float(seeds[0]["p_star"]),
        )
        if len(rows) > 1
    ]
