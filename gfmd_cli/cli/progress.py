"""Progress of a run, for a terminal or a log."""

import sys
import time
from contextlib import suppress
from math import isfinite
from typing import TYPE_CHECKING, Any

from gfmd_cli.cli.messages import print_error, printable
from gfmd_cli.units import count, duration

if TYPE_CHECKING:
    from gfmd_cli.study.context import ProgressEvent, Report

LOG_EVERY = 60.0  # seconds between two lines where stderr is no terminal
TASK_BAR = "{desc}: {n_fmt} steps, {elapsed}{postfix}"
RUN_BAR = "{desc}, {elapsed} so far"


class Reporter:
    """Progress: on a terminal a bar for the run and one a task at work, else a line a minute."""

    def __init__(self, quiet: bool) -> None:
        self.bars: dict[int | None, Any] = {}
        """Bars by task; that of the run is under None."""
        self.last_line = time.monotonic()
        self.quiet = quiet
        self.terminal = sys.stderr.isatty()
        self.failed: dict[int, str] = {}
        """Why tasks failed, by task."""

    def __enter__(self) -> "Report":
        return self.show

    def __exit__(self, *_: object) -> None:
        for task in list(self.bars):
            self._close(task)

    def show(self, progress: "ProgressEvent") -> None:
        """One event of one task."""
        if progress.status is not None and progress.status.is_failure:
            self.failed[progress.task] = progress.message
            self._close(progress.task)
            print_error(f"gfmd: task {progress.task} ({progress.label}): {progress.message}")
        elif progress.event == "warning":
            print_error(f"gfmd: {progress.message}")
        elif self.quiet:
            return
        elif self.terminal:
            with suppress(OSError):  # a terminal that was closed ends no run
                self._bar(progress)
        else:
            self._line(progress)

    def _bar(self, progress: "ProgressEvent") -> None:
        from tqdm import tqdm

        if progress.tasks_left is not None:
            if None not in self.bars:
                self.bars[None] = tqdm(position=0, leave=False, bar_format=RUN_BAR)
            self.bars[None].set_description_str(_left(progress))
        if progress.event == "end":
            self._close(progress.task)
            return
        bar = self.bars.get(progress.task)
        if bar is None:
            bar = tqdm(desc=printable(progress.label), leave=False, bar_format=TASK_BAR)
            self.bars[progress.task] = bar
        if progress.event == "step":
            bar.n = progress.step
            bar.set_postfix_str(f"{progress.points} points, {_state(progress)}")

    def _close(self, task: int | None) -> None:
        bar = self.bars.pop(task, None)
        if bar is not None:
            with suppress(OSError):
                bar.close()

    def _line(self, progress: "ProgressEvent") -> None:
        now = time.monotonic()
        if progress.event not in ("end", "step") or now - self.last_line < LOG_EVERY:
            return
        self.last_line = now
        print_error(
            f"{_left(progress)}; task {progress.task} {progress.label}: "
            f"step {progress.step} ({progress.points} points), {_state(progress)} "
            f"{progress.status or ''}".strip("; ")
        )


def _state(progress: "ProgressEvent") -> str:
    """Residual and, where it is known, contact area."""
    a_r = f", a_r {progress.a_r:.4g}" if isfinite(progress.a_r) else ""
    return f"residual {progress.residual:.1e}{a_r}"


def _left(progress: "ProgressEvent") -> str:
    """Number of tasks and time that are left."""
    if progress.tasks_left is None:
        return ""
    text = f"{count(progress.tasks_left, 'task')} left"
    seconds = progress.seconds_left
    return f"{text}, about {duration(seconds)}" if isfinite(seconds) else text
