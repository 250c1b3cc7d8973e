"""`gfmd analyze`, `report`, `export` and `diff`: tables, figures and files of studies."""

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gfmd_cli.cli.messages import print_data, print_error, print_text
from gfmd_cli.cli.options import FILE, Command, Number
from gfmd_cli.errors import InputError, typed

if TYPE_CHECKING:
    from gfmd_cli.analysis.compare import Theory


@click.command(cls=Command)
@click.argument("study", type=FILE)
@click.option("--json", "as_json", is_flag=True, help="Print a list of records instead of tables.")
@click.option("--figures", type=FILE, metavar="DIR", help="Write figures into this folder.")
@click.option(
    "--theory",
    type=click.Choice(["paper", "fitted", "coarse-grained"]),
    default="paper",
    show_default=True,
    help="Theory of the mean gap: Persson's with the weight of the paper, with a weight that is "
    "fitted to simulations, or coarse-graining without a constant.",
)
def analyze(study: Path, as_json: bool, figures: Path | None, theory: "Theory") -> None:
    """Compare a study with Persson theory.

    The tables contain the results beside the theory and, if there are any, continuum values, means
    over seeds and optional results.

    Example:

        gfmd analyze demo.h5 --figures figures
    """
    from gfmd_cli.analysis.compare import compare
    from gfmd_cli.analysis.export import as_records
    from gfmd_cli.units import count

    comparison = compare(study, theory)
    if as_json:
        print_data(json.dumps(as_records(comparison), indent=1) + "\n")
    else:
        print_text(str(comparison))
    if comparison.missing:
        note = (
            f"{count(len(comparison.missing), 'task')} not solved yet or failed; `gfmd status "
            f"{typed(study)}` prints the errors."
        )
        if as_json:
            print_error(note)
        else:
            print_text(f"\n{note}")
    if figures is not None:
        from gfmd_cli.analysis.figures import draw_all

        for path in draw_all(comparison, figures):
            print_error(str(path))


@click.command(cls=Command)
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
    from gfmd_cli.files.atomic import check_place, target_of, write_whole
    from gfmd_cli.report.page import report as page

    name = study.stem if other is None else f"{study.stem}-{other.stem}"
    path = output or study.parent / f"{name}.html"
    if output is not None and path.suffix not in (".html", ".htm"):
        raise InputError(f"{path}: unknown suffix {path.suffix!r}; allowed: .html, .htm")
    for source in (study, other, bench):
        if source is not None and os.path.realpath(path) == os.path.realpath(source):
            raise InputError(f"{path}: the report would replace what it is made from; use -o")
    check_place(target_of(path))
    write_whole(target_of(path), page(study, bench, other).encode())
    print_text(str(path))


@click.command(cls=Command)
@click.argument("study", type=FILE)
@click.option(
    "-o", "--output", type=FILE, help="FILE.csv, .nc or .vti; by default CSV on standard output."
)
@click.option(
    "--task", metavar="I", type=int, help="Index of the task whose fields a .vti file contains."
)
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
    from gfmd_cli.analysis.export import export_csv, write_image, write_netcdf
    from gfmd_cli.files.atomic import target_of, write_whole

    if output is None:
        print_data(export_csv(study))
        return
    if suffix == ".csv":
        write_whole(target_of(output), export_csv(study).encode())
    elif suffix == ".nc":
        write_netcdf(study, output)
    else:
        write_image(study, task, output)
    print_text(str(output))


@click.command(cls=Command)
@click.argument("one", type=FILE, metavar="A.h5")
@click.argument("other", type=FILE, metavar="B.h5")
@click.option(
    "--tolerance",
    metavar="X",
    type=Number(min=0),
    help="Exit with status 1 if a difference is larger.",
)
@click.option("--json", "as_json", is_flag=True, help="Print records instead of tables.")
@click.pass_context
def diff(
    context: click.Context, one: Path, other: Path, tolerance: float | None, as_json: bool
) -> None:
    """Compare the results of two studies.

    The command compares contact area, stress deviation and mean gap. Contacts are paired by
    surface, seed, elastomer and load; boundaries, grids and solvers may differ. Contacts of only
    one study are listed, but not compared. If no contacts match and each study has one surface and
    one elastomer, contacts are paired by load alone. Differences are relative; if the load is in Pa
    or m, those of stress and gap are in Pa and m, otherwise in reduced units.

    Example:

        gfmd diff coarse.h5 fine.h5 --tolerance 0.01
    """
    from gfmd_cli.analysis.diff import diff as diff_studies
    from gfmd_cli.analysis.diff import diff_json, diff_text

    difference = diff_studies(one, other)
    if as_json:
        print_data(diff_json(difference) + "\n")
    else:
        print_text(diff_text(difference))
    if tolerance is not None and difference.exceeds(tolerance):
        context.exit(1)
