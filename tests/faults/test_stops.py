"""Killed, stopped, out of time: nothing is lost, and no bit differs in the end."""

import os
import random
import select
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import Counter

import pytest

from gfmd_cli.files.locks import locked
from gfmd_cli.study.signals import signal_handlers

from .conftest import SIGNALS
from .equal import assert_same_bits

KILLS = 100
STARTS = 20
READER = """
import sys, h5py
with h5py.File(sys.argv[1], "r") as file:  # with HDF5's own lock
    print("open", flush=True)
    input()
    print(set(file["status"].asstr()[()]))
"""
LOSING = """
import signal, sys
from gfmd_cli.__main__ import main
class Finder:
    def find_spec(self, name, path, target=None):
        if name == "gfmd_cli.cli":
            try:
                signal.raise_signal(int(sys.argv[1]))
            except BaseException:
                raise ImportError("initialization failed")
sys.meta_path.insert(0, Finder())
main()
"""
"""An import that turns every exception into an ImportError, as those of compiled modules do."""
IGNORING = """
import signal, sys, types
from gfmd_cli.__main__ import main
class Command:
    def __del__(self):
        signal.raise_signal(int(sys.argv[1]))
sys.modules["gfmd_cli.cli"] = types.SimpleNamespace(main=Command)
main()
print("still alive")
"""
"""A command whose destructor receives the signal: Python ignores exceptions there."""
RUN = ("run", "spec.toml", "-j", "1", "-q", "--checkpoint-every", "1e-3", "-o")


def test_killed_at_random_moments_it_ends_bit_for_bit(folder, start, gfmd):
    assert gfmd(folder, *RUN, "warm.h5")[0] == 0
    begun = time.monotonic()
    assert gfmd(folder, *RUN, "unbroken.h5")[0] == 0
    takes = time.monotonic() - begun
    rng, met = random.Random(1), Counter()
    for _ in range(KILLS):
        child = start(folder, (*RUN, "killed.h5"))
        time.sleep(rng.uniform(0, takes))
        child.signal(signal.SIGKILL)
        ended = child.wait()
        parts = folder / "killed.parts"
        met["before"] += not parts.exists() and ended != 0
        met["during"] += ended == -signal.SIGKILL and parts.exists()
        met["after"] += ended == 0
        met["with checkpoints"] += any(parts.glob("*/pointer"))
        met["with half-written files"] += any(parts.rglob(".*"))
        met["with records"] += any(parts.glob("*.record"))
        assert gfmd(folder, *RUN, "killed.h5")[0] == 0
        assert_same_bits(folder / "killed.h5", folder / "unbroken.h5")
        assert not parts.exists()
        (folder / "killed.h5").unlink()
    print(dict(met))
    assert met["during"] > KILLS / 3
    assert met["with checkpoints"] > 5
    assert met["with records"] > 5


@pytest.mark.parametrize("name", SIGNALS)
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_signal_saves_all_and_the_same_call_goes_on(folder, start, gfmd, name, jobs):
    long = (*RUN[:3], jobs, "-q", "--set", "solver.tolerance=1e-15", "-o")
    big = ("--set", "grid.points=128", "--set", "elastomer.n=[2,3]")
    assert gfmd(folder, *long, "unbroken.h5", *big)[0] == 1  # out of reach
    child = start(folder, (*long, "stopped.h5", *big))
    while not any((folder / "stopped.parts").glob("*/lock")):
        time.sleep(0.01)
    child.signal(SIGNALS[name])
    assert child.wait() == 75, child.said
    assert "run again" in child.said
    assert any((folder / "stopped.parts").glob("*/pointer"))
    assert gfmd(folder, *long, "stopped.h5", *big)[0] == 1
    assert_same_bits(folder / "stopped.h5", folder / "unbroken.h5")


def test_a_second_interrupt_leaves_at_once(folder, start):
    child = start(folder, ("run", "spec.toml", "-j", "1", "--set", "grid.points=1024"))
    while not any((folder / "study.parts").glob("*/lock")):
        time.sleep(0.01)
    child.signal(signal.SIGINT)
    child.signal(signal.SIGINT)
    time.sleep(0.05)
    child.signal(signal.SIGINT)
    assert child.wait() in (130, 75)


def test_the_second_interrupt_ends_the_process(monkeypatch):
    ended, stop = [], threading.Event()
    monkeypatch.setattr(os, "_exit", ended.append)
    with signal_handlers(stop, may_exit=True):
        signal.raise_signal(signal.SIGINT)
        assert (stop.is_set(), ended) == (True, [])
        signal.raise_signal(signal.SIGINT)
    assert ended == [130]


@pytest.mark.parametrize("program", [LOSING, IGNORING])
@pytest.mark.parametrize("name", ["SIGTERM", "SIGINT"])
def test_a_signal_that_would_be_lost_ends_the_command_without_a_message(name, program):
    number = SIGNALS[name]
    words = [sys.executable, "-P", "-c", program, str(int(number))]
    done = subprocess.run(words, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (128 + number, "", "")


def test_a_signal_at_any_moment_of_the_start_is_a_quiet_end_or_a_saved_state(folder, command):
    words, rng, statuses = [*command, *RUN, "study.h5"], random.Random(1), Counter()
    for _ in range(STARTS):
        process = subprocess.Popen(words, cwd=folder, stderr=subprocess.PIPE, text=True)
        time.sleep(rng.uniform(0, 1))
        process.terminate()
        said = process.communicate()[1]
        statuses[process.returncode] += 1
        assert "Traceback" not in said
        assert "Exception" not in said
    print(dict(statuses))
    assert set(statuses) <= {143, -signal.SIGTERM, 75, 0}
    assert statuses[143]


@pytest.mark.parametrize("name", ["collecting", "planning"])
def test_a_run_says_that_it_waits_for_another_process_and_is_stopped(folder, command, gfmd, name):
    with locked(folder / "study.parts" / name):
        process = subprocess.Popen(
            [*command, *RUN, "study.h5"], cwd=folder, stderr=subprocess.PIPE, text=True
        )
        assert select.select([process.stderr], [], [], 30)[0]
        first = process.stderr.readline()
        assert f"waiting for 'study.parts/{name}', in use by process {os.getpid()} on " in first
        process.terminate()
        begun = time.monotonic()
        said = process.communicate()[1]
        assert time.monotonic() - begun < 5
        assert process.returncode == 75
    assert len(said.splitlines()) == 1
    assert "run again" in said
    assert gfmd(folder, *RUN, "study.h5") == (0, "")


def test_max_hours_ends_in_time_with_all_saved(folder, gfmd):
    def long(steps):
        solver = f"solver={{kind='fire', tolerance=1e-15, max_steps={steps}}}"
        settings = (solver, "grid.points=512", "elastomer.n=1")
        return (*RUN[:4], "-q", *(word for setting in settings for word in ("--set", setting)))

    gfmd(folder, *long(2), "-o", "warm.h5")
    begun = time.monotonic()
    assert gfmd(folder, *long(200), "-o", "short.h5")[0] == 1
    # Three times the limit on this machine, however fast it is.
    words = long(int(200 * 36 / (time.monotonic() - begun)))
    begun = time.monotonic()
    status, output = gfmd(folder, *words, "--max-hours", str(12 / 3600))
    assert status == 75, output
    assert time.monotonic() - begun < 12
    assert any((folder / "study.parts").glob("*/pointer"))
    while status == 75:
        status, output = gfmd(folder, *words, "--max-hours", str(12 / 3600))
    assert status == 1
    assert gfmd(folder, *words, "-o", "unbroken.h5")[0] == 1
    assert_same_bits(folder / "study.h5", folder / "unbroken.h5")


def test_a_clock_that_is_set_back_changes_nothing(folder, gfmd, start):
    def set_back():
        real, begun = time.time, time.time()
        time.time = lambda: begun - 3600 * (real() - begun)

    assert gfmd(folder, *RUN, "unbroken.h5")[0] == 0
    child = start(folder, (*RUN, "study.h5"), set_back)
    time.sleep(0.3)
    child.signal(signal.SIGTERM)
    assert child.wait() in (75, 0)
    for path in (folder / "study.parts").rglob("*"):
        os.utime(path, (4e9, 4e9))  # the year 2096
    status, output = gfmd(folder, *RUN, "study.h5", before=set_back)
    assert status == 0, output
    assert_same_bits(folder / "study.h5", folder / "unbroken.h5")


@pytest.mark.parametrize("count", [2, 8])
def test_several_writers_of_one_study_do_not_harm_each_other(folder, start, gfmd, count):
    assert gfmd(folder, *RUN, "unbroken.h5")[0] == 0
    for turn in range(4):
        shards = [("--shard", f"{i}/{count}") if turn % 2 else () for i in range(count)]
        children = [start(folder, (*RUN, "study.h5", *shard)) for shard in shards]
        assert [child.wait() for child in children] == [0] * count
        assert [child.said for child in children] == [""] * count
        assert_same_bits(folder / "study.h5", folder / "unbroken.h5")
        assert not (folder / "study.parts").exists()
        (folder / "study.h5").unlink()


def test_a_reader_never_stops_a_writer(folder, gfmd):
    assert gfmd(folder, *RUN, "study.h5", "--shard", "0/2")[0] == 0
    shutil.copy(folder / "study.h5", folder / "before.h5")
    reading = subprocess.Popen(
        [sys.executable, "-c", READER, folder / "study.h5"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert reading.stdout.readline() == "open\n"
    assert gfmd(folder, *RUN, "study.h5")[0] == 0
    assert "missing" in reading.communicate("\n")[0]  # the file that it opened
    assert gfmd(folder, "export", "study.h5")[0] == 0
