"""The command in a child of this process, which has everything loaded: a start takes no time."""

import os
import signal
import subprocess
import sys
import time
import traceback
from pathlib import Path

import pytest
from click.testing import CliRunner
from specs import power_spec

from gfmd_cli.__main__ import main as entry
from gfmd_cli.cli import main

SPEC = power_spec(
    n=[1, 2],
    points=32,
    p_star=[0.1, 0.3],
    more="""\
[solver]
tolerance = 1e-8
[output]
fields = ["u"]
""",
)


def pytest_collection_modifyitems(items):
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.faults)


@pytest.fixture(scope="session", autouse=True)
def _warm(tmp_path_factory):
    """Load all that a call loads, compiled sweeps and plans too."""
    folder = tmp_path_factory.mktemp("warm")
    (folder / "spec.toml").write_text(SPEC)
    study = str(folder / "study.h5")
    for words in (
        ["run", str(folder / "spec.toml"), "-j", "1", "-q", "-o", study],
        ["export", study],
        ["analyze", study],
        ["report", study],
        ["export", study, "-o", str(folder / "study.nc")],
        ["export", study, "-o", str(folder / "study.vti"), "--task", "0"],
        ["diff", study, study],
    ):
        assert CliRunner().invoke(main, words).exit_code == 0


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "spec.toml").write_text(SPEC)
    return tmp_path


class Child:
    """One call of the command."""

    def __init__(self, folder, words, before=None):
        self.log = Path(folder).parent / f"{Path(folder).name}.{time.monotonic_ns()}.log"
        self.pid = os.fork()
        if self.pid == 0:
            self._run(folder, words, before)

    def _run(self, folder, words, before):
        status = 99
        try:
            out = os.open(self.log, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
            os.dup2(out, 1)
            os.dup2(out, 2)
            sys.stdout, sys.stderr = (os.fdopen(os.dup(1), "w"), os.fdopen(os.dup(2), "w"))
            os.chdir(folder)
            if before is not None:
                before()
            sys.argv = ["gfmd", *map(str, words)]
            entry()
        except SystemExit as end:
            status = end.code or 0
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(status)

    def signal(self, number):
        os.kill(self.pid, number)

    def wait(self):
        """Exit status, minus the signal where one ended it."""
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])

    @property
    def said(self):
        return self.log.read_text()


@pytest.fixture
def start():
    return Child


@pytest.fixture
def gfmd():
    """Calls the command and waits: (exit status, what it said)."""

    def call(folder, *words, before=None):
        child = Child(folder, words, before)
        return child.wait(), child.said

    return call


@pytest.fixture
def disk(tmp_path):
    """Mounts a small disk; `disk(size)` again changes its size, `disk("ro")` makes it read-only."""
    place = tmp_path / "disk"
    place.mkdir()

    def mount(option):
        mounted = os.path.ismount(place)
        how = f"remount,{option}" if mounted else option
        done = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", how, "tmpfs", str(place)], capture_output=True, text=True
        )
        if done.returncode:
            pytest.skip(f"no disk can be mounted: {done.stderr.strip()}")
        return place

    yield mount
    subprocess.run(["umount", "-l", str(place)], capture_output=True)


SIGNALS = {
    name: getattr(signal, name)
    for name in ("SIGTERM", "SIGINT", "SIGUSR1", "SIGUSR2", "SIGHUP", "SIGXCPU")
}
