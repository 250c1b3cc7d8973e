"""The Python API: functions that do the same as the commands.

    from gfmd_cli import compare, dataset, rows, run, solve

A spec is the path of a TOML file, or its tables as a dictionary.
"""

import json
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from warnings import warn_explicit

import numpy as np
import tabulate

from gfmd_cli.analysis.compare import Comparison, in_continuum
from gfmd_cli.analysis.compare import compare as compare_study
from gfmd_cli.analysis.export import as_dataset
from gfmd_cli.analysis.table import Group, Table, TableColumn, plus_minus
from gfmd_cli.errors import InputError
from gfmd_cli.files.file_cache import forget_files
from gfmd_cli.grid.arrays import Field, Mask
from gfmd_cli.grid.blas import one_blas_thread
from gfmd_cli.maps.given_heights import write_heights
from gfmd_cli.physics.error_estimates import Verdict
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.indenters import SMALLEST_GRID
from gfmd_cli.spec.models import Spec
from gfmd_cli.spec.parse import read_spec, read_tables
from gfmd_cli.status import Status, counted
from gfmd_cli.study.context import (
    ProgressEvent,
    Report,
    SolveContext,
    Watcher,
    WorkerOptions,
    ignore,
)
from gfmd_cli.study.load_search import solve_at_load
from gfmd_cli.study.measure import all_columns
from gfmd_cli.study.plausibility import SEPARATOR
from gfmd_cli.study.reading import read_rows, solved_rows
from gfmd_cli.study.refinement import forget_scenes
from gfmd_cli.study.resources import usable_memory
from gfmd_cli.study.run import RunOptions, run_study
from gfmd_cli.study.tasks import plan

Tables = Mapping[str, Any]
SAME_SIDE = 1e-6  # relative difference of two sides that are meant to be equal
NUMBERS = (
    "length", "length_y", "h_std", "delta_sigma", "a_r", "sigma_p", "u_g", "residual", "status",
)  # fmt: skip
"""Attributes of a result that are columns of a study under the same name."""
WITH_CONTINUUM = {"a_r": "contact area", "sigma_p": "stress deviation", "u_g": "mean gap"}
"""Names in the summary of the quantities that can have a continuum value."""


@dataclass(frozen=True, eq=False)
class Result:
    """One solved contact, in physical units [m, Pa]; fields are indexed [y, x].

    Two results are equal only if they are the same object.
    """

    height: Field
    """Height of the indenter, filled in where it is masked; shape (points_y, points), for a line
    contact (points,)."""
    displacement: Field
    """Displacement of the elastomer."""
    stress: Field
    """Stress K u + p, compressive and positive; off contact zero up to the residual."""
    pressure: Field
    """Contact pressure: the stress in contact, exactly zero off contact."""
    x: Field
    """Positions of the grid points along x from the first one; for indenters from the crest."""
    nominal_pressure: float
    """Nominal pressure: load per area of the cell."""
    length: float
    """Side of the cell along x."""
    length_y: float
    """Side of the cell along y; NaN for a line contact."""
    h_std: float
    """Root-mean-square height."""
    delta_sigma: float
    """Root-mean-square stress in full contact, the unit of reduced pressures."""
    a_r: float
    """Relative contact area: (pressure > 0).mean()."""
    sigma_p: float
    """Standard deviation of the contact pressure, divided by delta_sigma."""
    u_g: float
    """Mean gap, divided by h_std."""
    residual: float
    """Natural residual of the solution."""
    status: Status
    """"converged", or the reason why the tolerance was missed."""
    warnings: tuple[str, ...] = ()
    """Reasons to doubt the result."""
    columns: Mapping[str, Any] = field(default_factory=dict)
    """All columns that a study would have of the contact, such as "a_r_continuum" where the table
    [accuracy] requests errors, "patches" where [output] requests them, and histograms."""

    @property
    def p_star(self) -> float:
        """Reduced pressure."""
        return self.nominal_pressure / self.delta_sigma

    @property
    def contact(self) -> Mask:
        """Points in contact: no gap and positive stress. Their share is a_r."""
        return self.pressure > 0

    @property
    def gap(self) -> Field:
        """Gap between indenter and elastomer; where the height is masked, to that filled in."""
        return self.displacement - self.height

    def summary(self) -> dict[str, str]:
        """The numbers, with symbol and unit."""
        mean_gap, deviation = self.u_g * self.h_std, self.sigma_p * self.delta_sigma
        points = " x ".join(map(str, self.height.shape[::-1]))
        numbers = {
            "status": f"{self.status}, natural residual {self.residual:.1e}",
            "grid": f"{points} points, L = {self.length:.6g} m",
            "nominal pressure": f"{self.nominal_pressure:.6g} Pa, p* = {self.p_star:.4g}",
            "contact area": f"a_r = {self.a_r:.5g}",
            "stress deviation": f"{deviation:.4g} Pa, sigma_p = {self.sigma_p:.5g} Delta_sigma",
            "mean gap": f"{mean_gap:.4g} m, u_g = {self.u_g:.5g} h_std",
            "largest pressure": f"{self.pressure.max():.4g} Pa",
            "scales": f"h_std = {self.h_std:.4g} m, Delta_sigma = {self.delta_sigma:.4g} Pa",
        }
        for symbol, name in WITH_CONTINUUM.items():
            if in_continuum(self.columns, symbol):
                value, error = (self.columns[f"{symbol}_continuum{end}"] for end in ("", "_error"))
                numbers[f"{name} in the continuum"] = f"{symbol} = {plus_minus(value, error)}"
            elif verdict := self.columns.get(f"{symbol}_verdict"):
                numbers[f"{name} in the continuum"] = Verdict(verdict).explanation
        return numbers | ({"warnings": "; ".join(self.warnings)} if self.warnings else {})

    def __str__(self) -> str:
        """The summary as a text table."""
        return tabulate.tabulate(self.summary().items(), tablefmt="plain", disable_numparse=True)

    __repr__ = __str__

    def _repr_html_(self) -> str:
        """The summary as HTML, for notebooks."""
        columns = [TableColumn("", key) for key in ("name", "value")]
        records = [{"name": name, "value": value} for name, value in self.summary().items()]
        return Table("", columns, [Group("", records)]).as_html()


def solve(spec: Path | str | Tables, *, heights: Any = None, threads: int = 1) -> Result:
    """Solve one contact in memory; no file is written.

    Parameters
    ----------
    spec
        The spec of one task.
    heights
        Height map that replaces the surface: an array or nested list of shape (points_y, points),
        for a line profile (points,), a masked array, an array of xarray, whose coordinates and
        units are read as those of a netCDF file, or a topography of SurfaceTopography, which states
        its sides, unit and periodicity. The spec is then a dictionary, whose table "surface"
        may contain the keys of a map, such as length, periodic, level and missing. Without
        grid.points the points of the map are those of the grid.
    threads
        Number of threads.

    Raises
    ------
    InputError
        If the spec or the heights are invalid, contradict each other, or the spec has several
        tasks.
    """
    _check_count("threads", threads)
    forget_files()  # they may have changed since the last call
    if heights is None:
        return _solve(spec, threads)
    if not isinstance(spec, Mapping):
        raise InputError("heights need a dictionary; a spec in a file has a surface")
    if isinstance(heights, Path | str):
        raise InputError("heights: an array is needed, not a path; name a file in surface.path")
    with TemporaryDirectory() as folder:
        path = Path(folder) / "heights.h5"
        keys = write_heights(path, heights)
        try:
            return _solve(_with_map(_without_numpy(spec), path, keys), threads)
        except InputError as error:  # the file is not the caller's
            raise InputError(str(error).replace(str(path), "heights")) from None
        finally:  # no other call can use what is kept of this file
            forget_files()
            forget_scenes()


def _with_map(tables: Tables, path: Path, keys: Tables) -> Tables:
    """The tables of a spec whose surface is a map and whose grid has, by default, its points.

    Raises InputError where the table [surface] contradicts the map, which has some keys by default.
    """
    for name in ("surface", "grid"):
        if not isinstance(tables.get(name, {}), Mapping):
            raise InputError(f"spec: {name} must be one table where heights are given")
    given = tables.get("surface", {})
    for name in ("kind", "path"):
        if given.get(name, "file") != "file":
            raise InputError(
                f"surface.{name} = {given[name]!r} and the argument heights both give a "
                "surface; leave one out"
            )
    tables = {**tables, "surface": {**keys, **given, "kind": "file", "path": str(path)}}
    grid = tables.get("grid", {})
    (surface, *_) = read_tables(tables | {"grid": {"points": SMALLEST_GRID, **grid}}).surface
    assert isinstance(surface, FileSurface)
    stated = surface.stated_sides() if "periodic" in keys else None  # those of a topography
    for name, side in zip(("length", "length_y"), reversed(stated or ()), strict=False):
        length = getattr(surface, name)
        if length is not None and not math.isclose(length, side, rel_tol=SAME_SIDE):
            raise InputError(
                f"surface.{name} = {length:g}: the topography in the argument heights has a side "
                f"of {side:g} m; leave out surface.{name}"
            )
    return tables | {"grid": {"points": surface.own_points(), **grid}}


@one_blas_thread()
def _solve(spec: Path | str | Tables, threads: int) -> Result:
    tasks = plan(_read(spec)[0])
    if tasks[0].surface.file or tasks[0].elastomer.file:
        forget_scenes()
    if len(tasks) != 1:
        raise InputError(f"solve computes one contact, the spec has {len(tasks)}; use run()")
    context = SolveContext(WorkerOptions(threads, usable_memory()))
    solved = solve_at_load(tasks[0], context, Watcher())
    row = all_columns(tasks[0], solved)
    x = np.arange(row["points"]) / row["points"] + row["x_first"]
    return Result(
        height=solved.field("height"),
        displacement=solved.field("u"),
        stress=solved.field("sigma"),
        pressure=solved.field("contact_pressure"),
        x=x * row["length"],
        nominal_pressure=row["pressure"],
        warnings=tuple(filter(None, row["warnings"].split(SEPARATOR))),
        columns=row,
        **{name: row[name] for name in NUMBERS},
    )


def run(
    spec: Path | str | Tables,
    study: Path | str | None = None,
    *,
    overrides: tuple[str, ...] = (),
    jobs: int = 1,
    report: Report = ignore,
) -> Path:
    """Run all tasks that a study does not contain yet, as `gfmd run`; return the study's path.

    In the main thread the function handles signals: it saves all states before it ends.

    A task that fails, or does not converge, does not end the run. The function then gives a
    Python warning at the end, and one for each warning that `gfmd run` prints.

    Parameters
    ----------
    spec
        Path of a TOML file, or its tables as a dictionary.
    study
        Study file; by default NAME.h5 in the working directory.
    overrides
        Strings "table.key=value" that override keys of a spec in a file.
    jobs
        Number of worker processes.
    report
        Function that is called at every start, step and end of a task.

    Raises
    ------
    InputError
        If the spec is invalid or does not fit the study.
    SpaceError
        If the disk is full or a file cannot be created.
    Interrupted
        If a signal stopped the run.
    KeyboardInterrupt
        After a second SIGINT (Ctrl-C). The next call resumes unfinished tasks from their last
        checkpoints.
    """
    _check_count("jobs", jobs)
    resolved, text = _read(spec, overrides)
    path = resolved.study_path(None if study is None else Path(study))
    messages: list[str] = []

    def watch(progress: ProgressEvent) -> None:
        report(progress)
        if progress.status is not None and progress.status.is_failure:
            messages.append(f"task {progress.task} ({progress.label}): {progress.message}")
        elif progress.event == "warning":
            messages.append(progress.message)

    counts = run_study(resolved, text, path, watch, RunOptions(jobs=jobs))
    if counts.keys() - {Status.CONVERGED}:
        messages.append(f"{path}: {counted(counts)}")
    caller = sys._getframe(1)
    place = caller.f_code.co_filename, caller.f_lineno, caller.f_globals.get("__name__")
    for message in messages:  # `warn` would be silent at the same line of a second call
        warn_explicit(message, UserWarning, *place)
    return path


def rows(study: Path | str) -> list[dict[str, Any]]:
    """Read a study: one dictionary per solved task, with the columns of `gfmd export`.

    A task is solved if it has a result, converged or not; see the column `status`.

    Raises
    ------
    InputError
        If there is no such study.
    StudyError
        If the study is damaged.
    """
    return solved_rows(read_rows(Path(study)))


def compare(study: Path | str) -> Comparison:
    """Compare a study with Persson theory, as `gfmd analyze`.

    Raises
    ------
    InputError
        If there is no such study.
    StudyError
        If the study is damaged.
    """
    return compare_study(Path(study))


def dataset(study: Path | str) -> Any:
    """Read a study as an `xarray.Dataset`, without the fields on the grid.

    Tasks are selected by their parameters, as `data.sel(hurst=0.8)`; the parameter `tolerance`,
    whose name is an argument of `sel` itself, only as `data.sel({"tolerance": 1e-8})`.

    Raises
    ------
    InputError
        If xarray is not installed or there is no such study.
    StudyError
        If the study is damaged.
    """
    return as_dataset(Path(study))


def _check_count(name: str, number: Any) -> None:
    """Raise InputError for anything but a whole number of at least 1."""
    if isinstance(number, bool) or not isinstance(number, int | np.integer) or number < 1:
        raise InputError(f"{name} = {number!r}: must be a whole number, at least 1")


def _read(spec: Path | str | Tables, overrides: tuple[str, ...] = ()) -> tuple[Spec, str]:
    if isinstance(spec, Mapping):
        if overrides:
            raise InputError("overrides need a spec in a file; change the dictionary")
        tables = _without_numpy(spec)
        return read_tables(tables), json.dumps(tables, indent=1, default=str)
    is_sequence = isinstance(overrides, tuple | list)
    if not (is_sequence and all(isinstance(each, str) for each in overrides)):
        raise InputError(f"overrides = {overrides!r}: a tuple or list of strings is needed")
    if not isinstance(spec, Path | str):
        raise InputError(f"spec: a path or a dictionary is needed, not {type(spec).__name__}")
    return read_spec(Path(spec), overrides)


def _without_numpy(item: Any) -> Any:
    """A copy of the tables of a spec, with numbers and lists in the place of those of NumPy."""
    if isinstance(item, Mapping):
        return {key: _without_numpy(value) for key, value in item.items()}
    if isinstance(item, list | tuple):
        return [_without_numpy(value) for value in item]
    return item.tolist() if isinstance(item, np.ndarray | np.generic) else item
