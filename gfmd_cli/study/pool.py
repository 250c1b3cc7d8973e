"""Tasks side by side on worker processes: if a worker dies, the others continue."""

import os
import signal
import subprocess
import sys
from collections import Counter, deque
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection, Pipe, wait
from pathlib import Path

from gfmd_cli.status import Status
from gfmd_cli.study.context import ProgressEvent, SolveContext, WorkerOptions
from gfmd_cli.study.resources import available_memory, gib, out_of_memory_kills
from gfmd_cli.study.signals import blocked_signals, interruptible
from gfmd_cli.study.tasks import Task
from gfmd_cli.study.worker import READY
from gfmd_cli.units import count

POLL_SECONDS = 0.1  # between two looks at whether to stop
END_SECONDS = 10.0  # that a worker may take to end once its pipe is closed
MAX_LOST_STARTS = 3  # workers that may die before they are ready
RETRIES = 1  # of a task whose worker died by an error or for lack of memory
KILLS = (signal.SIGKILL, signal.SIGQUIT, signal.SIGALRM, signal.SIGTERM)
"""Signals from outside that end a worker; others report an error of the program or the machine."""
START = """
import sys
from multiprocessing.connection import Connection
pipe = Connection(int(sys.argv[1]))
sys.path[:] = pipe.recv()
from gfmd_cli.study.worker import serve
serve(pipe)
"""
"""What a worker runs: with -P nothing is imported from the working directory."""


class Worker:
    """One worker process, seen from the run."""

    def __init__(self, parts: Path, options: WorkerOptions) -> None:
        self.pipe, other = Pipe()
        with other, blocked_signals():  # a signal waits until the worker can handle it
            number = str(other.fileno())
            command = [sys.executable, "-P", "-c", START, number]
            self.process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, pass_fds=[other.fileno()]
            )
        self.ready = False
        self.task: Task | None = None
        with suppress(OSError):  # it has died already; its end of the pipe says so
            self.pipe.send([folder for folder in sys.path if os.path.isabs(folder)])
            self.pipe.send((parts, options))

    def give(self, task: Task | None) -> None:
        """Give it a task to solve; None asks it to save its state and to end the task."""
        self.task = task or self.task
        with suppress(OSError):
            self.pipe.send(task)

    def end(self) -> int:
        """Close its pipe, which ends it; return its exit status, minus the signal if any."""
        self.pipe.close()
        try:
            return self.process.wait(END_SECONDS)
        except subprocess.TimeoutExpired:
            self.process.kill()
            return self.process.wait()

    def dismiss(self) -> None:
        """End a worker that is not needed any more."""
        if not self.ready:  # it has nothing to save, and would first import all it needs
            self.process.kill()
        self.end()


class Pool:
    """The workers of one run, and the tasks that they have not begun yet."""

    def __init__(
        self,
        tasks: list[Task],
        context: SolveContext,
        jobs: int,
        start: Callable[[], Worker],
    ) -> None:
        self.waiting = deque(sorted(tasks, key=lambda task: -task.seconds))
        """The longest first, so that none is left over at the end."""
        self.context, self.report, self.stop = context, context.report, context.stop
        self.jobs, self.start = jobs, start
        self.workers: dict[Connection, Worker] = {}
        self.counts: Counter[Status] = Counter()
        self.lost_starts = 0
        self.deaths: Counter[int] = Counter()
        """Workers that died at a task, by its index."""
        self.kills = out_of_memory_kills()

    def run(self) -> Counter[Status]:
        """Solve all tasks, or save their states after a signal; return the number by status.

        Tasks that are left to the next call are not counted. Where no worker can be started, the
        other tasks stay in `waiting`.
        """
        is_stopping = False
        try:
            while True:
                if self.stop.is_set() and not is_stopping:
                    is_stopping = True
                    self.waiting.clear()
                    for worker in self.workers.values():
                        worker.give(None)
                self._assign_tasks()
                if not self.workers:
                    return self.counts
                with interruptible():
                    ready = wait(list(self.workers), POLL_SECONDS)
                for pipe in ready:
                    self._receive(self.workers[pipe])  # type: ignore[index]
        finally:
            for pipe in self.workers:
                pipe.close()  # which ends all of them at the same time
            for worker in self.workers.values():
                worker.dismiss()

    def _assign_tasks(self) -> None:
        """Give tasks to idle workers, start more if there is work for them, and end the others."""
        for worker in [worker for worker in self.workers.values() if worker.task is None]:
            if not self.waiting:
                del self.workers[worker.pipe]
                worker.dismiss()
            elif worker.ready:
                worker.give(self.waiting.popleft())
        busy = sum(worker.task is not None for worker in self.workers.values())
        while self.waiting and len(self.workers) < min(self.jobs, busy + len(self.waiting)):
            try:
                worker = self.start()
            except OSError as error:
                self._count_failed_start(f"a worker process cannot be started: {error.strerror}")
            else:
                self.workers[worker.pipe] = worker

    def _receive(self, worker: Worker) -> None:
        """Receive a message of a worker."""
        try:
            message = worker.pipe.recv()
        except (EOFError, OSError):
            self._remove_dead(worker)
            return
        if isinstance(message, ProgressEvent):
            self.report(message)
            return
        if message == Status.INTERRUPTED:
            self.stop.set()  # a signal that came to the worker alone stops the run
        elif message != READY:
            self.counts[message] += 1
        worker.ready, worker.task = True, None

    def _remove_dead(self, worker: Worker) -> None:
        """Remove a worker that has died; the others continue."""
        del self.workers[worker.pipe]
        status, task = worker.end(), worker.task
        if not worker.ready:
            self._count_failed_start(f"a worker process {ending(status)} as it started")
        if task is not None:
            self._handle_lost_task(task, status)

    def _handle_lost_task(self, task: Task, status: int) -> None:
        """Decide about a task whose worker has died: left, tried once more, or failed.

        A kill from outside leaves the task to the next call. Every other end is tried once more,
        after all other tasks: memory may suffice then.
        """
        reason = f"its worker process {ending(status)}"
        killed_from_outside = -status in KILLS
        if status == -signal.SIGKILL and self._memory_ran_out():
            killed_from_outside = False
            self.jobs = max(1, len(self.workers))
            reason += f" (out of memory? {gib(task.bytes)} were predicted, "
            reason += f"{gib(available_memory())} are available now)"
        self.deaths[task.index] += 1
        if killed_from_outside or self.stop.is_set():
            self._end(task, Status.INTERRUPTED, f"{reason}; run again to resume the task")
        elif self.deaths[task.index] <= RETRIES:
            self.waiting.append(task)
            self._end(task, None, f"{reason}; the task is tried again at the end")
        else:
            self.counts[Status.KILLED] += 1
            self._end(task, Status.KILLED, f"{reason}, as before; run again to resume the task")

    def _memory_ran_out(self) -> bool:
        """Whether the kernel has killed a process for memory since the last look, or is silent."""
        before, self.kills = self.kills, out_of_memory_kills()
        return self.kills is None or self.kills != before

    def _count_failed_start(self, reason: str) -> None:
        """Count a worker that could not start; give up after several, if no other is at work."""
        self.lost_starts += 1
        if self.lost_starts <= MAX_LOST_STARTS:
            return
        self.jobs = len(self.workers)
        if not self.workers:
            left = count(len(self.waiting), "task")
            self.context.warn(f"{reason}; {left} left to the process of the run itself")

    def _end(self, task: Task, status: Status | None, reason: str) -> None:
        """Report why a task has ended, or, without a status, why it will start again."""
        if status is None or not status.is_failure:
            message = f"task {task.index} ({task.label}): {reason}"
            self.context.warn(message, task=task.index, label=task.label)
        if status is not None:
            self.report(ProgressEvent(task.index, "end", task.label, status=status, message=reason))


def ending(status: int) -> str:
    """How a process ended, in words."""
    if status >= 0:
        return f"ended with status {status}"
    with suppress(ValueError):
        return f"was killed by {signal.Signals(-status).name}"
    return f"was killed by signal {-status}"
