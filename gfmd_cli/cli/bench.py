"""`gfmd bench`."""

import sys
from pathlib import Path

import click

from gfmd_cli.cli.options import FILE, overrides_option
from gfmd_cli.cli.progress import Reporter


@click.command()
@click.argument("spec", type=FILE)
@click.option("-o", "--output", type=FILE, help="Bench file; by default NAME-bench.h5 here.")
@overrides_option
@click.option("--figures", type=FILE, metavar="DIR", help="By default beside the bench file.")
@click.option("-q", "--quiet", is_flag=True, help="Print the table and errors only.")
def bench(
    spec: Path, output: Path | None, overrides: tuple[str, ...], figures: Path | None, quiet: bool
) -> None:
    """Measure speed against error: each solver, each grid, each pressure.

    A spec whose one solver is "auto" compares it with ccg, fire and polonsky-keer. A second call
    measures again and replaces the file. Example:

        gfmd bench configs/bench.toml --figures figures
    """
    from gfmd_cli.analysis.benchmark import bench_table
    from gfmd_cli.analysis.work_precision import draw_bench
    from gfmd_cli.study.bench import run_bench
    from gfmd_cli.study.parse import read_spec
    from gfmd_cli.study.traces import check_target, write_bench

    resolved, text = read_spec(spec, overrides)
    path = output or Path(f"{resolved.study.name}-bench.h5")
    check_target(path, resolved)
    with Reporter(quiet) as report:
        traces = run_bench(resolved, report)
    write_bench(path, resolved, text, traces)
    click.echo(bench_table(traces))
    for file in (path, *draw_bench(traces, figures or path.parent)):
        click.echo(str(file), err=True)
    sys.exit(0 if all(trace.row["status"] == "converged" for trace in traces) else 1)
