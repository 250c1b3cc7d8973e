"""Work-precision diagrams of a bench: error of the mean gap over transforms and seconds."""

import re
from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.analysis.curve_styles import CurveStyle, distinct_styles, literal
from gfmd_cli.analysis.plotting import SMALL, WIDTH, LegendFigure, log_scale, styled
from gfmd_cli.analysis.selection import grouped
from gfmd_cli.analysis.wording import contact_title
from gfmd_cli.bench.file import Trace
from gfmd_cli.bench.run import REFERENCE
from gfmd_cli.bench.table import contact_of, solver_names
from gfmd_cli.files.atomic import make_folder
from gfmd_cli.grid.arrays import Field
from gfmd_cli.status import Status

FULL_WIDTH, ROW_HEIGHT = 2.09 * WIDTH, 2.0  # inches: a page of 180 mm; a row of panels
MAX_CONTACTS = 4  # rows of panels that a page holds
COSTS = (
    ("transforms", "transforms of the solved size"),
    ("seconds", "processor time on one thread (s)"),
)
ROOM = 2.0  # for the symbols at the ends of a curve
MAX_LABEL = 100  # characters of a title and of a file name
ERROR = r"relative error of $u_g$"


def draw_bench(traces: list[Trace], folder: Path) -> list[Path]:
    """Draw a bench as PDF and PNG: one figure, or one for each of many contacts; return the paths.

    Raises SpaceError where the folder cannot be written.
    """
    make_folder(folder)
    with styled():
        return [
            path
            for name, plot in bench_figures(traces).items()
            for path in plot.write(folder / name)
        ]


def bench_figures(traces: list[Trace]) -> dict[str, LegendFigure]:
    """The figures by name; to be called inside `styled`."""
    names = solver_names(traces)
    solvers = list(dict.fromkeys(names))
    styles = {style.label: style for style in distinct_styles(solvers)}  # the same in all contacts
    pairs = ((trace, styles[name]) for trace, name in zip(traces, names, strict=True))
    rows = list(grouped(pairs, lambda pair: contact_of(pair[0])).values())
    if len(rows) <= MAX_CONTACTS:
        return {"work_precision": _draw(rows)}
    return {
        f"work_precision_{i}_{_slug(_title(row[0][0]))}": _draw([row]) for i, row in enumerate(rows)
    }


def _draw(contacts: list[list[tuple[Trace, CurveStyle]]]) -> LegendFigure:
    """A row of two panels for each contact."""
    plot = LegendFigure(FULL_WIDTH, ROW_HEIGHT * len(contacts))
    grid = plot.figure.subplots(len(contacts), len(COSTS), sharey="row", squeeze=False)
    for solves, panels in zip(contacts, grid, strict=True):
        errors = np.concatenate([_errors(trace) for trace, _ in solves])
        errors = errors[np.isfinite(errors)]
        for axes, (cost, label) in zip(panels, COSTS, strict=True):
            spans = [_curve(plot, axes, trace, style, cost) for trace, style in solves]
            log_scale(axes, "x", min(s[0] for s in spans), max(s[1] for s in spans))
            if errors.size:
                log_scale(axes, "y", float(errors.min()) / ROOM, float(errors.max()) * ROOM)
            if solves is contacts[-1]:
                axes.set_xlabel(label)
        panels[0].set_ylabel(ERROR)
        panels[0].set_title(_title(solves[0][0]), loc="left", fontsize=SMALL)
    return plot


def _errors(trace: Trace) -> Field:
    """Error of the mean gap that no later step exceeds, at least that of the reference."""
    floor = max(trace.row["reference_residual"], REFERENCE.tolerance)
    return np.maximum(trace.lasting_error("u_g"), floor)


def _curve(
    plot: LegendFigure, axes: Any, trace: Trace, style: CurveStyle, cost: str
) -> tuple[float, float]:
    """One solve, its end marked; thin, the error itself. Returns where it begins and ends."""
    errors = _errors(trace)
    finite = np.isfinite(errors)
    x, y = trace.samples[cost][finite], errors[finite]
    options = {"color": style.colour, "mfc": "white", "lw": 1.3, "marker": style.marker}
    if x.size == 0:
        plot.line_on(axes, style.label, x, y, **options)
        return float(trace.samples[cost][0]), float(trace.samples[cost][-1])
    error = np.maximum(trace.samples["u_g_error"][finite], y.min())
    axes.plot(x, error, color=style.colour, lw=0.4, alpha=0.6)
    plot.line_on(axes, style.label, x, y, markevery=0.2, **options)
    end: dict[str, Any] = {"ls": "none", "zorder": 4}
    if Status(trace.row["status"]).is_converged:
        axes.plot(x[-1:], y[-1:], marker=style.marker, color=style.colour, **end)
    else:
        plot.line_on(axes, "not converged", x[-1:], y[-1:], marker="x", color="0.3", **end)
    return float(x[0]), float(x[-1])


def _title(trace: Trace) -> str:
    row = trace.row
    contact = contact_title(row)[:MAX_LABEL]
    return f"{literal(contact)}, {row['points']} points, p* = {row['p_star']:.4g}"


def _slug(text: str) -> str:
    """A file name from a title."""
    plain = text.replace("*", "").replace(" = ", "=")
    return re.sub(r"[^\w.=]+", "-", plain).strip("-")[:MAX_LABEL]
