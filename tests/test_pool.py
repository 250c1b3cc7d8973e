"""The pool with workers that do as their task says, so that every way to die is tried."""

import os
import signal
from collections import Counter
from pathlib import Path
from threading import Event
from types import SimpleNamespace

import pytest

from gfmd_cli.study import pool
from gfmd_cli.study.context import SolveContext
from gfmd_cli.study.pool import ending

WORKER = """
import os, signal, sys, time
from multiprocessing.connection import Connection
pipe = Connection(int(sys.argv[1]))
pipe.recv()
ready_after, _ = pipe.recv()
if ready_after == "dies at start":
    sys.exit(3)
pipe.send("ready")
while True:
    try:
        task = pipe.recv()
    except EOFError:
        sys.exit()
    if task is None:
        continue
    if task.does == "waits for a stop":
        assert pipe.recv() is None
        pipe.send("interrupted")
    elif task.does == "stops itself":
        pipe.send("interrupted")
    elif task.does == "dies when stopped":
        assert pipe.recv() is None
        os.kill(os.getpid(), signal.SIGKILL)
    elif task.does == "dies once":
        if not os.path.exists(task.label):
            open(task.label, "w").close()
            os.kill(os.getpid(), signal.SIGKILL)
        pipe.send("converged")
    elif task.does == "breaks":
        raise KeyError(task.index)
    elif task.does in signal.Signals.__members__:
        os.kill(os.getpid(), signal.Signals[task.does])
    elif task.does == "half a message":
        os.write(pipe.fileno(), bytes(2))
        os._exit(0)
    else:
        pipe.send("converged")
"""


@pytest.fixture
def stop():
    """Set to stop the run."""
    return Event()


@pytest.fixture
def solve(monkeypatch, stop, tmp_path):
    """Solves tasks that do what is asked: how many ended how, and what was reported of which."""
    monkeypatch.setattr(pool, "START", WORKER)

    def solve(*does, jobs=2, start="", stop_at_first_failure=False):
        tasks = [
            SimpleNamespace(
                index=i, seconds=1.0, label=str(tmp_path / f"task {i}"), bytes=2**30, does=what
            )
            for i, what in enumerate(does)
        ]
        reasons = {}

        def report(progress):
            reasons[progress.task] = progress.message
            if stop_at_first_failure:
                stop.set()

        options = SimpleNamespace()  # real ones would let every worker import the solvers
        context = SolveContext(options, report, stop)
        workers = pool.Pool(tasks, context, jobs, lambda: pool.Worker(start, options))
        return workers.run(), reasons

    return solve


@pytest.fixture
def memory_runs_out(monkeypatch):
    """The kernel counts a process killed for memory at every look."""
    kills = iter(range(100))
    monkeypatch.setattr(pool, "out_of_memory_kills", lambda: next(kills))


ERRORS = ("SIGSEGV", "SIGBUS", "SIGABRT", "breaks", "half a message")


@pytest.mark.parametrize("death", ERRORS)
@pytest.mark.parametrize("jobs", [1, 2, 3])
def test_a_task_whose_worker_dies_twice_fails_and_the_others_continue(solve, death, jobs):
    outcome, reasons = solve(*["converges", death] * 3, jobs=jobs)
    assert outcome == Counter(converged=3, killed=3)
    assert sorted(reasons) == [1, 3, 5]
    assert all("as before; run again" in reason for reason in reasons.values())


@pytest.mark.parametrize("jobs", [1, 2, 3])
def test_a_task_whose_worker_is_killed_from_outside_is_left_to_the_next_call(solve, jobs):
    outcome, reasons = solve(*["converges", "SIGKILL", "SIGQUIT"] * 2, jobs=jobs)
    assert outcome == Counter(converged=2)
    assert sorted(reasons) == [1, 2, 4, 5]
    assert all("run again" in reason for reason in reasons.values())


@pytest.mark.usefixtures("memory_runs_out")
@pytest.mark.parametrize("jobs", [1, 2, 3])
def test_a_task_killed_once_for_memory_is_solved_in_the_end(solve, jobs):
    outcome, reasons = solve("dies once", *["converges"] * 4, jobs=jobs)
    assert outcome == Counter(converged=5)
    assert "SIGKILL (out of memory? 1 GiB were predicted" in reasons[0]


class Scripted:
    """A worker and its pipe in one: what it will say follows from the tasks that it is given."""

    def __init__(self, deaths):
        self.pipe, self.ready, self.task = self, False, None
        self.deaths, self.messages = deaths, ["ready"]

    def give(self, task):
        self.task = task
        self.messages.append(EOFError if task.index in self.deaths else "converged")
        self.deaths.discard(task.index)

    def recv(self):
        message = self.messages.pop(0)
        if message is EOFError:
            raise EOFError
        return message

    def end(self):
        return -signal.SIGSEGV

    def dismiss(self):
        pass


@pytest.mark.parametrize("death", [0, 1])
def test_an_idle_worker_takes_the_task_of_one_that_dies_at_the_same_moment(monkeypatch, death):
    def wait(pipes, _):
        heard = [pipe for pipe in pipes if pipe.messages]
        assert heard, "all workers wait for a task"
        return heard

    monkeypatch.setattr(pool, "wait", wait)
    deaths = {death}
    tasks = [SimpleNamespace(index=i, seconds=1.0, label="", bytes=1) for i in (0, 1)]
    context = SolveContext(SimpleNamespace(), lambda progress: None, Event())
    outcome = pool.Pool(tasks, context, 2, lambda: Scripted(deaths)).run()
    assert outcome == Counter(converged=2)


@pytest.mark.usefixtures("memory_runs_out")
def test_a_task_killed_again_for_memory_fails_and_is_told_what_was_predicted(solve):
    outcome, reasons = solve("SIGKILL", "converges")
    assert outcome == Counter(converged=1, killed=1)
    assert "SIGKILL (out of memory? 1 GiB were predicted" in reasons[0]
    assert "as before" in reasons[0]


@pytest.mark.usefixtures("memory_runs_out")
def test_fewer_workers_go_on_where_the_kernel_says_that_memory_ran_out(solve, monkeypatch):
    at_once, running, worker, end = [], [], pool.Worker, pool.Worker.end
    monkeypatch.setattr(pool.Worker, "end", lambda one: running.pop() and end(one))
    started = lambda *how: running.append(1) or at_once.append(len(running)) or worker(*how)  # noqa: E731
    monkeypatch.setattr(pool, "Worker", started)
    outcome, _ = solve("dies once", *["converges"] * 5)
    assert outcome == Counter(converged=6)
    assert at_once[:2] == [1, 2]
    assert at_once[2:] in ([], [1])  # one goes on, a new one if it had solved the others before


LEFT = "2 tasks left to the process of the run itself"


def test_the_tasks_of_workers_that_cannot_start_are_left_to_the_run(solve):
    outcome, reasons = solve("converges", "converges", start="dies at start")
    assert outcome == Counter()
    assert reasons == {-1: f"a worker process ended with status 3 as it started; {LEFT}"}


def test_without_processes_for_this_user_the_tasks_are_left_to_the_run(solve, monkeypatch):
    def refuse(*_, **__):
        raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(pool.subprocess, "Popen", refuse)
    outcome, reasons = solve("converges", "converges")
    assert outcome == Counter()
    assert reasons[-1].endswith(f"Resource temporarily unavailable; {LEFT}")


@pytest.mark.parametrize("others", ["waits for a stop", "dies when stopped"])
def test_a_worker_that_dies_during_a_stop_does_not_keep_the_run(solve, others):
    outcome, _ = solve("SIGKILL", others, others, jobs=3, stop_at_first_failure=True)
    assert outcome == Counter()  # all are left to the next call


def test_a_signal_to_one_worker_stops_the_run(solve, stop):
    outcome, _ = solve("stops itself", "waits for a stop", "waits for a stop")
    assert outcome == Counter()
    assert stop.is_set()


def test_no_worker_is_left_behind(solve):
    solve("converges", "SIGKILL", "converges", "breaks")
    children = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
    names = [Path(f"/proc/{child}/cmdline").read_bytes() for child in children]
    assert not any(b"pipe = Connection" in name for name in names)


def test_an_ending_is_told_by_the_name_of_the_signal():
    assert ending(-signal.SIGKILL) == "was killed by SIGKILL"
    assert ending(3) == "ended with status 3"
