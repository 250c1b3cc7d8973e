"""`gfmd status` and `gfmd collect`: progress of a study; collection of its records."""

import json
import sys
import time
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gfmd_cli.cli.messages import print_data, print_error, print_text
from gfmd_cli.cli.options import FILE, Command, arguments_as_given, output_option, overrides_option
from gfmd_cli.errors import InputError, typed
from gfmd_cli.status import Status, counted
from gfmd_cli.units import count, duration, left_out

if TYPE_CHECKING:
    from gfmd_cli.study.checkpoint import SavedProgress
    from gfmd_cli.study.progress import StudyProgress

MAX_TASKS = 40  # that have not converged, listed


@click.command(cls=Command)
@click.argument("path", metavar="SPEC|STUDY", type=FILE)
@output_option
@overrides_option
@click.option("--shards", type=int, metavar="N", help="Also show the progress of each of N shards.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def status(
    path: Path, output: Path | None, overrides: tuple[str, ...], shards: int | None, as_json: bool
) -> None:
    """Show the progress of a study.

    The output is the number of tasks by status, the tasks that have not converged, the errors that
    ended tasks, and the next command to type. The command reads the study and its folder of
    unfinished work and changes nothing, so it can be called at any time. It does not query the
    batch system. With a study as its argument, the tasks are those of the last spec and all solved
    ones: missing tasks of an earlier spec are shown with that spec as the argument. Example:

        gfmd status configs/demo.toml --shards 4
    """
    from gfmd_cli.spec.parse import read_spec
    from gfmd_cli.study.progress import check_shards, is_study, progress_of_spec, progress_of_study

    if is_study(path):
        if output is not None or overrides:
            raise InputError(f"-o and --set need a spec; {path} is a study")
        progress, words = progress_of_study(path), arguments_as_given(Path("SPEC"), path, ())
    else:
        resolved, _ = read_spec(path, overrides)
        progress = progress_of_spec(resolved, resolved.study_path(output))
        words = arguments_as_given(path, output, overrides)
    if shards is not None:
        check_shards(shards, len(progress.tasks))
    if as_json:
        print_data(json.dumps(_as_data(progress, shards, words), indent=1) + "\n")
    else:
        print_text(_as_text(progress, shards, words))


@click.command(cls=Command)
@click.argument("spec", type=FILE)
@output_option
@overrides_option
def collect(spec: Path, output: Path | None, overrides: tuple[str, ...]) -> None:
    """Collect the results of all shards into the study file.

    No task is solved. Every shard collects when it ends; use this command if shards were stopped
    or killed. The exit status is 1 if any task is missing or has not converged. Example:

        gfmd collect configs/demo.toml
    """
    from gfmd_cli.spec.parse import read_spec
    from gfmd_cli.study.progress import progress_of_spec
    from gfmd_cli.study.store import Study
    from gfmd_cli.study.tasks import plan

    resolved, text = read_spec(spec, overrides)
    study = Study(resolved.study_path(output))
    if study.record_paths() or study.damaged_paths():
        tasks = plan(resolved)
        with study.work(tasks) as damaged:
            damaged += study.collect(resolved, tasks, text)
        for note in damaged:
            print_error(f"gfmd: {note}")
    progress = progress_of_spec(resolved, study.path)
    print_text(_as_text(progress, None, arguments_as_given(spec, output, overrides)))
    sys.exit(0 if progress.converged else 1)


def _as_text(progress: "StudyProgress", shards: int | None, words: str) -> str:
    """The state of a study, and the next command; `words` are the spec and its options."""
    lines = [f"{progress.study}: {count(len(progress.tasks), 'task')}: {counted(progress.counts)}"]
    for task in progress.tasks:
        name = f"task {task.task} {task.label}".rstrip()
        if task.failure:
            lines.append(f"  {name}: failed: {task.failure}")
        if task.saved is not None:
            age = max(0.0, time.time() - task.saved.time)
            lines.append(
                f"  {name}: state of step {task.saved.step} ({task.saved.points} points along x), "
                f"residual {task.saved.residual:.1e}, saved {duration(age)} ago"
            )
    unconverged = [
        f"task {task.task} {task.label}: {task.status}"
        for task in progress.tasks
        if task.status.is_solved and not task.status.is_converged
    ]
    listed = [*unconverged[:MAX_TASKS], *left_out(len(unconverged), MAX_TASKS, "task")]
    lines += [f"  {line}" for line in listed]
    if progress.records:
        lines.append(f"  {count(progress.records, 'record')} not collected yet")
    if progress.others:
        lines.append(f"  the study also contains {count(progress.others, 'task')} of other specs")
    lines += [f"  damaged, to be solved again: {name}" for name in progress.damaged]
    for index, counts in enumerate(progress.of_shards(shards or 0)):
        lines.append(f"  shard {index}/{shards}: {counted(counts)}")
    return "\n".join([*lines, f"next: {_next_command(progress, words)}"])


def _next_command(progress: "StudyProgress", words: str) -> str:
    """The command to run next."""
    from gfmd_cli.study.slurm import SUFFIX

    if not progress.missing:
        if progress.records:
            return f"gfmd collect {words}"
        return f"gfmd analyze {typed(progress.study)}"
    if progress.study.with_suffix(SUFFIX).exists():
        return f"gfmd submit {words} --missing    # when its jobs have left the queue"
    have_failed = all(task.failure for task in progress.tasks if not task.status.is_solved)
    condition = "    # when the causes of the failures are removed" if have_failed else ""
    return f"gfmd run {words}{condition}"


def _saved(task: int, saved: "SavedProgress") -> dict[str, Any]:
    data = {"task": task, **saved._asdict()}
    return data | ({} if isfinite(saved.residual) else {"residual": None})  # JSON has no NaN


def _as_data(progress: "StudyProgress", shards: int | None, words: str) -> dict[str, Any]:
    """The same as plain data."""
    counts = progress.counts
    data: dict[str, Any] = {
        "study": str(progress.study),
        "tasks": len(progress.tasks),
        "converged": counts[Status.CONVERGED],
        "missing": counts[Status.MISSING],
        "statuses": dict(counts),
        "missing_tasks": progress.missing,
        "saved": [_saved(task.task, task.saved) for task in progress.tasks if task.saved],
        "failed": [{"task": t.task, "message": t.failure} for t in progress.tasks if t.failure],
        "records": progress.records,
        "others": progress.others,
        "damaged": progress.damaged,
        "next": _next_command(progress, words),
    }
    if shards is not None:
        data["shards"] = [dict(counts) for counts in progress.of_shards(shards)]
    return data
