"""Options that several commands share."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

FILE = click.Path(path_type=Path)
overrides_option = click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    help="Set a key of the run spec; repeatable.",
)

output_option = click.option(
    "-o", "--output", type=FILE, help="Study file; by default NAME.h5 in the working directory."
)


def study_path(spec: Any, output: Path | None) -> Path:
    """The study file of a spec."""
    return output or Path(f"{spec.study.name}.h5")


def counted(counts: Mapping[str, int]) -> str:
    """The counts as text, such as "2 converged, 1 missing"."""
    return ", ".join(f"{count} {what}" for what, count in sorted(counts.items()))


def repeated(output: Path | None, overrides: tuple[str, ...]) -> list[str]:
    """The options -o and --set as given, for the next command to type."""
    words = [] if output is None else ["-o", str(output)]
    return [*words, *(word for override in overrides for word in ("--set", override))]
