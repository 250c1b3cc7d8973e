import fcntl
import math
import os
import pty
import struct
import subprocess
import sys
import termios

import pytest
from specs import power_spec

from gfmd_cli.cli.progress import Reporter
from gfmd_cli.study.context import ProgressEvent
from gfmd_cli.study.reading import read_rows

SPEC = power_spec(
    n=[0, 1, 3], points=64, p_star="{ from = 0.01, to = 1, per_decade = 4 }", cutoff=0.05
)


def on_a_terminal(folder, *words):
    """What a command shows on a terminal, and its exit status."""
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 100, 0, 0))
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "gfmd_cli", *words], cwd=folder, stdout=theirs, stderr=theirs
    )
    os.close(theirs)
    shown = b""
    while True:
        try:
            read = os.read(ours, 65536)
        except OSError:  # EIO: the other side has ended
            break
        if not read:
            break
        shown += read
    os.close(ours)
    return process.wait(60), shown.decode()


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_run_shows_its_progress_on_a_terminal(tmp_path, jobs):
    (tmp_path / "spec.toml").write_text(SPEC)
    status, shown = on_a_terminal(tmp_path, "run", "spec.toml", "-j", jobs)
    assert status == 0, shown
    assert "Traceback" not in shown
    assert "tasks left" in shown
    assert "next: gfmd analyze study.h5" in shown
    assert len(read_rows(tmp_path / "study.h5")) == 27


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_output_that_is_cut_short_is_an_error(tmp_path, unbuffered):
    """A file may have at most four blocks of 512 or 1024 bytes; the schema has more."""
    command = f'ulimit -f 4; "{sys.executable}" -P -m gfmd_cli schema > schema.json'
    variables = os.environ | {"PYTHONUNBUFFERED": unbuffered}
    options = {"cwd": tmp_path, "env": variables, "capture_output": True, "text": True}
    done = subprocess.run(["sh", "-c", command], **options)
    assert done.returncode == 73
    assert done.stderr == "gfmd: standard output: cannot be written: File too large\n"


def test_a_command_runs_without_an_output(tmp_path):
    command = f'"{sys.executable}" -P -m gfmd_cli schema >&-'
    assert subprocess.run(["sh", "-c", command], cwd=tmp_path, check=False).returncode == 0


def test_a_bench_shows_its_progress_on_a_terminal(tmp_path):
    (tmp_path / "spec.toml").write_text(SPEC)
    short = ("--set", "load.p_star=0.1", "--set", "elastomer.n=1")
    status, shown = on_a_terminal(tmp_path, "bench", "spec.toml", *short)
    assert status == 0, shown
    assert "Traceback" not in shown


@pytest.mark.parametrize(("a_r", "words"), [(0.25, "3.0e-05, a_r 0.25"), (math.nan, "3.0e-05")])
def test_a_line_of_progress_has_the_area_where_it_is_known(monkeypatch, capsys, a_r, words):
    """A process that shares a grid with others has a part of the contact only."""
    monkeypatch.setattr("gfmd_cli.cli.progress.LOG_EVERY", -1.0)
    Reporter(quiet=False).show(ProgressEvent(0, "step", "task", 64, 7, 3e-5, a_r, tasks_left=1))
    assert capsys.readouterr().err.endswith(f"step 7 (64 points), residual {words}\n")
