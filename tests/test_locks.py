import errno
import fcntl
import json
import multiprocessing
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import ExitStack
from itertools import count
from pathlib import Path
from threading import Event, Timer
from types import SimpleNamespace

import pytest

from gfmd_cli.errors import Interrupted, SpaceError
from gfmd_cli.files import locks
from gfmd_cli.files.locks import WaitOptions, locked
from gfmd_cli.study.reading import read_rows
from gfmd_cli.study.store import Study

HOLD = """
import sys
from pathlib import Path
from gfmd_cli.files import locks
if sys.argv[2] == "plain":
    def refuse(*_):
        raise OSError(37, "No locks available")
    locks.fcntl.flock = refuse
with locks.locked(Path(sys.argv[1]), shared=sys.argv[3] == "shared"):
    print("held", flush=True)
    input()
"""


@pytest.fixture
def lock(tmp_path):
    return tmp_path / "folder" / "lock"


@pytest.fixture(params=["kernel", "plain"])
def kind(request, monkeypatch):
    """Locks of the kernel, and of a file system that has none."""
    if request.param == "plain":
        without_locks(monkeypatch)
    return request.param


def without_locks(monkeypatch, number=errno.ENOLCK):
    def refuse(*_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(locks.fcntl, "flock", refuse)


@pytest.fixture
def holder(lock):
    """Another process that holds the lock."""
    started = []

    def hold(kind, how):
        process = subprocess.Popen(
            [sys.executable, "-P", "-c", HOLD, lock, kind, how],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        started.append(process)
        assert process.stdout.readline() == "held\n"
        return process

    yield hold
    for process in started:
        process.kill()
        process.communicate()


def test_a_second_process_does_not_get_a_lock_until_it_is_left(lock, kind, holder):
    process = holder(kind, "exclusive")
    with locked(lock, wait=False) as acquired:
        assert not acquired
    process.communicate("\n")
    with locked(lock, wait=False) as acquired:
        assert acquired


def test_a_forked_process_does_not_keep_a_lock(lock):
    with locked(lock):
        child = multiprocessing.get_context("fork").Process(target=time.sleep, args=(60,))
        child.start()
    try:
        with locked(lock, wait=False) as is_held:
            assert is_held
    finally:
        child.kill()
        child.join()


def test_the_lock_of_a_killed_process_is_free(lock, kind, holder):
    process = holder(kind, "exclusive")
    process.send_signal(signal.SIGKILL)
    process.wait()
    with locked(lock) as acquired:
        assert acquired


def test_a_long_wait_is_announced_once_with_its_owner_and_ends_with_the_run(
    lock, kind, holder, monkeypatch, caplog
):
    monkeypatch.setattr(locks, "LONG_SECONDS", 0.05)
    process, stop = holder(kind, "exclusive"), Event()
    owner = f"process {process.pid} on {socket.gethostname()}"
    Timer(0.5, stop.set).start()
    with (
        pytest.raises(Interrupted, match=f"in use by {owner}; run again"),
        locked(lock, wait_options=WaitOptions(stop)),
    ):
        pass
    (message,) = caplog.messages
    assert message.startswith("gfmd: waiting for")
    assert message.endswith(f", in use by {owner}")


def test_a_wait_ends_with_the_time_of_the_run(lock, kind, holder, monkeypatch):
    monkeypatch.setattr(locks, "LONG_SECONDS", 0.05)
    holder(kind, "exclusive")
    wait_options = WaitOptions(Event(), until=time.monotonic() + 0.3)
    with pytest.raises(Interrupted, match="run again"), locked(lock, wait_options=wait_options):
        pass


@pytest.mark.usefixtures("springs", "small_plans_measured")
@pytest.mark.parametrize("name", ["collecting", "planning"])
def test_a_run_with_a_time_limit_does_not_wait_longer_for_another(
    tmp_path, monkeypatch, invoke, name
):
    monkeypatch.setattr(locks, "LONG_SECONDS", 0.05)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "springs.parts").mkdir()
    limit = ("-o", "springs.h5", "--max-hours", 1e-4)
    with locked(tmp_path / "springs.parts" / name):
        done = invoke("run", "spec.toml", "-j", "1", "-q", *limit)
    assert done.exit_code == 75
    assert f"{name} is in use by" in done.output


@pytest.mark.usefixtures("springs")
@pytest.mark.parametrize(
    ("collected", "words", "status"),
    [(True, (), 0), (False, ("--shard", "0/2"), 0), (False, (), 75)],
)
def test_a_run_that_is_stopped_as_another_one_collects_ends_by_what_it_has_left_to_do(
    tmp_path, monkeypatch, invoke, collected, words, status
):
    """After its own collection nothing is left, and a shard leaves its records to others."""
    monkeypatch.setattr(locks, "LONG_SECONDS", 0.05)
    monkeypatch.chdir(tmp_path)
    collect = Study.collect
    with ExitStack() as other:

        def stopped(study, *rest):
            damaged = collect(study, *rest) if collected else []
            other.enter_context(locked(study.parts / "collecting"))
            signal.raise_signal(signal.SIGTERM)
            return damaged if collected else collect(study, *rest)

        monkeypatch.setattr(Study, "collect", stopped)
        done = invoke("run", "spec.toml", "-o", "springs.h5", "-j", "1", *words)
    assert done.exit_code == status, done.output
    monkeypatch.setattr(Study, "collect", collect)
    again = invoke("run", "spec.toml", "-o", "springs.h5", "-j", "1")
    assert again.exit_code == 0
    assert [row["status"] for row in read_rows(tmp_path / "springs.h5")] == ["converged"] * 2
    assert not (tmp_path / "springs.parts").exists()


def test_a_wait_for_another_worker_of_the_run_is_not_announced(lock, holder, monkeypatch, caplog):
    monkeypatch.setattr(locks, "LONG_SECONDS", 0.05)
    holder("kernel", "exclusive")
    stop = Event()
    Timer(0.3, stop.set).start()
    with (
        pytest.raises(Interrupted),
        locked(lock, wait_options=WaitOptions(stop, run_pid=os.getpid())),
    ):
        pass
    assert not caplog.messages


def test_a_wait_for_another_process_after_a_worker_of_the_run_is_announced(
    lock, monkeypatch, caplog
):
    monkeypatch.setattr(locks, "LONG_SECONDS", -1.0)
    monkeypatch.setattr(locks, "_parent", {1: 42, 2: 7}.get)
    waiting = locks._Wait(lock, WaitOptions(run_pid=42))
    for pid in (1, 2, 2):
        waiting.pause(lambda pid=pid: locks._Owner("here", pid))
    (message,) = caplog.messages
    assert "in use by process 2 on here" in message


def test_shared_locks_of_the_kernel_are_held_side_by_side(lock, holder):
    holder("kernel", "shared")
    with locked(lock, shared=True) as acquired:
        assert acquired


def test_without_locks_a_second_process_is_refused_by_name(lock, holder, monkeypatch):
    process = holder("plain", "shared")
    without_locks(monkeypatch)
    with (
        pytest.raises(SpaceError, match=f"process {process.pid} on {socket.gethostname()}"),
        locked(lock, shared=True),
    ):
        pass


def test_a_lock_of_another_machine_is_never_taken(lock, monkeypatch):
    without_locks(monkeypatch)
    lock.parent.mkdir()
    owner = {"host": "elsewhere", "pid": 1, "started": ""}
    lock.with_name("lock.owner").write_text(json.dumps(owner))
    with locked(lock, wait=False) as acquired:
        assert not acquired
    assert lock.with_name("lock.owner").exists()


def test_a_process_with_the_number_of_a_dead_one_is_told_by_its_start(lock, monkeypatch):
    without_locks(monkeypatch)
    lock.parent.mkdir()
    owner = {"host": socket.gethostname(), "pid": os.getpid(), "started": "earlier"}
    lock.with_name("lock.owner").write_text(json.dumps(owner))
    with locked(lock, wait=False) as acquired:
        assert acquired


@pytest.mark.usefixtures("springs", "small_plans_measured")
@pytest.mark.parametrize("number", sorted(locks.NO_LOCKS))
def test_a_run_without_locks_is_complete_and_leaves_no_files(tmp_path, monkeypatch, invoke, number):
    without_locks(monkeypatch, number)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    done = invoke("run", "spec.toml", "-j", "1", "-o", "study.h5")
    assert done.exit_code == 0, done.output
    assert [row["status"] for row in read_rows(Path("study.h5"))] == ["converged"] * 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cache", "spec.toml", "study.h5"]
    assert not list(tmp_path.rglob("*.owner"))


@pytest.mark.parametrize("place", ["/proc/x/lock", "/dev/null/lock", "/sys/x/lock"])
def test_a_place_where_nothing_can_be_made_is_refused_soon(place):
    begun = time.monotonic()
    with pytest.raises(SpaceError, match="cannot be written"), locked(Path(place)):
        pass
    assert time.monotonic() - begun < 5


def test_a_working_directory_that_is_gone_is_refused_soon(tmp_path, monkeypatch):
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    with pytest.raises(SpaceError, match="cannot be written"), locked(Path("a/lock")):
        pass


@pytest.mark.parametrize("what", ["link", "directory", "pipe", "socket"])
def test_what_is_no_regular_file_is_no_lock(lock, what, tmp_path):
    lock.parent.mkdir()
    if what == "link":
        lock.symlink_to(tmp_path / "elsewhere")
    elif what == "directory":
        lock.mkdir()
    elif what == "pipe":
        os.mkfifo(lock)
    else:
        with socket.socket(socket.AF_UNIX) as listening:
            listening.bind(str(lock))
    with pytest.raises(SpaceError, match="cannot be written"), locked(lock):
        pass
    assert not (tmp_path / "elsewhere").exists()


def test_a_file_system_that_asks_for_both_ways_of_access_gets_them(lock, monkeypatch):
    real = fcntl.flock

    def flock(file, how):  # as NFS: LOCK_SH needs a file to read, LOCK_EX one to write
        assert fcntl.fcntl(file, fcntl.F_GETFL) & os.O_ACCMODE == os.O_RDWR
        real(file, how)

    monkeypatch.setattr(locks.fcntl, "flock", flock)
    for shared in (True, False):
        with locked(lock, shared=shared) as acquired:
            assert acquired


NO_OWNER = {
    "nothing": lambda path: path.touch(),
    "other text": lambda path: path.write_text('{"host": 1}'),
    "a pipe": os.mkfifo,
    "a device": lambda path: path.symlink_to("/dev/zero"),
    "a directory": Path.mkdir,
}


@pytest.mark.parametrize("what", NO_OWNER)
@pytest.mark.parametrize("shared", [True, False])
def test_without_locks_a_file_that_names_no_owner_is_refused(lock, monkeypatch, what, shared):
    without_locks(monkeypatch)
    monkeypatch.setattr(locks, "UNREADABLE_SECONDS", 0.05)
    lock.parent.mkdir()
    NO_OWNER[what](lock.with_name("lock.owner"))
    with (
        pytest.raises(SpaceError, match=r"lock\.owner: not a lock file"),
        locked(lock, shared=shared),
    ):
        pass
    assert os.path.lexists(lock.with_name("lock.owner"))


def test_without_locks_a_full_disk_leaves_no_lock(lock, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    without_locks(monkeypatch)
    with monkeypatch.context() as broken:
        broken.setattr(locks.json, "dump", full)
        with pytest.raises(SpaceError, match="No space left"), locked(lock):
            pass
    with locked(lock) as acquired:
        assert acquired


def owned_elsewhere(lock):
    """A plain lock of a process on another machine, which may be dead."""
    lock.parent.mkdir()
    owner = {"host": "elsewhere", "pid": 7, "started": ""}
    lock.with_name(f"{lock.name}.owner").write_text(json.dumps(owner))


def test_without_locks_nobody_waits_for_ever(lock, monkeypatch):
    without_locks(monkeypatch)
    monkeypatch.setattr(locks, "OWNED_SECONDS", 0.05)
    owned_elsewhere(lock)
    with pytest.raises(SpaceError, match="process 7 on elsewhere"), locked(lock):
        pass


def test_without_locks_an_owner_that_leaves_after_long_is_no_damaged_lock(lock, monkeypatch):
    without_locks(monkeypatch)
    owned_elsewhere(lock)
    seconds, looks, owner = count(), [], locks._owner

    def leave_at_the_tenth(path):
        looks.append(path)
        if len(looks) == 10:  # between the attempt to take the lock and the look at its owner
            path.unlink()
        return owner(path)

    monkeypatch.setattr(locks, "_owner", leave_at_the_tenth)
    monkeypatch.setattr(locks, "time", SimpleNamespace(monotonic=seconds.__next__, sleep=id))
    with locked(lock) as acquired:
        assert acquired


@pytest.mark.usefixtures("springs", "small_plans_measured")
def test_a_lock_of_the_cache_that_nobody_frees_is_waited_for_once(tmp_path, monkeypatch, invoke):
    without_locks(monkeypatch)
    waits, sleep = [], time.sleep
    monkeypatch.setattr(locks, "OWNED_SECONDS", 0.05)
    monkeypatch.setattr(
        locks.time, "sleep", lambda seconds: (waits.append(seconds), sleep(seconds))
    )
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cache").mkdir()
    owned_elsewhere(tmp_path / "cache" / "gfmd" / "planning")
    many = ("--set", "elastomer.n=1", "--set", "grid.points=96")
    assert invoke("run", "spec.toml", "-j", "1", "-q", *many).exit_code == 0
    assert 0 < sum(waits) < 0.2
