"""The spectrum of the surfaces that were pressed."""

from dataclasses import dataclass

import numpy as np

from gfmd_cli.analysis.compare import Row
from gfmd_cli.analysis.looks import LONGEST, MARKERS, Look, colours
from gfmd_cli.analysis.report.contents import Contents, Section
from gfmd_cli.analysis.report.figure import figure
from gfmd_cli.analysis.report.markup import Group, Html, details, join, table, tag
from gfmd_cli.analysis.sheet import Sheet
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.persson import Shells
from gfmd_cli.physics.surface import dimension_of

PER_DECADE = 10  # bands
SHOWN = 8  # surfaces; more cannot be told apart
LABEL = r"$C(q)$"
C_OF_Q = Html("<var>C</var>(<var>q</var>)")
Q = Html("<var>q</var> [1/m]")


@dataclass(frozen=True)
class Spectrum:
    """Power spectral density of one surface in bands of wavenumber."""

    name: str
    dimension: int
    q: Field
    """Mean wavenumber of each band [1/m]."""
    density: Field
    """[m^4], of a line scene [m^3]."""
    modes: Field
    """How many modes a band has."""


def surface_spectrum(contents: Contents) -> Section | None:
    """C(q), double logarithmic."""
    scenes: dict[str, tuple[Row, Shells]] = {}
    for _, curve in contents.curves:
        scenes.setdefault(curve.surface, (curve.rows[0], curve.persson.shells))
    found = [spectrum(row, shells) for row, shells in scenes.values() if shells.q.size]
    known = [one for one in found if one.q.size]
    shown = known[:SHOWN]
    if not shown:
        return None
    label = f"Power spectral density of the surface over the wavenumber: {_names(shown)}"
    below = details("Table behind the figure", _table(shown))
    told = "" if len(known) == len(shown) else f" The first {SHOWN} of {len(known)} are shown."
    drawn = figure(_sheet(shown), "spectrum", label, join(CAPTION, told))
    return Section("Surface spectrum", join(tag("div", drawn, class_="figures"), below))


H = Html("<var>h</var>")
CAPTION = join(
    "Power spectral density of the surface, ",
    *(C_OF_Q, " = ", Html("<var>A</var>"), " ⟨|", H, Html("(<var>q</var>)|²⟩")),
    ": the variance of the heights in a band of wavenumber over the number of its modes, times the "
    "area of the cell (of a line its length), so that ⟨",
    *(H, "²⟩ = ∫ ", Html("<var>C</var> d²<var>q</var>"), " / (2π)²"),
    ". Waves shorter than two grid points along a side are left out.",
)


def _names(shown: list[Spectrum]) -> str:
    return "; ".join(found.name for found in shown)


def spectrum(row: Row, shells: Shells) -> Spectrum:
    """The density of a surface from the sums that its shells hold.

    <h^2> = sum of C over the modes, each of which has (2 pi / L)^d of the plane of q: the density
    is L^d times the mean over the modes of a band. Shells at the lowest q stand alone.
    """
    name, length = str(row["surface"]), float(row["length"])
    dimension = dimension_of(name.partition(" ")[0])
    radius = shells.q * length / (2 * np.pi)
    edges = _edges(radius, 0.5 * int(row["points"]))
    place = np.searchsorted(edges, radius) - 1
    inside = (place >= 0) & (place < edges.size - 1)
    total, moment = (
        np.bincount(place[inside], weight[inside], minlength=edges.size - 1)
        for weight in (shells.height, shells.height * shells.q)
    )
    modes = np.diff([_modes_within(edge, dimension) for edge in edges])
    kept = (total > 0) & (modes > 0)
    density = total[kept] / modes[kept] * length**dimension
    return Spectrum(name, dimension, moment[kept] / total[kept], density, modes[kept])


def _edges(radius: Field, nyquist: float) -> Field:
    """Edges of bands half-way between shells, about PER_DECADE in a decade [2 pi / L]."""
    between = np.sqrt(radius[1:] * radius[:-1])
    ends = np.concatenate([[0.5 * radius[0]], between, [radius[-1] * (1 + 1e-6)]])
    within = ends[ends < nyquist]  # on it, opposite modes are one
    chosen = [ends[0]]
    for edge in within[1:]:
        if edge >= chosen[-1] * 10 ** (1 / PER_DECADE):
            chosen.append(edge)
    if len(chosen) > 1:
        chosen[-1] = within[-1]  # the last band is wider rather than that a shell is lost
    return np.array(chosen)


def _modes_within(radius: float, dimension: int) -> float:
    """Modes with 0 < |q| <= radius, in units of 2 pi / L, counted on the lattice."""
    reach = np.arange(-np.floor(radius), np.floor(radius) + 1)
    if dimension == 1:
        return float(reach.size - 1)
    return float(np.sum(2 * np.floor(np.sqrt(radius**2 - reach**2)) + 1) - 1)


def _sheet(shown: list[Spectrum]) -> Sheet:
    power = {1: "3", 2: "4"}.get(shown[0].dimension)
    sheet = Sheet(r"wavenumber  $q$ (m$^{-1}$)", rf"{LABEL} (m$^{power}$)")
    for place, (found, colour) in enumerate(zip(shown, colours(len(shown)), strict=True)):
        name = found.name[:LONGEST].replace("$", r"\$")
        look = Look(colour, MARKERS[place % len(MARKERS)], name)
        sheet.axes.plot(found.q, found.density, color=colour, lw=0.7)
        sheet.points(look, found.q, found.density, np.full(found.q.size, True))
    sheet.scale("x", "log", np.concatenate([found.q for found in shown]))
    sheet.scale("y", "log", np.concatenate([found.density for found in shown]))
    return sheet


def _table(shown: list[Spectrum]) -> Html:
    unit = "m³" if shown[0].dimension == 1 else "m⁴"
    groups = [
        Group(
            found.name,
            [
                [float(q), float(2 * np.pi / q), float(c), int(modes)]
                for q, c, modes in zip(found.q, found.density, found.modes, strict=True)
            ],
        )
        for found in shown
    ]
    header = [Q, "wavelength [m]", join(C_OF_Q, f" [{unit}]"), "modes"]
    return table("Bands of wavenumber.", header, groups)
