"""`gfmd report`: a study as one HTML page."""

from pathlib import Path

import click

from gfmd_cli.cli.options import FILE
from gfmd_cli.errors import InputError


@click.command()
@click.argument("study", type=FILE)
@click.option("-o", "--output", type=FILE, help="HTML file; by default STUDY.html beside it.")
@click.option("--bench", type=FILE, help="Bench file, for speed against error.")
def report(study: Path, output: Path | None, bench: Path | None) -> None:
    """Write a study as one HTML page: what was run, figures, tables, maps.

    The page needs no network and no other file. The same study gives the same bytes. Example:

        gfmd report demo.h5
    """
    from gfmd_cli.analysis.report.page import report as page
    from gfmd_cli.study.files import check_place, write_whole

    path = output or study.with_suffix(".html")
    if path.suffix not in (".html", ".htm"):
        raise InputError(f"{path}: unknown suffix {path.suffix!r}; allowed: .html, .htm")
    for source in (study, bench):
        if source is not None and path.resolve() == source.resolve():
            raise InputError(f"{path}: the report would replace what it is made from; use -o")
    check_place(path)
    write_whole(path, page(study, bench).encode())
    click.echo(str(path))
