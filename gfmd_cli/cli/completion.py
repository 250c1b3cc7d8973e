"""`gfmd completion` and `gfmd schema`: words that shells and editors complete."""

import json

import click
from click.shell_completion import get_completion_class

from gfmd_cli.cli.messages import print_data
from gfmd_cli.cli.options import Command

SHELLS = ("bash", "zsh", "fish")


@click.command(cls=Command)
@click.argument("shell", type=click.Choice(SHELLS))
def completion(shell: str) -> None:
    """Print shell code that completes commands, options and files.

    Example, for bash (zsh: ~/.zshrc; fish: ~/.config/fish/completions/gfmd.fish):

        gfmd completion bash >> ~/.bashrc
    """
    from gfmd_cli.cli import main

    kind = get_completion_class(shell)
    assert kind is not None
    print_data(kind(main, {}, "gfmd", "_GFMD_COMPLETE").source() + "\n")


@click.command(cls=Command)
def schema() -> None:
    """Print the JSON Schema of the run spec, for editors.

    Editors use it to complete and check a spec. Editors with Taplo (VS Code: Even Better TOML) find
    the schema by the line `#:schema FILE` at the top of a spec. Example:

        gfmd schema > run-spec.schema.json
    """
    from gfmd_cli.spec.schema import spec_schema

    print_data(json.dumps(spec_schema(), indent=2) + "\n")
