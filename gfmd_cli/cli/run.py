"""`gfmd run`."""

import re
import sys
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gfmd_cli.cli.messages import print_error, print_text
from gfmd_cli.cli.options import FILE, Command, Number, output_option, overrides_option
from gfmd_cli.cli.progress import Reporter
from gfmd_cli.errors import InputError, typed
from gfmd_cli.status import Status, counted
from gfmd_cli.units import count

if TYPE_CHECKING:
    from gfmd_cli.spec.models import Spec
    from gfmd_cli.study.run import RunOptions


def _shard(context: click.Context, parameter: click.Parameter, text: str | None) -> tuple[int, int]:
    """ "I/N" as two numbers, 0 <= I < N."""
    if text is None:
        return 0, 1
    numbers = re.fullmatch("([0-9]{1,9})/([0-9]{1,9})", text)
    index, count = map(int, numbers.groups() if numbers else (0, 0))
    if index >= count:
        raise InputError(f"--shard {text}: write I/N with 0 <= I < N, such as 0/8")
    return index, count


@click.command(cls=Command)
@click.argument("specs", metavar="SPEC...", type=FILE, nargs=-1, required=True)
@output_option
@overrides_option
@click.option(
    "--shard",
    metavar="I/N",
    callback=_shard,
    help="Run only one of N parts of the study (shard I): tasks I, I + N, I + 2N, ...",
)
@click.option(
    "-j",
    "--jobs",
    metavar="N",
    type=click.IntRange(1, 1024),
    help="Number of worker processes; by default it follows from cores, memory and tasks.",
)
@click.option(
    "--overwrite",
    is_flag=True,
    help="Start a new study; the old one and its unfinished work are renamed.",
)
@click.option(
    "--dry-run", is_flag=True, help="List the tasks with their memory and time; run none."
)
@click.option(
    "--checkpoint-every",
    metavar="SECONDS",
    type=Number(min=0, min_open=True),
    default=600.0,
    show_default=True,
    help="Time between two checkpoints of a task.",
)
@click.option(
    "--max-hours",
    metavar="HOURS",
    type=Number(min=0, min_open=True),
    help="Stop before this wall time has passed: save all states, exit with status 75. Each "
    "call makes at least one step, even if that takes longer.",
)
@click.option(
    "--reproducible",
    is_flag=True,
    help="Give bit-identical results in every run on one machine, but slower: one thread a task, "
    "and no search for the fastest Fourier transform.",
)
@click.option("-q", "--quiet", is_flag=True, help="Print only errors and warnings.")
def run(
    specs: tuple[Path, ...],
    output: Path | None,
    overrides: tuple[str, ...],
    dry_run: bool,
    max_hours: float | None,
    quiet: bool,
    **run_options: Any,
) -> None:
    """Run all tasks that the study does not contain yet.

    A task is one contact: one load on one surface, elastomer and grid. A second call resumes a
    stopped run. A study can contain the tasks of several specs: stored results are kept, and
    missing tasks are added. Several specs are run one after the other. Examples:

    \b
        gfmd run configs/demo.toml --set load.p_star=0.1
        gfmd run one.toml two.toml -o both.h5
    """
    from gfmd_cli.grid.ranks import mpi_ranks, shared_errors

    ranks = mpi_ranks()
    max_seconds = None if max_hours is None else 3600 * max_hours
    unconverged = 0
    with shared_errors(ranks):
        from gfmd_cli.spec.parse import read_spec
        from gfmd_cli.study.run import RunOptions

        options = RunOptions(ranks=ranks, max_seconds=max_seconds, may_exit=True, **run_options)
        read = [read_spec(spec, overrides) for spec in specs]
        paths = [spec.study_path(output) for spec, _ in read]
        if options.overwrite and len(set(paths)) < len(paths):
            raise InputError(
                "--overwrite: not with several specs of one study; each would start it anew"
            )
        for (spec, text), path in zip(read, paths, strict=True):
            if dry_run:
                _print_tasks(spec, path, options)
            else:
                unconverged += _run(spec, text, path, quiet, options)
    sys.exit(1 if unconverged else 0)


def _run(spec: "Spec", text: str, path: Path, quiet: bool, options: "RunOptions") -> int:
    """Run the tasks of a spec; how many ended other than converged."""
    from gfmd_cli.grid.ranks import is_root
    from gfmd_cli.study.context import ignore
    from gfmd_cli.study.run import run_study

    first = is_root(options.ranks)
    reporter = Reporter(quiet)
    with reporter as report:
        counts = run_study(spec, text, path, report if first else ignore, options)
    unconverged = sum(counts.values()) - counts[Status.CONVERGED]
    if first and not quiet:
        _print_results(spec, path, options, counts, reporter.failed)
    elif first and unconverged:
        print_error(f"gfmd: {path}: {counted(counts)}")
    return unconverged


def _print_results(
    spec: "Spec",
    path: Path,
    options: "RunOptions",
    counts: Counter[Status],
    failed: Mapping[int, str],
) -> None:
    """Print the results, the tasks that have not converged, and the next commands."""
    from gfmd_cli.analysis.run_summary import other_tasks, run_text, unconverged
    from gfmd_cli.study.reading import read_rows
    from gfmd_cli.study.tasks import plan

    stored = read_rows(path) if counts and path.exists() else []
    tasks = plan(spec)
    indices = {task.id: task.index for task in options.shard_of(tasks)}
    rows = [row | {"task": indices[row["task_id"]]} for row in stored if row["task_id"] in indices]
    if table := run_text(rows):
        print_text(f"{table}\n")
    print_text(f"{path}: {counted(counts) or 'no tasks in this shard'}")
    for line in unconverged(rows, failed):
        print_text(f"  {line}")
    ids = {task.id for task in tasks}
    solved = [row for row in stored if row["status"].is_solved]
    for line in other_tasks([row for row in solved if row["task_id"] not in ids]):
        print_text(f"  {line}")
    if solved:
        print_text(f"next: gfmd analyze {typed(path)}\n      gfmd report {typed(path)}")


def _print_tasks(spec: "Spec", path: Path, options: "RunOptions") -> None:
    """Print the tasks of a shard with their load, memory and time, and those that are done."""
    from gfmd_cli.analysis.run_summary import task_text
    from gfmd_cli.grid.ranks import is_root
    from gfmd_cli.study.resources import check_memory
    from gfmd_cli.study.store import Study, without_result
    from gfmd_cli.study.tasks import plan

    tasks = options.shard_of(plan(spec))
    outcomes = {} if options.overwrite else Study(path).outcomes()
    missing = without_result(tasks, outcomes)
    check_memory(tasks, options.ranks)
    if not is_root(options.ranks):
        return
    if tasks:
        print_text(f"{task_text(tasks, outcomes, {task.id for task in missing})}\n")
    print_text(
        f"{count(len(tasks), 'task')}, {len(missing)} to do, "
        f"about {sum(t.seconds for t in missing):.3g} s of one core, "
        f"at most {max((t.bytes for t in tasks), default=0) / 2**20:.0f} MiB a task; "
        f"study {path}"
    )
