"""Peak memory of a task, measured, against what `gfmd run --dry-run` predicts, as a table.

    python scripts/memory.py 4096       # the table of docs/reliability.md

The arguments are numbers of points per side.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
from itertools import chain
from pathlib import Path

from markdown_tables import print_head, print_row

from gfmd_cli.spec.parse import read_spec
from gfmd_cli.study.tasks import plan

SPEC = """\
[surface]
kind = "self-affine"
[elastomer]
kind = "power"
n = 1
[load]
p_star = 0.1
[solver]
max_steps = 6
"""
CASES = {
    '`solver.kind = "pcg"`': ["solver.kind=pcg"],
    "a small contact": ["surface.cutoff=0.02", "load.p_star=0.01", "solver.max_steps=100"],
    "a small contact, n = 3": [
        "elastomer.n=3",
        "surface.cutoff=0.02",
        "load.p_star=0.005",
        "solver.max_steps=100",
    ],
    "a small contact, n = 4": [
        "elastomer.n=4",
        "surface.cutoff=0.02",
        "load.p_star=0.02",
        "solver.max_steps=100",
    ],
    '`"pcg"`, n = 2': ["elastomer.n=2"],
    '`"pcg"`, n = 0.25': ["elastomer.n=0.25"],
    '`"sort"` (n = 0)': ["elastomer.n=0"],
    '`"fire"`': ["solver.kind=fire"],
    '`"ccg"`': ["solver.kind=ccg"],
    '`"polonsky-keer"`': ["solver.kind=polonsky-keer"],
    "`[accuracy]`": ["accuracy.mean_gap=0.1"],
    "a free boundary": ["grid.boundary=free"],
    "a free boundary, n = 1.5": ["grid.boundary=free", "elastomer.n=1.5"],
    "a slab": ["elastomer={kind='slab', thickness=0.05}"],
    "`load.contact_area`": ["load={contact_area=0.1}"],
    "one stored field": ["output.fields=['u']"],
    "three stored fields": ["output.fields=['u','sigma','height']"],
    "`output.stiffness`": ["output.stiffness=true"],
    "`output.spectra`": ["output.spectra=true"],
    "`output.patches`, `percolation`": ["output.patches=true", "output.percolation=true"],
    "`output.gap_distribution`, `true_contact`": [
        "output.gap_distribution=true",
        "output.true_contact=true",
    ],
}
RATIO = 0.9  # predicted over measured, from which a row is marked


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("points", type=int, nargs="*", help="default: 1024 2048 4096")
    points = parser.parse_args().points or [1024, 2048, 4096]
    heads = ((f"{n}²: measured [MiB]", "predicted", "ratio") for n in points)
    print_head("", *chain.from_iterable(heads))
    for name, overrides in CASES.items():
        print_row(name, *chain.from_iterable(cells(overrides, n) for n in points))


def cells(overrides: list[str], points: int) -> tuple[str, str, str]:
    """Measured and predicted memory of one case on one grid, and their ratio."""
    with tempfile.TemporaryDirectory() as folder:
        spec = Path(folder) / "spec.toml"
        spec.write_text(SPEC)
        every = [f"grid.points={points}", *overrides]
        predicted = plan(read_spec(spec, every)[0])[0].bytes
        command = [sys.executable, __file__, "measure", str(spec), *every]
        done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=folder)
    measured = 1024.0 * int(done.stdout)
    ratio = predicted / measured
    mark = "" if ratio >= RATIO else " low"
    return f"{measured / 2**20:.0f}", f"{predicted / 2**20:.0f}", f"{ratio:.2f}{mark}"


def measure(spec: str, *overrides: str) -> None:
    """In a process of its own: run the spec, print the largest resident size in KiB."""
    command = [sys.executable, "-P", "-m", "gfmd_cli", "run", spec, "-o", "s.h5", "-q", "-j", "1"]
    command += [word for override in overrides for word in ("--set", override)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    if done.returncode not in (0, 1):  # 1: six steps do not converge
        sys.exit(done.stderr)
    print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)


if __name__ == "__main__":
    measure(*sys.argv[2:]) if sys.argv[1:2] == ["measure"] else main()
