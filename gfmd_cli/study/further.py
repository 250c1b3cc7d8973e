"""What [output] asks for beside the scalars, measured on a solved contact."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from gfmd_cli.physics.fields import Field, Mask
from gfmd_cli.physics.observables import contact_points, gap_distribution, stress_distribution
from gfmd_cli.physics.patches import area_distribution, contact_patches, open_gap
from gfmd_cli.physics.spectra import autocorrelations, spectra
from gfmd_cli.physics.true_contact import bearing, contact_stress
from gfmd_cli.solvers.response import contact_stiffness
from gfmd_cli.study.grids import Solved
from gfmd_cli.study.layout import PR_LINEAR, PR_LOGARITHMIC
from gfmd_cli.study.spec import OutputTable


@dataclass
class Further:
    """Columns, distributions and curves of one task; empty where none was asked for."""

    columns: dict[str, Any] = field(default_factory=dict)
    distribution: dict[str, Any] = field(default_factory=dict)
    spectra: Mapping[str, Field] = field(default_factory=dict)
    autocorrelations: Mapping[str, Field] = field(default_factory=dict)


def observe_further(output: OutputTable, solved: Solved) -> Further:
    """Measure what is asked for."""
    found, contact, solution = Further(), solved.contact, solved.solution
    if output.histogram:
        found.distribution |= _stress_distribution(solved)
    if output.gap_distribution:
        found.distribution |= _gap_distribution(solved)
    if output.true_contact or output.patches or output.percolation or output.stiffness:
        touching = contact_points(contact, solution.u, solution.sigma)
        if output.true_contact:
            found.columns |= _true_contact(solved, touching)
        if output.patches:
            _add_patches(found, touching)
        if output.percolation:
            winds = open_gap(touching).winds.astype(int).tolist()
            found.columns |= dict(zip(("leaks_x", "leaks_y"), winds[::-1], strict=False))
        if output.stiffness:
            found.columns["stiffness"] = contact_stiffness(contact, touching)
    if output.spectra:
        found.spectra, found.autocorrelations = _curves(solved)
    return found


def _stress_distribution(solved: Solved) -> dict[str, Any]:
    pr = stress_distribution(solved.contact, solved.solution.u, solved.solution.sigma)
    return {
        PR_LINEAR: pr.linear,
        PR_LOGARITHMIC: pr.logarithmic,
        "pr_zero": pr.zero,
        "pr_beyond": pr.beyond,
    }


def _gap_distribution(solved: Solved) -> dict[str, Any]:
    pr = gap_distribution(solved.contact, solved.solution.u)
    return {
        "pr_gap": pr.linear,
        "pr_gap_log": pr.logarithmic,
        "pr_gap_zero": pr.zero,
        "pr_gap_beyond": pr.beyond,
        "pr_gap_below": pr.below,
    }


def _true_contact(solved: Solved, touching: Mask) -> dict[str, float]:
    """Delta_sigma over the true contact and over the highest points, as columns."""
    contact = solved.contact
    found = contact_stress(contact, touching)
    return {
        "deviation_c": found.deviation,
        "quadrature_c": found.quadrature,
        "deviation_bearing": float(bearing(contact).delta_sigma_c(contact.pressure)),
    }


def _add_patches(found: Further, touching: Mask) -> None:
    areas = contact_patches(touching).sizes / touching.size
    found.columns["patches"] = areas.size
    if areas.size:
        found.columns["patch_area_mean"] = float(areas.mean())
        found.columns["patch_area_largest"] = float(areas.max())
    found.distribution["pr_patch_area"] = area_distribution(areas)


def _curves(solved: Solved) -> tuple[dict[str, Field], dict[str, Field]]:
    """Power spectra and autocorrelations, in units of m and Pa."""
    scene, solution = solved.scene, solved.solution
    fields = {"height": solved.contact.height, "u": solution.u, "sigma": solution.sigma}
    units = {"height": scene.h_std, "u": scene.h_std, "sigma": scene.delta_sigma}
    found = spectra(scene.grid, fields)
    powers = {name: power * units[name] ** 2 for name, power in found.power.items()}
    r, means = autocorrelations(scene.grid, fields)
    return {"q": found.q, "waves": found.waves, **powers}, {"r": r, **means}
