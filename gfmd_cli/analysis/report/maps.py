"""Maps of contact and stress, and cross-sections, of chosen contacts."""

from typing import Any

import numpy as np

from gfmd_cli.analysis.compare import Row
from gfmd_cli.analysis.report.contents import Contents, Section
from gfmd_cli.analysis.report.figure import figure
from gfmd_cli.analysis.report.markup import Group, Html, code, details, join, table, tag
from gfmd_cli.analysis.report.profiles import plane, profile_sheet, read_profile
from gfmd_cli.analysis.report.units import AREA, P_STAR, PRESSURE, quantity, scaled
from gfmd_cli.analysis.sheet import WIDTH, Sheet, shades
from gfmd_cli.physics.fields import Field, Mask
from gfmd_cli.physics.hdf5 import has, take
from gfmd_cli.study.layout import MISSING
from gfmd_cli.study.reading import open_study

SHOWN = 9  # contacts that are shown
CURVES = 3  # of at most so many curves
SIDE = 256  # pixels of a map at the most
NOISE = 1e-3  # of the nominal pressure; where contact is not known, less stress is none
ROWS = 256  # pixels' worth of rows that are held at a time
TOUCHING = "#0077bb"
STRESSES, FAINTEST = "viridis", 0.3
"""Colours of the stress, and how far along them the least stress is: told from none by LEGIBLE."""
NONE, BEYOND = "black", "#cc3311"
MOST = 99  # percentile of the stress in contact that the colours reach to
HOW = 'fields = ["u", "sigma", "height"]', "cross_section = true"
STORED = ("fields", "cross_sections")


def maps(contents: Contents) -> Section:
    """Where the surfaces touch, and how hard."""
    with open_study(contents.comparison.path) as file:
        held = [row for row in contents.rows if row["status"] != MISSING and _holds(file, row)]
        shown = _chosen(held)
        drawn = [_drawn(file, row) for row in shown]
    title = "Maps and cross-sections"
    if not shown:
        return Section(title, _how())
    note = [f"{len(shown)} of {len(held)} contacts with stored fields are shown, {SHOWN} at most."]
    if any(plane(row) and row["points"] > SIDE for row in shown):
        note.append(f"Maps have up to {SIDE} pixels a side, each the mean of some grid points.")
    below = details("Table: the contacts shown", _table(shown))
    return Section(
        title, join(tag("p", " ".join(note)), tag("div", *drawn, class_="figures trio"), below)
    )


def _how() -> Html:
    """How to get them."""
    first, second = (code(line) for line in HOW)
    return tag(
        "p",
        "The study stores no fields. For maps of contact and stress write ",
        first,
        " into the table ",
        code("[output]"),
        " of the spec, for cross-sections ",
        second,
        ", and run it under another name (",
        code("-o"),
        ").",
    )


def _holds(file: Any, row: Row) -> bool:
    return any(has(file, place) and has(file[place], str(row["task"])) for place in STORED)


def _chosen(held: list[Row]) -> list[Row]:
    """Some curves, some pressures of each, evenly."""
    curves: dict[Any, list[Row]] = {}
    for row in held:
        curves.setdefault((row["scene"], row["solver"], row["tolerance"]), []).append(row)
    chosen = _evenly(list(curves.values()), CURVES)
    pressures = [sorted(rows, key=lambda row: float(row["p_star"])) for rows in chosen]
    return [row for rows in pressures for row in _evenly(rows, SHOWN // len(chosen))]


def _evenly(things: list[Any], most: int) -> list[Any]:
    places = np.unique(np.linspace(0, len(things) - 1, min(most, len(things))).round().astype(int))
    return [things[place] for place in places]


def _drawn(file: Any, row: Row) -> Html:
    """The figures of one contact under its heading."""
    task = row["task"]
    figures = [
        figure(sheet, f"{name}-{task}", f"{what}, task {task}", f"{what}.")
        for name, sheet, what in _map_sheets(file, row)
    ]
    profile = read_profile(file, row)
    if profile is not None:
        what = f"Cross-section along {profile.along}: heights above, stress below"
        sheet = profile_sheet(profile)
        figures.append(figure(sheet, f"section-{task}", f"{what}, task {task}", f"{what}."))
    return tag(
        "div", tag("h3", _told(row)), tag("div", *figures, class_="figures trio"), class_="contact"
    )


def _told(row: Row) -> Html:
    return join(
        f"{row['elastomer']}, ",
        P_STAR,
        f" = {row['p_star']:.3g} ({quantity(row['pressure'], 'Pa')}), ",
        AREA,
        f" = {row['a_r']:.3g}",
    )


def _map_sheets(file: Any, row: Row) -> list[tuple[str, Sheet, str]]:
    """Maps of contact and stress, as far as the fields for them are stored."""
    place = f"fields/{row['task']}"
    if not (has(file, "fields") and has(file["fields"], str(row["task"]))):
        return []
    group = file[place]
    names = [name for name in ("sigma", "u", "height") if has(group, name)]
    if "sigma" not in names or take(group, "sigma").ndim != 2:
        return []
    touching, stress = _thumbnails({name: take(group, name) for name in names})
    what = f"Stress; black: none, red: the {100 - MOST} % of the contact above the scale"
    loaded = stress > NOISE * row["pressure"] if touching is None else touching > 0
    told = [("stress", _stress_sheet(stress, loaded, row), what)]
    if touching is not None:
        told.insert(0, ("contact", _contact_sheet(touching, row), "Contact"))
    return told


def _thumbnails(fields: dict[str, Any]) -> tuple[Field | None, Field]:
    """Share of contact, where it can be told, and mean stress, over the points of each pixel."""
    sigma = fields["sigma"]
    step = -(-sigma.shape[0] // SIDE)
    touching, stress = [], []
    for start in range(0, sigma.shape[0], ROWS * step):
        rows = slice(start, start + ROWS * step)
        stress.append(_means(sigma[rows], step))
        if len(fields) == 3:
            mask = (fields["u"][rows] == fields["height"][rows]) & (sigma[rows] > 0)
            touching.append(_means(mask.astype(np.float64), step))
    return np.concatenate(touching) if touching else None, np.concatenate(stress)


def _means(block: Field, step: int) -> Field:
    """Over squares of step x step points, smaller ones at the end."""
    if step == 1:
        return block
    total = np.ones_like(block)
    for axis in (0, 1):
        starts = np.arange(0, block.shape[axis], step)
        block = np.add.reduceat(block, starts, axis)
        total = np.add.reduceat(total, starts, axis)
    means: Field = block / total
    return means


def _contact_sheet(touching: Field, row: Row) -> Sheet:
    sheet, extent = _square(row)
    colour = np.array(list(bytes.fromhex(TOUCHING[1:]))) / 255
    image = np.concatenate(
        [np.broadcast_to(colour, (*touching.shape, 3)), touching[..., None]], axis=2
    )
    sheet.axes.imshow(image, origin="lower", extent=extent, interpolation="none")
    return sheet


def _stress_sheet(stress: Field, loaded: Mask, row: Row) -> Sheet:
    """Colours up to what but a few points of the contact exceed, else peaks leave all dark."""
    sheet, extent = _square(row)
    top = float(np.percentile(stress[loaded], MOST)) if np.any(loaded) else 0.0
    divisor, unit = scaled(top, "Pa")
    image = sheet.axes.imshow(
        np.where(loaded, stress / divisor, np.nan),
        origin="lower",
        extent=extent,
        interpolation="none",
        cmap=shades(STRESSES, FAINTEST, NONE, BEYOND),
        vmin=0,
        vmax=top / divisor or 1.0,
    )
    bar = sheet.figure.colorbar(image, ax=sheet.axes, shrink=0.92, pad=0.02, extend="max")
    bar.set_label(rf"stress  $\sigma$ ({unit})")
    return sheet


def _square(row: Row) -> tuple[Sheet, tuple[float, float, float, float]]:
    """Axes of the cell, and where it ends in their units."""
    divisor, unit = scaled(float(row["length"]), "m")
    side = float(row["length"]) / divisor
    sheet = Sheet(f"x ({unit})", f"y ({unit})")
    sheet.height = 0.85 * WIDTH
    return sheet, (0.0, side, 0.0, side)


def _table(rows: list[Row]) -> Html:
    header = ["Task", "Body", P_STAR, PRESSURE, AREA, "points"]
    names = ("task", "elastomer", "p_star", "pressure", "a_r", "points")
    caption = "The values lie in /fields/TASK and /cross_sections/TASK of the study file."
    return table(caption, header, [Group("", [[row[name] for name in names] for row in rows])])
