"""Traces: what a bench recorded, one solve each, and the HDF5 file that they are kept in."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np

from gfmd_cli.errors import InputError, StudyError
from gfmd_cli.files.atomic import check_place, exists, new_file, target_of
from gfmd_cli.files.hdf5 import find, new_hdf5, open_hdf5, read_dataset, write_scale
from gfmd_cli.grid.arrays import Field
from gfmd_cli.spec.differences import differences
from gfmd_cli.spec.models import Spec
from gfmd_cli.status import Status
from gfmd_cli.study.column import Column
from gfmd_cli.study.columns import BENCH_ATTRIBUTE
from gfmd_cli.study.provenance import origin
from gfmd_cli.study.reading import DAMAGE, check_column, damage_named
from gfmd_cli.study.writing import write_column

BENCH_LAYOUT = 1
SAMPLES = (
    Column("transforms", "real Fourier transforms so far, in units of the solved grid"),
    Column("seconds", "processor time so far on one thread, without that of the record", "s"),
    Column("points", "points per side of the grid that the solver was on", kind=int),
    Column("residual", "natural residual on that grid"),
    Column("a_r_error", "relative distance of the contact area to the reference"),
    Column("sigma_p_error", "relative distance of the stress deviation to it"),
    Column("u_g_error", "relative distance of the mean gap to it"),
)
"""Columns over `sample`. Errors are NaN on coarser grids, absolute where the reference is zero."""
COSTS = ("transforms", "seconds")
"""Samples that are finite and not negative."""
ROW = {
    "surface": str, "seed": int, "elastomer": str, "points": int, "p_star": float,
    "solver": str, "tolerance": float, "nested": bool, "residual": float, "status": str,
    "reference_residual": float,
}  # fmt: skip
"""What table and figures show of a trace besides its samples, with its type."""


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
        return np.maximum.accumulate(error[::-1])[::-1]

    def reached(self, name: str, error: float) -> tuple[float, float] | None:
        """Transforms and seconds after which the error stays below `error`, None if never."""
        below = np.flatnonzero(self.lasting_error(name) <= error)
        if below.size == 0:
            return None
        first = below[0]
        return float(self.samples["transforms"][first]), float(self.samples["seconds"][first])


def check_target(path: Path, spec: Spec) -> None:
    """Refuse to replace anything but a bench file of this spec. Raises InputError, SpaceError."""
    check_place(target_of(path))
    if not exists(path):
        return
    try:
        with open_hdf5(path) as file:
            old_spec = json.loads(file.attrs["spec"]) if BENCH_ATTRIBUTE in file.attrs else None
    except DAMAGE:
        old_spec = None
    if old_spec is None:
        raise InputError(f"{path}: exists and is not a bench file; take another name (-o)")
    if changed := differences(old_spec, spec.resolved()):
        lines = "\n".join(f"  {line}" for line in changed[:20])
        raise InputError(
            f"{path}: a bench file of another spec; take another name (-o).\n"
            f"Stored -> requested:\n{lines}"
        )


def write_bench(path: Path, spec: Spec, text: str, traces: list[Trace]) -> None:
    """Write a bench file, a group for each trace, whole or not at all. Raises SpaceError."""
    with new_file(target_of(path)) as fresh, new_hdf5(fresh) as file:
        file.attrs.update({BENCH_ATTRIBUTE: BENCH_LAYOUT, **origin(spec, text)})
        for number, trace in enumerate(traces):
            group = file.create_group(f"runs/{number}")
            group.attrs.update(trace.row)
            size = len(trace.samples["transforms"])
            sample = write_scale(group, "sample", np.arange(size), "1", "index of the sample")
            for column in SAMPLES:
                write_column(group, column, trace.samples[column.name], [sample])


def read_bench(path: Path) -> list[Trace]:
    """The traces of a bench file, which is checked as a study is.

    Raises InputError where there is none, StudyError where it is not a bench file or damaged.
    """
    with damage_named(path, "bench file"):
        if not exists(path):
            raise InputError(f"{path}: no such bench file")
        with open_hdf5(path) as file:
            if file.attrs.get(BENCH_ATTRIBUTE) != BENCH_LAYOUT:
                raise StudyError(f"{path}: not a bench file of layout {BENCH_LAYOUT}")
            runs = find(file, "runs")
            return [_read_trace(find(runs, str(number))) for number in range(len(runs))]


def _read_trace(group: Any) -> Trace:
    """One trace. Raises one of `DAMAGE` where it is not what it should be."""
    row = {
        name: value.item() if isinstance(value, np.generic) else value
        for name, value in group.attrs.items()
    }
    for name, value in row.items():
        if not isinstance(value, str | int | float):
            raise ValueError(f"{name} is not a single value")
    for name, kind in ROW.items():
        if type(row[name]) is not kind:
            raise ValueError(f"{name} is {row[name]!r}, not of type {kind.__name__}")
    Status(row["status"])
    samples = {column.name: read_dataset(group, column.name) for column in SAMPLES}
    if len({values.shape for values in samples.values()}) > 1 or not samples["seconds"].size:
        raise ValueError("its columns are not of one length")
    for column in SAMPLES:
        check_column(column, samples[column.name])
    for name in COSTS:
        if not (np.isfinite(samples[name]) & (samples[name] >= 0)).all():
            raise ValueError(f"{name} is negative or not finite")
    return Trace(row, samples)
