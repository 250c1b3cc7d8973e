"""`gfmd schema`."""

import json

import click


@click.command()
def schema() -> None:
    """Print the JSON Schema of the run spec, by which an editor completes and checks it.

    The line `#:schema FILE` at the top of a spec tells it to editors with Taplo (VS Code: Even
    Better TOML); `gfmd init` writes it. Example:

        gfmd schema > run-spec.schema.json
    """
    from gfmd_cli.study.schema import spec_schema

    click.echo(json.dumps(spec_schema(), indent=2))
