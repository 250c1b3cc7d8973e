"""Summary of a surface: size, ISO 25178 parameters, spectrum, the nearest self-affine surface."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import prod
from typing import Any

import numpy as np

from gfmd_cli.analysis.surface_spectrum import FIT, Spectrum, nearest_fit, spectrum
from gfmd_cli.analysis.table import Group, Table, TableColumn, plain, records_of
from gfmd_cli.maps.height_map import extent
from gfmd_cli.maps.roughness_parameters import MAP_NAMES, PROFILE_NAMES, roughness_parameters
from gfmd_cli.physics.contact import Scene, build_scene
from gfmd_cli.physics.elastomers import HalfSpace
from gfmd_cli.physics.indenters import RigidSurface
from gfmd_cli.physics.persson import Persson
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.physics.spectrum_fit import Moments, SelfAffineFit, moments
from gfmd_cli.study.forecast import first_grid
from gfmd_cli.study.plausibility import METRES

PRESSURES = np.array([0.003, 0.03, 0.3])  # p* of the predictions
MIN_HURST = 0.01  # of the table [surface] that is suggested
MAX_SCATTER = 3.0  # per shell, relative to Gaussian roughness; a self-affine surface has less


@dataclass(frozen=True)
class SurfaceSummary:
    """What `gfmd surface` prints of one surface."""

    surface: RigidSurface
    scene: Scene
    """The surface on its own points or those of a spec, mirrored if it has borders, under a
    half-space of unit modulus."""
    parameters: dict[str, float | None]
    """Of the measured part of a map, levelled, before its edges are treated; else of the cell."""
    moments: Moments
    """Of the cell that is solved."""
    spectrum: Spectrum
    """Of the cell that is solved; the fit is to a map with tapered edges instead of a mirrored
    one."""

    @property
    def copies(self) -> int:
        """Copies of the surface along each side of the cell of the scene."""
        return self.surface.within("periodic").copies

    @property
    def in_si(self) -> bool:
        """Whether lengths are in metres: rms heights of real surfaces are small."""
        return self.moments.height <= METRES

    def record(self) -> dict[str, Any]:
        """The summary as plain data in SI units."""
        grid = self.scene.grid
        record: dict[str, Any] = {
            "surface": self.surface.label,
            "preparation": self.surface.preparation(),
            "sides": [side / self.copies for side in grid.sides[::-1]],
            "points": [points // self.copies for points in grid.whole_shape[::-1]],
            **self.parameters,
            "h_std": self.moments.height,
            "gradient": self.moments.gradient,
            "curvature": self.moments.curvature,
            "warnings": self.surface.warnings(),
            **self.spectrum.fit_record,
        }
        return {key: plain(value) for key, value in record.items()}


def summarise(surface: RigidSurface, points: int = 0) -> SurfaceSummary:
    """The summary of a surface, unless it is a map on `points` points along x or more.

    Raises InputError for an unfit surface.
    """
    repeated = surface.within("periodic")
    smallest = repeated.smallest_grid()
    # modes at the Nyquist wavenumber are counted twice
    points = smallest if surface.is_map else max(points, 2 * smallest)
    scene = build_scene(repeated, HalfSpace(), points)
    measured = surface.measured_map()
    if measured is None:
        heights = np.ma.asarray(scene.in_metres(scene.height))
        measured = heights, scene.grid.spacings
    parameters = roughness_parameters(*measured)
    best = _fit_to_window(surface, scene) if repeated.copies > 1 else None
    spectral = spectrum(scene.shells, scene.grid.sides, scene.grid.whole_shape, best)
    return SurfaceSummary(surface, scene, parameters, moments(scene.shells), spectral)


def _fit_to_window(surface: RigidSurface, mirrored: Scene) -> tuple[SelfAffineFit | None, str]:
    """The fit for a mirrored map, from the map with tapered edges.

    The kinks of the mirrored map have a spectrum of q^-4 or so, which hides that of short waves.
    |h(q)|^2 of a mode is inversely proportional to the area of the cell; its rms height is kept.
    """
    tapered = surface.model_copy(update={"edges": "window"})
    scene = build_scene(tapered, HalfSpace(), tapered.smallest_grid())
    nearest, no_fit = nearest_fit(scene.shells, scene.grid.sides, scene.grid.whole_shape)
    if nearest is None:
        return None, no_fit
    areas = prod(scene.grid.sides) / prod(mirrored.grid.sides)
    heights = moments(mirrored.shells).height / moments(scene.shells).height
    return replace(nearest, c_0=nearest.c_0 * areas * heights**2), ""


UNITS = dict.fromkeys(("Sq", "Sa", "Sz", "Sal", "Pq", "Pa", "Pt", "Pal"), "m")
FORMATS = dict.fromkeys(("Ssk", "Sku", "Psk", "Pku"), ".3f")
COLUMNS = (
    TableColumn("surface", "surface"),
    *(
        TableColumn(
            name, name, FORMATS.get(name, TableColumn.format), UNITS.get(name, ""), optional=True
        )
        for name in (*MAP_NAMES, *PROFILE_NAMES)
    ),
    *(replace(column, error="") for column in FIT if column.value != "scatter"),
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
        f"L = {sides}{metres} on {extent(record['points'][::-1])} points",
        ", ".join(words[:5]),
        ", ".join(words[5:]),
        f"spectral: rms height {measured.height:.6g}{metres}, "
        f"rms gradient {measured.gradient:.5g}, rms curvature {measured.curvature:.5g}{per_metre}",
    ]
    if grid.dimension == 2:
        lines.append(f"half-space: p* = 1 is p = {0.5 * measured.gradient:.5g} E_star")
    lines += [f"warning: {warning}" for warning in summary.surface.warnings()]
    theories = {"spectrum": summary.scene}
    if summary.spectrum.fit is not None:
        table = _table(record, grid.length)
        model = SelfAffine.model_validate(table)
        theories["fit"] = build_scene(model, HalfSpace(), first_grid(model))
        random = ["random surface with the fitted spectrum:", "", "[surface]"]
        random += [f"{key} = {json.dumps(value)}" for key, value in table.items()]
        lines += [
            *_fit_lines(summary.spectrum.fit, metres),
            *_predicted(theories, metres),
            *random,
        ]
    elif grid.dimension == 2:
        lines += [f"no fit: {summary.spectrum.no_fit}", *_predicted(theories, metres)]
    title = summary.surface.preparation() or summary.surface.label
    return "\n".join([title, *(f"  {line}".rstrip() for line in lines)])


def _predicted(scenes: dict[str, Scene], metres: str) -> list[str]:
    """Persson theory of a half-space, Eqs. (25) and (28), on one spectrum or two."""
    theories = {name: Persson(scene.shells) for name, scene in scenes.items()}
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


def _fit_lines(nearest: SelfAffineFit, metres: str) -> list[str]:
    """The fit with warnings."""
    wavelength, error = nearest.rolloff_wavelength, nearest.rolloff_error
    rolloff = "no roll-off within the cell"
    if wavelength is not None:
        rolloff = f"lambda_r = {wavelength:.3g} +- {error:.1g}{metres}"
    lines = [
        f"fitted spectrum: H = {nearest.hurst:.3f} +- {nearest.hurst_error:.3f}, {rolloff}, "
        f"lambda_s = {nearest.cutoff_wavelength:.3g}{metres} (scatter {nearest.scatter:.3g})"
    ]
    if nearest.scatter > MAX_SCATTER:
        lines.append(
            "The scatter is far above 1: the surface is not self-affine; the surface below has the "
            "same rms height and gradient only."
        )
    if not MIN_HURST <= nearest.hurst <= 1:
        lines.append(
            f"The fit gives H = {nearest.hurst:.2g}, which is outside {MIN_HURST:g} to 1. The "
            "table below has the nearest possible exponent; its surface has another rms gradient."
        )
    return lines


def _table(record: dict[str, Any], length: float) -> dict[str, Any]:
    """The fit as a table [surface] of a run spec."""
    rolloff = record["rolloff_wavelength"]
    numbers = {
        "rolloff": rolloff / length if rolloff else 1.0,
        "hurst": min(max(record["hurst"], MIN_HURST), 1.0),
        "cutoff": record["cutoff_wavelength"] / length,
        "h_std": record["h_std"],
        "length": length,
    }
    rounded = {key: float(f"{value:.4g}") for key, value in numbers.items()}
    return {"kind": "self-affine"} | ({} if rolloff else {"spectrum": "cutoff"}) | rounded
