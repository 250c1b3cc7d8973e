"""What a study stores of one task: its row and its arrays.

The row is built here alone. `planned` gives the columns that follow from the spec, `measured` those
of a solved contact, `all_columns` both and those on request, and `result` everything. `task_row`
describes a stored row as the spec does.
"""

from collections.abc import Mapping
from dataclasses import asdict

import numpy as np

from gfmd_cli.grid.arrays import Field
from gfmd_cli.maps.map_preparation import mirror
from gfmd_cli.physics.approach import approach
from gfmd_cli.physics.observables import changed_fractions, gap_histogram, stress_histogram
from gfmd_cli.physics.patches import area_distribution
from gfmd_cli.physics.power_spectra import autocorrelations, spectra
from gfmd_cli.physics.surface_spectrum import map_spectrum, short_wave_factor
from gfmd_cli.spec.models import SWEPT, OutputTable
from gfmd_cli.study.column import Row
from gfmd_cli.study.columns import FIELDS, PARAMETERS, PR_LINEAR, PR_LOGARITHMIC, empty_row
from gfmd_cli.study.observables import OPTIONAL_OBSERVABLES, SolvedContact
from gfmd_cli.study.plausibility import SEPARATOR, warnings_of
from gfmd_cli.study.provenance import gfmd_version
from gfmd_cli.study.refinement import TaskSolution
from gfmd_cli.study.result import Entry, TaskResult
from gfmd_cli.study.tasks import Task


def planned(task: Task) -> Row:
    """The columns that follow from the spec of a task."""
    surface, elastomer = task.surface, task.elastomer
    values = {table: getattr(task, table).parameters() for table in SWEPT}
    checksums = {table: checksum for table, (_, _, checksum) in task.files.items()}
    return {
        **{each.column.name: each.cell(values[each.table]) for each in PARAMETERS},
        "surface": surface.label,
        "ensemble": surface.label_without({"seed"}),
        "surface_sha256": checksums.get("surface", ""),
        "elastomer_sha256": checksums.get("elastomer", ""),
        "dimension": surface.dimension,
        "x_first": surface.x_first,
        "rough": int(surface.rough),
        "preparation": surface.preparation(task.boundary),
        "elastomer": elastomer.label,
        "elastomer_short": elastomer.short_label,
        "stiffness_given": int(elastomer.stiffness_given),
        "points_y": task.points_y,
        "length_y": surface.sides[0] if surface.dimension == 2 else np.nan,
        "n": np.nan if elastomer.exponent is None else elastomer.exponent,
        "grid": "auto" if task.auto else "given",
        "load": task.load_key,
        "load_value": task.load,
    }


def measured(task: Task, solved: TaskSolution) -> Row:
    """The columns of a solved contact that need no key of [output], without the time."""
    scene, contact, solution = solved.scene, solved.contact, solved.solution
    u, sigma = solution.u, solution.sigma
    pressure = contact.pressure * scene.delta_sigma
    if task.load_key == "pressure":  # exactly as prescribed, so that contacts can be grouped by it
        pressure = task.load
    return {
        **asdict(solved.observables),
        "points": scene.grid.points,
        "points_y": scene.grid.points_y,
        "p_star": contact.pressure,
        "p_star_error": solved.pressure_error * contact.pressure,
        "residual": solution.residual,
        "solver": solution.solver,
        "transforms": solution.transforms,
        "status": solution.status,
        "pressure": pressure,
        "delta_sigma": scene.delta_sigma,
        "h_std": scene.h_std,
        "mean_height": scene.mean_height,
        "length": scene.grid.length,
        "mean_gap": solved.observables.u_g * scene.h_std,
        "displacement": approach(scene, task.surface.peak, task.elastomer, contact, u, sigma),
        "steps": solution.steps,
        "gfmd_version": gfmd_version(),
        "tolerance": task.solver.tolerance,
        **error_columns(solved),
    }


def error_columns(solved: TaskSolution) -> Row:
    """The errors and continuum values; none unless an accuracy is requested."""
    if solved.bounds is None:
        return {}
    row: Row = {"u_g_bound": solved.bounds.u_g, "sigma_p_bound": solved.bounds.sigma_p}
    for name, estimate in solved.estimates.items():
        algebraic = solved.algebraic(name)
        row |= {
            f"{name}_error": estimate.error + algebraic,
            f"{name}_continuum": estimate.continuum,
            f"{name}_continuum_error": estimate.continuum_error + algebraic,
            f"{name}_verdict": estimate.verdict,
            f"{name}_algebraic": algebraic,
        }
    return row


def all_columns(task: Task, solved: TaskSolution) -> Row:
    """The columns and histograms of a solved contact, without the time."""
    contact, solution = solved.contact, solved.solution
    u, sigma = solution.u, solution.sigma
    results = measured(task, solved)
    results |= changed_fractions(task.surface, contact, u, sigma)
    results["short_wave_factor"] = short_wave_factor(task.surface, task.elastomer)
    return (
        empty_row()
        | planned(task)
        | results
        | {"warnings": SEPARATOR.join(warnings_of(task, solved, results))}
        | optional_columns(task.output, SolvedContact(contact, u, sigma))
    )


def task_row(task: Task, row: Mapping[str, object]) -> Row:
    """The row of a task in a study, worded as in its last spec; blank before it is solved."""
    points = {name: row.get(name, -1) for name in ("points", "points_y")}  # of an "auto" grid
    return empty_row() | dict(row) | planned(task) | points


def result(task: Task, solved: TaskSolution, seconds: float) -> TaskResult:
    """All that a study keeps of one solution, which took `seconds`."""
    scene, output = solved.scene, task.output
    row = all_columns(task, solved) | {"seconds": seconds}
    arrays: dict[str, dict[str, Field]] = _curves(solved) if output.spectra else {}
    arrays["fields"] = {
        name: whole
        for name in output.fields
        if (whole := scene.grid.collect(solved.field(name))) is not None
    }
    if output.cross_section:
        arrays["cross_sections"] = {
            column.name: scene.grid.diagonal(solved.field(column.name)) for column in FIELDS
        }
    entry = Entry(task.id, task.scene_id, output.names(), row)
    spectrum = map_spectrum(task.surface)
    return TaskResult(entry, scene.shells, arrays, task.surface.pictures(), spectrum)


def optional_columns(output: OutputTable, solved: SolvedContact) -> Row:
    """The histograms, with the share of points in no bin, and the observables of [output]."""
    row: Row = {}
    if output.histogram:
        pr = stress_histogram(solved.contact, solved.u, solved.sigma)
        row |= {PR_LINEAR: pr.linear, PR_LOGARITHMIC: pr.logarithmic}
        row |= {"pr_zero": pr.zero, "pr_beyond": pr.beyond}
    if output.gap_distribution:
        pr = gap_histogram(solved.contact, solved.u)
        row |= {"pr_gap": pr.linear, "pr_gap_log": pr.logarithmic}
        row |= {"pr_gap_zero": pr.zero, "pr_gap_beyond": pr.beyond, "pr_gap_below": pr.below}
    for output_key, column, measure, *_ in OPTIONAL_OBSERVABLES:
        if getattr(output, output_key) and (value := measure(solved)) is not None:
            row[column.name] = column.kind(value)
    if output.patches:
        row["pr_patch_area"] = area_distribution(solved.patch_areas)
    return row


def _curves(solved: TaskSolution) -> dict[str, dict[str, Field]]:
    """Power spectra and autocorrelations, in units of m and Pa.

    With a free boundary the spectra are those of the fields mirrored to twice the sides.
    """
    scene, solution = solved.scene, solved.solution
    grid, periodic = scene.grid, solved.contact.is_periodic
    fields = {"height": solved.contact.height, "u": solution.u, "sigma": solution.sigma}
    units = {"height": scene.h_std, "u": scene.h_std, "sigma": scene.delta_sigma}
    r, means = autocorrelations(grid, fields, periodic=periodic)
    if not periodic:
        grid, fields = grid.doubled(), {name: mirror(field) for name, field in fields.items()}
    q, waves, powers = spectra(grid, fields)
    powers = {name: power * units[name] ** 2 for name, power in powers.items()}
    return {
        "spectra": {"q": q, "waves": waves, **powers},
        "autocorrelations": {"r": r, **means},
    }
