"""The errors that end a command, each with its exit status; commands in messages."""

import shlex
from pathlib import Path

INSTALL = 'pip install ".[{}]" in the source folder of gfmd'
"""How to install the packages of an extra."""


def typed(path: Path | str) -> str:
    """A file as a word of a command to type: not an option, although its name may begin with -."""
    return shlex.quote(f"./{path}" if str(path).startswith("-") else str(path))


class GfmdError(Exception):
    """An error that is printed as one message, without a traceback."""

    exit_status = 1


class InputError(GfmdError):
    """Bad input. The message names file or key, what was given and what is allowed."""

    exit_status = 2


class SpaceError(GfmdError):
    """No space left, or a file cannot be created."""

    exit_status = 73


class StudyError(GfmdError):
    """A study or record file is unreadable or corrupt."""

    exit_status = 74


class Interrupted(GfmdError):
    """A signal stopped the run after its state was saved; the same call goes on."""

    exit_status = 75
