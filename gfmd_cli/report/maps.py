"""Section: maps of contact, stress and gap, and cross-sections, of some contacts."""

from collections import defaultdict
from typing import Any

import numpy as np

from gfmd_cli.analysis.curve_styles import rgb
from gfmd_cli.analysis.plotting import WIDTH, ColumnFigure, LegendFigure, shades
from gfmd_cli.analysis.selection import evenly, grouped
from gfmd_cli.analysis.table import Group, Table, TableColumn
from gfmd_cli.analysis.tables import AREA, P_STAR, POINTS, PRESSURE
from gfmd_cli.analysis.wording import contact_title, pressure_text, shown
from gfmd_cli.grid.arrays import Field, Mask
from gfmd_cli.maps.pictures import block_sums
from gfmd_cli.physics.observables import contact_points
from gfmd_cli.report import profiles
from gfmd_cli.report.data import ReportData
from gfmd_cli.report.section import Section, drawing
from gfmd_cli.study.column import Row
from gfmd_cli.study.reading import StudyFile, open_study

MAX_CONTACTS, MAX_CURVES = 12, 3  # contacts that are shown, of at most so many curves
SIDE = 256  # pixels of a map at the most
MIN_FIGURE_ASPECT, MAX_FIGURE_ASPECT = 0.35, 1.2  # height over width, for oblong cells; choices
NOISE = 1e-3  # of the nominal pressure; where contact is not known, less stress is none
TOUCHING = "#0077bb"
COLOURS, FAINTEST = "viridis", 0.3
"""Colour map of stress and gap, and where it begins: with a contrast of LEGIBLE to NONE."""
NONE, BEYOND = "black", "#cc3311"
PERCENTILE = 99  # of the stress in contact and of the gap elsewhere: the end of the colour scale
STORED = ("fields", "cross_sections")
CAPTION = "The values are in /fields/TASK and /cross_sections/TASK of the study file."
SHOWN = (
    TableColumn("task", "task", "d"),
    TableColumn("elastomer", "elastomer"),
    P_STAR,
    PRESSURE,
    AREA,
    POINTS,
)


def maps(data: ReportData) -> Section:
    """Maps of contact, stress and gap, and cross-sections."""
    with open_study(data.comparison.path) as study:
        tasks = {task for group in STORED for task in study.tasks_with(group)}
        rows_with_fields = [row for row in data.solved if row["task"] in tasks]
        contacts_by_curve = _chosen(rows_with_fields)
        contacts = [row for rows in contacts_by_curve for row in rows]
        series = [
            {
                "title": contact_title(rows[0]),
                "contacts": [_contact_maps(study, row, data.prefix) for row in rows],
            }
            for rows in contacts_by_curve
        ]
    notes = [
        f"{len(contacts)} of {len(rows_with_fields)} contacts with stored fields are shown, "
        f"{MAX_CONTACTS} at most."
    ]
    if any(profiles.plane(row) and max(row["points"], row["points_y"]) > SIDE for row in contacts):
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
    """At most MAX_CURVES curves, and pressures at equal distances of each."""
    curves = grouped(stored, lambda row: (row["scene"], row["solver"], row["tolerance"]))
    chosen = evenly(list(curves.values()), MAX_CURVES)
    pressures = [sorted(rows, key=lambda row: float(row["p_star"])) for rows in chosen]
    return [evenly(rows, MAX_CONTACTS // len(chosen)) for rows in pressures]


def _contact_maps(study: StudyFile, row: Row, prefix: str) -> dict[str, Any]:
    """Title, maps and cross-section of one contact."""
    task = row["task"]
    figures: list[tuple[str, LegendFigure, str]] = [*_map_figures(study, row)]
    profile = profiles.read_profile(study, row)
    if profile is not None:
        line = f"along {profile.along}{profile.place}"
        what = f"Cross-section {line}: heights above, stress below"
        figures.append(("section", profiles.profile_figure(profile), what))
    return {
        "title": f"{pressure_text(row)}, a_r = {row['a_r']:.3g}",
        "drawings": [
            drawing(figure, f"{prefix}{name}-{task}", f"{what}, task {task}", f"{what}.")
            for name, figure, what in figures
        ],
    }


def _map_figures(study: StudyFile, row: Row) -> list[tuple[str, ColumnFigure, str]]:
    """Maps of contact, stress and gap, as far as the fields for them are stored."""
    points = max(row["points"], row["points_y"])
    pixels = _thumbnails(study, row["task"], -(-points // SIDE)) if profiles.plane(row) else {}
    if "stress" not in pixels:
        return []
    stress, touching = pixels["stress"], pixels.get("contact")
    red = f"red: the {100 - PERCENTILE} % of the {{}} above the scale"
    what = f"Stress; black: none, {red.format('contact')}"
    loaded = stress > NOISE * row["pressure"] if touching is None else touching > 0
    label = r"stress $\sigma$"
    figures = [("stress", _scaled_figure(stress, loaded, row, profiles.STRESS_SCALE, label), what)]
    if touching is not None:
        gap = pixels["gap"]
        figures.insert(0, ("contact", _contact_figure(touching, row), "Contact"))
        what = f"Gap; black: contact, {red.format('rest')}"
        figure = _scaled_figure(gap, gap > 0, row, profiles.HEIGHT_SCALE, "gap")
        figures.append(("gap", figure, what))
    return figures


def _thumbnails(study: StudyFile, task: int, step: int) -> dict[str, Field]:
    """Means over pixels of step^2 points: the stress and, as far as known, contact and gap."""
    rows: dict[str, list[Field]] = defaultdict(list)
    for block in study.blocks("fields", task, profiles.ROWS * step, ("u", "sigma", "height")):
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


def _scaled_figure(
    values: Field, shown: Mask, row: Row, scale: profiles.Scale, label: str
) -> ColumnFigure:
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
    """Axes of the cell, and where it ends in their units."""
    length, length_y = float(row["length"]), float(row["length_y"])
    longest = max(length, length_y)
    divisor, x = profiles.LENGTH_SCALE.axis(row, longest, "x")
    _, y = profiles.LENGTH_SCALE.axis(row, longest, "y")
    plot = ColumnFigure(x, y)
    plot.height = min(max(0.85 * length_y / length, MIN_FIGURE_ASPECT), MAX_FIGURE_ASPECT) * WIDTH
    return plot, (0.0, length / divisor, 0.0, length_y / divisor)
