"""`gfmd analyze` and `gfmd export`: tables, figures and files of a study."""

import json
from pathlib import Path
from typing import Literal

import click

from gfmd_cli.cli.messages import show, tell
from gfmd_cli.cli.options import FILE
from gfmd_cli.errors import InputError


@click.command()
@click.argument("study", type=FILE)
@click.option("--json", "as_json", is_flag=True, help="Print a list of records instead of tables.")
@click.option("--figures", type=FILE, metavar="DIR", help="Write figures into this folder.")
@click.option(
    "--theory",
    type=click.Choice(["paper", "fitted", "coarse-grained"]),
    default="paper",
    show_default=True,
    help="Theory of the mean gap; see docs/theory.md.",
)
def analyze(
    study: Path,
    as_json: bool,
    figures: Path | None,
    theory: Literal["paper", "fitted", "coarse-grained"],
) -> None:
    """Compare a study with Persson theory.

    The tables contain the results beside the theory and, if there are any, continuum values, means
    over seeds and optional results.

    Example:

        gfmd analyze demo.h5 --figures figures
    """
    from gfmd_cli.analysis.compare import compare
    from gfmd_cli.analysis.records import as_records
    from gfmd_cli.analysis.run_summary import edge_warnings
    from gfmd_cli.analysis.units import count

    comparison = compare(study, theory)
    if as_json:
        click.echo(json.dumps(as_records(comparison), indent=1))
    else:
        show(str(comparison))
        for line in edge_warnings([row for curve in comparison.curves for row in curve.rows]):
            show(f"\n{line}")
        if comparison.missing:
            show(f"\n{count(comparison.missing, 'task')} not solved yet: run the spec again.")
    if figures is not None:
        from gfmd_cli.analysis.figures import draw_all

        for path in draw_all(comparison, figures):
            tell(str(path))


@click.command()
@click.argument("study", type=FILE)
@click.option(
    "-o", "--output", type=FILE, help="FILE.csv, .nc or .vti; by default CSV on standard output."
)
@click.option("--task", type=int, help="Index of the task whose fields a .vti file contains.")
def export(study: Path, output: Path | None, task: int | None) -> None:
    """Export a study as CSV or netCDF, or fields as a VTK image.

    A CSV file has one row per solved task. A netCDF 4 file (.nc) has everything except the fields.
    A VTK image (.vti) has the fields of one task.

    Example:

        gfmd export demo.h5 -o demo.csv
    """
    suffix = ".csv" if output is None else output.suffix
    if suffix not in (".csv", ".nc", ".vti"):
        raise InputError(f"{output}: unknown suffix {suffix!r}; allowed: .csv, .nc, .vti")
    if task is not None and suffix != ".vti":
        raise InputError("--task: chooses fields, for a .vti file")
    if output is None:
        from gfmd_cli.analysis.export import export_csv

        click.echo(export_csv(study), nl=False)
        return
    if suffix == ".csv":
        from gfmd_cli.analysis.export import export_csv
        from gfmd_cli.files.atomic import write_whole

        write_whole(output, export_csv(study).encode())
    elif suffix == ".nc":
        from gfmd_cli.analysis.export import write_netcdf

        write_netcdf(study, output)
    else:
        from gfmd_cli.analysis.vtk import write_image

        write_image(study, task, output)
    show(str(output))
