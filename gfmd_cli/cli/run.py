"""`gfmd run`."""

import sys
from pathlib import Path
from typing import Any

import click

from gfmd_cli.cli.options import FILE, counted, output_option, overrides_option, study_path
from gfmd_cli.cli.progress import Reporter
from gfmd_cli.errors import InputError


@click.command()
@click.argument("spec", type=FILE)
@output_option
@overrides_option
@click.option("--shard", metavar="I/N", help="Only the tasks with index I modulo N.")
@click.option("-j", "--jobs", type=click.IntRange(1, 1024), help="Worker processes.")
@click.option("--dry-run", is_flag=True, help="List the tasks, their memory and time; run none.")
@click.option(
    "--checkpoint-every",
    type=click.FloatRange(min=0, min_open=True),
    default=600.0,
    show_default=True,
    help="Seconds between two saves of an unfinished solve.",
)
@click.option(
    "--max-hours",
    type=click.FloatRange(min=0, min_open=True),
    help="End within this wall time, states saved, as a signal ends it: exit status 75.",
)
@click.option(
    "--reproducible",
    is_flag=True,
    help="The same bits on every run of one machine: transforms planned without measuring, one "
    "thread a task. Slower.",
)
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
def run(
    spec: Path,
    output: Path | None,
    overrides: tuple[str, ...],
    shard: str | None,
    jobs: int | None,
    dry_run: bool,
    checkpoint_every: float,
    max_hours: float | None,
    reproducible: bool,
    quiet: bool,
) -> None:
    """Solve what the study does not hold yet.

    Called again, it goes on where it was stopped. Example:

        gfmd run configs/demo.toml --set load.p_star=0.1
    """
    from gfmd_cli.physics.ranks import launched, together

    ranks = launched()
    how = {
        "jobs": jobs,
        "checkpoint_every": checkpoint_every,
        "max_seconds": None if max_hours is None else 3600 * max_hours,
        "reproducible": reproducible,
        "ranks": ranks,
    }
    with together(ranks):
        missed = _run(spec, output, overrides, _shard(shard), dry_run, quiet, how)
    sys.exit(1 if missed else 0)


def _run(
    spec: Path,
    output: Path | None,
    overrides: tuple[str, ...],
    shard: tuple[int, int],
    dry_run: bool,
    quiet: bool,
    how: dict[str, Any],
) -> int:
    """Run, or list, the tasks of a spec; how many ended other than converged."""
    from gfmd_cli.physics.ranks import leads
    from gfmd_cli.study.parse import read_spec

    resolved, text = read_spec(spec, overrides)
    path = study_path(resolved, output)
    ranks = how["ranks"]
    if dry_run:
        _print_tasks(resolved, path, shard, ranks)
        return 0
    from gfmd_cli.study.run import run_study

    reporter = Reporter(quiet)
    with reporter as report:
        tell = report if leads(ranks) else lambda progress: None
        outcome = run_study(resolved, text, path, tell, shard=shard, **how)
    if leads(ranks) and not quiet:
        _print_results(path, shard, outcome, reporter.failed)
    return sum(outcome.values()) - outcome["converged"]


def _print_results(path: Path, shard: tuple[int, int], outcome: Any, failed: Any) -> None:
    """What was found, what was not and why, and what to type next."""
    from gfmd_cli.analysis.summary import missed, results
    from gfmd_cli.study.reading import read_rows

    rows = read_rows(path) if outcome and path.exists() else []
    rows = [row for row in rows if row["task"] % shard[1] == shard[0]]
    if table := results(rows):
        click.echo(f"{table}\n")
    told = counted(outcome)
    click.echo(f"{path}: {told or 'no tasks in this shard'}")
    for line in missed(rows, failed):
        click.echo(f"  {line}")
    click.echo(f"next: gfmd analyze {path}\n      gfmd report {path}")


def _shard(text: str | None) -> tuple[int, int]:
    """ "I/N" as two numbers, 0 <= I < N."""
    if text is None:
        return 0, 1
    index, _, count = text.partition("/")
    if not (index.isdigit() and count.isdigit() and int(index) < int(count)):
        raise InputError(f"--shard {text}: write I/N with 0 <= I < N, such as 0/8")
    return int(index), int(count)


def _print_tasks(spec: Any, path: Path, shard: tuple[int, int], ranks: Any) -> None:
    """The tasks of a shard with what they will take, and whether the study has them."""
    from gfmd_cli.physics.ranks import leads
    from gfmd_cli.study.resources import check_memory
    from gfmd_cli.study.store import Study
    from gfmd_cli.study.tasks import describe, plan

    study = Study(path)
    study.check_spec(spec)
    tasks = [task for task in plan(spec) if task.index % shard[1] == shard[0]]
    held = study.held()
    if tasks:
        check_memory(tasks, ranks)
    if not leads(ranks):
        return
    click.echo(f"{'task':>6} {'points':>6} {'load':>10} {'MiB':>8} {'s':>8}  scene")
    for task in tasks:
        done = f"  [{held[task.id]}]" if task.id in held else ""
        points = f"~{task.points}" if task.auto else str(task.points)
        click.echo(
            f"{task.index:6d} {points:>6} {task.asked:>10} {task.bytes / 2**20:8.0f} "
            f"{task.seconds:8.2g}  {describe(task.surface)} | {describe(task.elastomer)}{done}"
        )
    missing = [task for task in tasks if task.id not in held]
    click.echo(
        f"{len(tasks)} tasks, {len(missing)} to do, about {sum(t.seconds for t in missing):.3g} s "
        f"of one core, at most {max((t.bytes for t in tasks), default=0) / 2**20:.0f} MiB a task; "
        f"study {path}"
    )
