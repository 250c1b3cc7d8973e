"""Signals that ask a run for an orderly stop."""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, current_thread, main_thread
from typing import Any

SIGNALS = (
    signal.SIGTERM,
    signal.SIGINT,
    signal.SIGHUP,
    signal.SIGUSR1,
    signal.SIGUSR2,
    signal.SIGXCPU,
)
"""SIGHUP: the terminal is closed; SIGXCPU: the soft limit of processor time is reached."""


def _handled_signals() -> list[signal.Signals]:
    """The signals that this program may handle.

    Others are ignored, as under nohup, or have a handler that was not set from Python (None) and
    could not be restored, as in a program that embeds Python.
    """
    left_alone = (signal.SIG_IGN, None)
    return [number for number in SIGNALS if signal.getsignal(number) not in left_alone]


_interruptible = False  # whether the main thread may be interrupted now


@contextmanager
def interruptible() -> Iterator[None]:
    """Inside, a second SIGINT may raise KeyboardInterrupt: files appear whole or not at all."""
    global _interruptible
    if current_thread() is not main_thread():
        yield
        return
    _interruptible = True
    try:
        yield
    finally:
        _interruptible = False


@contextmanager
def signal_handlers(stop: Event, *, may_exit: bool) -> Iterator[None]:
    """Inside, a signal sets `stop`.

    A second SIGINT ends the process at once if it `may_exit`; otherwise, as in a notebook, it
    raises KeyboardInterrupt where the run is `interruptible`. Only the main thread of a program can
    take signals; in another they stay what they are.
    """
    if current_thread() is not main_thread():
        yield
        return

    def handle(number: int, _frame: Any) -> None:
        if number == signal.SIGINT and stop.is_set():
            if may_exit:
                os._exit(130)
            if _interruptible:
                raise KeyboardInterrupt
        stop.set()

    before = {number: signal.signal(number, handle) for number in _handled_signals()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def blocked_signals() -> Iterator[None]:
    """Inside, signals wait; a process that is started inside begins with its signals blocked."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def handle_signals_in_worker(stop: Event) -> None:
    """From now on every signal sets `stop`; those that were blocked at the start come now."""
    for number in _handled_signals():
        signal.signal(number, lambda *_: stop.set())
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
