"""`gfmd submit`."""

import os
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gfmd_cli.cli.messages import print_data, print_text
from gfmd_cli.cli.options import (
    FILE,
    Command,
    arguments_as_given,
    output_option,
    overrides_option,
    repeated,
)
from gfmd_cli.errors import GfmdError, InputError
from gfmd_cli.units import count

if TYPE_CHECKING:
    from gfmd_cli.study.slurm import Batch


@click.command(cls=Command)
@click.argument("spec", type=FILE)
@output_option
@overrides_option
@click.option("--shards", type=int, metavar="N", help="Divide the tasks into N shards.")
@click.option("--missing", is_flag=True, help="Submit only shards with missing tasks.")
@click.option("--dry-run", is_flag=True, help="Print the script and the commands; submit nothing.")
@click.option("--time", metavar="TIME", help="Time limit of a shard, such as 12:00:00.")
@click.option(
    "--mem",
    metavar="SIZE",
    help="Memory of a shard; by default that of the largest task times the tasks at once.",
)
@click.option(
    "--cpus-per-task",
    metavar="N",
    type=click.IntRange(1, 1024),
    help="Cores of a shard; by default 1.",
)
@click.option("--partition", metavar="NAME", help="Partition of the cluster.")
@click.option("--account", metavar="NAME", help="Account to charge.")
@click.option(
    "--sbatch",
    "sbatch_options",
    multiple=True,
    metavar="OPTION",
    help="Other option of sbatch; repeatable.",
)
def submit(
    spec: Path,
    output: Path | None,
    overrides: tuple[str, ...],
    shards: int | None,
    missing: bool,
    dry_run: bool,
    sbatch_options: tuple[str, ...],
    **slurm_options: Any,
) -> None:
    """Run a study as an array job of Slurm.

    Each member of the array runs a part of the tasks (a shard), and a second job collects the
    results. A shard that is preempted or reaches its time limit saves its state and is queued
    again. With --missing and without --shards, the script of the last submission is used unchanged;
    options given now take precedence over those in the script. Examples:

        gfmd submit configs/demo.toml --shards 4 --time 2:00:00 --sbatch qos=long

        gfmd submit configs/demo.toml --missing
    """
    from gfmd_cli.files.atomic import check_place
    from gfmd_cli.spec.parse import read_spec
    from gfmd_cli.study.progress import progress_of_spec
    from gfmd_cli.study.slurm import batch
    from gfmd_cli.study.tasks import plan

    if shards is None and not missing:
        raise InputError("submit: give --shards N, the number of array members, or --missing")
    resolved, _ = read_spec(spec, overrides)
    study = Path(os.path.realpath(resolved.study_path(output)))
    job = batch(
        progress_of_spec(resolved, study),
        plan(resolved),
        [str(spec.absolute()), *repeated(study, overrides)],
        shards=shards,
        missing=missing,
        named_options={
            name.replace("_", "-"): str(value)
            for name, value in slurm_options.items()
            if value is not None
        },
        sbatch_options=sbatch_options,
    )
    words = arguments_as_given(spec, output, overrides)
    if not job.members:
        print_text(f"{study}: nothing is missing\nnext: gfmd collect {words}")
    elif dry_run:
        print_data(job.text)
        for call in (job.array_call(), job.collect_call("JOB")):
            print_text(f"# {shlex.join(call)}")
    else:
        check_place(study)
        _send(job)
        print_text(f"next: gfmd status {words}")


def _send(job: "Batch") -> None:
    """Write the script and submit it, first as an array, then to collect."""
    from gfmd_cli.files.atomic import make_folder, write_whole
    from gfmd_cli.study.slurm import call, queued

    if queued_jobs := queued(job.path):
        raise InputError(
            f"{job.path}: job {queued_jobs[0]} of this study is in the queue; wait for it, "
            f"or end it by `scancel {queued_jobs[0].partition('_')[0]}`"
        )
    make_folder(job.logs)
    if job.fresh:
        write_whole(job.path, job.text.encode())
    number = call(job.array_call()).partition(";")[0]
    print_text(f"job {number}: {len(job.members)} of {count(job.shards, 'shard')}, by {job.path}")
    try:
        collect_job = call(job.collect_call(number)).partition(";")[0]
    except GfmdError as error:
        raise GfmdError(
            f"{error}\njob {number} is submitted, the job that collects its results is not: run "
            "gfmd collect when it has ended"
        ) from error
    print_text(f"job {collect_job}: collects when they have ended; logs in {job.logs}")
