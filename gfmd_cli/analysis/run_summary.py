"""What a run will compute and what it has computed, as tables; why tasks are not converged."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from gfmd_cli.analysis.compare import with_best, with_solvers
from gfmd_cli.analysis.selection import grouped
from gfmd_cli.analysis.table import Record, Table, TableColumn, groups_of
from gfmd_cli.analysis.tables import (
    P_STAR,
    POINTS,
    PRESSURE,
    RESIDUAL,
    STATUS,
    TASK,
    best_value,
    warnings_in,
)
from gfmd_cli.analysis.wording import contact_and_boundary, contact_title, grid_size, shown
from gfmd_cli.physics.observables import MAIN_OBSERVABLES
from gfmd_cli.study.measure import planned
from gfmd_cli.study.reading import solved_rows, tell_files_apart
from gfmd_cli.study.result import Outcome
from gfmd_cli.study.tasks import Task
from gfmd_cli.units import count, left_out

MAX_ROWS = 40
MAX_SCENES = 6  # of other specs that a run names
TASKS = (
    TASK,
    POINTS,
    TableColumn("load", "load"),
    TableColumn("MiB", "memory", ".0f"),
    TableColumn("s", "seconds", ".2g"),
    replace(STATUS, optional=True),
)
RUN = (
    replace(P_STAR, error="p_star_error"),
    PRESSURE,
    *(best_value(name, name, ".5g") for name in MAIN_OBSERVABLES),
    TableColumn("gap", "mean_gap", ".3g", "m"),
    RESIDUAL,
    STATUS,
)


def task_text(tasks: Sequence[Task], outcomes: Mapping[str, Outcome], missing: set[str]) -> str:
    """The tasks by contact, with predicted memory and time, and the status of those stored.

    `missing` are the ids of the tasks to solve, also those stored without the requested output.
    """
    status = {name: str(outcome.status) for name, outcome in outcomes.items()}
    status |= dict.fromkeys(missing & status.keys(), "again: more output is requested")
    records = (
        {
            "task": task.index,
            "points": f"~{task.points}" if task.auto else task.points,
            "load": task.load_label,
            "memory": task.bytes / 2**20,
            "seconds": task.seconds,
            "status": status.get(task.id),
        }
        for task in tasks
    )
    return Table("", TASKS, groups_of(zip(_contacts_of(tasks), records, strict=True))).as_text()


def _contacts_of(tasks: Sequence[Task]) -> list[str]:
    """Elastomer, surface and boundary of each task, and the keys of the solver that differ."""
    rows = [
        planned(task) | {"elastomer": task.elastomer.label_on(task.surface.sides[-1])}
        for task in tasks
    ]
    tell_files_apart(rows)
    return with_solvers(map(contact_and_boundary, rows), rows)


def run_text(rows: list[dict[str, Any]]) -> str:
    """The solved contacts by scene, MAX_ROWS at most; an empty string where nothing was solved."""
    solved = solved_rows(rows)
    listed = solved[:MAX_ROWS]
    titles = with_solvers(map(_scene, listed), listed)
    records = map(with_best, listed)
    table = Table("", shown(RUN, listed), groups_of(zip(titles, records, strict=True)))
    warnings = [f"warning: {line}" for line in warnings_in(solved)]
    blocks = [table.as_text(), *left_out(len(solved), MAX_ROWS, "contact"), "\n".join(warnings)]
    return "\n\n".join(filter(None, blocks))


def other_tasks(rows: list[dict[str, Any]]) -> list[str]:
    """Lines on the contacts of a study that do not belong to the spec of a run."""
    scenes = grouped(rows, _scene)
    if not scenes:
        return []
    lines = [f"the study also contains {count(len(rows), 'contact')} of other specs:"]
    for scene, group in list(scenes.items())[:MAX_SCENES]:
        loads = [row["p_star"] for row in group]
        ends = " to ".join(dict.fromkeys(f"{end:.4g}" for end in (min(loads), max(loads))))
        lines.append(f"  {len(group)} with {scene}, p* = {ends}")
    return [*lines, *(f"  {line}" for line in left_out(len(scenes), MAX_SCENES, "scene"))]


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
    return [*lines[:MAX_ROWS], *left_out(len(lines), MAX_ROWS, "task")]
