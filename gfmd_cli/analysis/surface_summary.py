"""Summary of a surface: size, ISO 25178 parameters, spectrum, the nearest self-affine surface."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from gfmd_cli.analysis.table import Group, Table, TableColumn, plain, plus_minus, records_of
from gfmd_cli.maps.height_map import shape_text
from gfmd_cli.maps.map_warnings import unresolved
from gfmd_cli.maps.roughness_parameters import MAP_NAMES, PROFILE_NAMES, roughness_parameters
from gfmd_cli.physics.contact import Scene
from gfmd_cli.physics.elastomers import HalfSpace
from gfmd_cli.physics.indenters import MAX_POINTS, RigidSurface
from gfmd_cli.physics.persson import Persson, Shells
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.physics.spectrum_fit import Moments, SelfAffineFit, moments
from gfmd_cli.physics.surface_spectrum import Spectrum, map_spectrum, short_wave_factor, spectrum
from gfmd_cli.study.forecast import first_grid
from gfmd_cli.units import LARGEST_RMS_HEIGHT

PRESSURES = np.array([0.003, 0.03, 0.3])  # p* of the predictions
MIN_HURST = 0.01  # of the table [surface] that is suggested
MAX_SCATTER = 3.0  # per shell, relative to Gaussian roughness; a self-affine surface has less
FIT = (
    TableColumn("H", "hurst", ".2f", error="hurst_error", optional=True),
    TableColumn("lambda_r", "rolloff_wavelength", ".3g", "m", "rolloff_error", "no_rolloff", True),
    TableColumn("lambda_s", "cutoff_wavelength", ".3g", "m", optional=True),
    TableColumn("rms of fit", "rms_height", ".3g", "m", optional=True),
    TableColumn("scatter", "scatter", ".3g", optional=True),
)
"""Columns of the fit, with the keys of `fit_record`."""


@dataclass(frozen=True)
class SurfaceSummary:
    """What `gfmd surface` prints of one surface."""

    surface: RigidSurface
    scene: Scene
    """The surface on its own points or those of a spec, mirrored if it has borders, under a
    half-space of unit modulus."""
    parameters: dict[str, float | None]
    """Roughness parameters of the levelled map before its edges are treated; else of the cell."""
    moments: Moments
    """Moments of the spectrum of the cell that is solved."""
    spectrum: Spectrum
    """Spectrum of the cell that is solved, or of a map with borders, tapered."""

    @cached_property
    def short_wave_factor(self) -> float:
        """See `surface_spectrum.short_wave_factor`; of a half-space, that of the rms gradient."""
        return short_wave_factor(self.surface, HalfSpace())

    def warnings(self) -> list[str]:
        """Probable mistakes, and whether a map resolves its roughness."""
        about_waves = unresolved(self.short_wave_factor, self.surface.period_limit())
        warnings = [*self.surface.warnings(), about_waves]
        return list(filter(None, warnings))

    @property
    def in_si(self) -> bool:
        """Whether lengths are in metres: rms heights of real surfaces are small."""
        return self.moments.height <= LARGEST_RMS_HEIGHT

    def record(self) -> dict[str, Any]:
        """The summary as plain data in SI units."""
        grid, copies = self.scene.grid, self.surface.within("periodic").copies
        record: dict[str, Any] = {
            "surface": self.surface.label,
            "preparation": self.surface.preparation(),
            "sides": [side / copies for side in grid.sides[::-1]],
            "points": [points // copies for points in grid.whole_shape[::-1]],
            **self.parameters,
            "h_std": self.moments.height,
            "gradient": self.moments.gradient,
            "curvature": self.moments.curvature,
            "short_wave_factor": self.short_wave_factor,
            "warnings": self.warnings(),
            **fit_record(self.spectrum.fit),
        }
        curves = {"q": self.spectrum.q.tolist(), "spectrum": self.spectrum.density.tolist()}
        return {key: plain(value) for key, value in record.items()} | curves


def summarise(surface: RigidSurface, points: int = 0) -> SurfaceSummary:
    """The summary of a surface, unless it is a map on `points` points along x or more.

    Raises InputError for an unfit surface.
    """
    repeated = surface.within("periodic")
    repeated.check_resolved(MAX_POINTS, MAX_POINTS)
    smallest = repeated.smallest_grid()
    # modes at the Nyquist wavenumber are counted twice
    points = smallest if surface.is_map else max(points, 2 * smallest)
    scene = build_scene(repeated, HalfSpace(), points)
    measured = surface.measured_map()
    if measured is None:
        heights = np.ma.asarray(scene.in_metres(scene.height))
        measured = heights, scene.grid.spacings
    parameters = roughness_parameters(*measured)
    spectral = map_spectrum(surface) or spectrum(
        scene.shells, scene.grid.sides, scene.grid.whole_shape
    )
    return SurfaceSummary(surface, scene, parameters, moments(scene.shells), spectral)


def fit_record(nearest: SelfAffineFit | None) -> dict[str, float | None]:
    """The parameters of a fit [m], as the columns FIT show them; empty without a fit."""
    if nearest is None:
        return {}
    keys = (key for column in FIT for key in (column.value, column.error) if key)
    return {str(key): getattr(nearest, str(key)) for key in keys}


UNITS = dict.fromkeys(("Sq", "Sa", "Sz", "Sal", "Pq", "Pa", "Pt", "Pal"), "m")
FORMATS = dict.fromkeys(("Ssk", "Sku", "Psk", "Pku"), "z.3f")
COLUMNS = (
    TableColumn("surface", "surface"),
    *(
        TableColumn(
            name, name, FORMATS.get(name, TableColumn.format), UNITS.get(name, ""), optional=True
        )
        for name in (*MAP_NAMES, *PROFILE_NAMES)
    ),
    *FIT,
)


def summary_table(summaries: Sequence[SurfaceSummary], names: Sequence[str]) -> Table:
    """One row for each surface."""
    records = [
        summary.record() | {"surface": name} for summary, name in zip(summaries, names, strict=True)
    ]
    in_si = any(summary.in_si for summary in summaries)
    columns = COLUMNS if in_si else [replace(column, unit="") for column in COLUMNS]
    return Table("", columns, [Group("", records)])


def summary_text(summary: SurfaceSummary) -> str:
    """The summary of one surface as text."""
    grid, measured, record = summary.scene.grid, summary.moments, summary.record()
    sides = " x ".join(dict.fromkeys(f"{side:.6g}" for side in record["sides"]))  # a square: one
    metres, per_metre = (" m", " 1/m") if summary.in_si else ("", "")
    words = [
        f"{name} {'-' if value is None else f'{value:.5g}'}{metres if name in UNITS else ''}"
        for name, value in summary.parameters.items()
    ]
    lines = [
        f"L = {sides}{metres} on {shape_text(record['points'][::-1])} points",
        ", ".join(words[:5]),
        ", ".join(words[5:]),
        f"spectral: rms height {measured.height:.6g}{metres}, "
        f"rms gradient {measured.gradient:.5g}, rms curvature {measured.curvature:.5g}{per_metre}",
        f"half-space: p* = 1 is p = {0.5 * measured.gradient:.5g} E_star",
    ]
    lines += [f"warning: {warning}" for warning in summary.warnings()]
    nearest = summary.spectrum.fit
    spectra = {"spectrum": summary.scene.shells}
    random: list[str] = []
    if nearest is not None and not _reason_against(nearest, grid.length):
        copies = summary.surface.within("periodic").copies
        tiles = copies**2 if copies > 1 else summary.scene.texture.tiles
        # the fit is that of one tile
        table, spectra["fit"] = _suggestion(nearest, grid.length, grid.area / tiles)
        random = ["random surface with the fitted spectrum:", "", "[surface]"]
        random += [f"{key} = {json.dumps(value)}" for key, value in table.items()]
    if grid.dimension == 2:
        fitted = [f"no fit: {summary.spectrum.no_fit}"]
        if nearest is not None:
            fitted = _fit_lines(nearest, grid.length, metres)
        lines += [*fitted, *_predicted(spectra, metres), *random]
    title = summary.surface.preparation() or summary.surface.label
    return "\n".join([title, *(f"  {line}".rstrip() for line in lines)])


def _predicted(spectra: dict[str, Shells], metres: str) -> list[str]:
    """Persson theory of a half-space, Eqs. (25) and (28), on one spectrum or two."""
    theories = {name: Persson(waves) for name, waves in spectra.items()}
    p = PRESSURES * theories["spectrum"].delta_sigma
    gaps = {name: theory.mean_gap(p) for name, theory in theories.items()}
    records = records_of(p=p, a_r=theories["spectrum"].contact_area(p), **gaps)
    columns = [
        TableColumn("p / E_star", "p", ".3g"),
        TableColumn("a_r", "a_r", ".4f"),
        *(TableColumn(f"gap, {name}", name, ".4g", metres.strip()) for name in theories),
    ]
    table = Table("", columns, [Group("Persson theory, half-space:", records)])
    return table.as_text().splitlines()


def _reason_against(nearest: SelfAffineFit, length: float) -> str:
    """Why no random surface on a cell of side `length` [m] is suggested; empty where one is."""
    if nearest.scatter > MAX_SCATTER:
        return "The scatter is far above 1: the surface is not self-affine"
    if nearest.cutoff_wavelength > length:
        return "lambda_s is larger than the side along x"
    return ""


def _fit_lines(nearest: SelfAffineFit, length: float, metres: str) -> list[str]:
    """The fit with warnings."""
    wavelength, error = nearest.rolloff_wavelength, nearest.rolloff_error
    rolloff = "no roll-off within the cell"
    if wavelength is not None and error is not None:
        rolloff = f"lambda_r = {plus_minus(wavelength, error)}{metres}"
    lines = [
        f"fitted spectrum: H = {plus_minus(nearest.hurst, nearest.hurst_error)}, {rolloff}, "
        f"lambda_s = {nearest.cutoff_wavelength:.3g}{metres}, rms height "
        f"{nearest.rms_height:.4g}{metres} (scatter {nearest.scatter:.3g})"
    ]
    if np.isfinite(nearest.hurst_of_long_waves):
        lines.append(
            "H depends on the wavenumber: below half of the largest wavenumber of the fit it is "
            f"{nearest.hurst_of_long_waves:.2g}; the error of H contains the difference. Check the "
            "map for noise, blur or a filter"
        )
    if reason := _reason_against(nearest, length):
        lines.append(f"{reason}, and no random surface is suggested.")
    elif not MIN_HURST <= round(nearest.hurst, 2) <= 1:  # as shown
        lines.append(
            f"The fit gives H = {nearest.hurst:.2g}, which is outside {MIN_HURST:g} to 1. The "
            "table below has the nearest possible exponent; its surface has another rms gradient."
        )
    return lines


def _suggestion(
    nearest: SelfAffineFit, length: float, area: float
) -> tuple[dict[str, Any], Shells]:
    """The fit as a table [surface] of a run spec, on a square cell of side `length` [m].

    The fit is that of `area` [m^2], for a mirrored map the area of the map, not of the cell. The
    spectral density, |h(q)|^2 times the area, is the same on the cell; the rms height is larger, as
    the cell has longer waves.

    Returns the table, and the spectrum of this surface under a half-space of unit modulus.
    """
    rolloff = nearest.rolloff_wavelength
    numbers = {
        "rolloff": (rolloff or 2 * np.pi / nearest.q_1) / length,
        "hurst": min(max(nearest.hurst, MIN_HURST), 1.0),
        "cutoff": nearest.cutoff_wavelength / length,
        "h_std": nearest.rms_height,
        "length": length,
    }
    rounded = {key: float(f"{value:.4g}") for key, value in numbers.items()}
    table = {"kind": "self-affine"} | ({} if rolloff else {"spectrum": "cutoff"}) | rounded
    model = SelfAffine.model_validate(table)
    waves = build_scene(model, HalfSpace(), first_grid(model)).shells
    variance = np.sum(waves.modes * nearest.density(waves.q)) * area / length**2
    h_std = float(f"{np.sqrt(variance):.4g}")
    factor = (h_std / rounded["h_std"]) ** 2
    scaled = {name: factor * getattr(waves, name) for name in ("height", "energy", "variance")}
    return table | {"h_std": h_std}, replace(waves, **scaled)
