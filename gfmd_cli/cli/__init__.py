"""The command line, a module a command. Only this package prints and knows click."""

import faulthandler
import os
import sys
from typing import Any

import click

import gfmd_cli
from gfmd_cli.cli.bench import bench
from gfmd_cli.cli.completion import completion
from gfmd_cli.cli.diff import diff
from gfmd_cli.cli.init import init, surface
from gfmd_cli.cli.report import report
from gfmd_cli.cli.results import analyze, export
from gfmd_cli.cli.run import run
from gfmd_cli.cli.schema import schema
from gfmd_cli.cli.status import collect, status
from gfmd_cli.cli.submit import submit
from gfmd_cli.errors import GfmdError


class Commands(click.Group):
    """Ends every known error in one message and its exit status."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands in the order in which they are used."""
        return list(self.commands)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except GfmdError as error:
            from gfmd_cli.physics.ranks import is_first

            for line in str(error).splitlines() if is_first() else ():
                click.echo(f"gfmd: {line}" if line == str(error) else line, err=True)
            ctx.exit(error.exit_status)


@click.group(cls=Commands, context_settings={"max_content_width": 100})
@click.version_option(gfmd_cli.__version__, prog_name="gfmd")
def main() -> None:
    """Elastic contact of rough surfaces, from springs (n = 0) to plates (n = 4).

    To begin with:

    \b
        gfmd init                       writes study.toml; --from SCAN presses a measured surface
        gfmd run study.toml             solves it
        gfmd analyze study.h5           sets it beside Persson theory
    """
    faulthandler.enable(sys.__stderr__ or 2)  # a crash leaves its place in the log
    # Dot products are all that is asked of BLAS: its threads bring nothing and, side by side
    # with other processes, spin for tens of times the work.
    for library in ("OPENBLAS", "OMP", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")


for command in (
    init,
    surface,
    run,
    submit,
    status,
    collect,
    analyze,
    report,
    export,
    diff,
    bench,
    schema,
    completion,
):
    main.add_command(command)
