"""What a figure shows of a curve: its points, or the mean over seeds with a confidence band."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from gfmd_cli.analysis.compare import Curve, Prediction, Row, best
from gfmd_cli.analysis.curve_styles import CurveStyle
from gfmd_cli.analysis.ensemble import by_load, spread_of, without_seed
from gfmd_cli.analysis.grid_size import grid_size
from gfmd_cli.analysis.plotting import ColumnFigure
from gfmd_cli.analysis.selection import grouped
from gfmd_cli.analysis.units import in_si, quantity
from gfmd_cli.grid.arrays import Field, Mask
from gfmd_cli.status import Status


@dataclass(frozen=True)
class View:
    """A quantity over the reduced pressure."""

    name: str
    column: str
    label: str
    x_scale: str = "log"
    y_scale: str = "linear"
    ratio: bool = False


@dataclass(frozen=True)
class Item:
    """A curve with its style, and its theory over pressures close enough for a line."""

    curve: Curve
    style: CurveStyle
    p_star: Field
    theory: Prediction


def seed_groups(items: list[Item]) -> list[list[Item]]:
    """The curves that differ in their seed only, together."""
    groups = grouped(items, lambda item: (item.curve.study, without_seed(item.curve.rows[0])))
    return list(groups.values())


@dataclass(frozen=True)
class Series:
    """A quantity over the pressure, of one curve or as the mean over seeds."""

    style: CurveStyle
    x: Field
    y: Field
    error: Field
    """Estimated error, of several seeds the mean of their errors; NaN where it is unknown."""
    half_width: Field
    """Of the 95 % confidence interval of the mean over seeds; NaN of a single seed."""
    converged: Mask
    details: Sequence[str]
    """Load, status and parameters of each point, a text of some lines."""
    theory: Field
    """Theory at `Item.p_star`, the mean over seeds."""

    @classmethod
    def of(cls, view: View, items: list[Item]) -> Self:
        """The series of curves that differ in their seed only."""
        units = {
            row["task"]: unit if view.ratio else 1.0
            for item in items
            for row, unit in zip(
                item.curve.rows, getattr(item.curve.prediction, view.column), strict=True
            )
        }
        loads = by_load(row for item in items for row in item.curve.rows)
        points = [_point(view.column, rows, units) for rows in loads]
        x, y, error, half_width, converged = (np.array(v) for v in zip(*points, strict=True))
        details = [_details(rows) for rows in loads]
        rising = np.argsort(x, kind="stable")
        style = items[0].style
        if len(items) > 1:
            style = replace(style, label=f"{style.label}, {len(items)} seeds")
        theory = np.mean([getattr(item.theory, view.column) for item in items], axis=0)
        series = cls(style, x, y, error, half_width, converged, details, theory)
        return series.only(rising)

    def only(self, kept: Any) -> Self:
        """The same with some of the points, by a mask or by their places."""
        names = ("x", "y", "error", "half_width", "converged")
        places = np.arange(self.x.size)[kept]
        details = [self.details[place] for place in places]
        return replace(
            self, details=details, **{name: getattr(self, name)[places] for name in names}
        )

    def draw(self, plot: ColumnFigure, *, line: bool) -> None:
        """Draw points with error bars, the band of several seeds, and a line on request."""
        if line:
            plot.unnamed_line((self.style.label,), self.x, self.y, color=self.style.colour, lw=0.6)
        plot.points(
            self.style, self.x, self.y, self.converged, error=self.error, details=self.details
        )
        known = np.isfinite(self.half_width)
        if np.any(known):
            x, y, wide = self.x[known], self.y[known], self.half_width[known]
            plot.band(self.style, x, np.maximum(y - wide, LOWEST * y), y + wide)

    def extent(self) -> Field:
        """The values that the scale of a figure must hold."""
        return np.concatenate([self.y, self.y + np.nan_to_num(self.half_width)])


LOWEST = 1e-3  # of a mean: lower end of its band on a logarithmic axis


def _point(
    name: str, rows: list[Row], units: dict[int, float]
) -> tuple[float, float, float, float, bool]:
    """p*, value, error, half width of the confidence interval, and whether all converged."""
    pairs = [best(row, name) for row in rows]
    values = [value / units[row["task"]] for row, (value, _) in zip(rows, pairs, strict=True)]
    errors = [abs(e) / units[row["task"]] for row, (_, e) in zip(rows, pairs, strict=True)]
    half_width = spread_of(values).half_width if len(rows) > 1 else np.nan
    converged = all(row["status"] == Status.CONVERGED for row in rows)
    p_star = float(np.mean([row["p_star"] for row in rows]))
    return p_star, float(np.mean(values)), float(np.mean(errors)), half_width, converged


def _details(rows: list[Row]) -> str:
    """Load, status and parameters of a point, a line each."""
    first = rows[0]
    lines = [
        *([f"pressure {quantity(first['pressure'], 'Pa')}"] if in_si(first) else []),
        f"{first['elastomer']} on {first['ensemble' if len(rows) > 1 else 'surface']}",
        f"{grid_size(rows)}, solver {first['solver']}",
    ]
    if len(rows) > 1:
        statuses = sorted({str(row["status"]) for row in rows})
        return "\n".join([*lines, f"mean of {len(rows)} seeds: {', '.join(statuses)}"])
    residual, tolerance = first["residual"], first["tolerance"]
    return "\n".join([*lines, f"{first['status']}: residual {residual:.1e} of {tolerance:.1e}"])
