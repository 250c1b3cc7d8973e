"""`gfmd schema`."""

import json

import click


@click.command()
def schema() -> None:
    """Print the JSON Schema of the run spec, for editors.

    Editors use it to complete and check a spec. Editors with Taplo (VS Code: Even Better TOML) find
    the schema by the line `#:schema FILE` at the top of a spec. Example:

        gfmd schema > run-spec.schema.json
    """
    from gfmd_cli.spec.schema import spec_schema

    click.echo(json.dumps(spec_schema(), indent=2))
