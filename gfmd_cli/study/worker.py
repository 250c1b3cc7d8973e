"""A worker process: it solves the tasks that come through its pipe, one after the other."""

import faulthandler
import os
import sys
from contextlib import suppress
from multiprocessing.connection import Connection
from queue import SimpleQueue
from threading import Event, Thread

from gfmd_cli.errors import Interrupted
from gfmd_cli.files.locks import WaitOptions
from gfmd_cli.grid import plans
from gfmd_cli.status import Status
from gfmd_cli.study.context import SolveContext
from gfmd_cli.study.run_task import attempt
from gfmd_cli.study.signals import handle_signals_in_worker
from gfmd_cli.study.tasks import Task

READY = "ready"


def serve(pipe: Connection) -> None:
    """Solve tasks until the other end of the pipe is closed.

    Sends every progress event, READY at the start, and the status of each finished task. After
    READY or a status, the next task can be sent.
    """
    faulthandler.enable(sys.__stderr__ or 2)
    parts, options = pipe.recv()
    context = SolveContext(options, pipe.send)
    handle_signals_in_worker(context.stop)
    tasks: SimpleQueue[Task] = SimpleQueue()
    try:
        Thread(target=_receive, args=(pipe, tasks, context.stop), daemon=True).start()
    except RuntimeError as error:
        sys.exit(f"gfmd: a worker process: {error} (see ulimit -u)")
    try:
        wait_options = WaitOptions(context.stop, options.wait_until, run_pid=os.getppid())
        plans.plan_with(parts, estimated=options.reproducible, wait_options=wait_options)
        pipe.send(READY)
        while True:
            pipe.send(attempt(tasks.get(), parts, context))
    except BrokenPipeError:  # the run has ended
        os._exit(1)
    except Interrupted:  # no plans before the end of the run: it stops before the first task
        with suppress(OSError):
            pipe.send(Status.INTERRUPTED)
        os._exit(1)


def _receive(pipe: Connection, tasks: SimpleQueue[Task], stop: Event) -> None:
    """Take tasks in; None asks for a stop. No worker outlives its run: a closed pipe ends it."""
    try:
        while True:
            task = pipe.recv()
            if task is None:
                stop.set()
            else:
                tasks.put(task)
    except (EOFError, OSError):
        os._exit(0)
