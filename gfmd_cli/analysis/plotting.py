"""Figures with their style, scales, legend and files. Only this module imports matplotlib."""

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial
from io import BytesIO
from itertools import compress
from pathlib import Path
from textwrap import fill
from typing import Any, Literal

import numpy as np

from gfmd_cli.analysis.curve_styles import MAX_NAMED, CurveStyle
from gfmd_cli.analysis.selection import evenly
from gfmd_cli.errors import INSTALL, InputError
from gfmd_cli.files.atomic import check_place, make_folder, target_of, write_whole
from gfmd_cli.grid.arrays import Field
from gfmd_cli.status import SHORTFALLS, TOLERANCE_NOT_REACHED, Status

try:
    from matplotlib import colormaps, rc_context, ticker
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.colors import to_hex as to_hex  # for other modules, too
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
except ImportError as error:
    raise InputError(f"figures need matplotlib: {INSTALL.format('plot')} ({error})") from error

WIDTH, HEIGHT, ROW = 3.39, 2.35, 0.145  # inches: a column of 86 mm; a row of the legend adds ROW
SMALL = 8.0  # points
COLUMN = 54  # characters and symbols that a row of the legend holds
SYMBOL = 6  # characters that a symbol and the space around it take
NAMED = 9  # curves that a legend names if there are more than MAX_NAMED; a choice
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
    "svg.fonttype": "path",
    "svg.hashsalt": "gfmd",  # the same figure gives the same bytes
}
LEAST_SPAN = 0.02  # of a linear axis, relative to its values: its labels need no offset such as +1
MANY_DECADES = 10  # of a logarithmic axis: minor ticks are decades, and fewer have a label
CAP = 2.0  # points, to either side of an error bar
METADATA: dict[str, Any] = {".png": {}, ".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
"""Formats of a figure, with the entries that would make the same figure another file."""
THEORY, CONFIDENCE = "Persson theory", "95 % confidence"
"""Entries of a legend that several curves share."""
SHORTFALL_MARKERS = dict(zip((TOLERANCE_NOT_REACHED, *SHORTFALLS.values()), "x*P", strict=True))
"""Markers of contacts that have missed something, by what that is."""
DASHED: dict[str, Any] = {"ls": (0, (4, 2)), "lw": 0.8, "zorder": 2.5}
"""Style of closed forms and of laws at the edge of a contact."""
BAND = 0.25  # opacity of a confidence band


@dataclass(frozen=True)
class PlotLayer:
    """Points, a line or a band of a figure, as data for a page that draws them anew."""

    kind: Literal["points", "line", "band"]
    names: tuple[str, ...]
    """Entries of the legend that the layer belongs to, that of its curve first."""
    x: Field
    y: Field
    """Values; of a band its lower end."""
    colour: str
    """As #rrggbb."""
    marker: str = ""
    """Marker of points, as matplotlib names it."""
    width: float = 0.9
    """Width of a line [points]."""
    dashed: bool = False
    error: Any = None
    """Lengths of the error bars of points down and up, shape (2, points); NaN: none."""
    high: Field | None = None
    """Upper end of a band."""
    details: Sequence[str] = ()
    """What else is known of each point, a text of some lines."""


def styled() -> AbstractContextManager[None]:
    """A context in which all figures are drawn in the same style."""
    return rc_context(STYLE)


def check_figure(path: Path) -> None:
    """Raise InputError for an unknown suffix, SpaceError where the figure cannot be written."""
    if path.suffix not in METADATA:
        raise InputError(f"{path}: unknown suffix {path.suffix!r}; allowed: {', '.join(METADATA)}")
    check_place(target_of(path))


class LegendFigure:
    """A figure with a legend above its axes."""

    def __init__(self, width: float, height: float) -> None:
        self.width, self.height = width, height  # inches, without the legend
        self.figure = Figure(figsize=(width, height), layout="constrained")
        self.legend: dict[str, Any] = {}
        self.shared_name = ""
        """The part of the names of all curves that their labels leave out."""
        self.layers: list[PlotLayer] = []
        """Points, lines and bands as data, for a page that draws them anew."""

    def line_on(self, axes: Any, label: str, x: Field, y: Field, **style: Any) -> None:
        """Draw a line where y > 0 on some axes, with an entry of the legend."""
        axes.plot(x, np.where(y > 0, y, np.nan), **style)
        self.legend[label] = Line2D([], [], **style)

    @property
    def curves(self) -> list[str]:
        """The names of the curves, in their order."""
        points = (layer for layer in self.layers if layer.kind == "points")
        return list(dict.fromkeys(layer.names[0] for layer in points))

    @property
    def heading(self) -> str:
        """Heading of the legend; it says how many curves the legend leaves out."""
        curves = self.curves
        named = f"{NAMED} of {len(curves)} curves are named" if len(curves) > MAX_NAMED else ""
        return ", ".join(filter(None, (self.shared_name, named)))

    @property
    def entries(self) -> dict[str, Any]:
        """The entries of the legend, those that several curves share after the curves."""
        shared = {CONFIDENCE, *SHORTFALL_MARKERS}
        return dict(sorted(self.legend.items(), key=lambda entry: entry[0] in shared))

    @property
    def named_entries(self) -> dict[str, Any]:
        """The entries in print: of more than MAX_NAMED curves NAMED, the ends among them."""
        entries, curves = self.entries, self.curves
        left_out = set(curves) - set(evenly(curves, NAMED)) if len(curves) > MAX_NAMED else set()
        return {name: handle for name, handle in entries.items() if name not in left_out}

    def _write_legend(self) -> None:
        """Write the legend, if there is any, above the axes, in as many rows as needed."""
        entries = self.named_entries
        if not entries:
            return
        wide = self.width / WIDTH
        longest = int(COLUMN * wide) - SYMBOL
        texts = [fill(text, longest, break_on_hyphens=False) for text in (self.heading, *entries)]
        heading, *labels = texts
        columns, rows = _legend_shape(labels, wide)
        rows += "".join(texts).count("\n") + bool(heading)
        self.figure.set_size_inches(self.width, self.height + ROW * rows)
        self.figure.legend(
            entries.values(),
            labels,
            title=heading or None,
            title_fontsize=SMALL,
            alignment="left",
            loc="outside upper center",
            ncols=columns,
            borderpad=0,
            labelspacing=0.25,
            columnspacing=1.2,
            handlelength=1.6,
            handletextpad=0.5,
        )

    def svg(self) -> str:
        """An SVG with outlined text and no background; to be called inside `styled`."""
        self._write_legend()
        parts: list[Any] = [self.figure, *self.figure.axes]
        for part in parts + [second for axes in parts[1:] for second in axes.child_axes]:
            part.patch.set(facecolor="none", edgecolor="none")
        image = BytesIO()
        # draws once; `savefig` would draw twice more, to lay out the figure
        FigureCanvasSVG(self.figure).print_svg(image, metadata=METADATA[".svg"])
        return image.getvalue().decode()

    def write(self, path: Path) -> list[Path]:
        """Write a PDF and a PNG, each whole or not at all. Raises SpaceError."""
        files = [path.with_name(f"{path.name}.{kind}") for kind in ("pdf", "png")]
        self._save(files, dpi=300)
        return files

    def write_file(self, path: Path) -> None:
        """Write one file of a suffix that `check_figure` allows, whole or not at all."""
        self._save([path], dpi=200)

    def _save(self, files: Sequence[Path], dpi: int) -> None:
        """Write files with one layout."""
        self._write_legend()
        self.figure.draw_without_rendering()
        self.figure.set_layout_engine("none")
        for file in files:
            image, metadata = BytesIO(), METADATA[file.suffix]
            self.figure.savefig(image, format=file.suffix[1:], dpi=dpi, metadata=metadata)
            write_whole(target_of(file), image.getvalue())


def write_all(figures: Mapping[str, LegendFigure], folder: Path) -> list[Path]:
    """Write figures by their names, as PDF and PNG; return the paths. Raises SpaceError."""
    make_folder(folder)
    return [path for name, plot in figures.items() for path in plot.write(folder / name)]


class ColumnFigure(LegendFigure):
    """A figure with one pair of axes, as wide as a printed column, and what it shows as data."""

    def __init__(self, x_label: str, y_label: str) -> None:
        super().__init__(WIDTH, HEIGHT)
        self.axes = self.figure.add_subplot(xlabel=x_label, ylabel=y_label)
        self.second: tuple[str, float] | None = None
        """Label of an axis at the top, and its values over those of x."""

    def points(
        self,
        style: CurveStyle,
        x: Field,
        y: Field,
        statuses: Sequence[Status] = (),
        every: Any = 1,
        error: Field | float = np.nan,
        details: Sequence[str] = (),
    ) -> None:
        """Draw open symbols with error bars, and others where a contact has missed something.

        Without `statuses` all are converged.
        `error` has shape (points,), or (2, points) for down and up, NaN for none. Of the symbols
        of converged contacts only some are drawn, as `markevery` of matplotlib has it. `details`
        are texts for the points.
        """
        error = np.broadcast_to(error, (2, x.size))
        known = np.isfinite(error).all(axis=0)
        if np.any(known):
            bars: dict[str, Any] = {"fmt": "none", "elinewidth": 0.7, "capsize": CAP}
            self.axes.errorbar(x[known], y[known], error[:, known], ecolor=style.colour, **bars)
        options: dict[str, Any] = {"ls": "none", "mfc": "none", "color": style.colour, "zorder": 3}
        shortfalls = np.array([each.shortfall for each in statuses or [Status.CONVERGED] * x.size])
        for missed, marker in {"": style.marker, **SHORTFALL_MARKERS}.items():
            mask = shortfalls == missed
            names = (style.label, missed) if missed else (style.label,)
            shown = 1 if missed else every
            self.axes.plot(x[mask], y[mask], marker=marker, markevery=shown, **options)
            if np.any(mask):
                layer = PlotLayer("points", names, x[mask], y[mask], to_hex(style.colour), marker)
                texts = list(compress(details, mask))
                self.layers.append(replace(layer, error=error[:, mask], details=texts))
            if missed and np.any(mask):
                self.legend[missed] = Line2D([], [], **options | {"marker": marker, "color": "0.4"})
        self.legend[style.label] = Line2D([], [], marker=style.marker, **options)
        self.shared_name = style.heading

    def band(self, style: CurveStyle, x: Field, low: Field, high: Field) -> None:
        """Draw the confidence band of a mean."""
        colour = style.colour
        self.axes.fill_between(x, low, high, color=colour, alpha=BAND, lw=0, zorder=1)
        self.legend[CONFIDENCE] = Line2D([], [], color="0.4", alpha=2 * BAND, lw=5)
        names = (style.label, CONFIDENCE)
        self.layers.append(PlotLayer("band", names, x, low, to_hex(colour), high=high))

    def line(self, label: str, x: Field, y: Field, **style: Any) -> None:
        """Draw a line where y >= 0, with an entry of the legend."""
        self.unnamed_line((label,), x, y, **style)
        self.legend[label] = Line2D([], [], **style)

    def unnamed_line(self, names: tuple[str, ...], x: Field, y: Field, **style: Any) -> None:
        """Draw a line where y >= 0 that belongs to entries of the legend and adds none.

        A zero is drawn, because theories underflow: at 0 on a linear axis, below a logarithmic one.
        """
        y = np.where(y >= 0, y, np.nan)
        self.axes.plot(x, y, **style)
        if x.size:
            colour, width = to_hex(style["color"]), style.get("lw", STYLE["lines.linewidth"])
            layer = PlotLayer("line", names, x, y, colour, width=width, dashed="ls" in style)
            self.layers.append(layer)

    def theory(self, lines: list[tuple[CurveStyle, Field, Field]], label: str = THEORY) -> None:
        """Draw one black line if the theory is the same for all curves, else one in each colour."""
        lines = [line for line in lines if np.any(np.isfinite(line[2]))]
        if not lines:
            return
        one = all(np.allclose(y, lines[0][2], rtol=1e-9, atol=0) for *_, y in lines)
        for style, x, y in lines[:1] if one else lines:
            names = (label,) if one else (style.label, label)
            self.unnamed_line(names, x, y, color="black" if one else style.colour, zorder=2)
        self.legend[label] = Line2D([], [], color="black" if one else "0.4")

    def second_x(self, label: str, factor: float) -> None:
        """Add an axis at the top for x times a factor; to be called after `scale`."""
        self.second = label, factor
        self.axes.tick_params(axis="x", which="both", top=False)
        ways = (partial(np.multiply, factor), partial(np.multiply, 1 / factor))
        second = self.axes.secondary_xaxis("top", ways)
        second.set_xlabel(label)
        if self.axes.get_xscale() == "log":
            low, high = self.axes.get_xlim()
            _tick(second.xaxis, low * factor, high * factor)

    def scale(self, name: str, scale: str, values: Any, *, zero: bool = True) -> None:
        """Set scale and limits of the axis `name`; `zero`: a linear axis begins at or below 0."""
        low, high = float(np.min(values)), float(np.max(values))
        if scale == "log":
            log_scale(self.axes, name, low, high)
            return
        low = min(low, 0.0) if zero else low
        pad = max(high - low, LEAST_SPAN * abs(high)) or 1.0
        span = (low - (0.03 if zero else 0.1) * pad, high + 0.1 * pad)
        self.axes.set(**{f"{name}scale": scale, f"{name}lim": span})


def log_scale(axes: Any, name: str, low: float, high: float) -> None:
    """Set a logarithmic scale and limits of the axis `name` around two values."""
    pad = max(1.4, float(np.sqrt(8 * low / high)))  # 8: holds two of the ticks 1, 2, 5, 10
    span = (low / pad, high * pad)
    axes.set(**{f"{name}scale": "log", f"{name}lim": span})
    _tick(getattr(axes, f"{name}axis"), *span)


def shades(name: str, start: float, none: str, beyond: str) -> Any:
    """The colours of a named map from `start` to 1; those of NaN and of values above the scale."""
    colours = colormaps[name](np.linspace(start, 1.0, 256))
    return LinearSegmentedColormap.from_list(name, colours).with_extremes(bad=none, over=beyond)


def _legend_shape(labels: list[str], wide: float) -> tuple[int, int]:
    """Columns and rows of a legend; `wide`: its width over that of a printed column."""
    for columns in range(min(int(4 * wide), len(labels)), 0, -1):
        split = np.array_split([len(label) + SYMBOL for label in labels], columns)
        if sum(max(lengths) for lengths in split) <= COLUMN * wide:
            break
    return columns, len(split[0])


def _tick(axis: Any, low: float, high: float) -> None:
    """Set the ticks of a log axis: whole decades, or 1, 2, 5 if there are fewer than two."""
    decades = np.floor(np.log10(high)) - np.ceil(np.log10(low)) + 1
    plain = low > 5e-4 and high < 5e4
    many = decades > MANY_DECADES
    subs = (1, 2, 5) if decades < 2 else (1,)
    axis.set_major_locator(ticker.LogLocator(subs=subs, numticks=5 if many else 8))
    axis.set_major_formatter(
        ticker.StrMethodFormatter("{x:g}")
        if plain
        else ticker.LogFormatterSciNotation(minor_thresholds=(np.inf, np.inf))
    )
    axis.set_minor_locator(ticker.LogLocator(subs=(1,) if many else range(2, 10), numticks=99))
    axis.set_minor_formatter(ticker.NullFormatter())
    axis.set_tick_params(labelsize=SMALL if plain else SCRIPTED)
