"""Figures of a comparison, each one printed column wide: symbols simulation, lines theory."""

from dataclasses import dataclass, replace
from fractions import Fraction
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.analysis.compare import Comparison, Curve, Row, einstein_prediction
from gfmd_cli.errors import InputError
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.observables import linear_edges, logarithmic_edges
from gfmd_cli.study.files import write_whole
from gfmd_cli.study.layout import PR_LINEAR, PR_LOGARITHMIC

try:
    from matplotlib import colormaps, rc_context
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter
except ImportError as error:
    raise InputError(f"figures need matplotlib: pip install gfmd-cli[plot] ({error})") from error

WIDTH, HEIGHT = 3.39, 2.35  # inches: 86 mm, one column; the legend adds to the height
ROW = 0.145  # inches that a row of the legend adds
DPI = 300
SCRIPTED = 9.3  # points: sub- and superscripts are printed at 0.7 of it, 6.5 points
STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 8.0,
    "axes.labelsize": SCRIPTED,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.0,
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
MARKERS = "os^Dv<p>h"
MANY = 8  # curves that a legend can tell apart one by one
TYPICAL_AREA = 0.1  # relative contact area of the paper's Fig. 7
PRESSURES = 5  # that the distribution of one body is drawn at
P_STAR = r"reduced pressure  $p^* = p\,/\,\Delta\sigma$"
DENSITY, STRESS = r"$\mathrm{Pr}(\sigma)\;\Delta\sigma$", r"stress  $\sigma\,/\,\Delta\sigma$"
Span = tuple[float, float]


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


class Sheet:
    """A figure in the making; its legend stands above the axes, off the data."""

    def __init__(self, x_label: str, y_label: str) -> None:
        self.figure = Figure(figsize=(WIDTH, HEIGHT), layout="constrained")
        self.axes = self.figure.add_subplot(xlabel=x_label, ylabel=y_label)
        self.legend: dict[str, Line2D] = {}

    def line(self, label: str, x: Field, y: Field, **style: Any) -> None:
        """A line; the first of a label stands in the legend."""
        self.axes.plot(x, y, **style)
        self.legend.setdefault(label, Line2D([], [], **style))

    def points(self, look: Look, x: Field, y: Field, error: Field, converged: Any) -> None:
        """Open symbols with error bars where there are errors; crosses where not converged."""
        open_symbol = {"ls": "none", "mfc": "none", "color": look.colour, "zorder": 3}
        known = np.isfinite(error)
        if np.any(known):
            bars = {"fmt": "none", "ecolor": look.colour, "elinewidth": 0.7, "capsize": 2}
            self.axes.errorbar(x[known], y[known], np.abs(error[known]), **bars)
        for chosen, marker in ((converged, look.marker), (~converged, "x")):
            self.axes.plot(x[chosen], y[chosen], marker=marker, **open_symbol)
        self.legend[look.label] = Line2D([], [], marker=look.marker, **open_symbol)
        if not np.all(converged):
            cross = open_symbol | {"color": "0.4"}
            self.legend["not converged"] = Line2D([], [], marker="x", **cross)

    def write(self, path: Path) -> list[Path]:
        """Write a PDF and a PNG, each whole or not at all. Raises SpaceError."""
        longest = max(map(len, self.legend), default=1)
        columns = max(1, min(4, len(self.legend), 56 // (longest + 7)))
        rows = -(-len(self.legend) // columns)
        self.figure.set_size_inches(WIDTH, HEIGHT + ROW * rows)
        self.figure.legend(
            self.legend.values(),
            self.legend.keys(),
            loc="outside upper center",
            ncols=columns,
            borderpad=0,
            labelspacing=0.25,
            columnspacing=1.4,
            handlelength=1.6,
            handletextpad=0.5,
        )
        files = [path.with_name(f"{path.name}.{kind}") for kind in ("pdf", "png")]
        for file, metadata in zip(files, ({"CreationDate": None}, {}), strict=True):
            image = BytesIO()
            self.figure.savefig(image, format=file.suffix[1:], dpi=DPI, metadata=metadata)
            write_whole(file, image.getvalue())
        return files


def draw_all(comparison: Comparison, folder: Path) -> list[Path]:
    """Draw every figure that the study has data for, as PDF and PNG; return their paths.

    Raises SpaceError where the folder cannot be written.
    """
    curves = comparison.curves
    looks = _looks(curves)
    with rc_context(STYLE):
        sheets = {view.name: _over_pressure(view, curves, looks) for view in VIEWS}
        sheets["stress_distribution"] = _distribution(curves, looks)
        sheets["stress_distribution_pressures"] = _distribution_pressures(curves)
        return [
            path
            for name, sheet in sheets.items()
            if sheet is not None
            for path in sheet.write(folder / name)
        ]


def _over_pressure(view: View, curves: list[Curve], looks: list[Look]) -> Sheet | None:
    """One quantity of all curves over the pressure, beside theory; None without data."""
    sheet = Sheet(P_STAR, view.label)
    drawn = []
    for curve, look in zip(curves, looks, strict=True):
        x, y, error = (curve.column(c) for c in ("p_star", view.column, f"{view.column}_error"))
        if view.ratio:
            scale = getattr(curve.prediction, view.column)
            y, error = y / scale, error / scale
        kept = np.isfinite(x) & np.isfinite(y) & ((y > 0) | (view.y_scale == "linear"))
        converged = np.array([row["status"] == "converged" for row in curve.rows])
        if np.any(kept):
            x, y = x[kept], y[kept]
            sheet.points(look, x, y, error[kept], converged[kept])
            drawn.append((curve, look, x, y))
    if not drawn:
        return None
    x, y = (np.concatenate([item[i] for item in drawn]) for i in (2, 3))
    span = _span(x, view.x_scale)
    if view.ratio:
        for _, look, *guide in drawn:
            sheet.axes.plot(*guide, color=look.colour, lw=0.6)
        sheet.line("Persson theory", np.array(span), np.ones(2), color="black", zorder=1)
        y = np.append(y, 1.0)
    else:
        p_star = _dense(span)
        lines = [(k, p_star, getattr(c.predict(p_star), view.column)) for c, k, *_ in drawn]
        _draw_theory(sheet, lines)
        if view.column == "u_g" and any(curve.n == 0 for curve, *_ in drawn):
            exact, style = einstein_prediction(p_star).u_g, {"color": "0.4", "ls": (0, (4, 2))}
            sheet.line("Gaussian heights, n = 0", p_star, exact, zorder=1.5, **style)
        if view.y_scale == "linear":
            y = np.concatenate([y, *(theory for *_, theory in lines)])
    _scale_axis(sheet.axes, "x", view.x_scale, span)
    _scale_axis(sheet.axes, "y", view.y_scale, _span(y, view.y_scale, zero=not view.ratio))
    return sheet


def _distribution(curves: list[Curve], looks: list[Look]) -> Sheet | None:
    """Pr(sigma) of all curves at the common pressure where a_r is nearest TYPICAL_AREA."""
    pairs = [
        (curve, look, [row for row in curve.rows if np.any(_density(row, PR_LOGARITHMIC) > 0)])
        for curve, look in zip(curves, looks, strict=True)
    ]
    pairs = [(curve, look, rows) for curve, look, rows in pairs if rows]
    if not pairs:
        return None
    candidates = sorted({row["p_star"] for *_, rows in pairs for row in rows})

    def chosen(p_star: float) -> list[Row]:
        return [min(rows, key=lambda r: abs(np.log(r["p_star"] / p_star))) for *_, rows in pairs]

    def distance(p_star: float) -> float:
        return sum(abs(float(np.log(row["a_r"] / TYPICAL_AREA))) for row in chosen(p_star))

    best = chosen(min(candidates, key=distance))
    sheet = Sheet(STRESS, DENSITY)
    edges = logarithmic_edges()
    middle = np.sqrt(edges[1:] * edges[:-1])
    drawn = []
    for (_, look, _), row in zip(pairs, best, strict=True):
        density = _density(row, PR_LOGARITHMIC)
        x, y = middle[density > 0], density[density > 0]
        converged = np.full(x.size, row["status"] == "converged")
        sheet.points(look, x, y, np.full(x.size, np.nan), converged)
        drawn.append((x, y))
    x, y = (np.concatenate(parts) for parts in zip(*drawn, strict=True))
    span = _span(x, "log")
    sigma = _dense(span)
    _draw_theory(
        sheet,
        [
            (look, sigma, _theory_density(curve, sigma, row["p_star"]))
            for (curve, look, _), row in zip(pairs, best, strict=True)
        ],
    )
    _scale_axis(sheet.axes, "x", "log", span)
    _scale_axis(sheet.axes, "y", "log", _span(y, "log"))
    low, high = min(r["p_star"] for r in best), max(r["p_star"] for r in best)
    between = f"{low:.3g}" if high < 1.001 * low else f"{low:.3g} ... {high:.3g}"
    sheet.axes.text(
        0.04, 0.94, f"$p^* = {between}$", transform=sheet.axes.transAxes, va="top", size=SCRIPTED
    )
    return sheet


def _distribution_pressures(curves: list[Curve]) -> Sheet | None:
    """Pr(sigma) in linear bins of the curve nearest n = 1 at up to five pressures."""
    held = [
        (curve, [row for row in curve.rows if np.any(_density(row, PR_LINEAR) > 0)])
        for curve in curves
    ]
    held = [(curve, rows) for curve, rows in held if len(rows) > 1]
    if not held:
        return None
    curve, rows = min(held, key=lambda pair: abs(np.nan_to_num(pair[0].n, nan=9.0) - 1))
    places = np.unique(np.linspace(0, len(rows) - 1, PRESSURES).round().astype(int))
    edges = linear_edges()
    middle = 0.5 * (edges[1:] + edges[:-1])
    sheet = Sheet(STRESS, DENSITY)
    drawn = []
    for place, colour in zip(places, _colours(places.size), strict=True):
        row = rows[place]
        density = _density(row, PR_LINEAR)
        x, y = middle[density > 0], density[density > 0]
        label = f"p* = {row['p_star']:.3g}"
        theory = _theory_density(curve, middle, row["p_star"])
        sheet.line("Persson theory", middle, theory, color="black", lw=0.6, zorder=3)
        sheet.line(label, x, y, color=colour, lw=1.4)
        drawn.append((x, y))
    x, y = (np.concatenate(parts) for parts in zip(*drawn, strict=True))
    _scale_axis(sheet.axes, "x", "linear", (0.0, 1.03 * float(x.max())))
    _scale_axis(sheet.axes, "y", "log", _span(y, "log"))
    return sheet


def _density(row: Row, name: str) -> Field:
    """Pr(sigma) Delta_sigma of a row in its bins, zero where it is not stored."""
    return np.nan_to_num(np.asarray(row.get(name, 0.0), dtype=np.float64))


def _theory_density(curve: Curve, sigma: Field, p_star: float) -> Field:
    """Pr(sigma) Delta_sigma of Persson theory over sigma / Delta_sigma. Paper Eq. (24)."""
    unit = curve.rows[0]["delta_sigma"]
    return unit * curve.persson.stress_density(sigma * unit, p_star * unit)


def _draw_theory(sheet: Sheet, lines: list[tuple[Look, Field, Field]]) -> None:
    """One black line where theory is the same for all curves, else one in each colour."""
    first = lines[0][2]
    if all(np.allclose(y, first, rtol=1e-9, atol=0) for *_, y in lines):
        lines = [(replace(lines[0][0], colour="black"), *lines[0][1:])]
    for look, x, y in lines:
        sheet.axes.plot(x, np.where(y > 0, y, np.nan), color=look.colour, zorder=2)
    colour = "black" if len(lines) == 1 else "0.4"
    sheet.legend["Persson theory"] = Line2D([], [], color=colour)


def _looks(curves: list[Curve]) -> list[Look]:
    """Colours ordered by the stiffness, one a body; markers tell bodies or variants apart."""

    def order(curve: Curve) -> tuple[float, float]:
        n, thickness = curve.n, float(curve.rows[0]["thickness"])
        return (np.nan_to_num(n, nan=9.0), np.nan_to_num(thickness, nan=0.0))

    bodies = list(dict.fromkeys(curve.elastomer for curve in sorted(curves, key=order)))
    names = _names({curve.elastomer: curve for curve in curves})
    variants = _variants(curves)
    single = len(curves) <= MANY
    one_body = len(bodies) == 1 and single
    colours = _colours(len(curves) if one_body else len(bodies))
    looks = []
    for index, (curve, variant) in enumerate(zip(curves, variants, strict=True)):
        body = bodies.index(curve.elastomer)
        mark = index if single and any(variants) else body
        label = ", ".join(filter(None, [names[curve.elastomer], variant if single else ""]))
        colour = colours[index if one_body else body]
        looks.append(Look(colour, MARKERS[mark % len(MARKERS)], label.replace("$", r"\$")))
    return looks


def _colours(count: int) -> list[Any]:
    """Ordered colours that keep their contrast on white and in grey."""
    return list(colormaps["plasma"](np.linspace(0.0, 0.8, count)))


def _names(bodies: dict[str, Curve]) -> dict[str, str]:
    """A short name for each elastomer; its full text where short ones would coincide."""
    short = {}
    for text, curve in bodies.items():
        thickness = float(curve.rows[0]["thickness"])
        if np.isfinite(curve.n):
            exact = Fraction(curve.n).limit_denominator(4)
            short[text] = f"n = {exact}" if exact == curve.n else f"n = {curve.n:g}"
        else:
            short[text] = f"t/L = {thickness:g}" if np.isfinite(thickness) else text
    return short if len(set(short.values())) == len(short) else {text: text for text in short}


def _variants(curves: list[Curve]) -> list[str]:
    """What sets curves apart besides the elastomer: surface, grid, solver; empty if nothing."""
    told = []
    for curve in curves:
        row = curve.rows[0]
        told.append(
            [
                *(word for word in curve.surface.split() if not word.startswith("seed=")),
                f"seed={row['seed']}",
                f"{curve.points} points",
                f"{row['solver']}",
                f"tolerance={row['tolerance']:g}",
            ]
        )
    common = set(told[0]).intersection(*told)
    return [" ".join(word for word in words if word not in common) for words in told]


def _dense(span: Span) -> Field:
    """Abscissae close enough for a line on either scale."""
    low, high = (span[0] if span[0] > 0 else 1e-3 * span[1]), span[1]
    return np.union1d(np.geomspace(low, high, 200), np.linspace(low, high, 200))


def _span(values: Field, scale: str, *, zero: bool = True) -> Span:
    """Limits of an axis around the values: on a log scale about a decade at least."""
    low, high = float(values.min()), float(values.max())
    if scale == "log":
        pad = max(1.4, float(np.sqrt(8 * low / high)))  # 8: holds two of the ticks 1, 2, 5, 10
        return low / pad, high * pad
    if zero:
        top = high if high > 0 else 1.0
        return -0.03 * top, 1.06 * top
    pad = 0.08 * (high - low) or 0.1 * abs(high)
    return low - pad, high + pad


def _scale_axis(axes: Any, name: str, scale: str, span: Span) -> None:
    """Scale, limits and ticks; on a log scale whole decades, or 1, 2, 5 where these are few."""
    axes.set(**{f"{name}scale": scale, f"{name}lim": span})
    if scale == "linear":
        return
    axis = getattr(axes, f"{name}axis")
    first, last = (int(np.floor(np.log10(end))) for end in span)
    step = 1 + (last - first) // 7
    ticks = [10.0**k for k in range(first, last + 1, step) if 10.0**k >= span[0]]
    if len(ticks) < 2:
        ticks = [m * 10.0**k for k in range(first, last + 1) for m in (1, 2, 5)]
    plain = span[0] > 5e-4 and span[1] < 5e4
    axis.set_major_locator(FixedLocator([tick for tick in ticks if span[0] <= tick <= span[1]]))
    axis.set_major_formatter(FuncFormatter(_plain if plain else _power))
    axis.set_minor_locator(LogLocator(subs=range(2, 10), numticks=99))
    axis.set_minor_formatter(NullFormatter())
    axis.set_tick_params(labelsize=8.0 if plain else SCRIPTED)


def _plain(value: float, _place: int) -> str:
    return f"{value:g}"


def _power(value: float, _place: int) -> str:
    """The tick label m x 10^k."""
    k = int(np.floor(np.log10(value) + 1e-9))
    m = round(value / 10.0**k)
    return f"$10^{{{k}}}$" if m == 1 else rf"${m}\times10^{{{k}}}$"
