"""Traces: what a bench recorded, one solve each, and the HDF5 file that they are kept in."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import h5py
import numpy as np

from gfmd_cli.errors import InputError, StudyError
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.hdf5 import take
from gfmd_cli.study.files import check_place, new_file, new_hdf5
from gfmd_cli.study.labelled import dataset, scale
from gfmd_cli.study.layout import BENCH, Column
from gfmd_cli.study.provenance import origin
from gfmd_cli.study.spec import Spec, refuse_other

BENCH_LAYOUT = 1
SAMPLES = (
    Column("transforms", float, "1", "real Fourier transforms so far, in units of the solved grid"),
    Column(
        "seconds", float, "s", "processor time so far on one thread, without that of the record"
    ),
    Column("points", int, "1", "points per side of the grid that the solver was on"),
    Column("residual", float, "1", "natural residual on that grid"),
    Column("a_r_error", float, "1", "relative distance of the contact area to the reference"),
    Column("sigma_p_error", float, "1", "relative distance of the stress deviation to it"),
    Column("u_g_error", float, "1", "relative distance of the mean gap to it"),
)
"""Over `sample`. The errors are NaN on the coarser grids, absolute where the reference is zero."""


@dataclass(frozen=True)
class Trace:
    """One solve."""

    row: dict[str, Any]
    """What was solved, how, and how it ended."""
    samples: dict[str, Field]
    """Columns SAMPLES."""

    @classmethod
    def of(cls, row: dict[str, Any], samples: list[tuple[float, ...]]) -> Self:
        """A trace from its samples one by one."""
        columns = zip(SAMPLES, zip(*samples, strict=True), strict=True)
        return cls(row, {c.name: np.array(values, dtype=c.kind) for c, values in columns})

    def lasting_error(self, name: str) -> Field:
        """The largest error of an observable from each sample on: what has been reached for good.

        The error itself passes zero wherever its sign changes. Infinite on the coarser grids.
        """
        error = np.nan_to_num(self.samples[f"{name}_error"], nan=np.inf)
        lasting: Field = np.maximum.accumulate(error[::-1])[::-1]
        return lasting

    def reached(self, name: str, error: float) -> tuple[float, float] | None:
        """Transforms and seconds after which the error stays below `error`, None if never."""
        below = np.flatnonzero(self.lasting_error(name) <= error)
        if below.size == 0:
            return None
        first = below[0]
        return float(self.samples["transforms"][first]), float(self.samples["seconds"][first])


def check_target(path: Path, spec: Spec) -> None:
    """Refuse to replace what is no bench of this spec. Raises InputError, SpaceError."""
    check_place(path)
    if not path.exists():
        return
    try:
        with h5py.File(path, "r", locking=False) as file:
            stored = json.loads(file.attrs["spec"]) if BENCH in file.attrs else None
    except (OSError, KeyError, ValueError):
        stored = None
    if stored is None:
        raise InputError(f"{path}: exists and is no bench; take another name (-o)")
    refuse_other(stored, spec, f"{path}: a bench of another spec; take another name (-o).")


def write_bench(path: Path, spec: Spec, text: str, traces: list[Trace]) -> None:
    """Write a bench file, a group for each trace, whole or not at all. Raises SpaceError."""
    with new_file(path) as fresh, new_hdf5(fresh) as file:
        file.attrs.update({BENCH: BENCH_LAYOUT, **origin(spec, text)})
        for number, trace in enumerate(traces):
            group = file.create_group(f"runs/{number}")
            group.attrs.update(trace.row)
            size = len(trace.samples["transforms"])
            sample = scale(group, "sample", np.arange(size), "1", "index of the sample")
            for column in SAMPLES:
                dataset(group, column, trace.samples[column.name], [sample])


def read_bench(path: Path) -> list[Trace]:
    """The traces of a bench file. Raises InputError, StudyError where it is none."""
    if not path.exists():
        raise InputError(f"{path}: no such bench")
    try:
        with h5py.File(path, "r", locking=False) as file:
            if file.attrs.get(BENCH) != BENCH_LAYOUT:
                raise StudyError(f"{path}: no bench of layout {BENCH_LAYOUT}")
            groups = [file[f"runs/{number}"] for number in range(len(file["runs"]))]
            return [
                Trace(
                    {name: _plain(value) for name, value in group.attrs.items()},
                    {column.name: take(group, column.name)[()] for column in SAMPLES},
                )
                for group in groups
            ]
    except (OSError, KeyError, RuntimeError, ValueError) as error:
        raise StudyError(f"{path}: damaged bench: {error}") from error


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value
