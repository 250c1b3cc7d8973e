"""What a bench has measured: the cost of each solver as a table, and work-precision diagrams.

The diagrams show the error of the mean gap over transforms and seconds.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.analysis.compare import with_solvers
from gfmd_cli.analysis.curve_styles import CurveStyle, distinct_styles, literal
from gfmd_cli.analysis.plotting import SMALL, WIDTH, LegendFigure, log_scale, styled, write_all
from gfmd_cli.analysis.selection import grouped
from gfmd_cli.analysis.table import Group, Record, Table, TableColumn
from gfmd_cli.analysis.tables import ELASTOMER, P_STAR, POINTS, RESIDUAL, STATUS
from gfmd_cli.analysis.wording import contact_and_boundary, points_text
from gfmd_cli.bench.file import Trace
from gfmd_cli.bench.run import REFERENCE
from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.observables import MAIN_OBSERVABLES
from gfmd_cli.status import Status
from gfmd_cli.study.columns import PARAMETERS

FULL_WIDTH, ROW_HEIGHT = 2.09 * WIDTH, 2.0  # inches: a page of 180 mm; a row of panels
LEAST_COSTS = {"transforms": 1.0, "seconds": 0.0}
"""Where less is drawn on the logarithmic axes: "sort" takes no transform."""
MAX_CONTACTS = 4  # rows of panels that a page holds
COST_LABELS = {
    "transforms": "transforms of the solved size",
    "seconds": "processor time on one thread (s)",
}
ROOM = 2.0  # for the symbols at the ends of a curve
MAX_LABEL = 100  # characters of a title and of a file name
SOLVER_KEYS = {each.column.name: each.column.blank for each in PARAMETERS if each.table == "solver"}
"""Columns of [solver], and the blank value of each."""
ERROR = r"relative error of $u_g$"
LEVELS = ("1e-2", "1e-4", "1e-6")
"""Relative errors of the mean gap."""
BENCH = (
    ELASTOMER,
    POINTS,
    P_STAR,
    TableColumn("solver", "name"),
    *(TableColumn(f"transforms\nto {level}", f"transforms_{level}", ".0f") for level in LEVELS),
    *(TableColumn(f"seconds\nto {level}", f"seconds_{level}", ".3g") for level in LEVELS),
    *(TableColumn(f"error of\n{name}", f"{name}_error", ".1e") for name in MAIN_OBSERVABLES),
    RESIDUAL,
    STATUS,
)


def bench_table(traces: list[Trace]) -> Table:
    """One record for each solver, grid and pressure.

    Transforms and seconds until the error of the mean gap falls below a level for good; the errors
    and the residual at the end. Surface and boundary are columns where there are several.
    """
    surfaces = list(dict.fromkeys(trace.row["surface"] for trace in traces))
    title, columns = surfaces[0], BENCH
    if len({trace.row.get("boundary") for trace in traces}) > 1:
        columns = (*columns, TableColumn("boundary", "boundary"))
    if len(surfaces) > 1:
        title, columns = "", (*columns, TableColumn("surface", "surface"))
    worst = max(trace.row["reference_residual"] for trace in traces)
    caption = (
        "Cost until the error of the mean gap stays below a level: Fourier transforms, in units of "
        "one on the final grid, and seconds of processor time on one thread, without the "
        "recording. Errors are relative to a reference; the largest residual of one is "
        f"{worst:.1e}."
    )
    names = solver_names(traces)
    records = [_record(trace, name) for trace, name in zip(traces, names, strict=True)]
    return Table(caption, columns, [Group(title, records)])


def _record(trace: Trace, name: str) -> Record:
    record = trace.row | {"name": name}
    for level in LEVELS:
        transforms, seconds = trace.reached("u_g", float(level)) or (None, None)
        record |= {f"transforms_{level}": transforms, f"seconds_{level}": seconds}
    errors = {
        f"{error}_error": float(trace.samples[f"{error}_error"][-1]) for error in MAIN_OBSERVABLES
    }
    return record | errors


def contact_of(trace: Trace) -> tuple[Any, ...]:
    """Values that identify the contact of a trace."""
    keys = ("surface", "seed", "elastomer", "boundary", "points", "points_y", "p_star")
    return tuple(trace.row.get(key) for key in keys)


def solver_names(traces: list[Trace]) -> list[str]:
    """Each solver, with the other keys of [solver] in which the traces differ."""
    rows = [SOLVER_KEYS | trace.row | {"solver_kind": ""} for trace in traces]
    return with_solvers((trace.row["solver"] for trace in traces), rows)


def draw_bench(traces: list[Trace], folder: Path) -> list[Path]:
    """Draw a bench as PDF and PNG: one figure, or one for each of many contacts; return the paths.

    Raises SpaceError where the folder cannot be written.
    """
    with styled():
        return write_all(bench_figures(traces), folder)


def bench_figures(traces: list[Trace]) -> dict[str, LegendFigure]:
    """The figures by name; to be called inside `styled`."""
    names = solver_names(traces)
    solvers = list(dict.fromkeys(names))
    styles = dict(zip(solvers, distinct_styles(solvers), strict=True))  # the same in all contacts
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
    grid = plot.figure.subplots(len(contacts), len(COST_LABELS), sharey="row", squeeze=False)
    for solves, panels in zip(contacts, grid, strict=True):
        errors = np.concatenate([_errors(trace) for trace, _ in solves])
        errors = errors[np.isfinite(errors)]
        for axes, (cost, label) in zip(panels, COST_LABELS.items(), strict=True):
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
    costs = np.maximum(trace.samples[cost], LEAST_COSTS[cost])
    x, y = costs[finite], errors[finite]
    options = {"color": style.colour, "mfc": "white", "lw": 1.3, "marker": style.marker}
    if x.size == 0:
        plot.line_on(axes, style.label, x, y, **options)
        return float(costs[0]), float(costs[-1])
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
    contact = contact_and_boundary(row)[:MAX_LABEL]
    points = points_text(row["points"], row.get("points_y", 1))
    return f"{literal(contact)}, {points} points, p* = {row['p_star']:.4g}"


def _slug(text: str) -> str:
    """A file name from a title."""
    plain = text.replace("*", "").replace(" = ", "=")
    return re.sub(r"[^\w.=]+", "-", plain).strip("-")[:MAX_LABEL]
