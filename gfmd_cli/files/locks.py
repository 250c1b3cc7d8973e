"""Locks between processes: of the kernel, or plain files where the file system has no locks."""

import errno
import fcntl
import json
import logging
import os
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from math import inf
from pathlib import Path
from threading import Event
from typing import BinaryIO, NamedTuple

from gfmd_cli.errors import Interrupted, SpaceError
from gfmd_cli.files.atomic import temporary_name
from gfmd_cli.files.regular import open_regular, read_regular

NO_LOCKS = {errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL, 524}
"""What a file system without locks answers; 524 is the kernel's ENOTSUPP, of NFS and Lustre."""
ATTEMPTS = 50  # at a file whose folder is removed again and again by other processes
WAIT_SECONDS = 0.02, 0.5  # between two attempts, at first and after a long time
LONG_SECONDS = 2.0  # of waiting, after which a message says so and a signal ends the wait
MAX_BYTES = 4096  # of the text in a plain lock
UNREADABLE_SECONDS = 2.0  # that a plain lock may be without the name of its owner, who writes it
OWNED_SECONDS = 600.0  # to wait for the owner of a plain lock, who may be dead on another machine

log = logging.getLogger(__name__)


class WaitOptions(NamedTuple):
    """How a process waits for locks."""

    stop: Event | None = None
    """Once set, a process that has waited long raises Interrupted."""
    until: float = inf
    """Time of the monotonic clock after which such a process does so, too [s]."""
    run_pid: int = 0
    """Process id of the run that started this worker, 0 if this is none.

    Waiting for other workers of the run is not announced.
    """


AS_LONG_AS_NEEDED = WaitOptions()


class _Owner(NamedTuple):
    """The process that has a lock."""

    host: str
    pid: int
    started: str = ""
    """See `_start_time`."""

    def __str__(self) -> str:
        return f"process {self.pid} on {self.host}"


@contextmanager
def locked(
    path: Path,
    *,
    shared: bool = False,
    wait: bool = True,
    wait_options: WaitOptions = AS_LONG_AS_NEEDED,
) -> Iterator[bool]:
    """Hold a lock file inside the block; the kernel releases that of a process that dies.

    The holder may delete the file: a process that waited for it then locks a new one. Yields
    whether the lock was obtained, always true if `wait` is. Raises SpaceError where the file cannot
    be written, and Interrupted (see `WaitOptions`). A long wait is announced once.

    On a file system without locks, the lock is a file beside it with the name of its owner, which
    others respect. It cannot be shared: a second process is refused with a SpaceError, and so is
    one that has waited for `OWNED_SECONDS`. That of a dead process of this machine is removed; two
    that remove it at the same moment may both go on.
    """
    operation = (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB
    waiting = _Wait(path, wait_options)
    while True:
        with _opened(path) as file:
            try:
                fcntl.flock(file, operation)
            except BlockingIOError:
                if not wait:
                    yield False
                    return
                waiting.pause(partial(_holder, file.fileno()))
                continue
            except OSError as error:
                if error.errno not in NO_LOCKS:
                    raise SpaceError(f"{path}: cannot be locked: {error.strerror}") from error
                break
            if _is_at(file.fileno(), path):
                try:
                    yield True
                finally:
                    fcntl.flock(file, fcntl.LOCK_UN)  # a process forked meanwhile holds it, too
                return
    with _owned(path.with_name(f"{path.name}.owner"), shared, wait, wait_options) as acquired:
        yield acquired


class _Wait:
    """A wait for a lock, from now on."""

    def __init__(self, path: Path, wait_options: WaitOptions) -> None:
        self.path, self.wait_options = path, wait_options
        self.since, self.is_announced = time.monotonic(), False

    def pause(self, find_owner: Callable[[], _Owner | None]) -> None:
        """Sleep until the next attempt; after a long wait, find out who has the lock.

        Raises Interrupted after a long wait only: a run that is stopped still solves the tasks that
        its workers have begun, and these wait for each other.
        """
        waited = time.monotonic() - self.since
        if waited > LONG_SECONDS:
            owner = find_owner()
            by = str(owner or "another process")
            stop, until, run_pid = self.wait_options
            if (stop is not None and stop.is_set()) or time.monotonic() > until:
                raise Interrupted(f"stopped; {self.path} is in use by {by}; run again to continue")
            is_foreign = run_pid == 0 or owner is None or _parent(owner.pid) != run_pid
            if is_foreign and not self.is_announced:
                log.warning("gfmd: waiting for %r, in use by %s", str(self.path), ascii(by)[1:-1])
                self.is_announced = True
        shortest, longest = WAIT_SECONDS
        time.sleep(min(longest, max(shortest, waited / 10)))


def _holder(descriptor: int) -> _Owner | None:
    """The process of this machine that has a lock of the kernel, None where it is not known."""
    with suppress(OSError, ValueError):
        status = os.fstat(descriptor)
        major, minor = os.major(status.st_dev), os.minor(status.st_dev)
        file = f"{major:02x}:{minor:02x}:{status.st_ino}"
        for line in Path("/proc/locks").read_text(encoding="ascii").splitlines():
            words = line.split()
            if len(words) > 5 and words[1] == "FLOCK" and words[5] == file and int(words[4]) > 0:
                return _Owner(socket.gethostname(), int(words[4]))
    return None


def _opened(path: Path) -> BinaryIO:
    """A lock file, made with its folder where it is missing. Raises SpaceError.

    The folders around that are not made: a study whose folder was renamed does not begin anew.
    """
    reason: str | None = None
    for _ in range(ATTEMPTS):
        try:
            path.parent.mkdir(exist_ok=True)
            return open_regular(path, os.O_RDWR | os.O_CREAT)  # NFS needs both
        except (FileNotFoundError, FileExistsError) as error:
            # the folder was deleted just now, perhaps while mkdir was running, or cannot be made
            reason = error.strerror
            time.sleep(WAIT_SECONDS[0])
        except OSError as error:
            raise SpaceError(f"{path}: cannot be written: {error.strerror}") from error
    raise SpaceError(f"{path}: cannot be written: its folder cannot be made: {reason}")


def _is_at(descriptor: int, path: Path) -> bool:
    """Whether an open file is the one that has this name."""
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except FileNotFoundError:
        return False


@contextmanager
def _owned(path: Path, shared: bool, wait: bool, wait_options: WaitOptions) -> Iterator[bool]:
    """A lock by a plain file.

    Raises SpaceError for a shared one that another process has, for one that another process has
    for too long, and for a file that is no lock.
    """
    known, since = None, time.monotonic()
    waiting = _Wait(path, wait_options)
    while not _claim(path):
        owner, now = _owner(path), time.monotonic()
        if owner != known:  # another process, or one that writes its name just now
            known, since = owner, now
        waited = now - since
        if owner is not None and _is_dead(owner):
            _remove_stale(path, owner)
        elif not wait:
            yield False
            return
        elif owner is None and waited > UNREADABLE_SECONDS:
            raise SpaceError(f"{path}: not a lock file of gfmd; delete it")
        elif owner is not None and (shared or waited > OWNED_SECONDS):
            raise SpaceError(
                f"{path}: in use by {owner}; this file system has no locks, so that one process "
                "at a time can work here (if that process is dead, delete this file)"
            )
        else:
            waiting.pause(partial(_owner, path))
    own_record = _owner(path)
    try:
        yield True
    finally:
        if _owner(path) == own_record:  # else it was deleted, and another process has one now
            with suppress(OSError):
                path.unlink()


def _claim(path: Path) -> bool:
    """Make a lock file with this process as its owner; false where there is one."""
    pid, descriptor = os.getpid(), None
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o666)
        with os.fdopen(descriptor, "w") as file:
            json.dump(_Owner(socket.gethostname(), pid, _start_time(pid))._asdict(), file)
    except FileExistsError:
        return False
    except OSError as error:
        if descriptor is not None:  # a file without an owner is no lock
            path.unlink(missing_ok=True)
        raise SpaceError(f"{path}: cannot be written: {error.strerror}") from error
    return True


def _start_time(pid: int) -> str:
    """When a process was started, in ticks of the kernel since the boot named; "" for none."""
    with suppress(OSError, IndexError):
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        return f"{boot} {_numbers_of(pid)[19]}"
    return ""


def _parent(pid: int) -> int:
    """The parent of a process of this machine; -1 where it has ended."""
    with suppress(OSError, IndexError):
        return int(_numbers_of(pid)[1])
    return -1


def _numbers_of(pid: int) -> list[str]:
    """What the kernel says of a process, after its name. Raises OSError."""
    status = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
    return status.rpartition(")")[2].split()


def _owner(path: Path) -> _Owner | None:
    """What a lock file says of its owner; None where it is gone or not written yet."""
    with suppress(OSError, ValueError, KeyError, TypeError):
        owner = json.loads(read_regular(path, MAX_BYTES))
        return _Owner(str(owner["host"]), int(owner["pid"]), owner["started"])
    return None


def _is_dead(owner: _Owner) -> bool:
    """Whether the owner is a process of this machine that has ended; False for other machines."""
    return owner.host == socket.gethostname() and owner.started != _start_time(owner.pid)


def _remove_stale(path: Path, owner: _Owner) -> None:
    """Remove the lock of a dead process, unless another one has just done so."""
    aside = path.with_name(temporary_name(path))
    with suppress(OSError):
        path.rename(aside)
        if _owner(aside) != owner:  # it is of a process that was faster
            os.link(aside, path)
        aside.unlink()
