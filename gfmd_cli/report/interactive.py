"""Figures as plotly.js draws them: the layers of a figure as traces, its axes as a layout."""

import math
from collections.abc import Iterable
from html import escape
from typing import Any

import numpy as np

from gfmd_cli.analysis.curve_styles import without_escapes
from gfmd_cli.analysis.plotting import BAND, ColumnFigure, PlotLayer, to_hex
from gfmd_cli.analysis.table import known, plus_minus
from gfmd_cli.grid.arrays import Field
from gfmd_cli.report.rendering import clean, html_label, plain_label

SYMBOLS = {
    "o": ("circle-open", "○"),
    "s": ("square-open", "□"),
    "^": ("triangle-up-open", "△"),
    "D": ("diamond-open", "◇"),
    "v": ("triangle-down-open", "▽"),
    "<": ("triangle-left-open", "◁"),
    "p": ("pentagon-open", "⬠"),
    ">": ("triangle-right-open", "▷"),
    "h": ("hexagon-open", "⬡"),
    "x": ("x-thin-open", "×"),
    "P": ("cross-open", "✚"),
    "*": ("star-open", "☆"),
}
"""Markers by their names in matplotlib: as plotly.js names them, and as a character."""
LINE, DASHES, PATCH = "—", "┄", "■"
DECADES = 1.5  # on shorter logarithmic axes plotly.js labels all of 2 to 9 if it may set 5 ticks
PIXELS = 1.6  # of the page for a point of the figure
DIGITS, LINE_DIGITS = 10, 5  # of the values of points, and of lines, which are only looked at


def interactive(figure: ColumnFigure) -> dict[str, Any] | None:
    """Traces, layout and legend of a figure, as plain data; None where it has no layer.

    Colours are those of the figure; the page replaces them by those of its colour scheme.
    """
    if not figure.layers:
        return None
    x, y = figure.axes.xaxis, figure.axes.yaxis
    names = plain_label(x.get_label_text()), plain_label(y.get_label_text())
    layout = {"xaxis": _axis(x, x.get_label_text()), "yaxis": _axis(y, y.get_label_text())}
    label, factor = figure.second or ("", None)
    if factor is not None:
        layout["xaxis2"] = _axis(x, label, factor) | {"overlaying": "x", "side": "top"}
    return {
        "data": [_trace(layer, names) for layer in figure.layers],
        "layout": layout,
        "factor": factor,
        "heading": _name(figure.shared_name),
        "legend": [
            {"name": _name(label), "symbol": _symbol(handle), "colour": to_hex(handle.get_color())}
            for label, handle in figure.entries.items()
        ],
        "names": names,
    }


def _trace(layer: PlotLayer, names: tuple[str, str]) -> dict[str, Any]:
    """A layer as plotly.js has it; `meta` names the entries of the legend it belongs to."""
    meta = [_name(name) for name in layer.names]
    digits = LINE_DIGITS if layer.kind == "line" else DIGITS
    x, y = _numbers(layer.x, digits), _numbers(layer.y, digits)
    if layer.kind == "points":
        return {"meta": meta, "x": x, "y": y, **_points(layer, names)}
    if layer.high is not None:
        x, y = x + x[::-1], y + _numbers(layer.high, digits)[::-1]  # there and back around a band
        filled = {"fill": "toself", "fillcolor": layer.colour, "opacity": BAND}
        return {"meta": meta, "x": x, "y": y, "mode": "none", "hoverinfo": "skip", **filled}
    line = {"color": layer.colour, "width": PIXELS * layer.width, "simplify": False}
    line |= {"dash": "dash"} if layer.dashed else {}
    return {"meta": meta, "x": x, "y": y, "mode": "lines", "line": line, "hoverinfo": "skip"}


def _points(layer: PlotLayer, names: tuple[str, str]) -> dict[str, Any]:
    symbol, _ = SYMBOLS[layer.marker]
    width = 0.9 * PIXELS
    marker = {"symbol": symbol, "color": layer.colour, "size": 8, "line": {"width": width}}
    trace: dict[str, Any] = {"mode": "markers", "marker": marker, "hoverinfo": "text"}
    if np.any(np.isfinite(layer.error)):
        down, up = (_numbers(side, DIGITS) for side in layer.error)
        bars = {"array": up, "color": layer.colour, "thickness": 1.2, "width": 3}
        trace["error_y"] = bars | ({} if down == up else {"symmetric": False, "arrayminus": down})
    trace["text"] = [_hover(layer, place, names) for place in range(layer.x.size)]
    return trace


def _hover(layer: PlotLayer, place: int, names: tuple[str, str]) -> str:
    """Text that appears at a point under the pointer: curve, values and details."""
    x, y, error = float(layer.x[place]), float(layer.y[place]), float(max(layer.error[:, place]))
    value_text = plus_minus(y, error).replace("+-", "±") if known(error) else f"{y:.4g}"
    details = clean(layer.details[place]).split("\n") if layer.details else []
    lines = [_name(layer.names[0]), f"{names[0]}: {x:.4g}", f"{names[1]}: {value_text}", *details]
    return "<br>".join(escape(line, quote=False) for line in lines)


def _axis(axis: Any, label: str, factor: float = 1.0) -> dict[str, Any]:
    """The range of an axis times a factor, with a label."""
    ends, scale = factor * axis.get_view_interval(), axis.get_scale()
    ends = np.log10(ends) if scale == "log" else ends
    few = scale == "log" and 1 <= np.ptp(ends) < DECADES
    return {
        "title": {"text": html_label(label)},
        "type": scale,
        "range": _numbers(ends, DIGITS),
        "nticks": 3 if few else 5,
    }


def _symbol(handle: Any) -> str:
    """A character for the symbol of an entry of the legend."""
    if handle.get_marker() in SYMBOLS:
        return SYMBOLS[handle.get_marker()][1]
    if handle.get_linewidth() > 4:
        return PATCH
    return LINE if handle.get_linestyle() == "-" else DASHES


def _name(label: str) -> str:
    return without_escapes(str(clean(label)))


def _numbers(values: Iterable[float] | Field, digits: int) -> list[float | None]:
    """Values rounded to some digits; None where there is none, which JSON has for NaN."""
    return [float(f"{v:.{digits}g}") if math.isfinite(v) else None for v in values]
