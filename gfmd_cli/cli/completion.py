"""`gfmd completion`."""

import click
from click.shell_completion import get_completion_class

SHELLS = ("bash", "zsh", "fish")


@click.command()
@click.argument("shell", type=click.Choice(SHELLS))
def completion(shell: str) -> None:
    """Print shell code that completes commands, options and files.

    Example, for bash (zsh: ~/.zshrc; fish: ~/.config/fish/completions/gfmd.fish):

        gfmd completion bash >> ~/.bashrc
    """
    from gfmd_cli.cli import main

    kind = get_completion_class(shell)
    assert kind is not None
    click.echo(kind(main, {}, "gfmd", "_GFMD_COMPLETE").source())
