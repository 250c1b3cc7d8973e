"""What a surface is, for people: size, moments, spectrum, the self-affine surface nearest to it."""

import json
from math import pi
from typing import Any

from gfmd_cli.errors import InputError
from gfmd_cli.physics.contact import build_scene
from gfmd_cli.physics.elastomer import HalfSpace
from gfmd_cli.physics.persson import Persson
from gfmd_cli.physics.spectrum import Moments, SelfAffineFit, fit, moments
from gfmd_cli.physics.surface import FileSurface, SelfAffine, Surface
from gfmd_cli.study.tasks import describe

PRESSURES = (0.003, 0.03, 0.3)  # p* that theory is told at
LEAST = 0.01  # Hurst exponent of a table
STRANGE = 3.0  # scatter per shell, beyond which the surface is not of this kind
MIRRORED = 4.0  # times the scatter, where waves come in equal fours


def roughness(surface: Surface) -> str:
    """Some lines on a surface. Raises InputError where it has one dimension only or is unfit."""
    if surface.dimension != 2:
        raise InputError(f"surface: kind {surface.kind!r} is a line; its spectrum is not looked at")
    finer = 1 if isinstance(surface, FileSurface) else 2  # modes at the edge count for two
    scene = build_scene(surface, HalfSpace(), finer * surface.smallest_grid())
    seen, length = moments(scene.shells), scene.grid.length
    lines = [
        surface.preparation() or describe(surface),
        f"  L = {length:.6g} m on {scene.grid.points} x {scene.grid.points} points",
        f"  rms height {seen.height:.6g} m, rms gradient {seen.gradient:.5g}, "
        f"rms curvature {seen.curvature:.5g} 1/m",
        f"  half-space: p* = 1 is p = {0.5 * seen.gradient:.5g} E_star",
    ]
    if isinstance(surface, FileSurface):
        lines += [f"  note: {remark}" for remark in surface.remarks()]
    theories = {"its spectrum": Persson(scene.shells)}
    try:
        found = fit(scene.shells)
    except InputError as error:
        return "\n".join([*lines, f"  no fit: {error}", *_predicted(theories)])
    table = _table(found, seen, length)
    like = SelfAffine.model_validate(table)
    theories["the fit"] = Persson(build_scene(like, HalfSpace(), 2 * like.smallest_grid()).shells)
    mirrored = isinstance(surface, FileSurface) and surface.treatment()[1] == "mirror"
    usual = MIRRORED if mirrored else 1.0
    lines += [
        *_told(found, usual),
        *_predicted(theories),
        "  as random roughness:",
        "",
        "  [surface]",
    ]
    return "\n".join([*lines, *(f"  {key} = {json.dumps(value)}" for key, value in table.items())])


def _predicted(theories: dict[str, Persson]) -> list[str]:
    """Persson theory of a half-space, Eqs. (25) and (28), on one spectrum or two."""
    unit = next(iter(theories.values())).delta_sigma
    heads = "".join(f"{f'gap [m], {name}':>24}" for name in theories)
    lines = ["  Persson theory, half-space:", f"    p / E_star       a_r{heads}"]
    for p_star in PRESSURES:
        p = p_star * unit
        gaps = "".join(f"{float(theory.mean_gap(p)):24.4g}" for theory in theories.values())
        area = float(next(iter(theories.values())).contact_area(p))
        lines.append(f"    {p:10.3g}  {area:8.4f}{gaps}")
    return lines


def _told(found: SelfAffineFit, usual: float) -> list[str]:
    """The fit, and how far it is to be trusted; `usual` is the scatter of Gaussian roughness."""
    short = 2 * pi / found.q_s
    lines = [f"  spectrum: H = {found.hurst:.3f} +- {found.hurst_error:.3f}"]
    if found.q_r:
        long = 2 * pi / found.q_r
        error = long * found.q_r_error / found.q_r
        lines[0] += f", lambda_r = {long:.3g} +- {error:.1g} m"
    else:
        lines[0] += ", no roll-off within the cell"
    lines[0] += f", lambda_s = {short:.3g} m (scatter {found.scatter:.3g})"
    if found.scatter > STRANGE * usual:
        lines.append(
            f"  A scatter far above {usual:g}: the spectrum is not that of a self-affine surface; "
            "what follows has the same rms height and gradient only."
        )
    if not LEAST <= found.hurst <= 1:
        lines.append(
            f"  An exponent outside {LEAST:g} to 1 is no roughness: what follows has the nearest "
            "one, and another gradient."
        )
    return lines


def _table(found: SelfAffineFit, seen: Moments, length: float) -> dict[str, Any]:
    """The fit as a table [surface] of a run spec."""
    if found.q_r:
        keys: dict[str, Any] = {"rolloff": 2 * pi / found.q_r / length}
    else:
        keys = {"spectrum": "cutoff", "rolloff": 1.0}
    keys |= {
        "hurst": min(max(found.hurst, LEAST), 1.0),
        "cutoff": 2 * pi / found.q_s / length,
        "h_std": seen.height,
        "length": length,
    }
    rounded = {k: v if isinstance(v, str) else float(f"{v:.4g}") for k, v in keys.items()}
    return {"kind": "self-affine", **rounded}
