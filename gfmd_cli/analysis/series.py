"""What a figure shows of a curve: its points, or the mean over seeds with a confidence band."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from gfmd_cli.analysis.compare import Curve, Prediction, best_of_all
from gfmd_cli.analysis.curve_styles import CurveStyle
from gfmd_cli.analysis.ensemble import by_load, spread_of, without_seed
from gfmd_cli.analysis.plotting import ColumnFigure
from gfmd_cli.analysis.selection import grouped
from gfmd_cli.analysis.wording import contact_title, grid_size, in_si, quantity
from gfmd_cli.grid.arrays import Field, Mask
from gfmd_cli.study.column import Row

LOWEST = 1e-3  # of a mean: lower end of its band on a logarithmic axis


@dataclass(frozen=True)
class Panel:
    """A quantity over the reduced pressure."""

    name: str
    column: str
    meaning: str
    """What the figure shows, as its caption."""
    x_scale: str = "log"
    y_scale: str = "linear"
    ratio: bool = False


@dataclass(frozen=True)
class StyledCurve:
    """A curve with its style, and its theory over pressures close enough for a line."""

    curve: Curve
    style: CurveStyle
    p_star: Field
    theory: Prediction


def seed_groups(items: list[StyledCurve]) -> list[list[StyledCurve]]:
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
    """Theory at `StyledCurve.p_star`, the mean over seeds."""

    @classmethod
    def of(cls, panel: Panel, items: list[StyledCurve]) -> Self:
        """The series of curves that differ in their seed only: what its scale can show."""
        loads = by_load(record for item in items for record in item.curve.records)
        loads.sort(key=lambda seeds: float(np.mean([record["p_star"] for record in seeds])))
        points = [_point(panel, seeds) for seeds in loads]
        columns = [np.array(values) for values in zip(*points, strict=True)]
        y = columns[1]
        visible = np.isfinite(y) & ((y > 0) | (panel.y_scale == "linear"))
        details = [_details(seeds) for seeds, s in zip(loads, visible, strict=True) if s]
        style = items[0].style
        if len(items) > 1:
            style = replace(style, label=f"{style.label}, {len(items)} seeds")
        theory = np.mean([getattr(item.theory, panel.column) for item in items], axis=0)
        x, y, error, half_width, converged = (column[visible] for column in columns)
        return cls(style, x, y, error, half_width, converged, details, theory)

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


def _point(panel: Panel, records: list[Row]) -> tuple[float, float, float, float, bool]:
    """p*, value, error, half width of the confidence interval, and whether all converged."""
    name = panel.column
    units = np.array([r[f"{name}_persson"] if panel.ratio else 1.0 for r in records])
    values, errors = np.transpose(best_of_all(records, name)) / units
    half_width = spread_of(values).half_width if len(records) > 1 else np.nan
    converged = all(record["status"].is_converged for record in records)
    p_star = np.mean([record["p_star"] for record in records])
    return float(p_star), float(values.mean()), float(np.abs(errors).mean()), half_width, converged


def _details(rows: list[Row]) -> str:
    """Load, status and parameters of a point, a line each."""
    first = rows[0]
    pressure = float(np.mean([row["pressure"] for row in rows]))
    lines = [
        *([f"pressure {quantity(pressure, 'Pa')}"] if in_si(first) else []),
        contact_title(first, of_seeds=len(rows) > 1),
        f"{grid_size(rows)}, solver {first['solver']}",
    ]
    if len(rows) > 1:
        statuses = sorted({str(row["status"]) for row in rows})
        return "\n".join([*lines, f"mean of {len(rows)} seeds: {', '.join(statuses)}"])
    residual, tolerance = first["residual"], first["tolerance"]
    return "\n".join([*lines, f"{first['status']}: residual {residual:.1e} of {tolerance:.1e}"])
