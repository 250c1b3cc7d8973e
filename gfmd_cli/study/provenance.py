"""Where and with what a study was made."""

import json
import os
import platform
import subprocess
from contextlib import suppress
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import gfmd_cli
from gfmd_cli.files.checksums import digest
from gfmd_cli.grid.plans import plans, processor
from gfmd_cli.spec.models import Spec
from gfmd_cli.study.resources import own_cores

PACKAGES = ("numpy", "scipy", "pyFFTW", "h5py", "pydantic", "SurfaceTopography")


def origin(spec: Spec, text: str) -> dict[str, str]:
    """Attributes of a file: the spec that it was made from, and software, machine and date."""
    resolved = spec.resolved()
    return {
        "Conventions": "CF-1.11",
        "title": spec.study.name,
        "spec": json.dumps(resolved),
        "spec_digest": digest(resolved),
        "spec_text": text,
        "software": "gfmd",
        "software_version": gfmd_cli.__version__,
        "git_commit": git_commit(),
        "packages": json.dumps({name: _version(name) for name in PACKAGES}),
        "machine": json.dumps(
            {
                "node": platform.node(),
                "system": platform.platform(),
                "processor": processor(),
                "plans": plans(),
                "cores": len(own_cores()),
                "python": platform.python_version(),
                "slurm_job": os.environ.get("SLURM_JOB_ID", ""),
            }
        ),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
    }


@cache
def git_commit() -> str:
    """The commit of the source tree this package runs from, empty outside of one."""
    source = Path(gfmd_cli.__file__).resolve().parents[1]
    if not (source / ".git").exists():
        return ""
    with suppress(OSError, subprocess.SubprocessError):
        command = ["git", "-C", str(source), "describe", "--always", "--dirty", "--abbrev=40"]
        completed = subprocess.run(command, capture_output=True, text=True, timeout=5, check=True)
        return completed.stdout.strip()
    return ""


def gfmd_version() -> str:
    """The version of this program, and its Git commit where that is known."""
    return f"{gfmd_cli.__version__} {git_commit()}".strip()


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""
