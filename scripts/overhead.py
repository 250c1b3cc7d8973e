"""Time of a solve against the time of its transforms alone, one thread, processor seconds."""

import sys
import time

from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.contact import build_scene
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import solve_contact

REPEATS = 3  # the least counts


def least(action) -> float:
    """Processor seconds of the fastest of some calls."""
    seconds = []
    for _ in range(REPEATS):
        begun = time.process_time()
        action()
        seconds.append(time.process_time() - begun)
    return min(seconds)


def main(points: int = 2048) -> None:
    grid = Grid(points)
    grid.padded[...] = 0.0
    pair = least(lambda: (grid.transform(), grid.transform_back()))
    print(f"{points}^2, p* = 0.1, tolerance 1e-4; one pair of transforms {1e3 * pair:.1f} ms")
    print("   n   pairs  transforms alone    solve  ratio")
    for n in (0.5, 1.0, 2.0, 3.0):
        contact = build_scene(SelfAffine(), Power(n=n), points).contact(0.1)
        solver, found = Auto(tolerance=1e-4), []

        def solve(contact=contact, solver=solver, found=found):
            found.append(solve_contact(contact, solver))

        seconds, pairs = least(solve), found[-1].transforms / 2
        alone = pairs * pair
        print(f"{n:4g} {pairs:7.0f} {alone:15.2f} s {seconds:6.2f} s  {seconds / alone:.2f}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]))
