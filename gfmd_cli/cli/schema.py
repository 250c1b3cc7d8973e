"""`gfmd schema`."""

import json

import click


@click.command()
def schema() -> None:
    """Print the JSON Schema of the run spec."""
    from gfmd_cli.study.schema import spec_schema

    click.echo(json.dumps(spec_schema(), indent=2))
