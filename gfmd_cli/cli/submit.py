"""`gfmd submit`."""

import shlex
from pathlib import Path
from typing import Any

import click

from gfmd_cli.cli.options import FILE, output_option, overrides_option, repeated, study_path
from gfmd_cli.errors import InputError


@click.command()
@click.argument("spec", type=FILE)
@output_option
@overrides_option
@click.option("--shards", type=int, metavar="N", help="Deal the tasks into N shards.")
@click.option("--missing", is_flag=True, help="Only shards with tasks that are not solved yet.")
@click.option("--dry-run", is_flag=True, help="Print script and commands; write, submit nothing.")
@click.option("--time", help="Time limit of a shard, such as 12:00:00.")
@click.option("--mem", help="Memory of a shard; by default what its largest task is said to take.")
@click.option("--cpus-per-task", type=click.IntRange(1, 1024), help="By default 1.")
@click.option("--partition", metavar="NAME", help="Partition of the cluster.")
@click.option("--account", metavar="NAME", help="Account to charge.")
@click.option("--sbatch", "further", multiple=True, metavar="OPTION", help="Hand on to sbatch.")
def submit(
    spec: Path,
    output: Path | None,
    overrides: tuple[str, ...],
    shards: int | None,
    missing: bool,
    dry_run: bool,
    further: tuple[str, ...],
    **given: Any,
) -> None:
    """Solve a study as an array job of Slurm, and collect it by a job that follows.

    A shard that is preempted or runs out of time saves its state and is queued again. With
    --missing and without --shards, the script of the last submission is used as it stands, and
    options given now go before its own. Examples:

        gfmd submit configs/demo.toml --shards 4 --time 2:00:00 --sbatch qos=long

        gfmd submit configs/demo.toml --missing
    """
    from gfmd_cli.study.parse import read_spec
    from gfmd_cli.study.slurm import batch
    from gfmd_cli.study.status import state_of_spec
    from gfmd_cli.study.tasks import plan

    if shards is None and not missing:
        raise InputError("submit: give --shards N, the number of array members, or --missing")
    resolved, _ = read_spec(spec, overrides)
    study = study_path(resolved, output).resolve()
    job = batch(
        state_of_spec(resolved, study),
        plan(resolved),
        [str(spec.absolute()), *repeated(study, overrides)],
        shards=shards,
        missing=missing,
        asked={
            name.replace("_", "-"): str(value) for name, value in given.items() if value is not None
        },
        further=further,
    )
    words = shlex.join([str(spec), *repeated(output, overrides)])
    if not job.members:
        click.echo(f"{study}: nothing is missing\nnext: gfmd collect {words}")
    elif dry_run:
        click.echo(job.text, nl=False)
        for call in (job.array_call(), job.collect_call("JOB")):
            click.echo(f"# {shlex.join(call)}")
    else:
        _send(job)
        click.echo(f"next: gfmd status {words}")


def _send(job: Any) -> None:
    """Write the script and submit it, first as an array, then to collect."""
    from gfmd_cli.study.files import make_folder, write_whole
    from gfmd_cli.study.slurm import call, queued

    if waiting := queued(job.path):
        raise InputError(
            f"{job.path}: job {waiting[0]} of this study is in the queue; wait for it, "
            f"or end it by `scancel {waiting[0].partition('_')[0]}`"
        )
    make_folder(job.logs)
    if job.fresh:
        write_whole(job.path, job.text.encode())
    number = call(job.array_call()).partition(";")[0]
    click.echo(f"job {number}: {len(job.members)} of {job.shards} shards, by {job.path}")
    following = call(job.collect_call(number)).partition(";")[0]
    click.echo(f"job {following}: collects when they have ended; logs in {job.logs}")
