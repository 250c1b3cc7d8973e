"""Options that several commands share."""

import shlex
from collections import Counter
from pathlib import Path
from typing import Any

import click

from gfmd_cli.errors import typed


class Number(click.FloatRange):
    """A number in a range; click would take NaN."""

    name = "number"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """The number. Raises click.BadParameter."""
        number = float(super().convert(value, param, ctx))
        if number != number:
            self.fail(f"{value!r} is not a number", param, ctx)
        return number


class Command(click.Command):
    """A command that refuses an option with two values; click would take the last one."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the words of the command line. Raises click.UsageError."""
        _, _, order = self.make_parser(ctx).parse_args(list(args))
        for option, uses in Counter(order).items():
            takes_one = isinstance(option, click.Option) and not (option.multiple or option.is_flag)
            if takes_one and uses > 1 and not ctx.resilient_parsing:
                raise click.UsageError(f"{option.opts[0]}: given {uses} times", ctx)
        return super().parse_args(ctx, args)


def _distinct(
    context: click.Context, parameter: click.Parameter, overrides: tuple[str, ...]
) -> tuple[str, ...]:
    """The values of --set. Raises InputError for two values of one key, and for two loads."""
    from gfmd_cli.spec.parse import check_distinct

    check_distinct(overrides)
    return overrides


FILE = click.Path(path_type=Path)
overrides_option = click.option(
    "--set",
    "overrides",
    multiple=True,
    callback=_distinct,
    metavar="KEY=VALUE",
    help="Set a key of the run spec; repeatable.",
)

output_option = click.option(
    "-o", "--output", type=FILE, help="Study file; by default NAME.h5 in the working directory."
)


def repeated(output: Path | None, overrides: tuple[str, ...]) -> list[str]:
    """The options -o and --set as given, for another command."""
    words = [] if output is None else ["-o", str(output)]
    return [*words, *(word for override in overrides for word in ("--set", override))]


def arguments_as_given(spec: Path, output: Path | None, overrides: tuple[str, ...]) -> str:
    """The spec and its options as given, for the next command to type."""
    return " ".join([typed(spec), *map(shlex.quote, repeated(output, overrides))])
