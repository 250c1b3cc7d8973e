"""A spec as a list of tasks, one for each surface, elastomer, grid, solver and load."""

from collections import Counter
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.files.checksums import Version, digest, file_version
from gfmd_cli.physics.indenters import RigidSurface
from gfmd_cli.physics.linear_elastomer import LinearElastomer
from gfmd_cli.solvers.auto import AnySolver
from gfmd_cli.spec import models
from gfmd_cli.spec_table import SpecTable
from gfmd_cli.study import forecast

LOAD_DIGITS = 14  # of a load that name its task: the last bit of a sequence depends on the machine
MAX_TASKS = 100_000  # upper limit of a study, guards against typing errors
MAX_COMBINATIONS = 2_000_000  # of all lists, of which paired lists choose a part
WITH_FILES = ("surface", "elastomer")  # tables of the spec that may name a file


@dataclass(frozen=True)
class Task:
    """One contact to solve."""

    index: int
    surface: RigidSurface
    elastomer: LinearElastomer
    grid: models.GridTable
    points: int
    """Points along x; of an "auto" grid a forecast."""
    points_y: int
    """Points along y, likewise; 1 of a line."""
    load_key: str
    """Key of the load in [load]: one of LOADS."""
    load: float
    """Its value."""
    load_tolerance: float
    """Relative distance to it at which a search ends."""
    solver: AnySolver
    output: models.OutputTable
    accuracy: models.AccuracyTable | None
    id: str
    """Name of the task by its content, the output left out."""
    scene_id: str
    """Name of its surface, elastomer and grid by their content."""
    swept: tuple[str, ...]
    """Swept keys of surface, grid and solver, as words of the label."""
    files: dict[str, tuple[Path, Version, str]]
    """The files of surface and elastomer, by table: path, version before its checksum was computed,
    and checksum."""

    @property
    def auto(self) -> bool:
        """Whether the grid is chosen by the accuracy that the spec requires."""
        return self.grid.points == "auto"

    @property
    def boundary(self) -> str:
        """Boundary of the contact, "periodic" or "free"."""
        return self.grid.boundary or "periodic"

    @property
    def has_fixed_unit(self) -> bool:
        """Whether the load is the same pressure on all grids: Delta_sigma may depend on them."""
        is_fixed = self.surface.band_limited and (
            self.boundary == "periodic" or self.surface.mirrored() is not None
        )
        return is_fixed or self.load_key != "p_star"

    @property
    def label(self) -> str:
        """The task in messages and progress: elastomer, swept keys, points and load."""
        points = "auto" if self.auto else str(self.points)
        if not self.auto and self.points_y not in (1, self.points):
            points += f"x{self.points_y}"
        return " ".join([self.elastomer.label, *self.swept, points, self.load_label])

    @property
    def load_label(self) -> str:
        """The load with its symbol."""
        return models.load_text(self.load_key, self.load)

    def p_star(self, delta_sigma: float) -> float:
        """The reduced pressure, where it is known, on a scene with this Delta_sigma [Pa]."""
        return self.load if self.load_key == "p_star" else self.load / delta_sigma

    @property
    def size(self) -> int:
        """Number of grid points."""
        return self.points * self.points_y

    def points_y_on(self, points: int) -> int:
        """Points along y of a finer or coarser grid of the same cell and aspect ratio."""
        if self.surface.dimension == 1:
            return 1
        return max(1, round(points * self.points_y / self.points))

    @property
    def bytes(self) -> float:
        """Memory that the solve takes, with its process."""
        return self.bytes_on(self.points)

    def bytes_on(self, points: int) -> float:
        """Memory that a solve on this many points along x takes, with its process."""
        shape = (self.points_y_on(points), points)
        fields = self.solver.fields_for(self.boundary, self.elastomer.exponent)
        fields += forecast.fields_of_output(self.output, self.boundary)
        fields += forecast.ACCURACY_FIELDS if self.accuracy is not None else 0.0
        if self.surface.dimension == 2 and self.boundary == "periodic":
            fields += forecast.fields_of_levels(shape, self.surface.sides)
        return fields * 8 * float(prod(shape)) + forecast.BASE_BYTES

    @property
    def least_points(self) -> int:
        """Points along x without which the task cannot begin."""
        return forecast.first_grid(self.surface) if self.auto else self.points

    @property
    def seconds(self) -> float:
        """Time that the task is expected to take on one thread, within a factor of about three."""
        return self.seconds_at(self.load if self.load_key == "p_star" else forecast.P_STAR)

    def seconds_at(self, p_star: float) -> float:
        """The same with a load of about this reduced pressure."""
        solves = 1.0
        if models.LOADS[self.load_key].searched:
            solves = forecast.SOLVES_PER_SEARCH[self.accuracy is not None]
        exponent, tolerance = self.elastomer.exponent, self.solver.tolerance
        pairs = forecast.pairs(exponent, p_star, tolerance, self.boundary)
        pairs = solves * pairs * self.solver.relative_time + forecast.OTHER_PAIRS
        return 0.01 + forecast.SECONDS_PER_PAIR * self.size * pairs


def plan(spec: models.Spec, *, suited: bool = True) -> list[Task]:
    """The tasks of a spec, in a fixed order: surface, elastomer, grid, solver, pressure.

    Raises InputError where a grid does not resolve its surface, a file is unfit or, if `suited`, a
    solver does not support its elastomer.
    """
    try:
        return _tasks(spec, suited=suited)
    except InputError as error:
        raise InputError(f"{spec.source}: {error}") from error


def _tasks(spec: models.Spec, *, suited: bool) -> list[Task]:
    versions = _file_versions(spec)
    _check(spec, suited=suited)
    resolved = spec.resolved()
    swept_keys = {table: _swept_keys(getattr(spec, table)) for table in models.SWEPT}
    tasks: dict[str, Task] = {}
    for at, loads in spec.combinations():
        chosen = _chosen(spec, at)
        tables = {table: resolved[table][i] for table, i in at.items()}
        for table, key in (("surface", "edges"), ("grid", "boundary")):
            if key in tables[table]:
                tables[table] = tables[table] | {key: getattr(chosen[table], key)}
        scene_id = digest([tables[name] for name in ("surface", "elastomer", "grid")])
        swept = _swept_words(chosen, swept_keys)
        files = {
            table: (path, versions[path], tables[table]["sha256"])
            for table in WITH_FILES
            if (path := chosen[table].file) is not None
        }
        for load in loads:
            surface, points, points_y = _cell(spec, chosen, load)
            task = Task(
                index=len(tasks),
                **chosen | {"surface": surface},
                points=points,
                points_y=points_y,
                load_key=spec.load.key,
                load=load,
                load_tolerance=spec.load.tolerance,
                output=spec.output,
                accuracy=spec.accuracy,
                id=_task_id(spec, resolved, tables, load),
                scene_id=scene_id,
                swept=swept,
                files=files,
            )
            _check_unit(task)
            tasks.setdefault(task.id, task)  # loads may agree in all digits that count
    return list(tasks.values())


def _file_versions(spec: models.Spec) -> dict[Path, Version]:
    """The versions of the files of surfaces and elastomers. Raises InputError, with the key."""
    versions = {}
    for table in WITH_FILES:
        for path in filter(None, (choice.file for choice in getattr(spec, table))):
            try:
                versions[path] = file_version(path)
            except OSError as error:
                raise InputError(f"{table}.path: {path}: {error.strerror}") from error
    return versions


def _check(spec: models.Spec, *, suited: bool) -> None:
    """Raise InputError for too many tasks, an unfit file, or tables that do not suit each other."""
    count = prod(len(getattr(spec, table)) for table in models.SWEPT) * len(spec.load.values())
    if spec.sweep:
        if count > MAX_COMBINATIONS:
            raise InputError(
                f"the lists have {count} combinations, from which [sweep] chooses; at most "
                f"{MAX_COMBINATIONS} are examined: split the study into several specs"
            )
        count = sum(len(loads) for _, loads in spec.combinations())
    if count > MAX_TASKS:
        raise InputError(f"the sweeps make {count} tasks; a study has at most {MAX_TASKS}")
    for elastomer in spec.elastomer:
        elastomer.stiffness(np.ones(1))  # raises where a table cannot be read
    combinations = [at for at, _ in spec.combinations()]
    for i, j in dict.fromkeys((at["surface"], at["grid"]) for at in combinations):
        _check_grid(spec.surface[i], spec.grid[j])
    for at in combinations:
        chosen = _chosen(spec, at)
        elastomer, dimension = chosen["elastomer"], chosen["surface"].dimension
        boundary = chosen["grid"].boundary
        if chosen["grid"].points == "auto" and spec.accuracy is not None:
            first, most = forecast.first_grid(chosen["surface"]), spec.accuracy.max_points
            if most < first:
                raise InputError(
                    f'accuracy.max_points: {most} given, but grid.points = "auto" begins with '
                    f"{first} points along x on this surface; {chosen['surface'].remedy(first)}"
                )
        chosen["solver"].check_boundary(boundary)
        if suited:
            chosen["solver"].check_elastomer(elastomer)
        if boundary == "free":
            elastomer.check_free_boundary(dimension)
        if spec.load.key == "displacement":
            elastomer.check_displacement_load(boundary, dimension)


def _check_unit(task: Task) -> None:
    """Raise InputError where p_star is another pressure on each of the grids to compare."""
    if task.accuracy is not None and not task.has_fixed_unit:
        raise InputError(
            f"load.p_star: {task.load:g} given, but Delta_sigma of this surface "
            f"({task.surface.kind}) depends on the grid; with [accuracy] give load.pressure"
        )


def _chosen(spec: models.Spec, at: dict[str, int]) -> dict[str, Any]:
    """The entries of the swept tables at these places, with the boundary of the contact."""
    chosen = {table: getattr(spec, table)[i] for table, i in at.items()}
    surface, grid = models.with_boundary(**chosen)
    return chosen | {"surface": surface, "grid": grid}


def _check_grid(surface: RigidSurface, grid: models.GridTable) -> None:
    """Raise InputError for a grid that does not resolve or does not suit its surface."""
    if surface.dimension == 1 and grid.points_y is not None:
        raise InputError(
            f"grid.points_y: {grid.points_y} given, but a surface of kind {surface.kind!r} is a "
            "line; leave grid.points_y out"
        )
    if grid.points != "auto":
        points = surface.copies * grid.points
        on_cell, points_y = grid.on_cell(surface, points)
        on_cell.check_resolved(points, points_y)


def _cell(spec: models.Spec, chosen: dict[str, Any], load: float) -> tuple[RigidSurface, int, int]:
    """The surface on its cell, and the points along x and y; of an "auto" grid a forecast.

    Each "auto" grid has exactly twice the points of the one before, along y as well.
    """
    surface, grid = chosen["surface"], chosen["grid"]
    if grid.points != "auto":
        points = surface.copies * grid.points
        on_cell, points_y = grid.on_cell(surface, points)
        return on_cell, points, points_y
    assert spec.accuracy is not None  # of every spec with an "auto" grid
    p_star = load if spec.load.key == "p_star" else forecast.P_STAR
    exponent = chosen["elastomer"].exponent
    points = forecast.last_grid(surface, exponent, p_star, grid.boundary, spec.accuracy)
    first = forecast.first_grid(surface)
    on_cell, first_y = grid.on_cell(surface, first)
    return on_cell, points, first_y * points // first if surface.dimension == 2 else 1


def _task_id(
    spec: models.Spec, resolved: dict[str, Any], tables: dict[str, Any], load: float
) -> str:
    """Name of a task: the digest of everything that its solution depends on."""
    key = spec.load.key
    content = [tables, key == "p_star", f"{load:.{LOAD_DIGITS}g}"]
    if models.LOADS[key].searched:
        content += [key, spec.load.tolerance]
    if spec.accuracy is not None:
        content.append(resolved["accuracy"])
    return digest(content)


def _swept_keys(alternatives: list[SpecTable]) -> set[str]:
    """The keys whose values differ between the alternatives of a table."""
    distinct = {item for choice in alternatives for item in choice}
    counts = Counter(key for key, _ in distinct)
    return {key for key, count in counts.items() if count > 1}


def _swept_words(chosen: dict[str, SpecTable], swept_keys: dict[str, set[str]]) -> tuple[str, ...]:
    """The swept keys of surface, grid and solver, as words; the label has the others already."""
    words: list[str] = []
    for table in ("surface", "grid", "solver"):
        given = {"kind", *chosen[table].model_fields_set} - {"points", "points_y"}
        words += chosen[table].words(given & swept_keys[table])
    return tuple(words)
