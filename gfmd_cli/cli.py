"""The command line: `gfmd run`, `analyze`, `export`, `bench`, `schema`. Only this module prints."""

import csv
import io
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

import gfmd_cli
from gfmd_cli.errors import GfmdError, InputError

LOG_EVERY = 60.0  # seconds between two lines on one task where stderr is no terminal
BAR = "{desc}: {n_fmt} steps, {elapsed}{postfix}"
READABLE = click.Path(path_type=Path)


class Commands(click.Group):
    """Ends every known error in one message and its exit status."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except GfmdError as error:
            for line in str(error).splitlines():
                click.echo(f"gfmd: {line}" if line == str(error) else line, err=True)
            ctx.exit(error.exit_status)


@click.group(cls=Commands)
@click.version_option(gfmd_cli.__version__, prog_name="gfmd")
def main() -> None:
    """Elastic contact of rough surfaces, from springs (n = 0) to plates (n = 4)."""
    # Dot products are all that is asked of BLAS: its threads bring nothing and, side by side
    # with other processes, spin for tens of times the work.
    for library in ("OPENBLAS", "OMP", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")


@main.command()
@click.argument("spec", type=READABLE)
@click.option("-o", "--output", type=READABLE, help="Study file; by default NAME.h5 here.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a key.")
@click.option("--shard", metavar="I/N", help="Only the tasks with index I modulo N.")
@click.option("-j", "--jobs", type=click.IntRange(1, 1024), help="Worker processes.")
@click.option("--dry-run", is_flag=True, help="List the tasks, their memory and time; run none.")
@click.option(
    "--checkpoint-every",
    type=click.FloatRange(min=0, min_open=True),
    default=600.0,
    show_default=True,
    help="Seconds between two saves of an unfinished solve.",
)
@click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")
def run(
    spec: Path,
    output: Path | None,
    overrides: tuple[str, ...],
    shard: str | None,
    jobs: int | None,
    dry_run: bool,
    checkpoint_every: float,
    quiet: bool,
) -> None:
    """Solve what the study does not hold yet.

    Called again, it goes on where it was stopped. Example:

        gfmd run configs/demo.toml --set load.p_star=0.1
    """
    from gfmd_cli.study.parse import read_spec

    resolved, text = read_spec(spec, overrides)
    path = output or Path(f"{resolved.study.name}.h5")
    share = _shard(shard)
    if dry_run:
        _print_tasks(resolved, path, share)
        return
    from gfmd_cli.study.run import run_study

    with _Reporter(quiet) as report:
        outcome = run_study(
            resolved,
            text,
            path,
            report,
            shard=share,
            jobs=jobs,
            checkpoint_every=checkpoint_every,
        )
    missed = sum(outcome.values()) - outcome["converged"]
    if not quiet:
        told = ", ".join(f"{count} {status}" for status, count in sorted(outcome.items()))
        click.echo(f"{path}: {told or 'no tasks in this shard'}")
        click.echo(f"next: gfmd analyze {path}")
    sys.exit(1 if missed else 0)


def _shard(text: str | None) -> tuple[int, int]:
    """ "I/N" as two numbers, 0 <= I < N."""
    if text is None:
        return 0, 1
    index, _, count = text.partition("/")
    if not (index.isdigit() and count.isdigit() and int(index) < int(count)):
        raise InputError(f"--shard {text}: write I/N with 0 <= I < N, such as 0/8")
    return int(index), int(count)


def _print_tasks(spec: Any, path: Path, shard: tuple[int, int]) -> None:
    """The tasks of a shard with what they will take, and whether the study has them."""
    from gfmd_cli.study.resources import check_memory
    from gfmd_cli.study.store import Study
    from gfmd_cli.study.tasks import describe, plan

    study = Study(path)
    study.check_spec(spec)
    tasks = [task for task in plan(spec) if task.index % shard[1] == shard[0]]
    held = study.held()
    if tasks:
        check_memory(tasks)
    click.echo(f"{'task':>6} {'points':>6} {'load':>10} {'MiB':>8} {'s':>8}  scene")
    for task in tasks:
        done = f"  [{held[task.id]}]" if task.id in held else ""
        load = f"p*={task.load:.4g}" if task.reduced else f"{task.load:.4g} Pa"
        points = f"~{task.points}" if task.auto else str(task.points)
        click.echo(
            f"{task.index:6d} {points:>6} {load:>10} {task.bytes / 2**20:8.0f} "
            f"{task.seconds:8.2g}  {describe(task.surface)} | {describe(task.elastomer)}{done}"
        )
    missing = [task for task in tasks if task.id not in held]
    click.echo(
        f"{len(tasks)} tasks, {len(missing)} to do, about {sum(t.seconds for t in missing):.3g} s "
        f"of one core, at most {max((t.bytes for t in tasks), default=0) / 2**20:.0f} MiB a task; "
        f"study {path}"
    )


class _Reporter:
    """Progress: a bar a task on a terminal, else a line a minute and one at each task's end."""

    def __init__(self, quiet: bool) -> None:
        self.bars: dict[int, Any] = {}
        self.told: dict[int, float] = {}
        self.quiet = quiet
        self.terminal = sys.stderr.isatty()

    def __enter__(self) -> Callable[[Any], None]:
        return self.show

    def __exit__(self, *_: object) -> None:
        for bar in self.bars.values():
            bar.close()

    def show(self, progress: Any) -> None:
        """One event of one task."""
        if progress.event == "failed":
            self._close(progress.task)
            click.echo(f"gfmd: task {progress.task} ({progress.label}): {progress.note}", err=True)
        elif self.quiet:
            return
        elif self.terminal:
            self._bar(progress)
        else:
            self._line(progress)

    def _bar(self, progress: Any) -> None:
        from tqdm import tqdm

        if progress.event in ("done", "interrupted"):
            self._close(progress.task)
            return
        bar = self.bars.get(progress.task)
        if bar is None:
            place = min(set(range(len(self.bars) + 1)) - {b.pos for b in self.bars.values()})
            bar = tqdm(desc=progress.label, position=place, leave=False, bar_format=BAR)
            self.bars[progress.task] = bar
        if progress.event == "step":
            bar.n = progress.step
            bar.set_postfix_str(
                f"{progress.points} points, residual {progress.residual:.1e}, "
                f"a_r {progress.a_r:.4f}"
            )

    def _close(self, task: int) -> None:
        bar = self.bars.pop(task, None)
        if bar is not None:
            bar.close()

    def _line(self, progress: Any) -> None:
        now = time.monotonic()
        since = self.told.setdefault(progress.task, now)
        if progress.event == "done" or (progress.event == "step" and now - since > LOG_EVERY):
            self.told[progress.task] = now
            click.echo(
                f"task {progress.task} {progress.label}: step {progress.step} "
                f"({progress.points} points) residual {progress.residual:.1e} "
                f"a_r {progress.a_r:.4g} {progress.note}".rstrip(),
                err=True,
            )


@main.command()
@click.argument("study", type=READABLE)
@click.option("--json", "as_json", is_flag=True, help="Print a list of records instead of tables.")
@click.option("--figures", type=READABLE, metavar="DIR", help="Draw figures into this folder.")
def analyze(study: Path, as_json: bool, figures: Path | None) -> None:
    """Compare a study with Persson theory.

    Example:

        gfmd analyze demo.h5 --figures figures
    """
    from gfmd_cli.analysis.compare import compare
    from gfmd_cli.analysis.distribution_tables import distribution_table
    from gfmd_cli.analysis.tables import as_records, tables

    comparison = compare(study)
    if as_json:
        click.echo(json.dumps(as_records(comparison), indent=1))
    else:
        told = [tables(comparison), distribution_table(comparison)]
        click.echo("\n\n".join(text for text in told if text))
    if figures is not None:
        from gfmd_cli.analysis.figures import draw_all

        for path in draw_all(comparison, figures):
            click.echo(str(path), err=True)


@main.command()
@click.argument("study", type=READABLE)
@click.option("-o", "--output", type=READABLE, help="CSV file; by default standard output.")
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


@main.command()
@click.argument("spec", type=READABLE)
@click.option("-o", "--output", type=READABLE, help="Bench file; by default NAME-bench.h5 here.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a key.")
@click.option("--figures", type=READABLE, metavar="DIR", help="By default beside the bench file.")
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
    with _Reporter(quiet) as report:
        traces = run_bench(resolved, report)
    write_bench(path, resolved, text, traces)
    click.echo(bench_table(traces))
    for file in (path, *draw_bench(traces, figures or path.parent)):
        click.echo(str(file), err=True)
    sys.exit(0 if all(trace.row["status"] == "converged" for trace in traces) else 1)


@main.command()
def schema() -> None:
    """Print the JSON Schema of the run spec."""
    from gfmd_cli.study.schema import spec_schema

    click.echo(json.dumps(spec_schema(), indent=2))


if __name__ == "__main__":
    main()
