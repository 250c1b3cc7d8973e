"""`gfmd analyze` and `gfmd export`: what a study holds."""

import csv
import io
import json
from pathlib import Path
from typing import Literal

import click

from gfmd_cli.cli.options import FILE


@click.command()
@click.argument("study", type=FILE)
@click.option("--json", "as_json", is_flag=True, help="Print a list of records instead of tables.")
@click.option("--figures", type=FILE, metavar="DIR", help="Draw figures into this folder.")
@click.option(
    "--gamma",
    type=click.Choice(["paper", "fitted"]),
    default="paper",
    show_default=True,
    help="Weight of the elastic energy in the mean gap of theory; see docs/theory.md.",
)
def analyze(
    study: Path, as_json: bool, figures: Path | None, gamma: Literal["paper", "fitted"]
) -> None:
    """Compare a study with Persson theory.

    Example:

        gfmd analyze demo.h5 --figures figures
    """
    from gfmd_cli.analysis.compare import compare
    from gfmd_cli.analysis.distribution_tables import distribution_table
    from gfmd_cli.analysis.tables import as_records, tables

    comparison = compare(study, gamma)
    if as_json:
        click.echo(json.dumps(as_records(comparison), indent=1))
    else:
        told = [tables(comparison), distribution_table(comparison)]
        click.echo("\n\n".join(text for text in told if text))
    if figures is not None:
        from gfmd_cli.analysis.figures import draw_all

        for path in draw_all(comparison, figures):
            click.echo(str(path), err=True)


@click.command()
@click.argument("study", type=FILE)
@click.option("-o", "--output", type=FILE, help="CSV file; by default standard output.")
def export(study: Path, output: Path | None) -> None:
    """Write one row per solved pressure as CSV.

    Example:

        gfmd export demo.h5 -o demo.csv
    """
    from gfmd_cli.analysis.tables import export_rows

    header, rows = export_rows(study)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    if output is None:
        click.echo(text.getvalue(), nl=False)
        return
    from gfmd_cli.study.files import write_whole

    write_whole(output, text.getvalue().encode())
