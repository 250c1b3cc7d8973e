"""Sections: pictures of measured surfaces; power spectral densities of all surfaces."""

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from gfmd_cli.analysis.compare import Row
from gfmd_cli.analysis.curve_styles import distinct_styles, literal, shortened
from gfmd_cli.analysis.plotting import ColumnFigure
from gfmd_cli.analysis.surface_figure import height_figure
from gfmd_cli.analysis.table import Group, Table, TableColumn
from gfmd_cli.errors import InputError
from gfmd_cli.grid.arrays import Field
from gfmd_cli.maps.pictures import Picture
from gfmd_cli.physics.persson import Shells
from gfmd_cli.physics.spectrum_fit import SelfAffineFit, fit
from gfmd_cli.report.data import ReportData
from gfmd_cli.report.section import Drawing, Section
from gfmd_cli.report.svg import drawing
from gfmd_cli.study.reading import open_study

MAX_PICTURES = 4  # measured surfaces that are shown; a choice
MISSING = " Grey: missing heights."
BANDS_PER_DECADE = 10
MAX_SURFACES = 8  # of the figure; more cannot be told apart


def measured_surface(data: ReportData) -> Section:
    """Pictures of the measured surfaces; a blank section without such a surface."""
    surfaces = {str(row["surface"]): row for row in reversed(data.solved)}
    rows: list[Row] = []
    drawings: list[Drawing] = []
    with open_study(data.comparison.path) as study:
        for row in reversed(surfaces.values()):
            pictures = study.pictures(row["scene"])
            if pictures and len(rows) < MAX_PICTURES:
                rows.append(row)
                drawings += _drawings(row, pictures, f"{data.prefix}{len(rows)}")
    notes = [str(row["preparation"]) for row in rows]
    return Section("Measured surface", notes=notes, drawings=drawings)


def _drawings(row: Row, pictures: dict[str, Picture], place: str) -> list[Drawing]:
    """The pictures of one surface."""
    captions = {
        "measured": "Heights as measured, relative to their mean.",
        "prepared": "Heights as prepared for the contact, relative to their mean.",
    }
    return [
        drawing(
            height_figure(picture),
            f"heights-{name}-{place}",
            f"Map of {captions[name].lower()} {row['surface']}",
            captions[name] + (MISSING if np.isnan(picture.heights).any() else ""),
        )
        for name, picture in pictures.items()
    ]


@dataclass(frozen=True)
class Spectrum:
    """Power spectral density of one surface in bands of wavenumber."""

    name: str
    dimension: int
    q: Field
    """Mean wavenumber of each band [1/m]."""
    density: Field
    """[m^4], of a line contact [m^3]."""
    modes: Field
    """Number of modes of each band."""
    fit: SelfAffineFit | None
    """None where there is no range to fit."""
    fitted: Field
    """The density of the fit in the bands, zero beyond its cut-off."""
    preparation: str
    """What was read from a file and how it was treated."""


def surface_spectrum(data: ReportData) -> Section:
    """C(q), double logarithmic."""
    scenes: dict[tuple[str, str, float], tuple[Row, Shells]] = {}
    for _, curve in data.curves:
        row = curve.rows[0]
        key = (curve.surface, row["preparation"], row["h_std"])  # of two studies the same once
        scenes.setdefault(key, (row, curve.persson.shells))
    spectra = [spectrum(row, shells) for row, shells in scenes.values() if shells.q.size]
    spectra = [each for each in spectra if each.q.size]
    drawn_spectra = spectra[:MAX_SURFACES]
    if not drawn_spectra:
        return Section("Surface spectrum")
    names = "; ".join(each.name for each in drawn_spectra)
    label = f"Power spectral density of the surface over the wavenumber: {names}"
    left_out = len(spectra) > len(drawn_spectra)
    more = f" The first {MAX_SURFACES} of {len(spectra)} are shown." if left_out else ""
    return Section(
        "Surface spectrum",
        notes=[each.preparation for each in drawn_spectra if each.preparation],
        drawings=[drawing(_spectrum_figure(drawn_spectra), "spectrum", label, CAPTION + more)],
        disclosed={
            "Self-affine fit": _fits(drawn_spectra),
            "Table behind the figure": _bands(drawn_spectra),
        },
    )


def _fits(shown: list[Spectrum]) -> Table:
    """The self-affine surface nearest to each."""
    records = [
        {
            "surface": curve.name,
            "hurst": fit.hurst,
            "hurst_error": fit.hurst_error,
            "rolloff": fit.rolloff_wavelength,
            "rolloff_error": fit.rolloff_error,
            "no_rolloff": "none within the cell",
            "cutoff": fit.cutoff_wavelength,
            "scatter": fit.scatter,
        }
        for curve in shown
        if (fit := curve.fit)
    ]
    return Table(FIT, FITS, [Group("", records)])


CAPTION = (
    "Power spectral density of the surface, C(q) = A ⟨|h(q)|²⟩: the variance of the heights in a "
    "band of wavenumber over the number of its modes, times the area A of the cell (of a line its "
    "length), so that ⟨h²⟩ = ∫ C(q) d²q / (2π)². Waves shorter than two grid points along a side "
    "are left out. Lines: the self-affine surface nearest to it."
)
FITS = (
    TableColumn("surface", "surface"),
    TableColumn("Hurst exponent", "hurst", error="hurst_error"),
    TableColumn("roll-off", "rolloff", unit="m", error="rolloff_error", otherwise="no_rolloff"),
    TableColumn("cut-off", "cutoff", unit="m"),
    TableColumn("scatter", "scatter"),
)
FIT = (
    "C ~ [1 + (q/q_r)²]^(−1−H) up to q_s, most likely below q_s, with the rms height and gradient "
    "of the surface. Scatter: 0 where phases alone are random, 1 as of Gaussian roughness, much "
    "more where the surface is not of this kind."
)


def spectrum(row: Row, shells: Shells) -> Spectrum:
    """The density of a surface from the sums that its shells hold.

    <h^2> = sum of C over the modes, each of which has (2 pi)^d over the area of the cell in the
    plane of q: the density is this area times the mean over the modes of a band.
    """
    name, length, dimension = str(row["surface"]), float(row["length"]), int(row["dimension"])
    radius = shells.q * length / (2 * np.pi)
    ratio = 1.0 if dimension == 1 else length / float(row["length_y"])
    points = int(row["points"]) if dimension == 1 else min(row["points"], row["points_y"] * ratio)
    edges = _edges(radius, 0.5 * points)
    place = np.searchsorted(edges, radius) - 1
    inside = (place >= 0) & (place < edges.size - 1)
    nearest = None
    if dimension == 2:
        with suppress(InputError):  # too narrow
            nearest = fit(shells, np.pi * points / length)
    fitted = nearest.density(shells.q) * shells.modes if nearest else np.zeros_like(shells.q)
    total, moment, modes, fitted = (
        np.bincount(place[inside], weight[inside], edges.size - 1).astype(float)
        for weight in (shells.height, shells.height * shells.q, shells.modes, fitted)
    )
    usable, unit = total > 0, length**dimension / ratio
    return Spectrum(
        name,
        dimension,
        q=moment[usable] / total[usable],
        density=total[usable] / modes[usable] * unit,
        modes=modes[usable],
        fit=nearest,
        fitted=fitted[usable] / modes[usable] * unit,
        preparation=str(row.get("preparation", "")),
    )


def _edges(radius: Field, nyquist: float) -> Field:
    """Edges of bands half-way between shells, about BANDS_PER_DECADE in a decade [2 pi / L]."""
    between = np.sqrt(radius[1:] * radius[:-1])
    ends = np.concatenate([[0.5 * radius[0]], between, [radius[-1] * (1 + 1e-6)]])
    within = ends[ends < nyquist]  # on it, opposite modes are one
    chosen = [ends[0]]
    for edge in within[1:]:
        if edge >= chosen[-1] * 10 ** (1 / BANDS_PER_DECADE):
            chosen.append(edge)
    if len(chosen) > 1:
        chosen[-1] = within[-1]  # the last band is wider rather than that a shell is lost
    return np.array(chosen)


def _spectrum_figure(shown: list[Spectrum]) -> ColumnFigure:
    power = 2 + shown[0].dimension
    plot = ColumnFigure(r"wavenumber  $q$ (m$^{-1}$)", rf"$C(q)$ (m$^{power}$)")
    labels = [literal(name) for name in shortened([curve.name for curve in shown])]
    for curve, style in zip(shown, distinct_styles(labels), strict=True):
        if curve.fit is not None:
            line = {"color": style.colour, "lw": 0.7}
            plot.unnamed_line((style.label,), curve.q, curve.fitted, **line)
        plot.points(style, curve.q, curve.density, np.full(curve.q.size, True))
    plot.scale("x", "log", np.concatenate([curve.q for curve in shown]))
    plot.scale("y", "log", np.concatenate([curve.density for curve in shown]))
    return plot


def _bands(shown: list[Spectrum]) -> Table:
    """The bands of wavenumber of each surface."""
    columns = (
        TableColumn("q", "q", unit="1/m"),
        TableColumn("wavelength", lambda record: 2 * np.pi / record["q"], unit="m"),
        TableColumn("C(q)", "density", unit="m³" if shown[0].dimension == 1 else "m⁴"),
        TableColumn("modes", "modes", ".0f"),
    )
    groups = [
        Group(
            curve.name,
            [
                {"q": float(q), "density": float(density), "modes": float(modes)}
                for q, density, modes in zip(curve.q, curve.density, curve.modes, strict=True)
            ],
        )
        for curve in shown
    ]
    return Table("Bands of wavenumber.", columns, groups)
