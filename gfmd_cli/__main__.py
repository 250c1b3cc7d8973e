"""`gfmd` and `python -m gfmd_cli`: signals are handled before the slow imports begin."""

import gc
import io
import os
import signal
import sys
import warnings
from types import FrameType

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGUSR1, signal.SIGUSR2)
IMPORTING = "<frozen importlib._bootstrap>"  # the file of Python's import system


def _leave(number: int, frame: FrameType | None) -> None:
    """End quietly, as a shell reports a signal; what is open is cleaned up on the way.

    Compiled modules lose an exception during their import, or turn it into an ImportError: there,
    the process ends at once.
    """
    while frame is not None:
        if frame.f_code.co_filename == IMPORTING:
            os._exit(128 + number)
        frame = frame.f_back
    sys.exit(128 + number)


def _leave_at_once(ignored: "sys.UnraisableHookArgs") -> None:
    """End the process where Python ignores the exception of `_leave`: in destructors, for example.

    Another exception there is reported, as Python does.
    """
    if isinstance(ignored.exc_value, SystemExit) and isinstance(ignored.exc_value.code, int):
        os._exit(ignored.exc_value.code)
    sys.__unraisablehook__(ignored)


def main() -> None:
    """Call the command line. While `gfmd run` solves, it takes signals itself."""
    for number in ENDING:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _leave)
    sys.unraisablehook = _leave_at_once
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115 - to the end
    raw = getattr(sys.stdout, "buffer", None)
    if isinstance(raw, io.RawIOBase):  # PYTHONUNBUFFERED: a short write would lose text
        settings = (sys.stdout.encoding, sys.stdout.errors)
        sys.stdout = io.TextIOWrapper(io.BufferedWriter(raw), *settings, write_through=True)
    gc.set_threshold(10_000)  # compilation makes many objects, and most of them stay
    warnings.formatwarning = lambda message, *_, **__: f"gfmd: {message}\n"
    from gfmd_cli.cli import main as commands

    commands()


if __name__ == "__main__":
    main()
