"""Contacts on surfaces that differ in their seed only: means over the seeds and what follows from them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from gfmd_cli.analysis.compare import Curve, Prediction, in_continuum, solver_of
from gfmd_cli.analysis.ensemble import without_seed
from gfmd_cli.analysis.selection import grouped
from gfmd_cli.grid.arrays import Field
from paper.claims import Value
from paper.drawing import slope

BAR = 0.5
"""Standard error of a continuum value in units of its bar, which holds in 95 % of cases."""
LEAST = 1e-3  # relative error that a value of a fit has at least


@dataclass(frozen=True)
class Mean:
    """A quantity as the mean over seeds."""

    each: Field
    """Of each seed, shape (seeds, ...)."""
    grid: Field | float = 0.0
    """Standard error that all seeds share, since they have the same grid; NaN where it is unknown."""

    @property
    def value(self) -> Field:
        """Mean over the seeds."""
        return self.each.mean(axis=0)

    @property
    def error(self) -> Field:
        """Standard error of the mean: of the seeds and, where it is known, of the grid; NaN of one seed."""
        count = len(self.each)
        if count < 2:
            return np.full(self.each.shape[1:], np.nan)
        return np.hypot(self.each.std(axis=0, ddof=1) / np.sqrt(count), np.nan_to_num(self.grid))

    def only(self, index: Any) -> "Mean":
        """Some of the values."""
        grid = np.broadcast_to(self.grid, self.each.shape[1:])
        return Mean(self.each[:, index], grid[index])

    def over(self, unit: Field) -> "Mean":
        """In other units."""
        return Mean(self.each / unit, self.grid / unit)


def estimate(of: Callable[..., float], *means: Mean) -> Value:
    """A number that follows from means over the same seeds, with its standard error.

    The scatter of the seeds enters by the jackknife, the means found anew without each seed in
    turn. To this the errors of the grid are added in quadrature, the number found anew with each
    value changed by its error. Raises ValueError for means over different numbers of seeds.
    """
    count = len(means[0].each)
    if any(len(mean.each) != count for mean in means):
        raise ValueError("means over different numbers of seeds")
    values = [np.array(mean.value, dtype=float) for mean in means]
    central = float(of(*values))
    if count < 2:
        return Value(central, np.nan)
    without = [
        of(*(np.delete(mean.each, seed, axis=0).mean(axis=0) for mean in means))
        for seed in range(count)
    ]
    variance = (count - 1) * float(np.var(without))
    for value, mean in zip(values, means, strict=True):
        grid = np.nan_to_num(np.broadcast_to(mean.grid, value.shape))
        for place in map(tuple, np.argwhere(grid)):
            before = value[place]
            value[place] = before + grid[place]
            variance += (of(*values) - central) ** 2
            value[place] = before
    return Value(central, float(np.sqrt(variance)))


def power(x: Field, mean: Mean) -> Value:
    """Exponent of x in a quantity: slope of its logarithm, each value weighted with its error."""
    weights = np.maximum(mean.error / mean.value, LEAST)

    def of(values: Field) -> float:
        return slope(np.log(x), np.log(values), weights).value

    return estimate(of, mean)


@dataclass(frozen=True)
class Group:
    """One elastomer on surfaces that differ in their seed only, at the same pressures."""

    curves: list[Curve]
    """One a seed."""

    @property
    def first(self) -> Curve:
        """The curve of one seed, for what all seeds share: spectrum, elastomer and grid."""
        return self.curves[0]

    @property
    def n(self) -> float:
        """Exponent of the stiffness."""
        return self.first.n

    @property
    def p(self) -> Field:
        """Reduced pressures, rising."""
        return self.first.column("p_star")

    def column(self, name: str) -> Mean:
        """A column of the study, over the pressures."""
        return Mean(np.array([curve.column(name) for curve in self.curves]))

    def continuum(self, name: str) -> Mean:
        """Continuum values; NaN at pressures where a seed has none."""
        kinds = (f"{name}_continuum", f"{name}_continuum_error")
        each, bars = (np.array([c.column(kind) for c in self.curves]) for kind in kinds)
        return Mean(np.where(np.isfinite(bars), each, np.nan), BAR * bars.mean(axis=0))

    def best(self, name: str) -> Mean:
        """Continuum values at pressures where all seeds have one, else the values of the grid."""
        rows = zip(*(curve.rows for curve in self.curves), strict=True)
        known = np.array([all(in_continuum(row, name) for row in seeds) for seeds in rows])
        fine, own = self.continuum(name), self.column(name)
        bars = self.column(f"{name}_error").value
        return Mean(np.where(known, fine.each, own.each), np.where(known, fine.grid, BAR * bars))

    @property
    def theory(self) -> Prediction:
        """Persson theory at the pressures: that of the spectrum, which all seeds share."""
        return self.first.prediction


def groups(studies: Any, name: str) -> list[Group]:
    """The elastomers of a study, exponents and grids rising.

    Raises ValueError where seeds have different pressures.
    """
    by_key = grouped(
        studies.comparison(name).curves,
        lambda curve: (without_seed(curve.rows[0]), *solver_of(curve.rows[0])),
    )
    for curves in by_key.values():
        if any(not np.allclose(c.column("p_star"), curves[0].column("p_star")) for c in curves):
            raise ValueError(f"{name}: seeds at different pressures")
    return sorted(
        map(Group, by_key.values()),
        key=lambda group: (np.nan_to_num(group.n, nan=9.0), group.first.points),
    )
