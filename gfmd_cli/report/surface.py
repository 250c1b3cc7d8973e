"""Sections: pictures of measured surfaces; power spectral densities of all surfaces."""

from collections.abc import Sequence

import numpy as np

from gfmd_cli.analysis.compare import Curve
from gfmd_cli.analysis.curve_styles import MAX_STYLES, distinct_labels, distinct_styles
from gfmd_cli.analysis.plotting import ColumnFigure
from gfmd_cli.analysis.selection import evenly, grouped
from gfmd_cli.analysis.surface_figure import height_figure, spectrum_labels
from gfmd_cli.analysis.surface_summary import FIT, fit_record
from gfmd_cli.analysis.table import Group, Table, TableColumn, records_of
from gfmd_cli.maps.map_warnings import unresolved
from gfmd_cli.maps.pictures import Picture
from gfmd_cli.physics.surface_spectrum import Spectrum, spectrum
from gfmd_cli.report.data import ReportData
from gfmd_cli.report.section import Drawing, Section, drawing
from gfmd_cli.study.column import Row
from gfmd_cli.study.columns import PARAMETERS
from gfmd_cli.study.reading import open_study

MAX_PICTURES = 4  # measured surfaces that are shown; a choice
MISSING = " Grey: missing heights."


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
    notes: list[str] = []
    for row in rows:
        notes.append(str(row["preparation"]))
        if note := unresolved(row["short_wave_factor"], row.get("lateral_period_limit", 0.0)):
            notes.append(f"Resolution: {note}.")
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


def surface_spectrum(data: ReportData) -> Section:
    """C(q), double logarithmic, of rough surfaces; an empty section without them."""
    by_surface = grouped((curve for _, curve in data.curves), _surface_of)
    finest = [max(each, key=lambda c: c.row_of_spectrum["points"]) for each in by_surface.values()]
    rough = [curve for curve in finest if curve.has_theory and curve.persson.shells.q.size]
    spectra = [(curve.rows[0], _spectrum(curve)) for curve in rough]
    spectra = [(row, each) for row, each in spectra if each.q.size]
    if not spectra:
        return Section("Surface spectrum")
    notes, drawings, fits, bands = [], [], [], {}
    by_dimension = grouped(spectra, lambda pair: int(pair[0]["dimension"]))
    for dimension, of_it in by_dimension.items():  # C(q) of lines has another unit
        several = len(by_dimension) > 1
        rows, drawn = zip(*evenly(of_it, MAX_STYLES), strict=True)
        names = [str(row["surface"]) for row in rows]
        label = f"Power spectral density of the surface over the wavenumber: {'; '.join(names)}"
        left_out = len(of_it) > MAX_STYLES
        more = f" {MAX_STYLES} of {len(of_it)} surfaces are shown." if left_out else ""
        figure = _spectrum_figure(names, drawn, dimension)
        place = f"spectrum-{dimension}" if several else "spectrum"
        drawings.append(drawing(figure, place, label, CAPTION + more))
        of_what = {1: " of lines", 2: " of areas"}[dimension] if several else ""
        bands[f"Table behind the figure{of_what}"] = _bands(names, drawn, dimension)
        notes += [str(row["preparation"]) for row in rows if row["preparation"]]
        fits += [
            {"surface": name, "no_rolloff": "none within the cell", **fit_record(each.fit)}
            for name, each in zip(names, drawn, strict=True)
            if each.fit is not None
        ]
    fit_table = Table(FIT_CAPTION, FITS, [Group("", fits)])
    return Section(
        "Surface spectrum",
        notes=notes,
        drawings=drawings,
        disclosed={"Self-affine fit": fit_table, **bands},
    )


def _surface_of(curve: Curve) -> tuple[str, ...]:
    """What names the surface of a curve, whatever its grid and study."""
    row = curve.rows[0]
    keys = (each.word(row) for each in PARAMETERS if each.table == "surface")
    return (curve.surface, row["surface_sha256"], row["preparation"], *keys)


def _spectrum(curve: Curve) -> Spectrum:
    """The spectrum of the surface of a curve."""
    row = curve.row_of_spectrum
    axes = slice(-row["dimension"], None)
    sides = (row["length_y"], row["length"])[axes]
    points = (row["points_y"], row["points"])[axes]
    return curve.map_spectrum or spectrum(curve.persson.shells, sides, points)


CAPTION = (
    "Power spectral density of the surface, C(q) = A ⟨|h(q)|²⟩: the variance of the heights in a "
    "band of wavenumber over the number of its modes, times the area A of the cell (of a line its "
    "length), so that ⟨h²⟩ = ∫ C(q) d²q / (2π)² (of a line ∫ C(q) dq / 2π). Modes with zero "
    "amplitude, as in a surface of equal tiles or grooves, are not counted. Waves shorter than two "
    "grid points along a side are left out. A map that is not periodic is tapered towards its "
    "borders. Lines: the self-affine surface nearest to it."
)
FITS = (TableColumn("surface", "surface"), *FIT)
FIT_CAPTION = (
    "Self-affine spectrum C ∝ [1 + (q / q_r)²]^(−1−H) up to q_s, zero above, with the Hurst "
    "exponent H, the roll-off lambda_r = 2π / q_r and the cut-off lambda_s = 2π / q_s. H and q_r "
    "maximise the likelihood of the spectrum below q_s; q_s gives the fit the rms gradient of the "
    "surface. Scatter: 1 for Gaussian roughness, 0 if only the "
    "phases are random, much larger if the spectrum of the surface has another shape."
)


def _spectrum_figure(names: list[str], shown: Sequence[Spectrum], dimension: int) -> ColumnFigure:
    plot = ColumnFigure(*spectrum_labels(dimension))
    for curve, style in zip(shown, distinct_styles(distinct_labels(names)), strict=True):
        if curve.fit is not None:
            line = {"color": style.colour, "lw": 0.7}
            fitted = np.where(curve.fitted > 0, curve.fitted, np.nan)  # it ends at q_s
            plot.unnamed_line((style.label,), curve.q, fitted, **line)
        plot.points(style, curve.q, curve.density)
    plot.scale("x", "log", np.concatenate([curve.q for curve in shown]))
    plot.scale("y", "log", np.concatenate([curve.density for curve in shown]))
    return plot


def _bands(names: list[str], shown: Sequence[Spectrum], dimension: int) -> Table:
    """The bands of wavenumber of each surface."""
    columns = (
        TableColumn("q", "q", unit="1/m"),
        TableColumn("wavelength", lambda record: 2 * np.pi / record["q"], unit="m"),
        TableColumn("C(q)", "density", unit="m³" if dimension == 1 else "m⁴"),
        TableColumn("modes", "modes", ".0f"),
    )
    groups = [
        Group(name, records_of(q=curve.q, density=curve.density, modes=curve.modes))
        for name, curve in zip(names, shown, strict=True)
    ]
    return Table("Bands of wavenumber.", columns, groups)
