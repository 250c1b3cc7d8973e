"""What the options of several commands share."""

from pathlib import Path

import click

FILE = click.Path(path_type=Path)
overrides_option = click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Override a key."
)
