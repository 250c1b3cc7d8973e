"""Figures of a comparison, each as wide as a printed column: symbols simulation, lines theory."""

from dataclasses import dataclass
from fractions import Fraction
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.analysis.compare import Comparison, Curve, Prediction, Row, einstein_prediction
from gfmd_cli.errors import InputError
from gfmd_cli.physics.fields import Field, Mask
from gfmd_cli.physics.observables import linear_edges, logarithmic_edges
from gfmd_cli.study.files import write_whole
from gfmd_cli.study.layout import PR_LINEAR, PR_LOGARITHMIC

try:
    from matplotlib import rc_context, ticker
    from matplotlib.colors import to_rgb
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
except ImportError as error:
    raise InputError(f"figures need matplotlib: pip install gfmd-cli[plot] ({error})") from error

WIDTH, HEIGHT, ROW = 3.39, 2.35, 0.145  # inches: a column of 86 mm; a row of the legend adds ROW
COLUMN = 54  # characters and symbols that a row of the legend holds
LONGEST = 46  # characters of a label
SCRIPTED = 9.3  # points: sub- and superscripts are printed at 0.7 of it, 6.5 points
STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 8.0,
    "axes.labelsize": SCRIPTED,
    "axes.linewidth": 0.6,
    "lines.linewidth": 0.9,
    "lines.markersize": 4.2,
    "lines.markeredgewidth": 0.9,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "pdf.fonttype": 42,  # TrueType: publishers refuse Type 3
}
LADDER = ("#332288", "#0077bb", "#009988", "#999933", "#ee7733", "#cc3311")
"""Told apart by the colour-blind too (P. Tol, Colour schemes, 2021), ordered by hue."""
MARKERS = "os^Dv<p>h"
MANY = 8  # curves; more cannot be told apart one by one
PRESSURES = 5  # that the distribution of one body is drawn at
TYPICAL_AREA = 0.1  # relative contact area of the paper's Fig. 7
WIDE = 20  # a ratio that varies by more is drawn on a log scale
NEAR = 1.5  # pressures that differ by a smaller factor are drawn side by side
FEW = 10  # grid points; a bin with fewer is noise of 30 % and more
P_STAR = r"reduced pressure  $p^* = p\,/\,\Delta\sigma$"
STRESS, DENSITY = r"stress  $\sigma\,/\,\Delta\sigma$", r"$\mathrm{Pr}(\sigma)\;\Delta\sigma$"
THEORY = "Persson theory"


@dataclass(frozen=True)
class View:
    """A quantity over the reduced pressure."""

    name: str
    column: str
    label: str
    x_scale: str = "log"
    y_scale: str = "linear"
    ratio: bool = False


AREA, GAP = r"relative contact area  $a_r$", r"mean gap  $u_g\,/\,h_\mathrm{std}$"
VIEWS = (
    View("contact_area", "a_r", AREA, y_scale="log"),
    View("contact_area_ratio", "a_r", r"$a_r\,/\,a_r$(Persson)", ratio=True),
    View("stress_deviation", "sigma_p", r"stress deviation  $\sigma_p\,/\,\Delta\sigma$"),
    View("mean_gap_log", "u_g", GAP),
    View("mean_gap_tail", "u_g", GAP, x_scale="linear", y_scale="log"),
)


@dataclass(frozen=True)
class Look:
    """How a curve is drawn."""

    colour: Any
    marker: str
    label: str


@dataclass(frozen=True)
class Item:
    """A curve with its look, and its theory over pressures close enough for a line."""

    curve: Curve
    look: Look
    p_star: Field
    theory: Prediction


class Sheet:
    """A figure in the making; its legend stands above the axes, off the data."""

    def __init__(self, x_label: str, y_label: str) -> None:
        self.figure = Figure(figsize=(WIDTH, HEIGHT), layout="constrained")
        self.axes = self.figure.add_subplot(xlabel=x_label, ylabel=y_label)
        self.legend: dict[str, Any] = {}

    def line(self, label: str, x: Field, y: Field, **style: Any) -> None:
        """A line where y > 0."""
        self.axes.plot(x, np.where(y > 0, y, np.nan), **style)
        self.legend[label] = Line2D([], [], **style)

    def points(self, look: Look, x: Field, y: Field, converged: Mask, every: Any = 1) -> None:
        """Open symbols, crosses where not converged."""
        style = {"ls": "none", "mfc": "none", "color": look.colour, "zorder": 3}
        for chosen, marker in ((converged, look.marker), (~converged, "x")):
            self.axes.plot(x[chosen], y[chosen], marker=marker, markevery=every, **style)
        self.legend[look.label] = Line2D([], [], marker=look.marker, **style)
        if not np.all(converged):
            self.legend["not converged"] = Line2D([], [], marker="x", ls="none", color="0.4")

    def theory(self, lines: list[tuple[Look, Field, Field]]) -> None:
        """One black line where theory is the same for all curves, else one in each colour."""
        one = all(np.allclose(y, lines[0][2], rtol=1e-9, atol=0) for *_, y in lines)
        for look, x, y in lines[:1] if one else lines:
            self.line(THEORY, x, y, color="black" if one else look.colour, zorder=2)
        self.legend[THEORY] = Line2D([], [], color="black" if one else "0.4")

    def scale(self, name: str, scale: str, values: Any, *, zero: bool = True) -> None:
        """Scale and limits of the axis `name` around the values; `zero` belongs to a linear one."""
        low, high = float(np.min(values)), float(np.max(values))
        if scale == "log":
            pad = max(1.4, float(np.sqrt(8 * low / high)))  # 8: holds two of the ticks 1, 2, 5, 10
            span = (low / pad, high * pad)
        else:
            low = 0.0 if zero else low
            pad = (high - low) or abs(high) or 1.0
            span = (low - (0.03 if zero else 0.1) * pad, high + 0.1 * pad)
        self.axes.set(**{f"{name}scale": scale, f"{name}lim": span})
        if scale == "log":
            _tick(getattr(self.axes, f"{name}axis"), *span)

    def write(self, path: Path) -> list[Path]:
        """Write a PDF and a PNG, each whole or not at all. Raises SpaceError."""
        columns, rows = _legend_shape(list(self.legend))
        self.figure.set_size_inches(WIDTH, HEIGHT + ROW * rows)
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
        self.figure.draw_without_rendering()
        self.figure.set_layout_engine("none")  # laid out once for both files
        files = [path.with_name(f"{path.name}.{kind}") for kind in ("pdf", "png")]
        for file, metadata in zip(files, ({"CreationDate": None}, {}), strict=True):
            image = BytesIO()
            self.figure.savefig(image, format=file.suffix[1:], dpi=300, metadata=metadata)
            write_whole(file, image.getvalue())
        return files


def draw_all(comparison: Comparison, folder: Path) -> list[Path]:
    """Draw every figure that the study has data for, as PDF and PNG; return their paths.

    Raises SpaceError where the folder cannot be written.
    """
    curves = sorted(comparison.curves, key=_order)
    pressures = np.concatenate([curve.column("p_star") for curve in curves])
    low, high = pressures.min() / 3, pressures.max() * 3
    low = min(low, high / 1000)  # near the left end of a linear axis
    p_star = np.union1d(np.geomspace(low, high, 200), np.linspace(low, high, 100))
    items = [
        Item(curve, look, p_star, curve.predict(p_star))
        for curve, look in zip(curves, _looks(curves), strict=True)
    ]
    with rc_context(STYLE):
        sheets = {view.name: _over_pressure(view, items) for view in VIEWS}
        sheets["stress_distribution"] = _distribution(items)
        sheets["stress_distribution_pressures"] = _distribution_pressures(items)
        return [path for name, s in sheets.items() if s for path in s.write(folder / name)]


def _over_pressure(view: View, items: list[Item]) -> Sheet | None:
    """One quantity of all curves over the pressure, beside theory; None without data."""
    sheet = Sheet(P_STAR, view.label)
    drawn, xs, ys = [], [], []
    for item in items:
        curve, look = item.curve, item.look
        x, y, error = (curve.column(c) for c in ("p_star", view.column, f"{view.column}_error"))
        unit = getattr(curve.prediction, view.column) if view.ratio else np.ones_like(y)
        y, error = y / unit, np.abs(error) / unit
        kept = np.isfinite(y) & ((y > 0) | (view.y_scale == "linear"))
        if not np.any(kept):
            continue
        converged = np.array([row["status"] == "converged" for row in curve.rows])
        if view.ratio:
            sheet.axes.plot(x[kept], y[kept], color=look.colour, lw=0.6)
        barred = kept & np.isfinite(error)
        if np.any(barred):
            bars = {"fmt": "none", "ecolor": look.colour, "elinewidth": 0.7, "capsize": 2}
            sheet.axes.errorbar(x[barred], y[barred], error[barred], **bars)
        sheet.points(look, x[kept], y[kept], converged[kept])
        drawn.append(item)
        xs.append(x[kept])
        ys.append(y[kept])
    if not drawn:
        return None
    p_star = drawn[0].p_star
    lines = [(item.look, p_star, getattr(item.theory, view.column)) for item in drawn]
    if view.ratio:
        lines = [(drawn[0].look, p_star, np.ones_like(p_star))]
    sheet.theory(lines)
    if view.column == "u_g" and any(item.curve.n == 0 for item in drawn):
        exact, dashes = einstein_prediction(p_star).u_g, (0, (4, 2))
        sheet.line("n = 0, Gaussian", p_star, exact, color="black", ls=dashes, lw=0.8, zorder=2.5)
    sheet.scale("x", view.x_scale, np.concatenate(xs))
    if view.y_scale == "linear":
        low, high = sheet.axes.get_xlim()
        ys += [y[(p_star >= low) & (p_star <= high)] for *_, y in lines]
    y = np.concatenate(ys)
    wide = view.ratio and y.max() > WIDE * y.min() > 0
    sheet.scale("y", "log" if wide else view.y_scale, y, zero=not view.ratio)
    return sheet


def _distribution(items: list[Item]) -> Sheet | None:
    """Pr(sigma) of the curves at one pressure: that of most curves, then of a_r = TYPICAL_AREA."""
    held = [(item, _with_density(item.curve, PR_LOGARITHMIC)) for item in items]
    held = [(item, rows) for item, rows in held if rows]
    if not held:
        return None

    def chosen(p_star: float) -> list[tuple[Item, Row]]:
        pairs = [
            (item, min(rows, key=lambda row: abs(np.log(row["p_star"] / p_star))))
            for item, rows in held
        ]
        return [(i, row) for i, row in pairs if 1 / NEAR < row["p_star"] / p_star < NEAR]

    def distance(p_star: float) -> tuple[int, float]:
        areas = np.array([row["a_r"] for _, row in chosen(p_star)])
        return -areas.size, float(np.sum(np.abs(np.log(areas / TYPICAL_AREA))))

    best = chosen(min(sorted({row["p_star"] for _, rows in held for row in rows}), key=distance))
    low, high = (end(row["p_star"] for _, row in best) for end in (min, max))
    between = f"{low:.3g}" if high < 1.001 * low else rf"{low:.3g}\;\mathrm{{to}}\;{high:.3g}"
    sheet = Sheet(rf"{STRESS}  at  $p^* = {between}$", DENSITY)
    xs, ys = [], []
    for place, (item, row) in enumerate(best):
        x, y = _bins(row, PR_LOGARITHMIC)
        sheet.axes.plot(x, y, color=item.look.colour, lw=0.7)
        converged = np.full(x.size, row["status"] == "converged")
        sheet.points(item.look, x, y, converged, every=(place % 3, 3) if len(best) > 1 else 1)
        xs.append(x)
        ys.append(y)
    sheet.scale("x", "log", np.concatenate(xs))
    sheet.scale("y", "log", np.concatenate(ys))
    sigma = np.geomspace(*sheet.axes.get_xlim(), 400)
    sheet.theory([(i.look, sigma, _theory_density(i.curve, row, sigma)) for i, row in best])
    return sheet


def _distribution_pressures(items: list[Item]) -> Sheet | None:
    """Pr(sigma) of the curve nearest to n = 1 at a few pressures, over the stress itself."""
    held = [(item, _with_density(item.curve, PR_LINEAR)) for item in items]
    held = [(item, rows) for item, rows in held if len(rows) > 1]
    if not held:
        return None
    item, rows = min(held, key=lambda pair: np.nan_to_num(abs(pair[0].curve.n - 1), nan=9.0))
    places = np.unique(np.linspace(0, len(rows) - 1, PRESSURES).round().astype(int))
    rows = [rows[place] for place in places]
    sheet = Sheet(f"{STRESS}  for  {item.look.label[:24]}", DENSITY)
    xs, ys = [], []
    for row, colour in zip(rows, _colours(len(rows)), strict=True):
        x, y = _bins(row, PR_LINEAR)
        sheet.line(f"p* = {row['p_star']:.3g}", x, y, color=colour, lw=1.6)
        xs.append(x)
        ys.append(y)
    sheet.scale("x", "linear", np.concatenate(xs))
    sheet.scale("y", "log", np.concatenate(ys))
    sigma = np.linspace(0.0, sheet.axes.get_xlim()[1], 400)
    for row in rows:
        density = _theory_density(item.curve, row, sigma)
        sheet.line(THEORY, sigma, density, color="black", lw=0.6, zorder=3)
    return sheet


def _with_density(curve: Curve, name: str) -> list[Row]:
    """The rows that have enough of Pr(sigma) for a line."""
    return [row for row in curve.rows if name in row and _bins(row, name)[0].size > 2]


def _bins(row: Row, name: str) -> tuple[Field, Field]:
    """Pr(sigma) Delta_sigma over sigma / Delta_sigma, bins with fewer than FEW points left out."""
    edges = linear_edges() if name == PR_LINEAR else logarithmic_edges()
    density = np.nan_to_num(row[name])
    counts = density * np.diff(edges) * row["points"]
    if not np.allclose(counts, np.rint(counts), rtol=0, atol=1e-6):  # no line scene
        counts *= row["points"]
    kept = counts > FEW - 0.5
    lower, upper = edges[:-1][kept], edges[1:][kept]
    middle = 0.5 * (lower + upper) if name == PR_LINEAR else np.sqrt(lower * upper)
    return middle, density[kept]


def _theory_density(curve: Curve, row: Row, sigma: Field) -> Field:
    """Pr(sigma) Delta_sigma of Persson theory over sigma / Delta_sigma. Paper Eq. (24)."""
    unit: float = row["delta_sigma"]
    return np.asarray(unit * curve.persson.stress_density(sigma * unit, row["p_star"] * unit))


def _order(curve: Curve) -> tuple[float, float]:
    """Slabs by rising thickness, then bodies by rising exponent, then the others."""
    thickness, n = (float(np.nan_to_num(curve.rows[0][c], nan=np.inf)) for c in ("thickness", "n"))
    return thickness, n


def _looks(curves: list[Curve]) -> list[Look]:
    """Colours along the ordered curves, one a body; symbols tell bodies, or else curves, apart."""
    bodies = list(dict.fromkeys(curve.elastomer for curve in curves))
    names = _names({curve.elastomer: curve for curve in curves})
    variants = _variants(curves) if len(curves) <= MANY else [""] * len(curves)
    singly = len(bodies) == 1 and any(variants)
    colours = _colours(len(curves) if singly else len(bodies))
    looks = []
    for i, (curve, variant) in enumerate(zip(curves, variants, strict=True)):
        body = bodies.index(curve.elastomer)
        marker = MARKERS[(i if any(variants) else body) % len(MARKERS)]
        label = ", ".join(filter(None, (names[curve.elastomer], variant)))
        looks.append(
            Look(colours[i if singly else body], marker, label[:LONGEST].replace("$", r"\$"))
        )
    return looks


def _colours(count: int) -> list[Any]:
    """Colours evenly along the ladder."""
    steps = np.array([to_rgb(colour) for colour in LADDER]).T
    at = np.linspace(0, len(LADDER) - 1, count)
    return list(np.stack([np.interp(at, range(len(LADDER)), step) for step in steps], axis=1))


def _names(bodies: dict[str, Curve]) -> dict[str, str]:
    """A short name for each elastomer; its full text where short ones would coincide."""
    short = {}
    for text, curve in bodies.items():
        thickness = curve.rows[0]["thickness"]
        short[text] = f"t/L = {thickness:g}" if np.isfinite(thickness) else text
        if np.isfinite(curve.n):
            exact = Fraction(curve.n).limit_denominator(4)
            short[text] = f"n = {exact}" if exact == curve.n else f"n = {curve.n:g}"
    return short if len(set(short.values())) == len(short) else {text: text for text in short}


def _variants(curves: list[Curve]) -> list[str]:
    """What sets curves of one elastomer apart: surface, seed, grid, solver; empty if nothing."""
    told = []
    for curve in curves:
        row = curve.rows[0]
        words = [word for word in curve.surface.split() if not word.startswith("seed=")]
        words += [f"seed={row['seed']}", f"{row['points']} points"]
        told.append([*words, row["solver"], f"tolerance={row['tolerance']:g}"])
    variants = []
    for curve, words in zip(curves, told, strict=True):
        peers = [w for c, w in zip(curves, told, strict=True) if c.elastomer == curve.elastomer]
        common = set(words).intersection(*peers)
        variants.append(" ".join(word for word in words if word not in common))
    return variants


def _legend_shape(labels: list[str]) -> tuple[int, int]:
    """Columns and rows of a legend that is filled column by column."""
    for columns in range(min(4, len(labels)), 0, -1):
        split = np.array_split([len(label) for label in labels], columns)
        if sum(max(lengths) + 6 for lengths in split) <= COLUMN:  # 6: symbol and space around it
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
    axis.set_tick_params(labelsize=8.0 if plain else SCRIPTED)
