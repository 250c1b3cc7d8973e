"""A spec as a list of tasks, one for each pressure, with what each will take."""

from dataclasses import dataclass
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import pyfftw

from gfmd_cli.errors import InputError
from gfmd_cli.physics.choice import Choice
from gfmd_cli.physics.continuum import LAST_LINE, LAST_STRESS
from gfmd_cli.physics.elastomer import Elastomer, HalfSpace, Membrane, Plate, Power, Slab
from gfmd_cli.physics.surface import FileSurface, Surface
from gfmd_cli.solvers.cascade import SolverChoice
from gfmd_cli.study.spec import SOUGHT, AccuracyTable, OutputTable, Spec, digest

FIELDS_IN_MEMORY = 6.65
"""Fields of double precision that a solve holds at its peak: h, u, sigma, work; at half the
size direction, change, k(q); contact marks, coarse levels. scripts/memory.py measures it."""
FURTHER_FIELDS = 3.0
"""What [output] stiffness and spectra add to that, measured likewise."""
BASE_BYTES = 215e6
"""What a process holds besides: the interpreter and its libraries."""
FIRST = 64  # points per side that "auto" begins with at the least; such a solve costs nothing
LAST = {"a_r": LAST_LINE, "u_g": 4.0, "sigma_p": LAST_STRESS}
"""Exponents n up to which a quantity has a continuum value to come near to."""
SYMBOLS = {"p_star": "p*", "pressure": "p", "contact_area": "a_r", "mean_gap": "u_g"}
SEARCH = 4.5  # solves that a search of the pressure takes, those on coarser grids included
MAX_TASKS = 100_000  # of a study; more are a slip of the pen
SECONDS_PER_PAIR = 1.7e-8
"""Per grid point and pair of transforms, with all work between two of them, on one thread."""


@dataclass(frozen=True)
class Task:
    """One contact to solve."""

    index: int
    surface: Surface
    elastomer: Elastomer
    points: int
    quantity: str
    """What the load is given as: one of LOADS."""
    load: float
    """Its value."""
    within: float
    """Relative distance to it at which a search ends."""
    solver: SolverChoice
    output: OutputTable
    accuracy: AccuracyTable | None
    auto: bool
    """Whether the grid is chosen by the accuracy asked for; `points` is then a forecast."""
    id: str
    """Name of the task by its content."""

    @property
    def label(self) -> str:
        """What sets the task apart, for people."""
        points = "auto" if self.auto else self.points
        return f"{describe(self.elastomer)} {points} {self.asked}"

    @property
    def asked(self) -> str:
        """The load, for people."""
        return f"{SYMBOLS[self.quantity]}={self.load:.4g}"

    def p_star(self, delta_sigma: float) -> float:
        """The reduced pressure, where it is known, on a scene with this Delta_sigma [Pa]."""
        return self.load if self.quantity == "p_star" else self.load / delta_sigma

    @property
    def size(self) -> int:
        """Number of grid points."""
        return int(self.points**self.surface.dimension)

    @property
    def bytes(self) -> float:
        """Memory that the solve takes, with its process."""
        return self.bytes_on(self.points)

    def bytes_on(self, points: int) -> float:
        """Memory that a solve on this many points per side takes, with its process."""
        further = FURTHER_FIELDS if self.output.stiffness or self.output.spectra else 0.0
        fields = FIELDS_IN_MEMORY + further
        return fields * 8 * float(points**self.surface.dimension) + BASE_BYTES

    @property
    def least_points(self) -> int:
        """Points per side without which the task cannot begin."""
        return first_grid(self.surface) if self.auto else self.points

    @property
    def seconds(self) -> float:
        """Time that the solve is expected to take on one thread, within a factor of about three."""
        solves = SEARCH if self.quantity in SOUGHT else 1.0
        return 0.01 + solves * SECONDS_PER_PAIR * self.size * self._pairs()

    def columns(self) -> dict[str, Any]:
        """What is to be solved, as columns of a study."""
        n, t = exponent(self.elastomer), thickness(self.elastomer)
        return {
            "surface": describe(self.surface),
            "preparation": self.surface.preparation(),
            "seed": getattr(self.surface, "seed", -1),
            "elastomer": describe(self.elastomer),
            "n": np.nan if n is None else n,
            "thickness": np.nan if t is None else t,
            "points": self.points,
            "grid": "auto" if self.auto else "given",
            "load": self.quantity,
            "asked": self.load,
        }

    def _pairs(self) -> float:
        """Pairs of transforms, fitted to the default surface at 512^2, tolerance 1e-6."""
        n = exponent(self.elastomer)
        n = 2.0 if n is None else n
        if n == 0:
            return 1.0
        p = min(max(self.load if self.quantity == "p_star" else 0.05, 1e-5), 3.0)
        pairs = float(np.interp(n, [0, 0.5, 1, 2, 3, 4], [30, 35, 30, 22, 30, 44]))
        slope = float(np.interp(n, [0, 1, 2, 3, 4], [0.0, 0.1, 0.08, 0.07, 0.15]))
        tightness = 1 - 0.1 * float(np.log10(max(self.solver.tolerance, 1e-14) / 1e-6))
        return float(pairs * (p / 0.1) ** -slope * tightness)


def exponent(elastomer: Elastomer) -> float | None:
    """Exponent n where the stiffness is one power of q, else None."""
    if isinstance(elastomer, Power):
        return elastomer.n
    return {HalfSpace: 1.0, Membrane: 2.0, Plate: 4.0}.get(type(elastomer))


def thickness(elastomer: Elastomer) -> float | None:
    """Thickness t / L of a slab, else None."""
    return elastomer.thickness if isinstance(elastomer, Slab) else None


def describe(choice: Choice) -> str:
    """The kind with all that differs from its defaults, in one line."""
    told = [
        f"{name}={_in_short(value)}"
        for name, value in choice
        if name != "kind" and value != type(choice).model_fields[name].default
    ]
    return " ".join([str(getattr(choice, "kind", "")), *told])


def _in_short(value: object) -> str:
    if isinstance(value, Path):
        return value.name
    return f"{value:g}" if isinstance(value, float) else str(value)


def first_grid(surface: Surface) -> int:
    """Points per side that an "auto" grid begins with: the fewest that resolve the surface."""
    needed = surface.smallest_grid()
    if isinstance(surface, FileSurface):
        return needed
    return 2 * int(pyfftw.next_fast_len((max(needed, FIRST) + 1) // 2))


def forecast(
    surface: Surface, elastomer: Elastomer, p_star: float | None, accuracy: AccuracyTable | None
) -> int:
    """Points per side that an "auto" grid will end with, right within a factor of two as a rule.

    Relative errors on the first grid, and the order at which they fall: read off the default
    surface with cutoff = 0.03, n = 0 to 4, p* = 0.01 to 1.
    """
    n, p = exponent(elastomer), p_star or 0.1
    n = 1.0 if n is None else n
    steep = float(np.interp(n, [0, 2, 3], [0.4, 0.48, 0.96]))
    area = float(np.interp(n, [0, 1, 2, 3], [0.05, 0.09, 0.26, 0.8])) * min(p / 0.1, 1.0) ** -steep
    gap = float(np.interp(n, [0, 1, 2, 3, 4], [0.007, 0.012, 0.035, 0.09, 0.27]))
    typical = {
        "a_r": (area, 1.6),
        "u_g": (3 * gap if p > 0.3 else gap, 2.5),
        "sigma_p": (0.03 * 3**n, max(0.5, min(2.0, 3.0 - n))),
    }
    doublings = [0]
    for name, share in (accuracy.asked() if accuracy is not None else {}).items():
        error, order = typical[name]
        if n <= LAST[name]:
            doublings.append(int(np.ceil((np.log2(error) - np.log2(share)) / order)))
    points = first_grid(surface) * int(2 ** min(max(doublings), 20))
    return points if accuracy is None else min(points, accuracy.max_points)


def plan(spec: Spec) -> list[Task]:
    """The tasks of a spec, in a fixed order: surface, elastomer, grid, solver, pressure.

    Raises InputError where a grid does not resolve its surface or a file is unfit.
    """
    loads = spec.load.values()
    swept: tuple[list[Any], ...] = (spec.surface, spec.elastomer, spec.grid, spec.solver, loads)
    if (count := prod(len(values) for values in swept)) > MAX_TASKS:
        raise InputError(f"the sweeps make {count} tasks; at most {MAX_TASKS} fit into a study")
    for surface, grid in product(spec.surface, spec.grid):
        needed = surface.smallest_grid()
        if grid.points != "auto" and grid.points < needed:
            of = f"a map of {needed} points" if isinstance(surface, FileSurface) else surface.kind
            raise InputError(
                f"grid.points: {grid.points} points per side do not resolve the surface "
                f"({of}{_cutoff(surface)}); take {needed} or more"
            )
    resolved = spec.resolved()
    tables = ("surface", "elastomer", "grid", "solver")
    quantity = spec.load.quantity
    tasks: list[Task] = []
    for places in product(*(range(len(resolved[name])) for name in tables)):
        parts = {name: resolved[name][i] for name, i in zip(tables, places, strict=True)}
        s, e, g, m = places
        for load in loads:
            content = [parts, quantity == "p_star", load, resolved["output"]]
            if quantity in SOUGHT:
                content += [quantity, spec.load.within]
            if spec.accuracy is not None:
                content.append(resolved["accuracy"])
            points = spec.grid[g].points
            expected = (
                points
                if points != "auto"
                else forecast(
                    spec.surface[s],
                    spec.elastomer[e],
                    load if quantity == "p_star" else None,
                    spec.accuracy,
                )
            )
            tasks.append(
                Task(
                    index=len(tasks),
                    surface=spec.surface[s],
                    elastomer=spec.elastomer[e],
                    points=expected,
                    quantity=quantity,
                    load=load,
                    within=spec.load.within,
                    solver=spec.solver[m],
                    output=spec.output,
                    accuracy=spec.accuracy,
                    auto=points == "auto",
                    id=digest(content),
                )
            )
    return tasks


def _cutoff(surface: Surface) -> str:
    cutoff = getattr(surface, "cutoff", None)
    return "" if cutoff is None else f", cutoff = {cutoff:g}: two points per lambda_s"
