"""Start programs on several processes, with the mpiexec that lies beside this Python."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAMS = Path(__file__).parent / "programs"


@pytest.fixture(scope="session")
def mpiexec():
    """Runs a program of this folder, or `gfmd`, on so many processes, with `more` variables."""
    pytest.importorskip("mpi4py", reason='needs pip install ".[mpi]"')
    beside = Path(sys.executable).with_name("mpiexec")
    launcher = str(beside) if beside.exists() else shutil.which("mpiexec")
    if launcher is None:
        pytest.skip("no mpiexec")
    once = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")
    environment = os.environ | dict.fromkeys(once, "1") | {"UCX_LOG_LEVEL": "error"}

    def run(count, program, *arguments, cwd=None, status=0, **more):
        script = [str(PROGRAMS / program)] if program.endswith(".py") else ["-P", "-m", program]
        command = [launcher, "-n", str(count), sys.executable, "-W", "error", *script]
        done = subprocess.run(
            [*command, *map(str, arguments)],
            cwd=cwd,
            env=environment | more,
            capture_output=True,
            text=True,
            timeout=300,
        )
        assert done.returncode == status, done.stdout + done.stderr
        return done

    return run
