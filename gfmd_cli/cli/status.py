"""`gfmd status` and `gfmd collect`: how far a study is, and its records in one file."""

import json
import shlex
import sys
import time
from math import isfinite
from pathlib import Path
from typing import Any

import click

from gfmd_cli.cli.options import (
    FILE,
    counted,
    output_option,
    overrides_option,
    repeated,
    study_path,
)
from gfmd_cli.errors import InputError


@click.command()
@click.argument("path", metavar="SPEC|STUDY", type=FILE)
@output_option
@overrides_option
@click.option("--shards", type=int, metavar="N", help="Say it for each of N shards, too.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def status(
    path: Path, output: Path | None, overrides: tuple[str, ...], shards: int | None, as_json: bool
) -> None:
    """Say how far a study is: what is solved, saved, missing, damaged, and what to type next.

    It reads the study and the work beside it, changes nothing and asks no batch system, so it may
    be called at any time. Example:

        gfmd status configs/demo.toml --shards 4
    """
    from gfmd_cli.study.status import check_shards, is_study, state_of_study

    if is_study(path):
        if output is not None or overrides:
            raise InputError(f"-o and --set go with a spec; {path} is a study")
        state, spec = state_of_study(path), "SPEC"
    else:
        state, _, _ = _of_spec(path, output, overrides)
        spec = str(path)
    if shards is not None:
        check_shards(shards, len(state.tasks))
    following = _next(state, spec, output if spec != "SPEC" else path, overrides)
    if as_json:
        click.echo(json.dumps(_as_data(state, shards, following), indent=1))
    else:
        click.echo("\n".join([*_lines(state, shards), f"next: {following}"]))


@click.command()
@click.argument("spec", type=FILE)
@output_option
@overrides_option
def collect(spec: Path, output: Path | None, overrides: tuple[str, ...]) -> None:
    """Take the records of all shards into the study; solve nothing.

    Every shard does so at its end; this is for those that were stopped or killed. The exit status
    is 1 where tasks are missing or not converged. Example:

        gfmd collect configs/demo.toml
    """
    from gfmd_cli.study.store import Study
    from gfmd_cli.study.tasks import plan

    state, resolved, text = _of_spec(spec, output, overrides)
    if state.records or state.damaged:
        study = Study(state.study)
        with study.work(resolved) as damaged:
            damaged += study.collect(resolved, plan(resolved), text)
        for note in damaged:
            click.echo(f"gfmd: {note}", err=True)
        state, _, _ = _of_spec(spec, output, overrides)
    following = _next(state, str(spec), output, overrides)
    click.echo("\n".join([*_lines(state, None), f"next: {following}"]))
    sys.exit(0 if state.converged else 1)


def _of_spec(spec: Path, output: Path | None, overrides: tuple[str, ...]) -> tuple[Any, Any, str]:
    """How far a spec is, the spec and its text."""
    from gfmd_cli.study.parse import read_spec
    from gfmd_cli.study.status import state_of_spec

    resolved, text = read_spec(spec, overrides)
    return state_of_spec(resolved, study_path(resolved, output)), resolved, text


def _lines(state: Any, shards: int | None) -> list[str]:
    """What a person wants to know."""
    lines = [f"{state.study}: {len(state.tasks)} tasks: {counted(state.counts)}"]
    for task in state.tasks:
        if task.saved is not None:
            name = f"task {task.task} {task.label}".rstrip()
            lines.append(
                f"  {name}: state of step {task.saved.step} ({task.saved.points} points), residual "
                f"{task.saved.residual:.1e}, saved {_ago(task.saved.time)}"
            )
    if state.records:
        lines.append(f"  {state.records} records are not collected yet")
    lines += [f"  damaged, to be solved again: {name}" for name in state.damaged]
    for index in range(shards or 0):
        lines.append(f"  shard {index}/{shards}: {counted(state.shard(index, shards or 1))}")
    return lines


def _ago(when: float) -> str:
    seconds = max(0.0, time.time() - when)
    return f"{seconds:.0f} s ago" if seconds < 120 else f"{seconds / 60:.0f} min ago"


def _next(state: Any, spec: str, output: Path | None, overrides: tuple[str, ...]) -> str:
    """The command that brings the study on."""
    from gfmd_cli.study.slurm import SUFFIX

    words = [spec, *repeated(output, overrides)]
    if not state.missing:
        if state.records:
            return shlex.join(["gfmd", "collect", *words])
        return shlex.join(["gfmd", "analyze", str(state.study)])
    if state.study.with_suffix(SUFFIX).exists():
        again = shlex.join(["gfmd", "submit", *words, "--missing"])
        return f"{again}    # when its jobs have left the queue"
    return shlex.join(["gfmd", "run", *words])


def _saved(task: Any) -> dict[str, Any]:
    data = {"task": task.task, **task.saved._asdict()}
    return data | ({} if isfinite(task.saved.residual) else {"residual": None})  # JSON has no NaN


def _as_data(state: Any, shards: int | None, following: str) -> dict[str, Any]:
    """The same as plain data."""
    counts = state.counts
    data: dict[str, Any] = {
        "study": str(state.study),
        "tasks": len(state.tasks),
        "converged": counts["converged"],
        "missing": counts["missing"],
        "statuses": dict(counts),
        "missing_tasks": state.missing,
        "saved": [_saved(task) for task in state.tasks if task.saved is not None],
        "records": state.records,
        "damaged": state.damaged,
        "next": following,
    }
    if shards is not None:
        data["shards"] = [dict(state.shard(index, shards)) for index in range(shards)]
    return data
