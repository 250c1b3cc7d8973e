"""Warnings about results that are probably not what the user means."""

from collections.abc import Iterator, Mapping, Sequence
from math import inf, isfinite
from typing import Any

import numpy as np

from gfmd_cli.maps.map_warnings import MAX_GRADIENT, unresolved
from gfmd_cli.physics.contact import Scene
from gfmd_cli.physics.indenters import RigidSurface
from gfmd_cli.physics.spectrum_fit import moments
from gfmd_cli.spec.models import LOADS
from gfmd_cli.status import LARGEST_TOLERANCE, Status
from gfmd_cli.study.refinement import TaskSolution, border_share, inaccurate_columns
from gfmd_cli.study.tasks import Task
from gfmd_cli.units import LARGEST_RMS_HEIGHT, percent

FEW_POINTS = 30  # a choice: about 20 of the points of such a circle are on its edge
MIN_MODULUS_IN_PA = 1e3  # a choice: gels have 1e3 Pa, reduced moduli are mostly 1
MAX_MODULUS = 1.2e13  # [Pa]: ten times that of diamond; no material has more
REDUCED_PRESSURES = (1e-6, 100.0)
"""Reduced pressures outside of which a load has another unit than was meant; a choice. Rough
surfaces are in full contact from about 6 on; below, the largest grids have few points in contact.
"""
SMALL_GAPS = (1e-5, 1e-3)
"""Mean gaps [h_std]: below the first, or below the second if that is a possible gap in m, they are
probably meant in m; a choice."""
LARGEST_INDENTER = 0.1
"""Rms height of the cell of a single indenter [m] above which its unit is not the metre; a choice:
that of a wheel of 1 m radius in a cell of 1 m is 0.05 m."""
MAX_EDGE_SLOPE = 1.0  # of a single indenter at the edge of its contact; a choice: 45 degrees
MAX_CHANGED_SHARE = 0.05  # of contact or load where heights are not those measured; a choice
SMALL_DISPLACEMENT = 1e-4  # [h_std], below which heights have another unit; a choice
ROUNDING = 1e-9  # of a wavenumber, relative
MAX_FINEST_SHARE = 0.2
"""Share of the squared Delta_sigma at waves of two to four spacings, from which it depends on the
grid; a choice. From 64 to 512 points, ten exponents n and eleven single indenters, Delta_sigma
changed from a grid to the next by 3 % or more in 159 of 164 cases above this share, and by at most
2.7 % (157 times by less than 1.1 %) in 166 below:
`scripts/indenter_bars.py --units --points 64 128 256 512`."""
OTHER_UNIT = "so that p* is another pressure on another grid; give load.pressure"
SEPARATOR = " | "
"""Between the warnings of one contact in a column of text."""


def loaded_value(load_key: str, results: Mapping[str, Any]) -> float:
    """The value that a load prescribes: in the continuum if it is known, else on the grid."""
    name = LOADS[load_key].searched
    continuum = float(results.get(f"{name}_continuum", inf))
    return continuum if isfinite(continuum) else float(results[name])


def warnings_of(task: Task, solved: TaskSolution, results: Mapping[str, Any]) -> Iterator[str]:
    """Reasons to doubt the result of one contact, a sentence each; mostly none."""
    elastomer, scene = task.elastomer, solved.scene
    yield from task.surface.warnings(task.boundary)
    if elastomer.modulus > MIN_MODULUS_IN_PA:
        yield from _doubtful_lengths(task.surface, scene.h_std, elastomer.modulus)
        yield from _steep_contact(task.surface, solved)
    if elastomer.modulus > MAX_MODULUS and scene.h_std <= LARGEST_RMS_HEIGHT:
        key = "k_n" if elastomer.kind == "power" else "E_star"
        yield (
            f"the contact modulus, {elastomer.modulus:.3g} Pa, is more than ten times that of "
            f"diamond, 1.2e12 Pa: is elastomer.{key} in Pa?"
        )
    gradient = moments(scene.shells).gradient
    if {"h_std", "length"} <= task.surface.model_fields_set and gradient > MAX_GRADIENT:
        yield (
            f"rms gradient {gradient:.3g}: check that surface.h_std and surface.length are in the "
            "same unit"
        )
    if task.solver.tolerance > LARGEST_TOLERANCE:
        yield (
            f"solver.tolerance = {task.solver.tolerance:g}: contact area and mean gap may be wrong "
            f"by several percent; at most {LARGEST_TOLERANCE:g} is usual"
        )
    yield from elastomer.warnings(scene, task.boundary, is_rough=task.surface.rough)
    yield from _compressed(task, scene.h_std, results["displacement"])
    yield from _unit_of_grid(task, scene)
    yield from _load_in_jump(task, solved.solution.status, results)
    yield from _contact_at_border(task, solved)
    if max(results.get("edge_contact", 0.0), results.get("edge_load", 0.0)) > MAX_CHANGED_SHARE:
        yield (
            f"more than {MAX_CHANGED_SHARE:.0%} of the contact or of the load is at the edges, "
            "where the window has changed the heights (see the columns edge_contact and "
            "edge_load); leave out surface.edges to keep them"
        )
    if max(results.get("filled_contact", 0.0), results.get("filled_load", 0.0)) > MAX_CHANGED_SHARE:
        yield (
            f"more than {MAX_CHANGED_SHARE:.0%} of the contact or of the load is where heights are "
            "missing and were filled in (see the columns filled_contact and filled_load): if the "
            "highest points lack a height, contact area, stress and gap are uncertain"
        )
    about_waves = unresolved(results["short_wave_factor"], task.surface.period_limit())
    if task.accuracy is not None and about_waves:
        yield about_waves
    if scene.has_voids and solved.observables.u_g < 0:
        yield (
            "the mean gap is negative: where heights are missing, the elastomer enters the holes "
            "deeper than the interpolated heights, from which the gap is counted"
        )
    yield from _missed_accuracy(task, solved)
    if units := _doubtful_unit(task, solved):
        yield units
    elif round(solved.observables.a_r * scene.grid.size) < FEW_POINTS:  # not due to the unit
        yield (
            f"fewer than {FEW_POINTS} grid points in contact: contact area and stress depend on "
            "the grid; use more points"
        )


def _doubtful_lengths(surface: RigidSurface, h_std: float, modulus: float) -> Iterator[str]:
    """Warnings about lengths that are not in metres, or not given, beside a modulus in Pa."""
    lengths = {
        key: value
        for key, value in surface
        if surface.unit_of(key) == "m" and key not in ("length_y", "depth")
    }
    largest = LARGEST_RMS_HEIGHT if surface.rough else LARGEST_INDENTER
    if h_std > largest and not surface.stepped:  # the depth of a punch may have any value
        keys = ["length", "scale"] if surface.is_map else sorted(lengths)
        yield (
            f"a modulus of {modulus:.3g} Pa and an rms height of {h_std:.3g} m: are heights and "
            f"lengths in metres? Set {' or '.join(f'surface.{key}' for key in keys)}"
        )
        return
    for key, value in lengths.items():
        if value is not None and key not in surface.model_fields_set:
            yield f"surface.{key} is not given: {value:g} m is assumed"


def _steep_contact(surface: RigidSurface, solved: TaskSolution) -> Iterator[str]:
    """A warning about a single indenter in metres that is steep where its contact ends."""
    if surface.rough or surface.stepped:
        return
    grid, a_r = solved.scene.grid, solved.observables.a_r
    r = 0.5 * a_r * grid.length if grid.dimension == 1 else (a_r * grid.area / np.pi) ** 0.5
    slope = surface.slope_at(r) if r > 0 else 0.0
    if slope > MAX_EDGE_SLOPE:
        key = next(key for key in ("radius", "slope", "amplitude") if key in dict(surface))
        yield (
            f"the indenter has a slope of {slope:.3g} at the edge of the contact, {r:.3g} m from "
            f"its middle, but linear elasticity needs small slopes: check surface.{key} and the "
            "load"
        )


def _compressed(task: Task, h_std: float, displacement: float) -> Iterator[str]:
    """A warning about a layer that is compressed by more than its thickness.

    A single indenter counts only with a modulus in Pa: in reduced units its height has any factor.
    """
    largest, is_rough = task.elastomer.largest_displacement, task.surface.rough
    already_warned = is_rough and largest <= h_std  # by the elastomer
    has_real_lengths = is_rough or task.elastomer.modulus > MIN_MODULUS_IN_PA
    if displacement > largest and has_real_lengths and not already_warned:
        yield (
            f"the indenter has moved by {displacement:.3g} m since first touch, but "
            f"elastomer.thickness is {largest:g} m: linear elasticity does not hold for "
            f"such compressions; check load.{task.load_key}, elastomer.E_star and thickness"
        )


def unit_of_grids(tasks: Sequence[Task]) -> str:
    """A warning if p* of rough surfaces has another unit on each of several grids, else "".

    Single indenters are warned of contact by contact, see `MAX_FINEST_SHARE`. Interpolated maps
    have too little of Delta_sigma at the shortest waves of their own grid to show the change.
    """
    changing = [task for task in tasks if task.surface.rough and not task.has_fixed_unit]
    if len({task.points for task in changing}) < 2:
        return ""
    kind = changing[0].surface.kind
    return f"load.p_star: Delta_sigma of the surface ({kind}) depends on the grid, {OTHER_UNIT}"


def finest_share(scene: Scene) -> float:
    """Share of the squared Delta_sigma at waves of two to less than four of the wider spacings.

    Grids have waves of four spacings exactly; rounding of q does not decide on these.
    """
    q, variance = scene.shells.q, scene.shells.variance
    four_spacings = 0.5 * np.pi / max(scene.grid.spacings)
    return float(variance[q > (1 + ROUNDING) * four_spacings].sum() / variance.sum())


def _unit_of_grid(task: Task, scene: Scene) -> Iterator[str]:
    """A warning if the unit of p* of a single indenter depends on the grid; also on one grid."""
    if task.has_fixed_unit or task.surface.rough:
        return
    if (share := finest_share(scene)) > MAX_FINEST_SHARE:
        yield (
            f"load.p_star: {percent(share)} of the square of Delta_sigma is at waves of two to "
            f"four grid spacings, {OTHER_UNIT}"
        )


def _load_in_jump(task: Task, status: Status, results: Mapping[str, Any]) -> Iterator[str]:
    """A warning if a contact area is farther than the tolerance from the load."""
    if task.load_key == "contact_area" and status.is_accurate:
        value = loaded_value(task.load_key, results)
        if not abs(value - task.load) <= task.load_tolerance * task.load:
            load = f"load.contact_area = {task.load:g}"
            yield f"{load} lies in a jump; this is the nearest contact found"


def _missed_accuracy(task: Task, solved: TaskSolution) -> Iterator[str]:
    """Warnings if a fixed grid misses the requested accuracy; with "auto" that is a status."""
    columns = [] if task.auto else inaccurate_columns(task, solved)
    if columns and solved.scene.has_voids:
        yield (
            f"[accuracy]: no error of {', '.join(columns)} is known on any grid with "
            'surface.missing = "void"'
        )
        return
    final = [name for name in columns if solved.estimates[name].is_final]
    for name in final:
        yield f"[accuracy] is met on no grid: {name} {solved.estimates[name].verdict.explanation}"
    if others := [name for name in columns if name not in final]:
        remedy = "more points"
        if not LOADS[task.load_key].searched:
            remedy = 'grid.points = "auto"; accuracy.max_points limits it'
        yield (
            f"the errors of {', '.join(others)} are larger than [accuracy] requests, or unknown: "
            f"use {remedy}"
        )


def _contact_at_border(task: Task, solved: TaskSolution) -> Iterator[str]:
    """A warning if the contact of a single indenter reaches the border of its cell.

    Lines are left out: a wave or ridge is periodic by nature.
    """
    is_single = not task.surface.rough and task.surface.dimension == 2
    if is_single and border_share(solved.contact, solved.solution):
        beyond = (
            "where it meets that of the next periodic copy of the indenter"
            if task.boundary == "periodic"
            else "which acts as the edge of a punch"
        )
        yield (
            f"the contact reaches the border of the cell, {beyond}: enlarge surface.length for a "
            "single indenter"
        )


def _doubtful_unit(task: Task, solved: TaskSolution) -> str:
    """A warning about a load that has probably another unit than was meant, else ""."""
    scene, key, load = solved.scene, f"load.{task.load_key}", task.load
    low, high = REDUCED_PRESSURES
    unit = f"p* = 1 is {scene.delta_sigma:.3g} Pa here"
    if task.load_key == "mean_gap":
        near_zero, small = SMALL_GAPS
        is_possible = small <= load / scene.h_std <= scene.highest
        if load < near_zero or (load < small and is_possible):
            return (
                f"{key} is relative to the rms height, {scene.h_std:.3g} m here, and {load:g} is "
                "next to full contact: is it a length in m? Divide it by the rms height"
            )
    if task.load_key == "displacement" and load < SMALL_DISPLACEMENT * scene.h_std:
        return (
            f"{key} = {load:g} m is {load / scene.h_std:.1g} of the rms height, "
            f"{scene.h_std:.3g} m: are heights and lengths in m?"
        )
    if solved.observables.a_r == 1 and solved.contact.pressure > high:
        if task.load_key == "p_star":
            return f"{key} is far above full contact; {unit}: load.pressure takes Pa"
        return f"{key} is far above full contact; {unit}: are moduli, heights and load in Pa and m?"
    is_light = task.surface.rough and solved.contact.pressure < low
    if task.load_key == "pressure" and is_light and solved.observables.a_r < 1:
        return f"{key} gives hardly any contact; {unit}: are moduli, heights and load in Pa and m?"
    return ""
