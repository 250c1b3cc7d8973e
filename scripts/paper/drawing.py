"""What the figures share: the style of an elastomer, values with their errors, a quantity over pressure."""

from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.analysis.compare import Curve
from gfmd_cli.analysis.curve_styles import MARKERS, CurveStyle, colours
from gfmd_cli.analysis.plotting import ColumnFigure
from paper.claims import SIGMAS, Value

KNOWN = 0.5  # twice the relative error up to which a value is drawn, else its upper limit
EXPONENTS = (0.0, 0.5, 1.0, 2.0, 3.0, 4.0)
STYLES = {
    n: CurveStyle(colour, MARKERS[i], f"n = {'1/2' if n == 0.5 else f'{n:g}'}")
    for i, (n, colour) in enumerate(zip(EXPONENTS, colours(len(EXPONENTS)), strict=True))
}
Row = dict[str, Any]


def column(rows: list[Row], name: str) -> np.ndarray:
    """A column of the study."""
    return np.array([row[name] for row in rows], dtype=float)


def draw_points(plot: ColumnFigure, style: CurveStyle, x: Any, y: Any, error: Any = np.nan) -> None:
    """Open symbols with error bars where the error is known."""
    x, y = np.asarray(x), np.asarray(y)
    plot.points(style, x, y, error=np.asarray(error))


def draw_limits(plot: ColumnFigure, style: CurveStyle, x: Any, y: Any, error: Any) -> np.ndarray:
    """Values with standard errors; arrows, two errors above, where these are large; which are values."""
    known = np.isfinite(y) & (SIGMAS * error < KNOWN * y)
    draw_points(plot, style, x[known], y[known], error[known])
    limited = np.isfinite(y) & ~known
    if np.any(limited):
        arrows = {"marker": r"$\downarrow$", "ls": "none", "ms": 7, "color": style.colour}
        plot.axes.plot(x[limited], (y + SIGMAS * error)[limited], **arrows)
        plot.legend["upper limit"] = plot.axes.lines[-1]
    return known


def dense(curve: Curve) -> np.ndarray:
    """Pressures close enough for a line."""
    p = curve.column("p_star")
    return np.geomspace(p.min(), p.max(), 200)


def finish(
    plot: ColumnFigure, folder: Path, name: str, x_scale: str, y_scale: str, x: Any, y: Any
) -> None:
    """Scales around the values, and both files. A scale of "ratio" is linear and needs no zero."""
    for axis, scale, span in (("x", x_scale, x), ("y", y_scale, y)):
        span = np.asarray(span, dtype=float)
        span = span[np.isfinite(span) & ((span > 0) | (scale != "log"))]
        plot.scale(axis, "linear" if scale == "ratio" else scale, span, zero=scale != "ratio")
    plot.write(folder / name)


def label(n: float) -> str:
    """An exponent in words."""
    return STYLES[n].label


def slope(x: Any, y: Any, error: Any) -> Value:
    """Slope of a straight line by weighted least squares, with its standard error.

    The scatter about the line widens the error where it is larger than the errors of the points.
    """
    x, y, weight = np.asarray(x), np.asarray(y), 1 / np.square(error)
    centre = weight @ x / weight.sum()
    moment = weight @ (x - centre) ** 2
    exponent = float(weight @ ((x - centre) * y) / moment)
    rest = y - (weight @ y / weight.sum() + exponent * (x - centre))
    misfit = max(1.0, float(weight @ rest**2) / max(1, x.size - 2))
    return Value(exponent, float(np.sqrt(misfit / moment)))
