"""Summary of a surface: size, ISO 25178 parameters, spectrum, the nearest self-affine surface."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import pi
from typing import Any

import numpy as np

from gfmd_cli.analysis.table import Column, Group, Table, plain
from gfmd_cli.errors import InputError
from gfmd_cli.physics.contact import Scene, build_scene
from gfmd_cli.physics.elastomers import HalfSpace
from gfmd_cli.physics.height_map import extent
from gfmd_cli.physics.indenters import RigidSurface
from gfmd_cli.physics.persson import Persson
from gfmd_cli.physics.roughness_parameters import MAP_NAMES, PROFILE_NAMES, roughness_parameters
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.physics.spectrum_fit import Moments, SelfAffineFit, fit, moments
from gfmd_cli.study.plausibility import METRES

PRESSURES = (0.003, 0.03, 0.3)  # p* of the predictions
MIN_HURST = 0.01  # of the table [surface] that is suggested
MAX_SCATTER = 3.0  # per shell, relative to Gaussian roughness; a self-affine surface has less


@dataclass(frozen=True)
class SurfaceSummary:
    """What `gfmd surface` prints of one surface."""

    surface: RigidSurface
    scene: Scene
    """The surface on its smallest grid, mirrored if it has borders, under a half-space of unit
    modulus."""
    parameters: dict[str, float | None]
    """Of the measured part of a map, levelled, before its edges are treated; else of the cell."""
    moments: Moments
    """Of the cell that is solved."""
    fit: SelfAffineFit | None
    """The nearest self-affine surface; None where there is none."""
    no_fit: str
    """Why there is none."""

    @property
    def copies(self) -> int:
        """Copies of the surface along each side of the cell of the scene."""
        return self.surface.within("periodic").copies

    @property
    def in_si(self) -> bool:
        """Whether lengths are in metres: rms heights of real surfaces are small."""
        return self.moments.height <= METRES

    @property
    def remarks(self) -> list[str]:
        """Warnings about likely mistakes."""
        return self.surface.remarks()

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
            "remarks": self.remarks,
        }
        if self.fit is not None:
            record |= {
                "hurst": self.fit.hurst,
                "hurst_error": self.fit.hurst_error,
                "rolloff_wavelength": 2 * pi / self.fit.q_r if self.fit.q_r else None,
                "cutoff_wavelength": 2 * pi / self.fit.q_s,
                "scatter": self.fit.scatter,
            }
        return {key: plain(value) for key, value in record.items()}


def summarise(surface: RigidSurface) -> SurfaceSummary:
    """The summary of a surface. Raises InputError for an unfit surface."""
    finer = 1 if surface.is_map else 2  # modes at the Nyquist wavenumber are counted twice
    repeated = surface.within("periodic")
    scene = build_scene(repeated, HalfSpace(), finer * repeated.smallest_grid())
    measured = surface.measured_map()
    if measured is None:
        heights = np.ma.asarray(scene.in_metres(scene.height))
        measured = heights, scene.grid.spacings
    nearest, reason = None, "a line has no fit" if scene.grid.dimension == 1 else ""
    if not reason:
        try:
            nearest = fit(scene.shells, pi / max(scene.grid.spacings))
        except InputError as error:
            reason = str(error)
    parameters = roughness_parameters(*measured)
    return SurfaceSummary(surface, scene, parameters, moments(scene.shells), nearest, reason)


UNITS = dict.fromkeys(("Sq", "Sa", "Sz", "Sal", "Pq", "Pa", "Pt", "Pal"), "m")
FORMATS = dict.fromkeys(("Ssk", "Sku", "Psk", "Pku"), ".3f")
COLUMNS = (
    Column("surface", "surface"),
    *(
        Column(name, name, FORMATS.get(name, Column.format), UNITS.get(name, ""), optional=True)
        for name in (*MAP_NAMES, *PROFILE_NAMES)
    ),
    Column("H", "hurst", ".2f", optional=True),
    Column("lambda_r", "rolloff_wavelength", ".3g", unit="m", optional=True),
    Column("lambda_s", "cutoff_wavelength", ".3g", unit="m", optional=True),
)


def summary_table(summaries: Sequence[SurfaceSummary], names: Sequence[str]) -> Table:
    """One row for each surface."""
    records = [
        summary.record() | {"surface": name} for summary, name in zip(summaries, names, strict=True)
    ]
    in_si = any(summary.in_si for summary in summaries)
    columns = COLUMNS if in_si else [replace(column, unit="") for column in COLUMNS]
    return Table("", columns, [Group("", records)])


def as_text(summary: SurfaceSummary) -> str:
    """The summary of one surface as text."""
    grid, measured, record = summary.scene.grid, summary.moments, summary.record()
    sides = " x ".join(dict.fromkeys(f"{side:.6g}" for side in record["sides"]))  # a square: one
    points = extent(record["points"][::-1])
    metres, per_metre = (" m", " 1/m") if summary.in_si else ("", "")
    lines = [
        summary.surface.preparation() or summary.surface.label,
        f"  L = {sides}{metres} on {points} points",
        *_parameter_lines(summary.parameters, metres),
        f"  spectral: rms height {measured.height:.6g}{metres}, "
        f"rms gradient {measured.gradient:.5g}, rms curvature {measured.curvature:.5g}{per_metre}",
    ]
    if grid.dimension == 2:
        lines.append(f"  half-space: p* = 1 is p = {0.5 * measured.gradient:.5g} E_star")
    lines += [f"  note: {remark}" for remark in summary.remarks]
    if grid.dimension == 1:
        return "\n".join(lines)
    theories = {"spectrum": Persson(summary.scene.shells)}
    if summary.fit is None:
        no_fit = f"  no fit: {summary.no_fit}"
        return "\n".join([*lines, no_fit, *_predicted(theories, summary.in_si)])
    table = _table(summary.fit, measured, grid.length)
    model = SelfAffine.model_validate(table)
    theories["fit"] = Persson(build_scene(model, HalfSpace(), 2 * model.smallest_grid()).shells)
    gaussian = float(summary.copies**2)  # modes (+-q_x, +-q_y) of a mirrored map are alike
    lines += [
        *_fit_lines(summary.fit, gaussian, metres),
        *_predicted(theories, summary.in_si),
        "  random surface with the fitted spectrum:",
        "",
        "  [surface]",
    ]
    return "\n".join([*lines, *(f"  {key} = {json.dumps(value)}" for key, value in table.items())])


def _parameter_lines(parameters: dict[str, float | None], metres: str) -> list[str]:
    """The parameters by their names in the standards, in two lines."""
    words = [
        f"{name} {'-' if value is None else f'{value:.5g}'}{metres if name in UNITS else ''}"
        for name, value in parameters.items()
    ]
    return [f"  {', '.join(words[:5])}", f"  {', '.join(words[5:])}"]


def _predicted(theories: dict[str, Persson], in_si: bool) -> list[str]:
    """Persson theory of a half-space, Eqs. (25) and (28), on one spectrum or two."""
    unit = next(iter(theories.values())).delta_sigma
    gap = "gap [m]" if in_si else "gap"
    heads = "".join(f"{f'{gap}, {name}':>24}" for name in theories)
    lines = ["  Persson theory, half-space:", f"    p / E_star       a_r{heads}"]
    for p_star in PRESSURES:
        p = p_star * unit
        gaps = "".join(f"{float(theory.mean_gap(p)):24.4g}" for theory in theories.values())
        area = float(next(iter(theories.values())).contact_area(p))
        lines.append(f"    {p:10.3g}  {area:8.4f}{gaps}")
    return lines


def _fit_lines(nearest: SelfAffineFit, gaussian: float, metres: str) -> list[str]:
    """The fit with warnings; `gaussian` is the scatter that Gaussian roughness has."""
    short = 2 * pi / nearest.q_s
    lines = [f"  fitted spectrum: H = {nearest.hurst:.3f} +- {nearest.hurst_error:.3f}"]
    if nearest.q_r:
        long = 2 * pi / nearest.q_r
        error = long * nearest.q_r_error / nearest.q_r
        lines[0] += f", lambda_r = {long:.3g} +- {error:.1g}{metres}"
    else:
        lines[0] += ", no roll-off within the cell"
    lines[0] += f", lambda_s = {short:.3g}{metres} (scatter {nearest.scatter:.3g})"
    if nearest.scatter > MAX_SCATTER * gaussian:
        lines.append(
            f"  The scatter is far above {gaussian:g}: the surface is not self-affine; the surface "
            "below has the same rms height and gradient only."
        )
    if not MIN_HURST <= nearest.hurst <= 1:
        lines.append(
            f"  The Hurst exponent is outside {MIN_HURST:g} to 1: the surface below has "
            "the nearest possible one, and another gradient."
        )
    return lines


def _table(nearest: SelfAffineFit, measured: Moments, length: float) -> dict[str, Any]:
    """The fit as a table [surface] of a run spec."""
    if nearest.q_r:
        keys: dict[str, Any] = {"rolloff": 2 * pi / nearest.q_r / length}
    else:
        keys = {"spectrum": "cutoff", "rolloff": 1.0}
    keys |= {
        "hurst": min(max(nearest.hurst, MIN_HURST), 1.0),
        "cutoff": 2 * pi / nearest.q_s / length,
        "h_std": measured.height,
        "length": length,
    }
    rounded = {k: v if isinstance(v, str) else float(f"{v:.4g}") for k, v in keys.items()}
    return {"kind": "self-affine", **rounded}
