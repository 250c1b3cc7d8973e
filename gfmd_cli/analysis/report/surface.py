"""The spectrum of the surfaces that were pressed."""

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from gfmd_cli.analysis.compare import Row
from gfmd_cli.analysis.looks import LONGEST, MARKERS, Look, colours
from gfmd_cli.analysis.report.contents import Contents, Section
from gfmd_cli.analysis.report.figure import figure
from gfmd_cli.analysis.report.markup import Group, Html, details, join, table, tag
from gfmd_cli.analysis.report.units import with_error
from gfmd_cli.analysis.sheet import Sheet
from gfmd_cli.errors import InputError
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.persson import Shells
from gfmd_cli.physics.spectrum import SelfAffineFit, fit
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
    fit: SelfAffineFit | None
    """None where there is no range to fit."""
    fitted: Field
    """The density of the fit in the bands, zero beyond its cut-off."""
    preparation: str
    """What was read from a file and what was done to it."""


def surface_spectrum(contents: Contents) -> Section | None:
    """C(q), double logarithmic."""
    scenes: dict[str, tuple[Row, Shells]] = {}
    for _, curve in contents.curves:
        scenes.setdefault(curve.surface, (curve.rows[0], curve.persson.shells))
    counted = [(row, shells) for row, shells in scenes.values() if shells.modes is not None]
    found = [spectrum(row, shells) for row, shells in counted if shells.q.size]
    known = [one for one in found if one.q.size]
    shown = known[:SHOWN]
    if not shown:
        return None
    label = f"Power spectral density of the surface over the wavenumber: {_names(shown)}"
    below = details("Table behind the figure", _table(shown))
    told = "" if len(known) == len(shown) else f" The first {SHOWN} of {len(known)} are shown."
    drawn = figure(_sheet(shown), "spectrum", label, join(CAPTION, told))
    prepared = [tag("p", one.preparation) for one in shown if one.preparation]
    figures = tag("div", drawn, class_="figures")
    return Section("Surface spectrum", join(*prepared, figures, *_fits(shown), below))


def _fits(shown: list[Spectrum]) -> list[Html]:
    """The self-affine surface nearest to each, as a table."""
    rows = [
        [
            found.name,
            with_error(fit.hurst, fit.hurst_error),
            with_error(long, long * fit.q_r_error / fit.q_r) if fit.q_r else "none within the cell",
            2 * np.pi / fit.q_s,
            fit.scatter,
        ]
        for found in shown
        if (fit := found.fit)
        for long in [2 * np.pi / fit.q_r if fit.q_r else np.inf]
    ]
    if not rows:
        return []
    header = ["surface", "Hurst exponent", "roll-off [m]", "cut-off [m]", "scatter"]
    return [details("Self-affine fit", table(FIT, header, [Group("", rows)]))]


H = Html("<var>h</var>")
CAPTION = join(
    "Power spectral density of the surface, ",
    *(C_OF_Q, " = ", Html("<var>A</var>"), " ⟨|", H, Html("(<var>q</var>)|²⟩")),
    ": the variance of the heights in a band of wavenumber over the number of its modes, times the "
    "area of the cell (of a line its length), so that ⟨",
    *(H, "²⟩ = ∫ ", Html("<var>C</var> d²<var>q</var>"), " / (2π)²"),
    ". Waves shorter than two grid points along a side are left out. Lines: the self-affine "
    "surface nearest to it.",
)
FIT = (
    "C ~ [1 + (q/q_r)²]^(−1−H) up to q_s, most likely below q_s, with the rms height and gradient "
    "of the surface. Scatter: 0 where phases alone are random, 1 as of Gaussian roughness, much "
    "more where the surface is not of this kind."
)


def _names(shown: list[Spectrum]) -> str:
    return "; ".join(found.name for found in shown)


def spectrum(row: Row, shells: Shells) -> Spectrum:
    """The density of a surface from the sums that its shells hold.

    <h^2> = sum of C over the modes, each of which has (2 pi / L)^d of the plane of q: the density
    is L^d times the mean over the modes of a band.
    """
    name, length = str(row["surface"]), float(row["length"])
    dimension = dimension_of(name.partition(" ")[0])
    radius = shells.q * length / (2 * np.pi)
    edges = _edges(radius, 0.5 * int(row["points"]))
    place = np.searchsorted(edges, radius) - 1
    inside = (place >= 0) & (place < edges.size - 1)
    assert shells.modes is not None
    best = None
    if dimension == 2:
        with suppress(InputError):  # too narrow
            best = fit(shells)
    fitted = best.density(shells.q) * shells.modes if best else np.zeros_like(shells.q)
    total, moment, modes, fitted = (
        np.bincount(place[inside], weight[inside], edges.size - 1).astype(float)
        for weight in (shells.height, shells.height * shells.q, shells.modes, fitted)
    )
    kept, unit = total > 0, length**dimension
    return Spectrum(
        name,
        dimension,
        q=moment[kept] / total[kept],
        density=total[kept] / modes[kept] * unit,
        modes=modes[kept],
        fit=best,
        fitted=fitted[kept] / modes[kept] * unit,
        preparation=str(row.get("preparation", "")),
    )


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


def _sheet(shown: list[Spectrum]) -> Sheet:
    power = {1: "3", 2: "4"}.get(shown[0].dimension)
    sheet = Sheet(r"wavenumber  $q$ (m$^{-1}$)", rf"{LABEL} (m$^{power}$)")
    for place, (found, colour) in enumerate(zip(shown, colours(len(shown)), strict=True)):
        name = found.name[:LONGEST].replace("$", r"\$")
        look = Look(colour, MARKERS[place % len(MARKERS)], name)
        if found.fit is not None:
            inside = found.fitted > 0
            sheet.axes.plot(found.q[inside], found.fitted[inside], color=colour, lw=0.7)
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
