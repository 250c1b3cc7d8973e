"""What the figures share: the look of a body, values with their errors, a quantity over pressure."""

from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.analysis.compare import Curve
from gfmd_cli.analysis.looks import MARKERS, Look, colours
from gfmd_cli.analysis.sheet import Sheet

WELL = 0.3  # relative error of a continuum value that is preferred to the value of the grid
BODIES = (0.0, 0.5, 1.0, 2.0, 3.0, 4.0)
LOOKS = {
    n: Look(colour, MARKERS[i], f"n = {'1/2' if n == 0.5 else f'{n:g}'}")
    for i, (n, colour) in enumerate(zip(BODIES, colours(len(BODIES)), strict=True))
}
Row = dict[str, Any]


def value(row: Row, name: str) -> tuple[float, float]:
    """A quantity with its error: in the continuum where that is well known, else of the grid."""
    found, error = row[f"{name}_continuum"], row[f"{name}_continuum_error"]
    if np.isfinite(found) and error < WELL * found:
        return float(found), float(error)
    return float(row[name]), float(row[f"{name}_error"])


def values(rows: list[Row], name: str) -> tuple[np.ndarray, np.ndarray]:
    """The same of many rows."""
    found = np.array([value(row, name) for row in rows]).reshape(-1, 2)
    return found[:, 0], found[:, 1]


def column(rows: list[Row], name: str) -> np.ndarray:
    """A column of the study."""
    return np.array([row[name] for row in rows], dtype=float)


def curves(held: Any, name: str) -> list[Curve]:
    """The curves of a study, exponents rising."""
    return sorted(held.comparison(name).curves, key=lambda curve: np.nan_to_num(curve.n, nan=9.0))


def draw_points(sheet: Sheet, look: Look, x: Any, y: Any, error: Any = None) -> None:
    """Open symbols with error bars where the error is known."""
    x, y = np.asarray(x), np.asarray(y)
    if error is not None:
        known = np.isfinite(error)
        sheet.bars(look, x[known], y[known], error[known])
    sheet.points(look, x, y, np.full(x.size, True))


def dense(curve: Curve) -> np.ndarray:
    """Pressures close enough for a line."""
    p = curve.column("p_star")
    return np.geomspace(p.min(), p.max(), 200)


def finish(
    sheet: Sheet, folder: Path, name: str, x_scale: str, y_scale: str, x: Any, y: Any
) -> None:
    """Scales around the values, and both files. A scale of "ratio" is linear and needs no zero."""
    folder.mkdir(parents=True, exist_ok=True)
    for axis, scale, span in (("x", x_scale, x), ("y", y_scale, y)):
        span = np.asarray(span, dtype=float)
        span = span[np.isfinite(span) & ((span > 0) | (scale != "log"))]
        sheet.scale(axis, "linear" if scale == "ratio" else scale, span, zero=scale != "ratio")
    sheet.write(folder / name)


def percent(share: float) -> str:
    """A share in per cent, two digits."""
    return f"{100 * share:.0f} %" if share >= 0.1 else f"{100 * share:.2g} %"


def plus_minus(found: float, error: float) -> str:
    """A value with its error in plain digits: 0.123 ± 0.004."""
    if not (np.isfinite(error) and error > 1e-8):
        return f"{found:.3g}"
    digits = max(
        0,
        -int(np.floor(np.log10(error)))
        + (0 if error >= 2 * 10 ** np.floor(np.log10(error)) else 1),
    )
    return f"{found:.{digits}f} ± {error:.{digits}f}"


def slope(x: Any, y: Any, error: Any) -> tuple[float, float]:
    """Slope of a straight line by weighted least squares, with its standard error.

    The scatter about the line widens the error where it is larger than the errors of the points.
    """
    x, y, weight = np.asarray(x), np.asarray(y), 1 / np.square(error)
    centre = weight @ x / weight.sum()
    moment = weight @ (x - centre) ** 2
    found = float(weight @ ((x - centre) * y) / moment)
    rest = y - (weight @ y / weight.sum() + found * (x - centre))
    misfit = max(1.0, float(weight @ rest**2) / max(1, x.size - 2))
    return found, float(np.sqrt(misfit / moment))
