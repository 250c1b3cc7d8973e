"""A run whose parent or workers are killed, at any moment: it ends, and its numbers stay."""

import gc
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path

import pytest

from gfmd_cli.study import pool
from gfmd_cli.study.worker import serve

from .equal import assert_same_bits

COUNT = int(os.environ.get("GFMD_KILLS", "16"))  # `make test-kills` takes 500
PART = 50  # runs of one test
SECONDS = 600  # after which a run is taken to hang; on an idle machine it takes one or two
RUN = ("run", "spec.toml", "-q", "--checkpoint-every", "1e-3", "-o")
BIG = ("--set", "grid.points=64", "--set", "load.p_star=[0.03, 0.3]")
STOPS = ("SIGTERM", "SIGINT", "SIGHUP", "SIGUSR1", "SIGUSR2", "SIGXCPU")
WAYS = (
    "a worker is killed",
    "all workers are killed",
    "the parent is killed",
    "the parent is stopped, then a worker is killed",
    "the parent is stopped, then all workers are killed",
    "a worker is killed, then the parent is stopped",
    "a worker gets the signal",
    "all processes get the signal",
)


FRESH_SHARE = 0.1  # of the runs start their workers as processes of their own


class Forked:
    """A worker forked from the run, which has loaded everything already.

    A fresh worker imports for a second and solves for a tenth of it, so that most kills would meet
    an import.
    """

    def __init__(self, command, stdin, pass_fds):
        self.status = None
        self.pid = os.fork()
        if self.pid == 0:
            with suppress(BaseException):
                self.serve(*pass_fds)
            os._exit(1)

    @staticmethod
    def serve(number):
        """What a fresh worker does after its start."""
        gc.freeze()  # nothing of the run is finalised here
        for stop in (*STOPS, "SIGALRM"):
            signal.signal(getattr(signal, stop), signal.SIG_DFL)
        os.closerange(3, number)
        os.closerange(number + 1, 1024)
        pipe = Connection(number)
        sys.path[:] = pipe.recv()
        serve(pipe)

    def wait(self, timeout=None):
        """As that of a process of `subprocess`."""
        end = time.monotonic() + (timeout or SECONDS)
        while self.status is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                self.status = os.waitstatus_to_exitcode(status)
            elif time.monotonic() > end:
                raise subprocess.TimeoutExpired("worker", timeout)
            else:
                time.sleep(0.002)
        return self.status

    def kill(self):
        """Kill it, unless it has ended."""
        if self.status is None:
            os.kill(self.pid, signal.SIGKILL)


def children(pid):
    """The worker processes of a run."""
    try:
        return [int(c) for c in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []


def kill(pids, number=signal.SIGKILL):
    """Signal processes, those that have just ended excepted."""
    for pid in pids:
        with suppress(ProcessLookupError):
            os.kill(pid, number)


def disturb(run, way, rng, stop):
    """Do to a run what is tried."""
    workers = children(run.pid)
    some = rng.sample(workers, min(1, len(workers)))
    pause = rng.choice([0.0, rng.uniform(0, 0.02), rng.uniform(0, 0.3)])
    if way.startswith("the parent is stopped"):
        kill([run.pid], stop)
        time.sleep(pause)
        kill(workers if "all" in way else some)
    elif way == "the parent is killed":
        kill([run.pid])
    elif way == "a worker gets the signal":
        kill(some, stop)
    elif way == "all processes get the signal":
        kill([*workers, run.pid], stop)
    else:
        kill(workers if "all" in way else some)
        if "stopped" in way:
            time.sleep(pause)
            kill([run.pid], stop)


@pytest.fixture
def call(folder, start):
    """Starts a run; one that hangs is ended by an alarm, which is no status of a run."""

    def call(name, jobs, fresh=False):
        def prepare():
            signal.alarm(SECONDS)
            if not fresh:
                pool.subprocess.Popen = Forked

        return start(folder, (*RUN, name, "-j", jobs, *BIG), prepare)

    return call


@pytest.mark.parametrize("first", range(0, COUNT, PART))
def test_a_matrix_of_kills(folder, call, first):
    assert call("warm.h5", 1).wait() == 0
    begun = time.monotonic()
    assert call("unbroken.h5", 2).wait() == 0
    takes = time.monotonic() - begun
    rng, met = random.Random(first), Counter()
    for turn in range(first, min(first + PART, COUNT)):
        way, stop = WAYS[turn % len(WAYS)], getattr(signal, rng.choice(STOPS))
        fresh = rng.random() < FRESH_SHARE
        run = call("killed.h5", 2, fresh)
        time.sleep(rng.uniform(0.0, 4.0 if fresh else 1.0) * takes)  # imports
        workers = children(run.pid)
        met[moment(folder)] += 1
        disturb(run, way, rng, stop)
        status = run.wait()
        met[f"{way}: {status}"] += 1
        assert status in allowed(way, stop), (way, stop, status, run.said)
        assert have_ended(workers), way
        again = call("killed.h5", rng.choice([1, 2]))
        assert (again.wait(), again.said) == (0, ""), way
        assert_same_bits(folder / "killed.h5", folder / "unbroken.h5")
        assert not (folder / "killed.parts").exists()
        (folder / "killed.h5").unlink()
    print("MET", dict(sorted(met.items())))


def moment(folder):
    """How far the run is."""
    if (folder / "killed.h5").exists():
        return "after the run"
    if not (folder / "killed.parts").exists():
        return "before the first file"
    records, states = (list((folder / "killed.parts").glob(f"*{end}")) for end in (".record", "/a"))
    return f"{'some' if records else 'no'} records, {'some' if states else 'no'} states"


def allowed(way, stop):
    """Exit statuses: 0 over already; 75 saved, or a worker killed; a signal met no run."""
    if way == "the parent is killed":
        return {0, -signal.SIGKILL}
    stopped = {128 + stop} if "stopped" in way or "signal" in way else set()
    return {0, 75, *stopped}


def have_ended(pids):
    """Whether these processes end, on a busy machine too: no worker outlives its run."""
    for _ in range(10 * SECONDS):
        if not any(Path(f"/proc/{pid}").exists() for pid in pids):
            return True
        time.sleep(0.1)
    return False
