"""The optional results of [output], measured on a solved contact."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.observables import gap_histogram, stress_histogram
from gfmd_cli.physics.patches import area_distribution
from gfmd_cli.physics.power_spectra import autocorrelations, spectra
from gfmd_cli.spec.models import OutputTable
from gfmd_cli.study.columns import PR_LINEAR, PR_LOGARITHMIC
from gfmd_cli.study.observables import SolvedContact, measure
from gfmd_cli.study.refinement import Solved


@dataclass
class OptionalResults:
    """Columns, histograms and curves of one task; empty where none is turned on."""

    columns: dict[str, Any] = field(default_factory=dict)
    histograms: dict[str, Field] = field(default_factory=dict)
    curves: Mapping[str, Mapping[str, Field]] = field(default_factory=dict)
    """By group and name."""


def measure_optional(output: OutputTable, solved: Solved) -> OptionalResults:
    """Measure the optional results that [output] turns on."""
    results, contact, solution = OptionalResults(), solved.contact, solved.solution
    if output.histogram:
        _add_stress_histogram(results, solved)
    if output.gap_distribution:
        _add_gap_histogram(results, solved)
    it = SolvedContact(contact, solution.u, solution.sigma)
    results.columns |= measure(output, it)
    if output.patches:
        results.histograms["pr_patch_area"] = area_distribution(it.patch_areas)
    if output.spectra:
        results.curves = _curves(solved)
    return results


def _add_stress_histogram(results: OptionalResults, solved: Solved) -> None:
    pr = stress_histogram(solved.contact, solved.solution.u, solved.solution.sigma)
    results.histograms |= {PR_LINEAR: pr.linear, PR_LOGARITHMIC: pr.logarithmic}
    results.columns |= {"pr_zero": pr.zero, "pr_beyond": pr.beyond}


def _add_gap_histogram(results: OptionalResults, solved: Solved) -> None:
    pr = gap_histogram(solved.contact, solved.solution.u)
    results.histograms |= {"pr_gap": pr.linear, "pr_gap_log": pr.logarithmic}
    results.columns |= {
        "pr_gap_zero": pr.zero,
        "pr_gap_beyond": pr.beyond,
        "pr_gap_below": pr.below,
    }


def _curves(solved: Solved) -> dict[str, dict[str, Field]]:
    """Power spectra and autocorrelations, in units of m and Pa."""
    scene, solution = solved.scene, solved.solution
    fields = {"height": solved.contact.height, "u": solution.u, "sigma": solution.sigma}
    units = {"height": scene.h_std, "u": scene.h_std, "sigma": scene.delta_sigma}
    found = spectra(scene.grid, fields)
    powers = {name: power * units[name] ** 2 for name, power in found.power.items()}
    r, means = autocorrelations(scene.grid, fields)
    return {
        "spectra": {"q": found.q, "waves": found.waves, **powers},
        "autocorrelations": {"r": r, **means},
    }
