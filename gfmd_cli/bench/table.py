"""The table of a bench: the cost of each solver down to an error of the mean gap."""

from typing import Any

from gfmd_cli.analysis.table import Group, Record, Table, TableColumn
from gfmd_cli.analysis.tables import P_STAR, POINTS, RESIDUAL, STATUS
from gfmd_cli.bench.file import Trace
from gfmd_cli.physics.observables import QUANTITIES

LEVELS = (1e-2, 1e-4, 1e-6)
"""Relative errors of the mean gap."""


def _costs(cost: str, number_format: str) -> list[TableColumn]:
    return [
        TableColumn(
            f"{cost}\nto {level:.0e}".replace("e-0", "e-"), f"{cost}_{level}", number_format
        )
        for level in LEVELS
    ]


BENCH = (
    TableColumn("elastomer", "elastomer"),
    POINTS,
    P_STAR,
    TableColumn("solver", "name"),
    *_costs("transforms", ".0f"),
    *_costs("seconds", ".3g"),
    *(TableColumn(f"error of\n{name}", f"{name}_error", ".1e") for name in QUANTITIES),
    RESIDUAL,
    STATUS,
)


def bench_table(traces: list[Trace]) -> Table:
    """One record for each solver, grid and pressure.

    Transforms and seconds until the error of the mean gap falls below a level for good; the errors
    and the residual at the end. The surface is a column where there are several.
    """
    surfaces = list(dict.fromkeys(trace.row["surface"] for trace in traces))
    title, columns = surfaces[0], BENCH
    if len(surfaces) > 1:
        title, columns = "", (*BENCH, TableColumn("surface", "surface"))
    worst = max(trace.row["reference_residual"] for trace in traces)
    caption = (
        "Cost until the error of the mean gap stays below a level: Fourier transforms, in units of "
        "one on the final grid, and seconds of processor time on one thread, without the "
        f"recording. Errors are relative to a reference with a residual of {worst:.0e} or less."
    )
    names = solver_names(traces)
    records = [_record(trace, name) for trace, name in zip(traces, names, strict=True)]
    return Table(caption, columns, [Group(title, records)])


def _record(trace: Trace, name: str) -> Record:
    record = trace.row | {"name": name}
    for level in LEVELS:
        transforms, seconds = trace.reached("u_g", level) or (None, None)
        record |= {f"transforms_{level}": transforms, f"seconds_{level}": seconds}
    errors = {f"{error}_error": float(trace.samples[f"{error}_error"][-1]) for error in QUANTITIES}
    return record | errors


def contact_of(trace: Trace) -> tuple[Any, ...]:
    """Values that identify the contact of a trace."""
    keys = ("surface", "seed", "elastomer", "boundary", "points", "p_star")
    return tuple(trace.row.get(key) for key in keys)


def solver_names(traces: list[Trace]) -> list[str]:
    """Each solver, with its tolerance and its start where these are not the same for all."""
    tolerances = {trace.row["tolerance"] for trace in traces}
    starts = {trace.row["nested"] for trace in traces}
    names = []
    for trace in traces:
        name = str(trace.row["solver"])
        if len(tolerances) > 1:
            name += f" {trace.row['tolerance']:g}"
        if len(starts) > 1 and not trace.row["nested"]:
            name += " not nested"
        names.append(name)
    return names
