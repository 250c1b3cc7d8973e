"""A study from Python: what the commands do, as a few functions.

    from gfmd_cli import compare, dataset, rows, run, solve

A spec is the path of a TOML file, or its tables as a dictionary.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from gfmd_cli.analysis.compare import Comparison
from gfmd_cli.analysis.compare import compare as compare_study
from gfmd_cli.analysis.export import as_dataset
from gfmd_cli.errors import InputError
from gfmd_cli.physics.fields import Field, Mask
from gfmd_cli.study.grids import no_state
from gfmd_cli.study.layout import MISSING
from gfmd_cli.study.parse import read_spec, read_tables
from gfmd_cli.study.reading import read_rows
from gfmd_cli.study.resources import room
from gfmd_cli.study.run import run_study
from gfmd_cli.study.search import solve_task_on_grids
from gfmd_cli.study.solve import Report
from gfmd_cli.study.spec import Spec
from gfmd_cli.study.tasks import plan

Tables = Mapping[str, Any]


@dataclass(frozen=True)
class Result:
    """One solved contact, in physical units [m, Pa]; fields are indexed [y, x]."""

    height: Field
    """Indenter, shape (points, points), of a line scene (points,)."""
    displacement: Field
    stress: Field
    """Compressive and positive."""
    pressure: float
    """Nominal pressure."""
    length: float
    """Side of the cell."""
    h_std: float
    """rms height."""
    delta_sigma: float
    """rms stress in full contact: the unit of reduced pressures."""
    a_r: float
    """Relative contact area."""
    sigma_p: float
    """Standard deviation of the stress / delta_sigma."""
    u_g: float
    """Mean gap / h_std."""
    residual: float
    """Natural residual."""
    status: str
    """"converged", or why not."""

    @property
    def p_star(self) -> float:
        """Reduced pressure."""
        return self.pressure / self.delta_sigma

    @property
    def contact(self) -> Mask:
        """Points in contact, whose share is a_r: no gap, and pressed (stress alone rounds)."""
        return np.asarray((self.displacement == self.height) & (self.stress > 0))

    @property
    def gap(self) -> Field:
        """Distance of the bodies."""
        return self.displacement - self.height


def solve(spec: Path | str | Tables, *, heights: Field | None = None, threads: int = 1) -> Result:
    """Solve one contact in memory; nothing is kept on disk.

    Parameters
    ----------
    spec : describes one pressure on one scene
    heights : (N, N), pressed in the place of the surface of a dictionary, whose table "surface" may
        say more: length, periodic, level, edges, scale, crop, missing
    threads : of the transforms and of what lies between them

    Raises InputError for a bad spec, or one of several tasks.
    """
    if heights is None:
        return _solve(spec, threads)
    if not isinstance(spec, Mapping):
        raise InputError("heights go with a dictionary; a spec in a file has a surface")
    with TemporaryDirectory() as folder:
        path = Path(folder) / "heights.npy"
        np.save(path, heights)
        surface = {**spec.get("surface", {}), "kind": "file", "path": str(path)}
        return _solve({**spec, "surface": surface}, threads)


def _solve(spec: Path | str | Tables, threads: int) -> Result:
    tasks = plan(_read(spec)[0])
    if len(tasks) != 1:
        raise InputError(f"solve takes one contact, the spec has {len(tasks)}; run() takes them")
    found = solve_task_on_grids(
        tasks[0], threads, (room(None), False), no_state, None, lambda notes: None, watch=_ignore
    )
    scene, solution, seen = found.scene, found.solution, found.seen
    return Result(
        height=found.contact.height * scene.h_std + scene.mean_height,
        displacement=solution.u * scene.h_std + scene.mean_height,
        stress=solution.sigma * scene.delta_sigma,
        pressure=found.contact.pressure * scene.delta_sigma,
        length=scene.grid.length,
        h_std=scene.h_std,
        delta_sigma=scene.delta_sigma,
        a_r=seen.a_r,
        sigma_p=seen.sigma_p,
        u_g=seen.u_g,
        residual=solution.residual,
        status=solution.status,
    )


def run(
    spec: Path | str | Tables,
    study: Path | str | None = None,
    *,
    overrides: tuple[str, ...] = (),
    jobs: int = 1,
    report: Report = lambda progress: None,
) -> Path:
    """Solve what a study does not hold yet, as `gfmd run` does; return the path of its file.

    Parameters
    ----------
    study : the file, by default NAME.h5 in the working directory
    overrides : "key.name=value" each, for a spec in a file
    jobs : worker processes; more than one takes a script with `if __name__ == "__main__":`
    report : told of every start, step and end of a task

    In the main thread it takes signals while it runs, and ends in order on them. Raises
    InputError, SpaceError, Interrupted.
    """
    resolved, text = _read(spec, overrides)
    path = Path(study if study is not None else f"{resolved.study.name}.h5")
    run_study(resolved, text, path, report, jobs=jobs)
    return path


def rows(study: Path | str) -> list[dict[str, Any]]:
    """One dictionary a solved pressure: the columns of `gfmd export`, Pr(sigma) where stored.

    Raises InputError, StudyError.
    """
    return [row for row in read_rows(Path(study)) if row["status"] != MISSING]


def compare(study: Path | str) -> Comparison:
    """A study beside Persson theory, curve by curve: `gfmd analyze`.

    Raises InputError, StudyError.
    """
    return compare_study(Path(study))


def dataset(study: Path | str) -> Any:
    """A study as an `xarray.Dataset`, all of it but the fields on the grid.

    Raises InputError where xarray is missing or there is no such study, StudyError.
    """
    return as_dataset(Path(study))


def _read(spec: Path | str | Tables, overrides: tuple[str, ...] = ()) -> tuple[Spec, str]:
    if isinstance(spec, Mapping):
        if overrides:
            raise InputError("overrides go with a spec in a file; change the dictionary")
        return read_tables(dict(spec)), json.dumps(spec, indent=1, default=str)
    return read_spec(Path(spec), overrides)


def _ignore(*_: Any) -> None:
    """Watch nothing."""
