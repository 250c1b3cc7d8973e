"""What a surface is, for people: size, moments, spectrum, the self-affine surface nearest to it."""

from math import pi

from gfmd_cli.errors import InputError
from gfmd_cli.physics.contact import build_scene
from gfmd_cli.physics.elastomer import HalfSpace
from gfmd_cli.physics.spectrum import Moments, SelfAffineFit, fit, moments
from gfmd_cli.physics.surface import FileSurface, Surface
from gfmd_cli.study.tasks import describe

STRANGE = 3.0  # scatter per shell, beyond which the surface is not of this kind


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
    try:
        return "\n".join([*lines, *_told(fit(scene.shells), seen, length)])
    except InputError as error:
        return "\n".join([*lines, f"  no fit: {error}"])


def _told(found: SelfAffineFit, seen: Moments, length: float) -> list[str]:
    """The fit, and as a table of a run spec."""
    short = 2 * pi / found.q_s
    lines = [f"  spectrum: H = {found.hurst:.3f} +- {found.hurst_error:.3f}"]
    if found.q_r:
        long = 2 * pi / found.q_r
        error = long * found.q_r_error / found.q_r
        lines[0] += f", lambda_r = {long:.3g} +- {error:.1g} m"
        keys: dict[str, str | float] = {"rolloff": long / length, "cutoff": short / length}
    else:
        lines[0] += ", no roll-off within the cell"
        keys = {"spectrum": "cutoff", "rolloff": 1.0, "cutoff": short / length}
    lines[0] += f", lambda_s = {short:.3g} m (scatter {found.scatter:.3g})"
    if found.scatter > STRANGE:
        lines.append(
            "  A scatter far above 1: the spectrum is not that of a self-affine surface; what "
            "follows has the same rms height and gradient only."
        )
    table = {
        "kind": "self-affine",
        "hurst": min(max(found.hurst, 0.01), 1.0),
        **keys,
        "h_std": seen.height,
        "length": length,
    }
    lines += ["  as random roughness:", "", "  [surface]"]
    return lines + [
        f'  {key} = "{value}"' if isinstance(value, str) else f"  {key} = {value:.4g}"
        for key, value in table.items()
    ]
