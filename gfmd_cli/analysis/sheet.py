"""Sheets that figures are drawn on: style, scales, legend, files. The one user of matplotlib."""

from contextlib import AbstractContextManager
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.analysis.looks import Look
from gfmd_cli.errors import InputError
from gfmd_cli.physics.fields import Field, Mask
from gfmd_cli.study.files import write_whole

try:
    from matplotlib import colormaps, rc_context, ticker
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
except ImportError as error:
    raise InputError(f"figures need matplotlib: pip install gfmd-cli[plot] ({error})") from error

WIDTH, HEIGHT, ROW = 3.39, 2.35, 0.145  # inches: a column of 86 mm; a row of the legend adds ROW
SMALL = 8.0  # points
COLUMN = 54  # characters and symbols that a row of the legend holds
SCRIPTED = 9.3  # points: sub- and superscripts are printed at 0.7 of it, 6.5 points
STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": SMALL,
    "axes.labelsize": SCRIPTED,
    "axes.linewidth": 0.6,
    "lines.linewidth": 0.9,
    "lines.markersize": 4.2,
    "lines.markeredgewidth": 0.9,
    "legend.fontsize": SMALL,
    "legend.frameon": False,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "pdf.fonttype": 42,  # TrueType: publishers refuse Type 3
}
CAP = 2.0  # points, to either side of an error bar
THEORY = "Persson theory"


def styled() -> AbstractContextManager[None]:
    """Draw inside in the style of the house."""
    style: AbstractContextManager[None] = rc_context(STYLE)
    return style


class Page:
    """A figure in the making; its legend stands above the axes, off the data."""

    def __init__(self, width: float, height: float) -> None:
        self.width, self.height = width, height  # inches, without the legend
        self.figure = Figure(figsize=(width, height), layout="constrained")
        self.legend: dict[str, Any] = {}

    def line(self, axes: Any, label: str, x: Field, y: Field, **style: Any) -> None:
        """A line where y > 0."""
        axes.plot(x, np.where(y > 0, y, np.nan), **style)
        self.legend[label] = Line2D([], [], **style)

    def _write_legend(self) -> None:
        """Above the axes, on as many rows as it takes."""
        columns, rows = _legend_shape(list(self.legend), self.width / WIDTH)
        self.figure.set_size_inches(self.width, self.height + ROW * rows)
        self.figure.legend(
            self.legend.values(),
            self.legend.keys(),
            loc="outside upper center",
            ncols=columns,
            borderpad=0,
            labelspacing=0.25,
            columnspacing=1.2,
            handlelength=1.6,
            handletextpad=0.5,
        )

    def _lay_out(self) -> None:
        """Once for all files."""
        if self.legend:
            self._write_legend()
        self.figure.draw_without_rendering()
        self.figure.set_layout_engine("none")

    def svg(self) -> str:
        """An SVG on no ground, text as outlines; the same figure gives the same text."""
        self._lay_out()
        image = BytesIO()
        with rc_context({"svg.hashsalt": "gfmd", "svg.fonttype": "path"}):
            self.figure.savefig(image, format="svg", transparent=True, metadata={"Date": None})
        return image.getvalue().decode()

    def write(self, path: Path) -> list[Path]:
        """Write a PDF and a PNG, each whole or not at all. Raises SpaceError."""
        self._lay_out()
        files = [path.with_name(f"{path.name}.{kind}") for kind in ("pdf", "png")]
        for file, metadata in zip(files, ({"CreationDate": None}, {}), strict=True):
            image = BytesIO()
            self.figure.savefig(image, format=file.suffix[1:], dpi=300, metadata=metadata)
            write_whole(file, image.getvalue())
        return files


class Sheet(Page):
    """One pair of axes, as wide as a printed column."""

    def __init__(self, x_label: str, y_label: str) -> None:
        super().__init__(WIDTH, HEIGHT)
        self.axes = self.figure.add_subplot(xlabel=x_label, ylabel=y_label)

    def points(self, look: Look, x: Field, y: Field, converged: Mask, every: Any = 1) -> None:
        """Open symbols, crosses where not converged."""
        style: dict[str, Any] = {"ls": "none", "mfc": "none", "color": look.colour, "zorder": 3}
        for chosen, marker in ((converged, look.marker), (~converged, "x")):
            self.axes.plot(x[chosen], y[chosen], marker=marker, markevery=every, **style)
        self.legend[look.label] = Line2D([], [], marker=look.marker, **style)
        if not np.all(converged):
            self.legend["not converged"] = Line2D([], [], marker="x", ls="none", color="0.4")

    def bars(self, look: Look, x: Field, y: Field, error: Field) -> None:
        """Error bars, of shape (points,) or (2, points) for down and up."""
        self.axes.errorbar(x, y, error, fmt="none", ecolor=look.colour, elinewidth=0.7, capsize=CAP)

    def theory(self, lines: list[tuple[Look, Field, Field]]) -> None:
        """One black line where theory is the same for all curves, else one in each colour."""
        one = all(np.allclose(y, lines[0][2], rtol=1e-9, atol=0) for *_, y in lines)
        for look, x, y in lines[:1] if one else lines:
            self.line(self.axes, THEORY, x, y, color="black" if one else look.colour, zorder=2)
        self.legend[THEORY] = Line2D([], [], color="black" if one else "0.4")

    def scale(self, name: str, scale: str, values: Any, *, zero: bool = True) -> None:
        """Scale and limits of the axis `name` around the values; `zero` belongs to a linear one."""
        low, high = float(np.min(values)), float(np.max(values))
        if scale == "log":
            log_scale(self.axes, name, low, high)
            return
        low = 0.0 if zero else low
        pad = (high - low) or abs(high) or 1.0
        span = (low - (0.03 if zero else 0.1) * pad, high + 0.1 * pad)
        self.axes.set(**{f"{name}scale": scale, f"{name}lim": span})


def log_scale(axes: Any, name: str, low: float, high: float) -> None:
    """Logarithmic scale and limits of the axis `name` around two values."""
    pad = max(1.4, float(np.sqrt(8 * low / high)))  # 8: holds two of the ticks 1, 2, 5, 10
    span = (low / pad, high * pad)
    axes.set(**{f"{name}scale": "log", f"{name}lim": span})
    _tick(getattr(axes, f"{name}axis"), *span)


def shades(name: str, start: float, none: str, beyond: str) -> Any:
    """Colours of a map from `start` of the way along those named; of no value and of too large."""
    kept = colormaps[name](np.linspace(start, 1.0, 256))
    return LinearSegmentedColormap.from_list(name, kept).with_extremes(bad=none, over=beyond)


def _legend_shape(labels: list[str], wide: float) -> tuple[int, int]:
    """Columns and rows of a legend that is filled column by column, `wide` times a column wide."""
    for columns in range(min(int(4 * wide), len(labels)), 0, -1):
        split = np.array_split([len(label) for label in labels], columns)
        if (
            sum(max(lengths) + 6 for lengths in split) <= COLUMN * wide
        ):  # 6: symbol and space around it
            break
    return columns, len(split[0])


def _tick(axis: Any, low: float, high: float) -> None:
    """Ticks of a log axis: at whole decades, or at 1, 2, 5 where these are few."""
    decades = np.floor(np.log10(high)) - np.ceil(np.log10(low)) + 1
    plain = low > 5e-4 and high < 5e4
    axis.set_major_locator(ticker.LogLocator(subs=(1, 2, 5) if decades < 2 else (1,), numticks=8))
    axis.set_major_formatter(
        ticker.StrMethodFormatter("{x:g}")
        if plain
        else ticker.LogFormatterSciNotation(minor_thresholds=(np.inf, np.inf))
    )
    axis.set_minor_locator(ticker.LogLocator(subs=range(2, 10), numticks=99))
    axis.set_minor_formatter(ticker.NullFormatter())
    axis.set_tick_params(labelsize=SMALL if plain else SCRIPTED)
