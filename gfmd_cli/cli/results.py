"""`gfmd analyze` and `gfmd export`: what a study holds."""

import csv
import io
import json
from pathlib import Path
from typing import Literal

import click

from gfmd_cli.cli.options import FILE
from gfmd_cli.errors import InputError


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
@click.option(
    "-o", "--output", type=FILE, help="FILE.csv, .nc or .vti; by default CSV to standard output."
)
@click.option("--task", type=int, help="Task whose fields a .vti file is to hold.")
def export(study: Path, output: Path | None, task: int | None) -> None:
    """Write a study as CSV, netCDF 4 (.nc) or, the fields of one task, as VTK image (.vti).

    CSV has one row per solved pressure; netCDF has all but the fields.

    Example:

        gfmd export demo.h5 -o demo.csv
    """
    suffix = ".csv" if output is None else output.suffix
    if suffix not in (".csv", ".nc", ".vti"):
        raise InputError(f"{output}: unknown suffix {suffix!r}; allowed: .csv, .nc, .vti")
    if task is not None and suffix != ".vti":
        raise InputError("--task: chooses fields, for a .vti file")
    if output is None:
        click.echo(_csv(study), nl=False)
        return
    if suffix == ".csv":
        from gfmd_cli.study.files import write_whole

        write_whole(output, _csv(study).encode())
    elif suffix == ".nc":
        from gfmd_cli.analysis.export import write_netcdf

        write_netcdf(study, output)
    else:
        from gfmd_cli.analysis.image import write_image

        write_image(study, task, output)
    click.echo(str(output))


def _csv(study: Path) -> str:
    from gfmd_cli.analysis.export import export_rows

    header, rows = export_rows(study)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()
