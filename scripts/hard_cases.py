"""Contacts that are hard to solve: the table of docs/hard_cases.md, natural residual 1e-6 for all.

    python scripts/hard_cases.py [--points 512] [--only WORDS] > table.md

Loads that leave one spot of contact or one of gap, stiff and soft elastomers, flat plateaus,
roughness down to two grid points. Columns beyond the obvious:

    identity  |2 v / (<sigma h> - p <u>) - 1|; the two differ by <sigma g>, zero at the solution
    u_g off   by how much u_g changes, relatively, once the residual is 1e-8
    floor     what rounding u to doubles does to the residual: rms change of sigma = K u + p on the
              points off the indenter as u moves by -1, 0 or 1 unit in the last place, over
              sqrt(8) (their variance is 2/3, that of rounding 1/12), over min(p*, 1); "-" for
              direct solutions, whose sigma is not computed from u

Seconds are CPU seconds of one solve, set-up of the scene not included. Of a solve that is given up
for time, pairs are those of the grid it was on.
"""

import argparse
import tempfile
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from math import pi
from pathlib import Path

import exact_solutions as reference
import numpy as np
from markdown_tables import print_head, print_row

from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.elastomers import Elastomer, Power, Slab, Tabulated
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.indenters import LineParabola, Parabola, Punch
from gfmd_cli.physics.observables import Observables, observe
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.physics.surfaces import Surface
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import Solution, solve_contact

TOLERANCE = 1e-6  # the default of [solver]
TIGHTER = 1e-8  # a hundredth of it; no number where rounding or time does not allow it
TINY = 1e-300  # a gap that is no gap
EXPONENTS = (0.0, 0.5, 1.0, 2.0, 3.0, 4.0)
THIN = 1e-4 / (2 * pi)  # thickness of a slab whose longest wave has q t = 1e-4
DECADES = 20
HEAD = [
    "case",
    "grid",
    "n",
    "p*",
    "status",
    "residual",
    "pairs",
    "s",
    "a_r",
    "u_g",
    "identity",
    "u_g off",
    "floor",
]


@dataclass(frozen=True)
class Case:
    """One contact; `p_star` in units of what just closes the last gap where `of_full`."""

    name: str
    surface: Surface
    elastomer: Elastomer
    p_star: float
    of_full: bool = False
    stiffness: str = ""
    """What stands in the column n; by default the exponent."""
    finer: int = 1
    """Factor on the points of a side."""

    def __str__(self) -> str:
        share = " p_full" if self.of_full else ""
        finer = f", {self.finer} times finer" if self.finer > 1 else ""
        return f"{self.name}, n={self.exponent}, p*={self.p_star:g}{share}{finer}"

    @property
    def exponent(self) -> str:
        return self.stiffness or f"{self.elastomer.n:g}"

    def contact(self, points: int) -> Contact:
        scene = build_scene(self.surface, self.elastomer, points * self.finer)
        if not self.of_full:
            return scene.contact(self.p_star)
        contact = scene.contact(1.0)
        return scene.contact(self.p_star * full_contact_pressure(contact))


def full_contact_pressure(contact: Contact) -> float:
    """max(-K h), where the last gap closes."""
    return -float(contact.apply_stiffness(contact.height, contact.grid.empty()).min())


def cases(points: int, folder: Path) -> Iterator[Case]:
    """All cases; files they read are those that `write_inputs` leaves in `folder`."""
    rough = SelfAffine(cutoff=2.56 / points)  # on 512 points the default, 0.005
    for n in (3.0, 4.0):
        yield Case("small load", rough, Power(n=n), 1e-3)
    for n in EXPONENTS[1:]:
        yield Case("one patch or a few", rough, Power(n=n), 1e-5)
    for n in (1.0, 4.0):
        yield Case("a single point", rough, Power(n=n), 1e-9)
    for n in EXPONENTS:
        yield Case("high load", rough, Power(n=n), 6.0)
    for n in EXPONENTS:
        yield Case("last gap", rough, Power(n=n), 0.99, of_full=True)
    for hurst in (0.1, 1.0):
        for n in (1.0, 3.0):
            surface = SelfAffine(hurst=hurst, cutoff=2.56 / points)
            yield Case(f"H = {hurst:g}", surface, Power(n=n), 0.05)
    for n in (1.0, 3.0):
        yield Case("lambda_s = 2 dx", SelfAffine(cutoff=2 / points), Power(n=n), 0.05)
    for share in (0.9, 0.1, 0.01, 0.001):
        yield Case("thin slab", rough, Slab(thickness=THIN), share, True, "q t > 1e-4")
    clipped = FileSurface(path=folder / f"plateaus-{points}.npy")
    for n in (1.0, 3.0):
        for p_star in (1e-3, 0.05):
            yield Case("plateaus", clipped, Power(n=n), p_star)
    for n in EXPONENTS[1:]:
        yield Case("punch", Punch(), Power(n=n), 0.05)
    for n in (3.0, 3.5):
        for p_star in (1e-3, 0.05):
            yield Case("paraboloid", Parabola(), Power(n=n), p_star)
    ridge, beam = LineParabola(), Power(n=4.0)
    for finer in (1, 2, 4):
        scene = build_scene(ridge, beam, points * finer)
        for share in (3.0, 30.0, 300.0):  # of the load up to which the crest alone is touched
            p = share * float(reference.beam_line_pressure(1.0, 1.0, 1.0))
            yield Case("line parabola", ridge, beam, p / scene.delta_sigma, finer=finer)
    for table in TABLES:
        elastomer = Tabulated(path=folder / f"{table}.txt")
        for p_star in (1e-3, 0.05):
            yield Case(table.replace("-", " "), rough, elastomer, p_star, stiffness="table")


def coated(m):
    """From n = 1 at long waves to n = 3 at short ones and back to n = 1."""
    return m * (1 + (m / 4) ** 2) / (1 + (m / 40) ** 2)


def soft_band(m):
    """n = 1 with a band of waves that are a thousand times softer: k falls and rises again."""
    return m * 10.0 ** (-3 * np.exp(-2 * np.log(m / 10) ** 2))


def steep(m):
    """20 decades of stiffness, evenly over the waves of the grid: n = 8 at 512^2."""
    return 10.0 ** (DECADES * np.log(m) / np.log(m[-1]))


def cliff(m):
    """20 decades of stiffness between L / 8 and L / 16, n = 1 before and after."""
    return m * 10.0 ** (DECADES * np.clip(np.log2(m / 8), 0, 1))


TABLES = {"coated": coated, "soft-band": soft_band, "20-decades": steep, "20-decades-cliff": cliff}


def write_inputs(folder: Path, points: int) -> None:
    """The height map with plateaus and the tables of k(q)."""
    height = SelfAffine(cutoff=2.56 / points, h_std=1.0).heights(points)
    np.save(folder / f"plateaus-{points}.npy", np.clip(height, -0.5, 0.5))
    m = np.geomspace(1, points / np.sqrt(2), 400)
    for name, law in TABLES.items():
        np.savetxt(folder / f"{name}.txt", np.column_stack([2 * pi * m, law(m)]), fmt="%.17g")


class OutOfTimeError(Exception):
    """A solve that has had its time."""


@dataclass
class Result:
    """A solved contact and its numbers."""

    contact: Contact
    solution: Solution
    status: str
    seconds: float
    observables: Observables

    @property
    def identity(self) -> float:
        """|2 v / (<sigma h> - p <u>) - 1|."""
        return abs(2 * self.observables.energy / self.observables.work - 1)

    def floor(self) -> float:
        """The residual that rounding u leaves."""
        contact, u = self.contact, self.solution.u
        nudge = np.random.default_rng(0).integers(-1, 2, u.shape) * np.spacing(np.abs(u))
        moved = contact.stress(u + nudge, out=contact.grid.empty())
        moved -= contact.stress(u, out=contact.grid.empty())
        moved[u == contact.height] = 0.0
        return float(np.sqrt(np.mean(moved**2) / 8)) / min(contact.pressure, 1.0)


def solve(
    contact: Contact, tolerance: float = TOLERANCE, seconds: float = 30.0, max_steps: int = 20000
) -> Result:
    """Solve; give up after `seconds`."""
    start = time.process_time()
    latest = []

    def watch(current, state):
        latest[:] = [current, state]
        if time.process_time() - start > seconds:
            raise OutOfTimeError

    solver = Auto(tolerance=tolerance, max_steps=max_steps)
    try:
        solution = solve_contact(contact, solver, watch)
        solution.recompute(contact)  # as a run does
        status = solution.status
    except OutOfTimeError:
        contact, state = latest
        solver.refresh(contact, state)
        status = f"given up at step {state.step}, {contact.grid.points} points a side"
        solution = Solution(
            state.u, state.sigma, state.residual, status, "pcg", state.step, state.transforms
        )
    seconds = time.process_time() - start
    return Result(contact, solution, status, seconds, observe(contact, solution.u, solution.sigma))


def row(case: Case, points: int, seconds: float) -> list[str]:
    """The cells of one case."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        contact = case.contact(points)
        result = solve(contact, seconds=seconds)
    solution, observables = result.solution, result.observables
    floor, status = result.floor(), result.status
    reach = " **out of reach**" if floor > TOLERANCE else ""
    off = "-"
    if result.status == "converged":
        tighter = solve(contact, TIGHTER, seconds)
        if tighter.status == "converged":
            exact = tighter.observables.u_g
            off = f"{abs(observables.u_g - exact) / max(exact, TINY):.1e}"
    if caught:
        status += f" ({len(caught)} warnings: {caught[0].message})"
    return [
        case.name,
        f"{contact.grid.points}" + ("^2" if contact.grid.dimension == 2 else ""),
        case.exponent,
        f"{contact.pressure:.3g}",
        status,
        f"{solution.residual:.1e}",
        f"{solution.transforms / 2:.0f}",
        f"{result.seconds:.2f}",
        f"{observables.a_r:.3g}",
        f"{observables.u_g:.4g}",
        f"{result.identity:.1e}",
        off,
        "-" if solution.is_direct else f"{floor:.0e}{reach}",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, default=512)
    parser.add_argument("--only", default="", help="cases whose name contains this")
    parser.add_argument("--seconds", type=float, default=30.0, help="for one solve")
    arguments = parser.parse_args()
    print_head(*HEAD)
    solve(build_scene(SelfAffine(cutoff=0.1), Power(n=3), 64).contact(0.1))  # loads the kernels
    with tempfile.TemporaryDirectory() as name:
        write_inputs(Path(name), arguments.points)
        for case in cases(arguments.points, Path(name)):
            if arguments.only in str(case):
                print_row(*row(case, arguments.points, arguments.seconds))


if __name__ == "__main__":
    main()
