"""Progress of a run, for a terminal or a log."""

import sys
import time
from collections.abc import Callable
from typing import Any

import click

LOG_EVERY = 60.0  # seconds between two lines on one task where stderr is no terminal
BAR = "{desc}: {n_fmt} steps, {elapsed}{postfix}"


class Reporter:
    """Progress: a bar a task on a terminal, else a line a minute and one at each task's end."""

    def __init__(self, quiet: bool) -> None:
        self.bars: dict[int, Any] = {}
        self.told: dict[int, float] = {}
        self.quiet = quiet
        self.terminal = sys.stderr.isatty()

    def __enter__(self) -> Callable[[Any], None]:
        return self.show

    def __exit__(self, *_: object) -> None:
        for bar in self.bars.values():
            bar.close()

    def show(self, progress: Any) -> None:
        """One event of one task."""
        if progress.event == "failed":
            self._close(progress.task)
            click.echo(f"gfmd: task {progress.task} ({progress.label}): {progress.note}", err=True)
        elif progress.event == "warning":
            click.echo(f"gfmd: {progress.note}", err=True)
        elif self.quiet:
            return
        elif self.terminal:
            self._bar(progress)
        else:
            self._line(progress)

    def _bar(self, progress: Any) -> None:
        from tqdm import tqdm

        if progress.event in ("done", "interrupted"):
            self._close(progress.task)
            return
        bar = self.bars.get(progress.task)
        if bar is None:
            place = min(set(range(len(self.bars) + 1)) - {b.pos for b in self.bars.values()})
            bar = tqdm(desc=progress.label, position=place, leave=False, bar_format=BAR)
            self.bars[progress.task] = bar
        if progress.event == "step":
            bar.n = progress.step
            bar.set_postfix_str(
                f"{progress.points} points, residual {progress.residual:.1e}, "
                f"a_r {progress.a_r:.4f}"
            )

    def _close(self, task: int) -> None:
        bar = self.bars.pop(task, None)
        if bar is not None:
            bar.close()

    def _line(self, progress: Any) -> None:
        now = time.monotonic()
        since = self.told.setdefault(progress.task, now)
        if progress.event == "done" or (progress.event == "step" and now - since > LOG_EVERY):
            self.told[progress.task] = now
            click.echo(
                f"task {progress.task} {progress.label}: step {progress.step} "
                f"({progress.points} points) residual {progress.residual:.1e} "
                f"a_r {progress.a_r:.4g} {progress.note}".rstrip(),
                err=True,
            )
