"""No code is taken from the working directory, which may be a shared folder of studies."""

import os
import signal
import subprocess
import sys

import pytest

NAMES = ("pickle", "struct", "numpy", "click", "json", "queue", "h5py", "gfmd_cli")


@pytest.fixture
def folder(tmp_path, springs):
    """A folder with modules that leave a mark when they are imported."""
    for name in NAMES:
        mark = tmp_path / f"{name}.mark"
        (tmp_path / f"{name}.py").write_text(f"open({str(mark)!r}, 'w')\nraise SystemExit(99)\n")
    return tmp_path


def marks(folder):
    return [path.name for path in folder.glob("*.mark")]


def test_workers_import_nothing_from_the_working_directory(folder, command):
    done = subprocess.run([*command, "run", "spec.toml", "-q", "-j", "2"], cwd=folder)
    assert done.returncode == 0
    assert marks(folder) == []


def test_the_batch_script_imports_nothing_from_the_working_directory(folder, command):
    subprocess.run([*command, "submit", "spec.toml", "--shards", "2", "--dry-run"], cwd=folder)
    submit = [*command, "submit", "spec.toml", "--shards", "1", "-o", "study.h5"]
    bin_folder = folder / "bin"
    bin_folder.mkdir()
    for name, script in (("sbatch", "echo 1"), ("squeue", "true")):
        (bin_folder / name).write_text(f"#!/bin/sh\n{script}\n")
        (bin_folder / name).chmod(0o755)
    path = f"{bin_folder}:{os.environ['PATH']}"
    subprocess.run(submit, cwd=folder, env=os.environ | {"PATH": path}, check=True)
    shard = os.environ | {"SLURM_ARRAY_TASK_ID": "0", "SLURM_ARRAY_JOB_ID": "1"}
    done = subprocess.run(["bash", "study.sbatch"], cwd=folder, env=shard)
    assert done.returncode == 0
    assert (folder / "study.h5").exists()
    assert marks(folder) == []


SIGNALLED = """
import os, signal, sys
number, module = int(sys.argv[1]), sys.argv[2]

class Finder:  # of no module: it sends the signal as one is looked for
    def find_spec(self, name, *_):
        if name == module:
            os.kill(os.getpid(), number)

sys.meta_path.insert(0, Finder())
sys.argv = ["gfmd", "export", "nowhere.h5"]
from gfmd_cli.__main__ import main
main()
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP", "SIGUSR1"])
@pytest.mark.parametrize("module", ["click", "gfmd_cli.cli.run", "h5py"])
def test_a_signal_while_modules_are_imported_ends_quietly(name, module):
    number = signal.Signals[name]
    done = subprocess.run(
        [sys.executable, "-P", "-c", SIGNALLED, str(int(number)), module],
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 128 + number
    assert done.stderr == done.stdout == ""
