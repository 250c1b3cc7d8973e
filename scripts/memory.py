"""Peak memory of a solve, measured, against what `gfmd run --dry-run` says."""

import resource
import subprocess
import sys
import tempfile
from pathlib import Path

from gfmd_cli.study.parse import read_spec
from gfmd_cli.study.tasks import plan

SPEC = """\
[surface]
kind = "self-affine"
[elastomer]
kind = "power"
n = 2
[grid]
points = {points}
[load]
p_star = 1.0
"""


def main() -> None:
    print(f"{'points':>7} {'predicted':>10} {'measured':>10}  ratio")
    for points in (512, 1024, 2048, 4096):
        with tempfile.TemporaryDirectory() as folder:
            spec = Path(folder) / "spec.toml"
            spec.write_text(SPEC.format(points=points))
            predicted = plan(read_spec(spec)[0])[0].bytes
            command = [sys.executable, __file__, "measure", str(spec)]
            done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=folder)
        measured = 1024.0 * int(done.stdout)
        print(
            f"{points:7d} {predicted / 2**20:7.0f} MiB {measured / 2**20:7.0f} MiB "
            f"{measured / predicted:6.3f}"
        )


def measure(spec: str) -> None:
    """In a process of its own: run the spec, print the largest resident size in KiB."""
    command = [sys.executable, "-m", "gfmd_cli", "run", spec, "-o", "s.h5", "-q"]
    subprocess.run(command, check=True)
    print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)


if __name__ == "__main__":
    measure(sys.argv[2]) if sys.argv[1:2] == ["measure"] else main()
