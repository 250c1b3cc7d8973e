"""Build the package and try it where the checkout is not: an empty environment, another folder.

`make wheel` calls it. Prints how long each step takes. The distributions are left in dist/.
"""

import os
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[1]


def call(*words: object, where: Path) -> str:
    """Run a command, tell what it took, return what it printed."""
    begin = time.monotonic()
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV")}
    done = subprocess.run(
        [str(word) for word in words], cwd=where, env=environment, capture_output=True, text=True
    )
    shown = " ".join(Path(str(word)).name if "/" in str(word) else str(word) for word in words)
    print(f"{time.monotonic() - begin:6.1f} s  {shown}", flush=True)
    if done.returncode:
        sys.exit(f"{done.stdout}{done.stderr}\nstatus {done.returncode}")
    return done.stdout


def main() -> None:
    """Build, check, install, use."""
    shutil.rmtree(ROOT / "dist", ignore_errors=True)
    call(sys.executable, "-m", "build", "--outdir", ROOT / "dist", ROOT, where=ROOT)
    (wheel,), (archive,) = ((ROOT / "dist").glob(f"*.{end}") for end in ("whl", "tar.gz"))
    call(sys.executable, "-m", "twine", "check", "--strict", *(ROOT / "dist").iterdir(), where=ROOT)
    names = zipfile.ZipFile(wheel).namelist()
    files = (path for path in (ROOT / "gfmd_cli").rglob("*") if path.is_file())
    package = {str(path.relative_to(ROOT)) for path in files if path.parent.name != "__pycache__"}
    assert package <= set(names), f"{wheel.name} lacks {package - set(names)}"
    assert all(name.startswith("gfmd_cli") for name in names), "more than the package"
    with tarfile.open(archive) as source:
        assert not any("/tests/" in name for name in source.getnames()), "tests without their data"
    with tempfile.TemporaryDirectory() as folder:
        there = Path(folder)
        call(sys.executable, "-m", "venv", there / "venv", where=there)
        binaries = there / "venv" / "bin"
        quiet = ("--quiet", "--disable-pip-version-check")
        call(binaries / "pip", "install", *quiet, f"{wheel}[plot]", where=there)
        gfmd = binaries / "gfmd"
        version = call(gfmd, "--version", where=there)
        assert wheel.name.split("-")[1] in version, version
        call(gfmd, "init", where=there)
        done = call(gfmd, "run", "study.toml", "--set", "grid.points=128", where=there)
        assert "12 converged" in done, done
        output = call(gfmd, "analyze", "study.h5", "--figures", "figures", where=there)
        assert "Persson" in output, output
        assert (there / "figures" / "contact_area.png").exists()
        call(gfmd, "report", "study.h5", where=there)
        assert "Persson" in (there / "study.html").read_text("utf-8")


if __name__ == "__main__":
    main()
