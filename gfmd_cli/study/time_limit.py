"""The wall time that a run may take."""

from collections.abc import Iterator
from contextlib import contextmanager
from threading import TIMEOUT_MAX, Event, Timer

from gfmd_cli.study.context import Progress, Report


class TimeLimit:
    """Sets `stop` once the time is over, but not before a task has begun.

    Each call of a run therefore advances at least one task, however short its time.
    """

    def __init__(self, stop: Event) -> None:
        self._stop, self._is_over, self._has_begun = stop, Event(), Event()

    def watching(self, report: Report) -> Report:
        """A report from which this learns that a task has begun."""

        def watch(progress: Progress) -> None:
            if progress.event == "start":
                self._has_begun.set()
                self._stop_if_due()
            report(progress)

        return watch

    @contextmanager
    def after(self, seconds: float | None) -> Iterator[None]:
        """Inside, the time is over after so many seconds; never with None."""
        if seconds is None:
            yield
            return
        timer = Timer(min(seconds, TIMEOUT_MAX), self._end)
        timer.daemon = True
        timer.start()
        try:
            yield
        finally:
            timer.cancel()

    def _end(self) -> None:
        self._is_over.set()
        self._stop_if_due()

    def _stop_if_due(self) -> None:
        if self._is_over.is_set() and self._has_begun.is_set():
            self._stop.set()
