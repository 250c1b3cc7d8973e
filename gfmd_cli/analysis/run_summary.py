"""What a run has computed, as a short table, and why tasks are not converged."""

from collections.abc import Mapping, Sequence, Sized
from typing import Any

from gfmd_cli.analysis.compare import with_best, with_solvers
from gfmd_cli.analysis.selection import grouped
from gfmd_cli.analysis.table import Record, Table, TableColumn, groups_of
from gfmd_cli.analysis.tables import P_STAR, PRESSURE, RESIDUAL, STATUS, warnings_in
from gfmd_cli.analysis.wording import contact_title, grid_size, shown
from gfmd_cli.physics.observables import QUANTITIES
from gfmd_cli.study.reading import solved_rows
from gfmd_cli.units import count

MAX_ROWS = 40
MAX_EDGE_SHARE = 0.05  # of contact or load in the tapered zone, without a warning; a choice
MAX_SCENES = 6  # of other specs that a run names
RUN = (
    P_STAR,
    PRESSURE,
    *(TableColumn(name, f"{name}_best", ".5g", error=f"{name}_best_error") for name in QUANTITIES),
    TableColumn("gap", "mean_gap", ".3g", "m"),
    RESIDUAL,
    STATUS,
)


def run_text(rows: list[dict[str, Any]]) -> str:
    """The solved contacts by scene, MAX_ROWS at most; an empty string where nothing was solved."""
    solved = solved_rows(rows)
    listed = solved[:MAX_ROWS]
    titles = with_solvers(map(_scene, listed), listed)
    records = map(with_best, listed)
    table = Table("", shown(RUN, listed), groups_of(zip(titles, records, strict=True)))
    warnings = [f"warning: {line}" for line in warnings_in(solved)]
    blocks = [table.as_text(), *_left_out(solved, MAX_ROWS, "contact"), "\n".join(warnings)]
    return "\n\n".join(filter(None, blocks))


def _left_out(items: Sized, limit: int, what: str) -> list[str]:
    """A line on what is not listed, if anything is not."""
    return [f"and {count(len(items) - limit, f'more {what}')}"] if len(items) > limit else []


def edge_warnings(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """A line for each scene that carries much of its load where a window changed the heights."""
    much = [row for row in rows if max(row["edge_contact"], row["edge_load"]) > MAX_EDGE_SHARE]
    return [  # nothing where the shares are unknown
        f"{surface}: up to {max(row['edge_contact'] for row in group):.0%} of the contact and "
        f"{max(row['edge_load'] for row in group):.0%} of the load are at the edges, where the "
        "window has changed the heights; leave out surface.edges to keep them"
        for surface, group in grouped(much, lambda row: row["surface"]).items()
    ]


def other_tasks(rows: list[dict[str, Any]]) -> list[str]:
    """Lines on the contacts of a study that do not belong to the spec of a run."""
    scenes = grouped(rows, _scene)
    if not scenes:
        return []
    lines = [f"{count(len(rows), 'more contact')} of the study, not of this spec:"]
    for scene, group in list(scenes.items())[:MAX_SCENES]:
        loads = sorted({row["p_star"] for row in group})
        ends = " to ".join(f"{load:.4g}" for load in dict.fromkeys([loads[0], loads[-1]]))
        lines.append(f"  {len(group)} with {scene}, p* = {ends}")
    return [*lines, *(f"  {line}" for line in _left_out(scenes, MAX_SCENES, "scene"))]


def _scene(row: Record) -> str:
    """Elastomer, surface and grid of a row in words."""
    return f"{contact_title(row)}, {grid_size([row])}"


def unconverged(rows: list[dict[str, Any]], errors: Mapping[int, str]) -> list[str]:
    """A line for each task that is not converged, with the reason.

    `errors` are the messages of the tasks that an error ended, by task.
    """
    lines = []
    for row in rows:
        status, name = row["status"], f"task {row['task']}"
        if status.is_converged:
            continue
        if status.is_solved:
            name += f" ({row['elastomer']}, p* = {row['p_star']:.4g}): {status}"
        lines.append(f"{name}: {errors.get(row['task']) or status.explain(row)}")
    return [*lines[:MAX_ROWS], *_left_out(lines, MAX_ROWS, "task")]
