"""Options that several commands share."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gfmd_cli.errors import InputError
from gfmd_cli.status import Status

if TYPE_CHECKING:
    from gfmd_cli.spec.models import Spec

OF_OTHERS = {".csv", ".nc", ".vti", ".html", ".json", ".toml"}
"""Suffixes of files that other commands write or read."""
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


def study_path(spec: "Spec", output: Path | None) -> Path:
    """The study file of a spec. Raises InputError for the suffix of a file of another kind."""
    if output is not None and output.suffix.lower() in OF_OTHERS:
        raise InputError(
            f"-o {output}: a study is an HDF5 file, such as {output.stem}.h5; gfmd export writes "
            "CSV, netCDF and VTK, gfmd report HTML"
        )
    return output or Path(f"{spec.study.name}.h5")


def counted(counts: Mapping[Status, int]) -> str:
    """The counts as text, such as "2 converged, 1 missing"."""
    return ", ".join(f"{count} {what}" for what, count in sorted(counts.items()))


def repeated(output: Path | None, overrides: tuple[str, ...]) -> list[str]:
    """The options -o and --set as given, for the next command to type."""
    words = [] if output is None else ["-o", str(output)]
    return [*words, *(word for override in overrides for word in ("--set", override))]
