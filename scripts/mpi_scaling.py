"""Strong and weak scaling of runs under MPI: a pair of transforms, a V-cycle, a solve.

    python scripts/mpi_scaling.py       # the table of docs/mpi.md

Starts mpiexec (`pip install -e ".[mpi]"`) for each count of processes; the least of many repeats
counts, as the machine may be shared. All times are wall times on the slowest process.
"""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from gfmd_cli.grid.ranks import mpi_ranks
from gfmd_cli.grid.transposition import Transposition
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.contact_state import PRESSED
from gfmd_cli.solvers.multigrid import Multigrid
from gfmd_cli.solvers.nested_grids import solve_contact

STRONG = [(count, points) for points in (512, 1024, 2048) for count in (1, 2)]
WEAK = [(1, 512), (2, 720), (4, 1024)]
SECONDS = 4.0  # of repeats of each action, at most
REPEATS = 200


def main() -> None:
    for title, cases in (("strong", STRONG), ("weak", WEAK)):
        print(f"{title}: n = 1, p* = 0.1, tolerance 1e-6; load {os.getloadavg()[0]:.1f}")
        print(" processes points  pair [ms]  exchange  V-cycle [ms]  solve [s]  transforms")
        for count, points in cases:
            record = json.loads(_launch(count, points))
            print(
                f"{count:10d} {points:6d} {1e3 * record['pair']:10.2f} {record['share']:9.0%} "
                f"{1e3 * record['cycle']:13.2f} {record['solve']:10.3f} "
                f"{record['transforms']:11.1f}",
                flush=True,
            )


def _launch(count: int, points: int) -> str:
    launcher = [str(Path(sys.executable).with_name("mpiexec")), "-n", str(count)]
    command = [*launcher, sys.executable, __file__, "measure", str(points)]
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    return done.stdout.strip().splitlines()[-1]


def measure(points: int) -> None:
    """On each process: time the parts; the first prints them."""
    ranks = mpi_ranks()
    contact = build_scene(SelfAffine(cutoff=2.56 / points), Power(n=1), points, 1, ranks).contact(
        0.1
    )
    grid, exchange = contact.grid, [0.0]
    if not grid.whole:
        _clock_exchange(exchange)
    pair, share = least(grid, lambda: (grid.transform(), grid.transform_back()), exchange)
    state = grid.rows.empty_with_halo(points, dtype=np.int8)
    u = contact.settle(np.zeros(grid.shape))
    state[...] = 0
    grid.rows.interior(state)[...] = PRESSED * (u == contact.height)
    cycle, change = Multigrid(contact, grid), np.zeros(grid.shape, np.float32)
    sigma = contact.stress(u, out=grid.empty())
    once, _ = least(grid, lambda: cycle.apply(sigma, state, PRESSED, change), exchange)
    counts: list[float] = []

    def solve() -> None:
        solution = solve_contact(contact, Auto())
        counts.append(solution.transforms)

    whole, _ = least(grid, solve, exchange, repeats=5)
    record = {"pair": pair, "share": share, "cycle": once, "solve": whole, "transforms": counts[-1]}
    if ranks is None or ranks.rank == 0:
        print(json.dumps(record))


def _clock_exchange(spent: list[float]) -> None:
    """Add the time of every transposition to the first of `spent`."""

    def clocked(method):
        def call(self, *arrays):
            begun = time.perf_counter()
            method(self, *arrays)
            spent[0] += time.perf_counter() - begun

        return call

    for name in ("to_columns", "to_lines"):
        setattr(Transposition, name, clocked(getattr(Transposition, name)))


def least(grid, action, exchange, repeats=REPEATS) -> tuple[float, float]:
    """Least wall time of an action on the slowest process, and the share of exchange in it."""
    action()
    best, share, begun = np.inf, 0.0, time.perf_counter()
    for _ in range(repeats):
        grid.max(0.0)  # begin together
        exchange[0], start = 0.0, time.perf_counter()
        action()
        seconds = time.perf_counter() - start
        slowest = grid.max(seconds)
        if slowest < best:
            best, share = slowest, grid.max(exchange[0] / seconds)
        if grid.max(time.perf_counter() - begun) > SECONDS:
            break
    return best, share


if __name__ == "__main__":
    measure(int(sys.argv[2])) if sys.argv[1:2] == ["measure"] else main()
