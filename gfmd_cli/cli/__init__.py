"""The command line: one module per command. Only this package prints and imports click."""

import errno
import faulthandler
import os
import sys
from typing import Any

import click

import gfmd_cli
from gfmd_cli.cli.bench import bench
from gfmd_cli.cli.completion import completion, schema
from gfmd_cli.cli.init import init, surface
from gfmd_cli.cli.messages import discard_output, print_error
from gfmd_cli.cli.results import analyze, diff, export, report
from gfmd_cli.cli.run import run
from gfmd_cli.cli.status import collect, status
from gfmd_cli.cli.submit import submit
from gfmd_cli.errors import GfmdError, SpaceError, StudyError

COMMANDS = [
    *(init, surface, run, submit, status, collect),
    *(analyze, report, export, diff, bench, schema, completion),
]
"""Commands in the order in which a user needs them."""
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
UNWRITABLE = (*FULL, errno.EROFS, errno.ENAMETOOLONG)
"""Errors of writing; those in FULL mean that a disk, a quota or a file size is exhausted."""


class Commands(click.Group):
    """The group of commands; prints a known error as one message and exits with its status."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands in the order in which a user needs them."""
        return list(self.commands)

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except GfmdError as error:
            status, message = error.exit_status, str(error)
        except MemoryError:
            status, message = GfmdError.exit_status, "not enough memory"
        except BrokenPipeError:  # click ends quietly
            raise
        except OSError as error:
            status = (SpaceError if error.errno in UNWRITABLE else StudyError).exit_status
            message = str(error)
            if error.errno in FULL and error.filename is None:
                discard_output()
                message = f"standard output: cannot be written: {error.strerror}"
        from gfmd_cli.grid.ranks import is_first

        for line in message.splitlines() if is_first() else ():
            print_error(f"gfmd: {line}")
        return ctx.exit(status)


@click.group(cls=Commands, commands=COMMANDS, context_settings={"max_content_width": 100})
@click.version_option(gfmd_cli.__version__, prog_name="gfmd")
def main() -> None:
    """Elastic contact of rough surfaces, from springs (n = 0) to plates (n = 4).

    First steps:

    \b
        gfmd init                       write study.toml (--from SCAN: for a measured surface)
        gfmd run study.toml             solve all tasks of the spec
        gfmd analyze study.h5           compare the results with Persson theory
    """
    faulthandler.enable(sys.__stderr__ or 2)  # a crash prints a traceback
    # A solve uses one thread of BLAS (grid/blas.py); others need not be started.
    for library in ("OPENBLAS", "OMP", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
