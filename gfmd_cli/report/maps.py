"""Section: maps of contact, stress and gap, and cross-sections, of some contacts.

Cross-sections show the heights of indenter and elastomer, and the stress. Axes are in SI units
where these mean something, else reduced.
"""

from collections import defaultdict
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from gfmd_cli.analysis.compare import solver_of, with_solvers
from gfmd_cli.analysis.curve_styles import rgb
from gfmd_cli.analysis.plotting import HEIGHT, WIDTH, ColumnFigure, LegendFigure, shades
from gfmd_cli.analysis.selection import evenly, grouped
from gfmd_cli.analysis.table import Group, Table
from gfmd_cli.analysis.tables import AREA, ELASTOMER, ON_GRIDS, P_STAR, POINTS, PRESSURE, TASK
from gfmd_cli.analysis.wording import (
    contact_and_boundary,
    in_si,
    largest,
    pressure_text,
    shown,
    with_unit,
)
from gfmd_cli.grid.arrays import Field, Mask
from gfmd_cli.maps.pictures import block_sums
from gfmd_cli.physics.observables import contact_points
from gfmd_cli.report.data import ReportData
from gfmd_cli.report.section import Section, drawing
from gfmd_cli.study.column import Row
from gfmd_cli.study.reading import StudyFile, open_study
from gfmd_cli.units import count, scaled

MAX_CONTACTS, MAX_CURVES = 12, 3  # contacts that are shown, of at most so many curves
SIDE = 256  # pixels of a map at the most
MIN_FIGURE_ASPECT, MAX_FIGURE_ASPECT = 0.35, 1.2  # height over width, for oblong cells; choices
BORDER = 0.1  # of the side; a cross-section at a free boundary avoids it; a choice
NOISE = 1e-3  # of the nominal pressure; where contact is not known, less stress is none
TOUCHING = "#0077bb"
COLOURS, FAINTEST = "viridis", 0.3
"""Colour map of stress and gap, and where it begins: with a contrast of LEGIBLE to NONE."""
NONE, BEYOND = "black", "#cc3311"
PERCENTILE = 99  # of the stress in contact and of the gap elsewhere: the end of the colour scale
STORED = ("fields", "cross_sections")
CAPTION = f"{ON_GRIDS} Fields: /fields/TASK and /cross_sections/TASK of the study file."
SHOWN = (TASK, ELASTOMER, P_STAR, PRESSURE, AREA, POINTS)
LINES = {
    "height": ("indenter h", {"color": "black", "lw": 1.2}),
    "u": ("elastomer u", {"color": "#0077bb", "lw": 0.9}),
}
STRESS = "#cc3311"
ROWS = 256  # of fields, or of pixels of a map, that are in memory at a time


class Scale(NamedTuple):
    """Units of a quantity on axes."""

    si_unit: str
    unit_column: str
    """Column of a row that holds the reduced unit."""
    symbol: str

    def axis(self, row: Row, largest_value: float, label: str) -> tuple[float, str]:
        """A divisor for values up to `largest_value`, and the label with its unit."""
        if in_si(row, self.si_unit):
            divisor, unit = scaled(largest_value, self.si_unit)
            return divisor, f"{label} ({unit})"
        return float(row[self.unit_column]), f"{label} / {self.symbol}"


LENGTH_SCALE = Scale("m", "length", "L")
HEIGHT_SCALE = Scale("m", "h_std", r"$h_\mathrm{std}$")
STRESS_SCALE = Scale("Pa", "delta_sigma", r"$\Delta\sigma$")


def maps(data: ReportData) -> Section:
    """Maps of contact, stress and gap, and cross-sections."""
    with open_study(data.comparison.path) as study:
        tasks = {task for group in STORED for task in study.tasks_with(group)}
        rows_with_fields = [row for row in data.solved if row["task"] in tasks]
        contacts: list[Row] = []
        series = []
        curves = _chosen(rows_with_fields)
        first = [rows[0] for rows in curves]
        titles = with_solvers(map(contact_and_boundary, first), first)
        for title, rows in zip(titles, curves, strict=True):
            drawn = [(row, _contact_maps(study, row, data.prefix)) for row in rows]
            drawn = [(row, each) for row, each in drawn if each["drawings"]]
            contacts += [row for row, _ in drawn]
            if drawn:
                series.append({"title": title, "contacts": [each for _, each in drawn]})
    notes = [
        f"Shown: {len(contacts)} of {count(len(rows_with_fields), 'contact')} with stored fields "
        f"or cross-sections, {MAX_CONTACTS} at most."
    ]
    if any(plane(row) and max(row["points"], row["points_y"]) > SIDE for row in contacts):
        notes.append(f"Maps have up to {SIDE} pixels a side, each the mean of some grid points.")
    table = Table(CAPTION, shown(SHOWN, data.solved), [Group("", contacts)])
    return Section(
        "Maps and cross-sections",
        notes=notes,
        disclosed={"Table: the contacts shown": table},
        template="maps.html",
        content=series,
    )


def _chosen(stored: list[Row]) -> list[list[Row]]:
    """At most MAX_CURVES curves, each of one scene and solver, and evenly spaced points of each."""
    curves = grouped(stored, lambda row: (row["scene"], *solver_of(row)))
    chosen = evenly(list(curves.values()), MAX_CURVES)
    pressures = [sorted(rows, key=lambda row: float(row["p_star"])) for rows in chosen]
    return [evenly(rows, MAX_CONTACTS // len(chosen)) for rows in pressures]


def _contact_maps(study: StudyFile, row: Row, prefix: str) -> dict[str, Any]:
    """Title, maps and cross-section of one contact."""
    task = row["task"]
    figures: list[tuple[str, LegendFigure, str]] = [*_map_figures(study, row)]
    profile = read_profile(study, row)
    if profile is not None:
        line = f"along {profile.along}{profile.place}"
        what = f"Cross-section {line}: heights above, stress below"
        figures.append(("section", profile_figure(profile), what))
    title = f"{pressure_text(row)}, a_r = {row['a_r']:.3g}"
    return {
        "title": title,
        "drawings": [
            drawing(
                figure,
                f"{prefix}{name}-{task}",
                f"{what}; {contact_and_boundary(row)}, {title}, task {task}",
                f"{what}.",
            )
            for name, figure, what in figures
        ],
    }


def _map_figures(study: StudyFile, row: Row) -> list[tuple[str, ColumnFigure, str]]:
    """Maps of contact, stress and gap, as far as the fields for them are stored."""
    points = max(row["points"], row["points_y"])
    pixels = _thumbnails(study, row["task"], -(-points // SIDE)) if plane(row) else {}
    if "stress" not in pixels:
        return []
    stress, touching = pixels["stress"], pixels.get("contact")
    red = f"red: the {100 - PERCENTILE} % of the {{}} above the scale"
    loaded = stress > NOISE * row["pressure"] if touching is None else touching > 0
    plot = _scaled_figure(stress, loaded, row, STRESS_SCALE, r"stress $\sigma$")
    of_stress = ("stress", plot, f"Map of the stress; black: none, {red.format('contact')}")
    if touching is None:
        return [of_stress]
    gap = pixels["gap"]  # negative where the elastomer enters holes of the map
    plot = _scaled_figure(gap, touching < 1, row, HEIGHT_SCALE, "gap")
    of_gap = ("gap", plot, f"Map of the gap; black: contact, {red.format('rest')}")
    return [("contact", _contact_figure(touching, row), "Map of the contact"), of_stress, of_gap]


def _thumbnails(study: StudyFile, task: int, step: int) -> dict[str, Field]:
    """Means over pixels of step^2 points: the stress and, as far as known, contact and gap."""
    rows: dict[str, list[Field]] = defaultdict(list)
    for block in study.blocks("fields", task, ROWS * step, ("u", "sigma", "height")):
        if "sigma" in block:
            rows["stress"].append(_means(block["sigma"], step))
        if {"u", "sigma", "height"} <= block.keys():
            mask = contact_points(block["height"], block["u"], block["sigma"])
            rows["contact"].append(_means(mask.astype(np.float64), step))
            rows["gap"].append(_means(block["u"] - block["height"], step))
    return {name: np.concatenate(blocks) for name, blocks in rows.items()}


def _means(block: Field, step: int) -> Field:
    """Means over squares of step x step points; the last ones of a side may be smaller."""
    return block_sums(block, step) / block_sums(np.ones_like(block), step)


def _contact_figure(touching: Field, row: Row) -> ColumnFigure:
    plot, extent = _cell(row)
    image = np.dstack([np.broadcast_to(rgb(TOUCHING), (*touching.shape, 3)), touching])
    plot.axes.imshow(image, origin="lower", extent=extent, interpolation="none")
    return plot


def _scaled_figure(values: Field, shown: Mask, row: Row, scale: Scale, label: str) -> ColumnFigure:
    """Values in colours up to a percentile: a scale up to the peaks would leave the rest dark."""
    plot, extent = _cell(row)
    top = float(np.percentile(values[shown], PERCENTILE)) if np.any(shown) else 0.0
    divisor, label = scale.axis(row, top, label)
    image = plot.axes.imshow(
        np.where(shown, values / divisor, np.nan),
        origin="lower",
        extent=extent,
        interpolation="none",
        cmap=shades(COLOURS, FAINTEST, NONE, BEYOND),
        vmin=0,
        vmax=top / divisor or 1.0,
    )
    bar = plot.figure.colorbar(image, ax=plot.axes, shrink=0.92, pad=0.02, extend="max")
    bar.set_label(label)
    return plot


def _cell(row: Row) -> tuple[ColumnFigure, tuple[float, float, float, float]]:
    """Axes of the cell, and its borders in their units, from the crest of an indenter."""
    length, length_y = float(row["length"]), float(row["length_y"])
    longest = max(length, length_y)
    divisor, x = LENGTH_SCALE.axis(row, longest, "x")
    _, y = LENGTH_SCALE.axis(row, longest, "y")
    plot = ColumnFigure(x, y)
    plot.height = min(max(0.85 * length_y / length, MIN_FIGURE_ASPECT), MAX_FIGURE_ASPECT) * WIDTH
    (left, right), (bottom, top) = (
        (row["x_first"] * side / divisor, (row["x_first"] + 1.0) * side / divisor)
        for side in (length, length_y)
    )
    return plot, (left, right, bottom, top)


@dataclass(frozen=True)
class Profile:
    """Values along a line through the cell."""

    values: dict[str, Field]
    """Stored ones of u [m], height [m] and sigma [Pa], each of shape (points,)."""
    position: Field
    """Distance along the line [m], shape (points,)."""
    along: str
    """Name of the line."""
    row: Row
    """The contact; stresses far below its nominal pressure are rounding."""
    place: str = ""
    """Where the line lies in the cell, in words."""


def read_profile(study: StudyFile, row: Row) -> Profile | None:
    """The cross-section of a contact; a line contact may have stored it as its fields.

    Where the fields of a cell are stored, the row of `_most_loaded`; the diagonal, which can miss
    all contacts, only where that alone is stored.
    """
    line = not plane(row)
    if not line and (profile := _most_loaded(study, row)):
        return profile
    values = study.arrays("cross_sections", row["task"])
    if line and not values:
        values = study.arrays("fields", row["task"])
    if not values:
        return None
    size = next(iter(values.values())).size
    length = float(row["length"])
    step = (length if line else float(np.hypot(length, row["length_y"]))) / size
    position = (np.arange(size) + size * row["x_first"]) * step
    return Profile(values, position, "the cell" if line else "the diagonal", row)


def _most_loaded(study: StudyFile, row: Row) -> Profile | None:
    """The row of the grid that carries most load; None where not all fields are stored.

    At a free boundary, where stress is concentrated, a row near it only where no other touches.
    """
    loads, values = np.empty(0), {}
    border = int(BORDER * row["points_y"]) if row["boundary"] == "free" else 0
    for block in study.blocks("fields", row["task"], ROWS, (*LINES, "sigma")):
        if len(block) <= len(LINES):
            return None
        of_block = np.nan_to_num(np.maximum(block["sigma"], 0.0)).sum(axis=1)
        y = loads.size + np.arange(of_block.size)
        of_block[np.minimum(y, row["points_y"] - 1 - y) < border] *= NOISE
        if of_block.max() > loads.max(initial=-1.0):
            values = {name: data[np.argmax(of_block)].copy() for name, data in block.items()}
        loads = np.append(loads, of_block)
    if not values:
        return None
    top, size = int(np.argmax(loads)), values["sigma"].size
    position = (np.arange(size) / size + row["x_first"]) * float(row["length"])
    inside = " away from the borders" if 0 < border <= top < loads.size - border else ""
    y_of_row = (top / loads.size + row["x_first"]) * float(row["length_y"])
    at = with_unit(y_of_row, "m") if in_si(row, "m") else f"{y_of_row / row['length']:.2f} L"
    place = f" through the row{inside} that carries most load (y = {at})"
    return Profile(values, position, "x", row, place)


def plane(row: Row) -> bool:
    """Whether a contact has maps; a line contact has none."""
    return int(row["dimension"]) == 2


def profile_figure(profile: Profile) -> LegendFigure:
    """Heights above, stress below, over one position."""
    plot = LegendFigure(WIDTH, 1.5 * HEIGHT)
    length = float(np.ptp(profile.position))
    divisor, label = LENGTH_SCALE.axis(profile.row, length, f"position along {profile.along}")
    x = profile.position / divisor
    upper, lower = plot.figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    _draw_heights(plot, upper, x, profile)
    _draw_stress(lower, x, profile)
    lower.set(xlabel=label, xlim=(x[0], x[-1]))
    return plot


def _draw_heights(plot: LegendFigure, axes: Any, x: Field, profile: Profile) -> None:
    heights = {name: profile.values[name] for name in LINES if name in profile.values}
    highest = max((largest(np.abs(y)) for y in heights.values()), default=0.0)
    divisor, axis = HEIGHT_SCALE.axis(profile.row, highest, "height")
    for name, y in heights.items():
        label, style = LINES[name]
        plot.legend[label] = axes.plot(x, y / divisor, **style)[0]  # of either sign
    axes.set_ylabel(axis)


def _draw_stress(axes: Any, x: Field, profile: Profile) -> None:
    if "sigma" not in profile.values:
        return
    sigma = profile.values["sigma"]
    top = max(largest(sigma), profile.row["pressure"])
    divisor, label = STRESS_SCALE.axis(profile.row, top, r"$\sigma$")
    axes.plot(x, sigma / divisor, color=STRESS, lw=0.9)
    axes.set_ylabel(label)
    axes.set_ylim(-0.05 * top / divisor, 1.1 * top / divisor)
