"""Processor seconds of a solve with single measures and without them.

python scripts/economy.py --points 1024     # the table of docs/performance.md
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from timing import least

from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.elastomers import HalfSpace, Power
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.indenters import LineParabola
from gfmd_cli.physics.observables import observe, stress_histogram
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import solve_contact
from gfmd_cli.solvers.pcg import ProjectedCG
from gfmd_cli.solvers.sort import Sort

REPEATS = 3  # the least counts


def solved(contact: Contact, solver=Auto, **keys):
    """Seconds of a solve, and what was measured on it."""
    solution = solve_contact(contact, solver(**keys))
    seconds = least(lambda: solve_contact(contact, solver(**keys)), REPEATS)
    return seconds, observe(contact, solution.u, solution.sigma), solution


def show(measure, slow, fast, change=None):
    end = "" if change is None else f"  {change:.0e}"
    print(f"{measure:58} {slow:9.3f} {fast:9.3f} {slow / fast:8.1f}{end}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--points", type=int, default=1024)
    points = parser.parse_args().points
    print(f"{points}^2, p* = 0.1{'':42} without s    with s    ratio  |change of u_g|, relative")

    springs = build_scene(SelfAffine(), Power(n=0), points).contact(0.1)
    slow, a, _ = solved(springs, ProjectedCG, tolerance=1e-6)
    fast, b, _ = solved(springs, Sort)
    show("n = 0: one root instead of iterations", slow, fast, abs(a.u_g / b.u_g - 1))

    line = build_scene(LineParabola(radius=1.0), HalfSpace(), points)
    p_star = 0.5 / line.delta_sigma
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "line.npy"
        np.save(path, np.tile(line.height * line.h_std, (points, 1)))
        plane = build_scene(FileSurface(path=path), HalfSpace(), points)
        slow, a, _ = solved(plane.contact(0.5 / plane.delta_sigma), tolerance=1e-6)
    fast, b, _ = solved(line.contact(p_star), tolerance=1e-6)
    show("a line contact on a line", slow, fast, abs(a.u_g / b.u_g - 1))

    half_space = build_scene(SelfAffine(), Power(n=1), points).contact(0.1)
    slow, a, _ = solved(half_space, tolerance=1e-4, nested=False)
    fast, b, _ = solved(half_space, tolerance=1e-4)
    show("coarse grids first, n = 1", slow, fast, abs(a.u_g / b.u_g - 1))
    plate = build_scene(SelfAffine(), Power(n=3), points).contact(0.1)
    slow, a, _ = solved(plate, tolerance=1e-4, nested=False)
    fast, b, _ = solved(plate, tolerance=1e-4)
    show("coarse grids first, n = 3", slow, fast, abs(a.u_g / b.u_g - 1))

    slow, _, _ = solved(replace(half_space, pressure=3.0), tolerance=1e-6)
    fast, _, _ = solved(replace(half_space, pressure=30.0), tolerance=1e-6)
    show("full contact recognised at once (against p* = 3)", slow, fast)

    solve, _, solution = solved(half_space, tolerance=1e-4)
    extra = least(lambda: stress_histogram(half_space, solution.u, solution.sigma), REPEATS)
    show("no histogram", solve + extra, solve)


if __name__ == "__main__":
    main()
