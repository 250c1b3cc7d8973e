"""What a run has found, in a few lines, and why a task is not what was asked for."""

from collections.abc import Mapping
from typing import Any

from gfmd_cli.analysis.compare import Row, best, in_continuum
from gfmd_cli.analysis.tables import plus_minus
from gfmd_cli.physics.observables import QUANTITIES
from gfmd_cli.study.layout import MISSING

MOST = 40  # rows that are printed; who has more wants a file
HEADER = ("p*", "p [Pa]", "a_r", "sigma_p", "u_g", "gap [m]", "residual", "status")

REASONS = {
    "max_steps": "residual {residual:.1e} after {steps} steps, asked {tolerance:.1e}: allow more "
    '(solver.max_steps), or take solver.kind = "auto"',
    "rounding": "residual {residual:.1e}, asked {tolerance:.1e}: double precision ends here; ask "
    "for less (solver.tolerance)",
    "diverged": 'the solver diverged: take solver.kind = "auto"',
    "accuracy_not_reached": "the grid of {points} points was the last that memory or "
    "accuracy.max_points allows; the error bars say how far it came",
    "load_not_reached": "no pressure gives load.{load} = {asked:g} as close as load.within asks: "
    "on this grid the nearest is in the table",
    MISSING: "not solved yet: call again",
}
"""Why a task is not converged, by its status."""


def results(rows: list[dict[str, Any]]) -> str:
    """A table of what was solved, body by body; "" where nothing was."""
    solved = [row for row in rows if row["status"] != MISSING]
    bodies: dict[str, list[tuple[str, ...]]] = {}
    for row in solved[:MOST]:
        body = f"{row['elastomer']} on {row['surface']}, {row['points']} points a side"
        bodies.setdefault(body, [HEADER]).append(
            (
                f"{row['p_star']:.4g}",
                f"{row['pressure']:.4g}",
                *(_measured(row, name) for name in QUANTITIES),
                f"{row['mean_gap']:.3g}",
                f"{row['residual']:.1e}",
                row["status"],
            )
        )
    blocks = ["\n".join([body, *_aligned(cells)]) for body, cells in bodies.items()]
    if len(solved) > MOST:
        blocks.append(f"... and {len(solved) - MOST} more")
    return "\n\n".join(blocks)


def _aligned(rows: list[tuple[str, ...]]) -> list[str]:
    """Cells as columns, right-aligned but the last."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)][:-1]
    return [
        "  ".join(
            ["", *(f"{cell:>{width}}" for cell, width in zip(row, widths, strict=False)), row[-1]]
        )
        for row in rows
    ]


def _measured(row: Row, name: str) -> str:
    """A value on its grid, or with its error bar in the continuum."""
    value, error = best(row, name)
    return plus_minus(value, error) if in_continuum(row, name) else f"{value:.5g}"


def missed(rows: list[dict[str, Any]], failed: Mapping[int, str]) -> list[str]:
    """A line for each task that did not end as asked, with the reason.

    `failed` are the reasons of those that ended in an error, by task.
    """
    lines = []
    for row in rows:
        if row["status"] == "converged":
            continue
        reason = failed.get(row["task"]) or REASONS.get(row["status"], "").format(**row)
        name = f"task {row['task']}"
        if row["status"] != MISSING:
            name += f" ({row['elastomer']}, p* = {row['p_star']:.4g}): {row['status']}"
        lines.append(f"{name}: {reason}")
    more = len(lines) - MOST
    return [*lines[:MOST], f"... and {more} more"] if more > 0 else lines
