"""Printing of text: control characters are escaped; a closed terminal does not stop a run."""

import os
import sys
from contextlib import suppress

import click


def printable(text: str) -> str:
    """Text in which control characters, as of terminal escapes in file names, are spelled out."""
    return "".join(
        letter if letter.isprintable() or letter in "\n\t" else ascii(letter)[1:-1]
        for letter in text
    )


def print_error(text: str) -> None:
    """Print on stderr; an error of writing is ignored."""
    with suppress(OSError):
        click.echo(printable(text), err=True)


def print_text(text: str) -> None:
    """Print on stdout; if the reader has closed the pipe, the rest is discarded."""
    print_data(f"{printable(text)}\n")


def print_data(text: str) -> None:
    """Print text for other programs on stdout, unchanged; a closed pipe is treated as above."""
    try:
        click.echo(text, nl=False)
    except BrokenPipeError:
        discard_output()


def discard_output() -> None:
    """Discard what is left to print on stdout, which cannot be written."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)
