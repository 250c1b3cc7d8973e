"""`gfmd report`: a study as one HTML page."""

import os
from pathlib import Path

import click

from gfmd_cli.cli.messages import show
from gfmd_cli.cli.options import FILE
from gfmd_cli.errors import InputError


@click.command()
@click.argument("study", type=FILE)
@click.argument("other", type=FILE, required=False)
@click.option("-o", "--output", type=FILE, help="HTML file; default: STUDY[-OTHER].html.")
@click.option(
    "--bench", type=FILE, help="File of `gfmd bench`; adds a figure of speed against error."
)
def report(study: Path, other: Path | None, output: Path | None, bench: Path | None) -> None:
    """Write a report with figures, tables and maps as one HTML page.

    With two studies, such as two materials or two treatments of a scan, each figure has the curves
    of both, and the table of `gfmd diff` comes first. The page needs no network and no other
    file. The same study always gives the same page.

    Examples:

        gfmd report demo.h5

        gfmd report soft.h5 stiff.h5
    """
    from gfmd_cli.files.atomic import check_place, write_whole
    from gfmd_cli.report.page import report as page

    name = study.stem if other is None else f"{study.stem}-{other.stem}"
    path = output or study.with_name(f"{name}.html")
    if path.suffix not in (".html", ".htm"):
        raise InputError(f"{path}: unknown suffix {path.suffix!r}; allowed: .html, .htm")
    for source in (study, other, bench):
        if source is not None and os.path.realpath(path) == os.path.realpath(source):
            raise InputError(f"{path}: the report would replace what it is made from; use -o")
    check_place(path)
    write_whole(path, page(study, bench, other).encode())
    show(str(path))
