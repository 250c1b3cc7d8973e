"""Work-precision diagrams of a bench: error of the mean gap over transforms and seconds."""

import re
from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.analysis.benchmark import scene_of, solver_names
from gfmd_cli.analysis.looks import MARKERS, Look, colours
from gfmd_cli.analysis.sheet import SMALL, WIDTH, Page, log_scale, styled
from gfmd_cli.physics.fields import Field
from gfmd_cli.study.bench import REFERENCE
from gfmd_cli.study.traces import Trace

FULL_WIDTH, ROW_HEIGHT = 2.09 * WIDTH, 2.0  # inches: a page of 180 mm; a row of panels
SCENES = 4  # rows of panels that a page holds
COSTS = (
    ("transforms", "transforms of the solved size"),
    ("seconds", "processor time on one thread (s)"),
)
ROOM = 2.0  # for the symbols at the ends of a curve
LONGEST = 100  # characters of a title and of a file name
ERROR = r"relative error of $u_g$"


def draw_bench(traces: list[Trace], folder: Path) -> list[Path]:
    """Draw a bench as PDF and PNG: one figure, or one for each of many scenes; return the paths.

    Raises SpaceError where the folder cannot be written.
    """
    with styled():
        return [path for name, page in pages(traces).items() for path in page.write(folder / name)]


def pages(traces: list[Trace]) -> dict[str, Page]:
    """The figures by name; to be called inside `styled`."""
    scenes: dict[Any, list[tuple[Trace, Look]]] = {}
    for trace, look in zip(traces, _looks(traces), strict=True):
        scenes.setdefault(scene_of(trace), []).append((trace, look))
    rows = list(scenes.values())
    if len(rows) <= SCENES:
        figures = {"work_precision": rows}
    else:
        figures = {
            f"work_precision_{i}_{_slug(_title(row[0][0]))}": [row] for i, row in enumerate(rows)
        }
    return {name: _draw(rows) for name, rows in figures.items()}


def _draw(scenes: list[list[tuple[Trace, Look]]]) -> Page:
    """A row of two panels for each scene."""
    page = Page(FULL_WIDTH, ROW_HEIGHT * len(scenes))
    grid = page.figure.subplots(len(scenes), len(COSTS), sharey="row", squeeze=False)
    for scene, panels in zip(scenes, grid, strict=True):
        errors = np.concatenate([_errors(trace) for trace, _ in scene])
        errors = errors[np.isfinite(errors)]
        for axes, (cost, label) in zip(panels, COSTS, strict=True):
            spans = [_curve(page, axes, trace, look, cost) for trace, look in scene]
            log_scale(axes, "x", min(s[0] for s in spans), max(s[1] for s in spans))
            if errors.size:
                log_scale(axes, "y", float(errors.min()) / ROOM, float(errors.max()) * ROOM)
            if scene is scenes[-1]:
                axes.set_xlabel(label)
        panels[0].set_ylabel(ERROR)
        panels[0].set_title(_title(scene[0][0]), loc="left", fontsize=SMALL)
    return page


def _errors(trace: Trace) -> Field:
    """What lasts of the error of the mean gap, no less than the reference can tell."""
    floor = max(trace.row["reference_residual"], REFERENCE.tolerance)
    errors: Field = np.maximum(trace.lasting_error("u_g"), floor)
    return errors


def _curve(page: Page, axes: Any, trace: Trace, look: Look, cost: str) -> tuple[float, float]:
    """One solve, its end marked; thin, the error itself. Returns where it begins and ends."""
    kept = np.isfinite(_errors(trace))
    x = trace.samples[cost][kept]
    style = {"color": look.colour, "mfc": "white", "lw": 1.3, "marker": look.marker}
    if x.size == 0:
        page.line(axes, look.label, x, x, **style)
        ends: Field = trace.samples[cost][[0, -1]]
        return float(ends[0]), float(ends[1])
    y = _errors(trace)[kept]
    itself = np.maximum(trace.samples["u_g_error"][kept], y.min())
    axes.plot(x, itself, color=look.colour, lw=0.4, alpha=0.6)
    ended = trace.row["status"] == "converged"
    page.line(axes, look.label, x, y, markevery=0.2, **style)
    end = {"ls": "none", "marker": look.marker if ended else "x", "color": look.colour}
    if ended:
        axes.plot(x[-1:], y[-1:], zorder=4, **end)
    else:
        page.line(axes, "not converged", x[-1:], y[-1:], zorder=4, **end | {"color": "0.3"})
    return float(x[0]), float(x[-1])


def _looks(traces: list[Trace]) -> list[Look]:
    """A colour and a symbol for each solver, the same in all scenes."""
    names = solver_names(traces)
    known = list(dict.fromkeys(names))
    chosen = dict(zip(known, colours(len(known)), strict=True))
    return [Look(chosen[n], MARKERS[known.index(n) % len(MARKERS)], n) for n in names]


def _title(trace: Trace) -> str:
    row = trace.row
    body = f"{row['elastomer']} on {row['surface']}"[:LONGEST].replace("$", r"\$")
    return f"{body}, {row['points']} points, p* = {row['p_star']:.4g}"


def _slug(text: str) -> str:
    """A file name that tells."""
    plain = text.replace("*", "").replace(" = ", "=")
    return re.sub(r"[^\w.=]+", "-", plain).strip("-")[:LONGEST]
