"""`gfmd diff`: two studies compared."""

from pathlib import Path

import click

from gfmd_cli.cli.options import FILE


@click.command()
@click.argument("one", type=FILE, metavar="A.h5")
@click.argument("other", type=FILE, metavar="B.h5")
@click.option(
    "--tolerance",
    type=click.FloatRange(min=0),
    help="Exit with status 1 if a difference is larger.",
)
@click.option("--json", "as_json", is_flag=True, help="Print records instead of tables.")
@click.pass_context
def diff(
    context: click.Context, one: Path, other: Path, tolerance: float | None, as_json: bool
) -> None:
    """Compare the results of two studies.

    The command compares contact area, stress deviation and mean gap. Contacts are paired by
    surface, seed, elastomer and load; grids and solvers may differ. Contacts of only one study are
    listed, but not compared. If no contacts match and each study has one surface and one elastomer,
    contacts are paired by load alone. Differences are relative.

    Example:

        gfmd diff coarse.h5 fine.h5 --tolerance 0.01
    """
    from gfmd_cli.analysis.diff import diff as diff_studies
    from gfmd_cli.analysis.diff_table import diff_json, diff_text

    found = diff_studies(one, other)
    click.echo(diff_json(found) if as_json else diff_text(found))
    if tolerance is not None and found.exceeds(tolerance):
        context.exit(1)
