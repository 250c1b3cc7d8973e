"""What the options of several commands share."""

from pathlib import Path

import click

FILE = click.Path(path_type=Path)
overrides_option = click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a key."
)


def repeated(output: Path | None, overrides: tuple[str, ...]) -> list[str]:
    """-o and --set as they were given, for a command to type next."""
    words = [] if output is None else ["-o", str(output)]
    return [*words, *(word for override in overrides for word in ("--set", override))]
