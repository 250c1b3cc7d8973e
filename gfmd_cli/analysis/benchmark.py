"""The table of a bench: what each solver takes to an error of the mean gap."""

from typing import Any

from gfmd_cli.physics.observables import QUANTITIES
from gfmd_cli.study.traces import Trace

LEVELS = (1e-2, 1e-4, 1e-6)
"""Relative errors of the mean gap."""
TEXTS = ("elastomer", "solver", "status", "surface")
COSTS = [f"{level:.0e}".replace("e-0", "e-") for level in LEVELS]
HEADER = ["elastomer", "points", "p*", "solver", *COSTS, *COSTS, *QUANTITIES, "residual", "status"]


def bench_table(traces: list[Trace]) -> str:
    """One row per solver, grid and pressure.

    Transforms and seconds until the error of the mean gap falls below a level for good; the errors
    and the residual at the end.
    """
    surfaces = sorted({trace.row["surface"] for trace in traces})
    header, rows = bench_cells(traces)
    widths = [max(map(len, column)) for column in zip(header, *rows, strict=True)]
    lines = [
        "  ".join(
            cell.ljust(width) if title in TEXTS else cell.rjust(width)
            for title, cell, width in zip(header, row, widths, strict=True)
        ).rstrip()
        for row in (header, *rows)
    ]
    above = _heading(widths)
    told = f"{surfaces[0]}\n\n" if len(surfaces) == 1 else ""
    return told + "\n".join([above, *lines]) + "\n\n" + "\n".join(footnotes(traces))


def bench_cells(traces: list[Trace]) -> tuple[list[str], list[list[str]]]:
    """Titles and rows of the table; the surface is told where there are several."""
    names = solver_names(traces)
    rows = [_row(trace, name) for trace, name in zip(traces, names, strict=True)]
    if len({trace.row["surface"] for trace in traces}) > 1:
        rows = [[*row, trace.row["surface"]] for row, trace in zip(rows, traces, strict=True)]
    return [*HEADER, "surface"][: len(rows[0])], rows


def _heading(widths: list[int]) -> str:
    """What columns share, above them."""
    at = [sum(widths[:i]) + 2 * i for i in range(len(widths))]
    line = ""
    for title, first in (
        ("transforms to", 4),
        ("seconds to", 4 + len(LEVELS)),
        ("error at the end", 4 + 2 * len(LEVELS)),
    ):
        line = line.ljust(at[first]) + title
    return line


def _row(trace: Trace, name: str) -> list[str]:
    reached = [trace.reached("u_g", level) for level in LEVELS]
    row = trace.row
    return [
        row["elastomer"],
        str(row["points"]),
        f"{row['p_star']:.4g}",
        name,
        *("-" if found is None else f"{found[0]:.0f}" for found in reached),
        *("-" if found is None else f"{found[1]:.3g}" for found in reached),
        *(f"{trace.samples[f'{error}_error'][-1]:.1e}" for error in QUANTITIES),
        f"{row['residual']:.1e}",
        row["status"],
    ]


def footnotes(traces: list[Trace]) -> tuple[str, str]:
    """What the columns mean."""
    worst = max(trace.row["reference_residual"] for trace in traces)
    return (
        "Transforms of the solved size and seconds until the error of the mean gap falls below "
        "a level for good.",
        f"Errors are relative to a reference of residual {worst:.0e} or less; seconds are "
        "processor time on one thread, without the record.",
    )


def scene_of(trace: Trace) -> tuple[Any, ...]:
    """What traces of one scene share."""
    return tuple(trace.row[key] for key in ("surface", "seed", "elastomer", "points", "p_star"))


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
