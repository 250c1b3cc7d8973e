"""`gfmd bench`."""

import sys
from pathlib import Path

import click

from gfmd_cli.cli.messages import print_error, print_text
from gfmd_cli.cli.options import FILE, Command, overrides_option
from gfmd_cli.cli.progress import Reporter
from gfmd_cli.status import Status


@click.command(cls=Command)
@click.argument("spec", type=FILE)
@click.option("-o", "--output", type=FILE, help="File of the results; by default NAME-bench.h5.")
@overrides_option
@click.option(
    "--figures",
    type=FILE,
    metavar="DIR",
    help="Folder of the figures; by default that of the results.",
)
@click.option("-q", "--quiet", is_flag=True, help="Print only the table and errors.")
def bench(
    spec: Path, output: Path | None, overrides: tuple[str, ...], figures: Path | None, quiet: bool
) -> None:
    """Measure the speed of solvers as a function of the error.

    The spec defines solvers, grids and pressures. If its only solver is "auto", it is compared with
    "ccg", "fire" and "polonsky-keer". A second call measures again and replaces the file. Example:

        gfmd bench configs/bench.toml --figures figures
    """
    from gfmd_cli.bench.file import check_target, write_bench
    from gfmd_cli.bench.results import bench_table, draw_bench
    from gfmd_cli.bench.run import run_bench
    from gfmd_cli.files.atomic import make_folder
    from gfmd_cli.spec.parse import read_spec

    resolved, text = read_spec(spec, overrides)
    path = output or Path(f"{resolved.study.name}-bench.h5")
    check_target(path, resolved)
    if figures is not None:
        make_folder(figures)
    with Reporter(quiet) as report:
        traces = run_bench(resolved, report)
    write_bench(path, resolved, text, traces)
    print_text(bench_table(traces).as_text())
    for file in (path, *draw_bench(traces, figures or path.parent)):
        print_error(str(file))
    sys.exit(0 if all(Status(trace.row["status"]).is_converged for trace in traces) else 1)
