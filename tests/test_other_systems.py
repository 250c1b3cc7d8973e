"""macOS, by a Python without what only Linux has; and the message on Windows.

`make check` also checks the types of the package with the standard library of macOS.
"""

import os
import subprocess
import sys

import numpy as np
import pytest

from gfmd_cli.study.reading import read_rows

AS_ON_MACOS = """\
import builtins, io, os

for name in ("sched_getaffinity", "sched_setaffinity", "posix_fallocate", "posix_fadvise"):
    delattr(os, name)
original = io.open

def open_outside_of_proc(file, *args, **kwargs):
    name = file if isinstance(file, int) else os.fspath(file)
    if str(name).startswith(("/proc/", "/sys/")) and name != "/proc/self/maps":  # threadpoolctl
        raise FileNotFoundError(2, "No such file or directory", str(file))
    return original(file, *args, **kwargs)

builtins.open = io.open = open_outside_of_proc
"""
SPEC = """\
surface = {{kind = "self-affine", cutoff = 0.05}}
elastomer = {{kind = "power", n = {n}}}
grid.points = 64
load.p_star = {p_star}
"""


@pytest.fixture
def gfmd(tmp_path):
    """Start a command of the program in a folder, as on macOS."""
    (tmp_path / "site").mkdir()
    (tmp_path / "site/sitecustomize.py").write_text(AS_ON_MACOS)
    path = os.pathsep.join([str(tmp_path / "site"), *filter(None, sys.path)])
    environment = os.environ | {"PYTHONPATH": path}

    def start(*words):
        command = [sys.executable, "-m", "gfmd_cli", *words]
        return subprocess.Popen(
            command, cwd=tmp_path, env=environment, text=True, stdout=-1, stderr=subprocess.STDOUT
        )

    return start


def output_of(process, status=0):
    text = process.communicate(timeout=300)[0]
    assert status in (None, process.returncode), text
    return text


def test_a_study_on_macos_is_solved_by_workers_and_read(gfmd, tmp_path):
    (tmp_path / "study.toml").write_text(SPEC.format(n=[1, 3], p_star=[0.01, 0.1]))
    assert "4 converged" in output_of(gfmd("run", "study.toml", "--jobs", "2"))
    assert "4 tasks: 4 converged" in output_of(gfmd("status", "study.h5"))
    assert "Persson" in output_of(gfmd("analyze", "study.h5"))
    output_of(gfmd("report", "study.h5", "-o", "page.html"))
    assert "</html>" in (tmp_path / "page.html").read_text(encoding="utf-8")


def test_a_study_that_is_stopped_on_macos_resumes_bit_for_bit(gfmd, tmp_path):
    """A run with no time makes one step and saves its state, without `posix_fallocate`."""
    (tmp_path / "study.toml").write_text(SPEC.format(n=1, p_star=0.1))
    run = ("run", "study.toml", "--reproducible")
    output_of(gfmd(*run, "-o", "whole.h5"))
    for _ in range(3):
        output_of(gfmd(*run, "--max-hours", "1e-9"), status=75)
        assert "step" in output_of(gfmd("status", "study.h5"), status=None)
    output_of(gfmd(*run))
    (one,), (other,) = (read_rows(tmp_path / name) for name in ("whole.h5", "study.h5"))
    for name in ("a_r", "sigma_p", "u_g", "residual", "transforms"):
        np.testing.assert_array_equal(one[name], other[name], name)


def test_windows_is_refused_with_one_message():
    code = "import sys; sys.platform = 'win32'; import gfmd_cli"
    end = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert end.returncode == 1
    assert end.stderr.splitlines()[-1].startswith("ImportError: gfmd needs Linux or macOS")
