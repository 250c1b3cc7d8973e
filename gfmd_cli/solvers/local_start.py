"""A start on the finest grid whose cost is in proportion to the contact.

At small pressure most of a grid is never in contact. From a coarse grid on, the contact is solved
only on tiles that it can reach: those around the contact of the next coarser grid (see
`local_solve`). The solver on the whole grid takes over on the finest grid: it measures the residual
and makes steps if that is too large. With a free boundary it takes the pressure. In a periodic cell
it takes the displacement, which is laid on the indenter before.
"""

from collections.abc import Callable
from itertools import pairwise, product
from math import hypot
from typing import Any, ClassVar

import numpy as np

from gfmd_cli.grid.arrays import Field, Mask
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.free_contact import FreeContact
from gfmd_cli.solvers.local_solve import LocalSolve
from gfmd_cli.solvers.loop import Start
from gfmd_cli.solvers.tile_operators import FreeOperators, PeriodicOperators
from gfmd_cli.solvers.tiles import SIDE, Tiles

SMALLEST_EXPONENT = 0.2  # of k(q) for which there are tiles; measured from 0.25 on
MIN_COARSE_POINTS, MAX_REFINEMENT = 256, 4
"""Smallest number of points per side of the first grid that is solved on tiles, and largest ratio
of those of the finest grid to it. Measured: if the first grid is finer, the whole grids before it
take longer; if it is coarser, spots of contact are missed, which costs an evaluation later."""
COARSE_TOLERANCE = 0.03  # on grids before the finest; measured: 0.01 to 0.1 differ by 5 %
MAX_JACOBI_STEPS = 6  # after C s is laid on the indenter; with 8 the prediction is worse
MAX_JACOBI_REDUCTION = 4.0  # of the residual by these steps; measured: 3 to 5
JACOBI_DAMPING = 0.8  # a choice
MAX_CLOSED_GAP = 2.0  # over the Jacobi move, which removes the stress of the point; a choice


def start_from(
    coarse: Contact,
    pressure: Field,
    finer: list[Contact],
    tolerance: float,
    pause: Callable[[], None] = lambda: None,
) -> Start | None:
    """The start on the last of the `finer` grids from the contact pressure on a coarser one.

    Each grid must have twice the points of the one before. `pause` is called at every step and may
    end the solve by an exception. None where a solve on the whole grid is faster or the operators
    on tiles do not apply.
    """
    last, transforms = finer[-1], 0.0
    shapes = [contact.grid.shape for contact in (coarse, *finer)]
    doubled = all(b == tuple(2 * n for n in a) for a, b in pairwise(shapes))
    first = min(finer[0].grid.shape)
    is_large = first >= max(MIN_COARSE_POINTS, min(last.grid.shape) / MAX_REFINEMENT)
    if not (doubled and is_large and all(map(_operators_apply, finer))):
        return None
    solve_on_tiles = LOCAL_SOLVES[last.boundary]
    for contact in finer:
        touching, fraction = pressure > 0, solve_on_tiles.max_fraction(contact.exponents[1])
        if np.count_nonzero(touching) > fraction * touching.size:
            return None  # there are at least as many tiles, and to find them takes longer
        tiles = _tiles_in_reach(touching, is_periodic=contact.is_periodic)
        if tiles.count > fraction * tiles.used.size:
            return None
        s = _refined(pressure, tiles)
        if contact.may_touch is not None:
            s *= tiles.take(contact.may_touch)
        if not s.any():
            return None
        solve = solve_on_tiles(contact, tiles, s, pause)
        del pressure, s  # their memory is needed now
        if contact is not last:
            solve.run(COARSE_TOLERANCE)
            pressure = np.empty(contact.grid.shape)
            solve.tiles.put(solve.s, pressure)
            transforms += solve.transforms * contact.grid.size / last.grid.size
    start = solve.start(tolerance)
    start.transforms += transforms
    return start


def tiles_apply(contact: Contact) -> bool:
    """Whether a start on tiles of this grid is possible, and can be faster."""
    is_large = min(contact.grid.shape) >= LOCAL_SOLVES[contact.boundary].min_points
    return is_large and _operators_apply(contact)


def _operators_apply(contact: Contact) -> bool:
    """Whether the operators on tiles apply to a grid, whatever its size."""
    grid, solve_on_tiles = contact.grid, LOCAL_SOLVES[contact.boundary]
    if grid.dimension == 1 or not grid.whole:
        return False
    if any(points % SIDE for points in grid.shape) or min(grid.spacings) < 0.5 * max(grid.spacings):
        return False
    smallest, largest = contact.exponents
    return smallest >= SMALLEST_EXPONENT and largest <= solve_on_tiles.max_exponent


def _tiles_in_reach(touching: Mask, *, is_periodic: bool) -> Tiles:
    """The tiles of a grid of twice the points that contact on a grid can reach.

    It may grow by a point of its own grid, a choice.
    """
    side = SIDE // 2
    used = np.zeros([points // side for points in touching.shape], dtype=np.bool_)
    rows, columns = np.divmod(np.flatnonzero(touching), touching.shape[1])
    mode: Any = "wrap" if is_periodic else "clip"
    for i, j in product((rows - 1, rows + 1), (columns - 1, columns + 1)):
        used.ravel()[np.ravel_multi_index((i // side, j // side), used.shape, mode=mode)] = True
    return Tiles(used, is_periodic=is_periodic)


def _refined(field: Field, tiles: Tiles) -> Field:
    """A field on the tiles of a grid of twice the points.

    Interpolated linearly between points of a periodic grid; constant on pixels with borders.
    """
    half = SIDE // 2
    nodes, fine = np.arange(half + 1), np.arange(SIDE)[:, None]
    hats = (
        np.maximum(1 - np.abs(fine / 2 - nodes), 0.0) if tiles.is_periodic else fine // 2 == nodes
    )
    i = (tiles.rows[:, None] * half + nodes) % field.shape[0]
    j = (tiles.columns[:, None] * half + nodes) % field.shape[1]
    values: Field = hats @ field[i[:, :, None], j[:, None, :]] @ hats.T
    return values.reshape(tiles.count, -1)


class PeriodicSolve(LocalSolve):
    """The solve in a periodic cell; the iteration on the whole grid starts from u."""

    operators_type = PeriodicOperators
    min_points: ClassVar[int] = 512
    max_exponent: ClassVar[float] = 2.05

    @staticmethod
    def max_fraction(exponent: float) -> float:
        """Less for larger n, for which a solve on tiles takes more steps."""
        return max(0.17 - 0.1 * exponent, 0.012)

    def compliance_everywhere(self, *, in_single_precision: bool) -> Field:
        """C s at all points, in the memory of the transforms."""
        grid = self.contact.grid_of_moves if in_single_precision else self.grid
        values = grid.padded[..., : grid.points]
        self.tiles.put(self.s, values)
        grid.unfilter_padded(self.contact.stiffness, self.tiles.blocks)
        self.transforms += grid.pair_cost
        return values

    def start(self, tolerance: float) -> Start:
        """The displacement u >= h, and u = h at the points that are pressed on the indenter.

        K C s is s without its mean, so that the stress is s + K (u - C s).
        """
        result, displacement = self.solve(tolerance)
        contact, tiles, moves = self.contact, self.tiles, self.contact.grid_of_moves
        u = self.grid.empty()  # only now: the solves on tiles need memory, too
        np.subtract(displacement, result.level, out=u, dtype=np.float64)
        laid, before = self.obstacle + result.gap, tiles.take(u)
        if contact.may_touch is not None:
            laid = np.where(tiles.take(contact.may_touch), laid, before)
        tiles.overwrite(laid, u)
        if result.gap.min() > 0:
            return Start(contact, self.transforms, u)
        change = (laid - before).astype(moves.real)  # zero elsewhere
        values = moves.padded[..., : moves.points]  # in the memory of the displacement
        tiles.put(change, values)
        moves.filter_padded(contact.stiffness, tiles.blocks)
        self.transforms += moves.pair_cost
        sigma = self.grid.empty()
        sigma[...] = values
        tiles.overwrite(self.s + tiles.take(values), sigma)
        rounding = hypot(contact.rounding(change), result.rounding)
        return Start(contact, self.transforms, u, sigma, rounding)

    def lay(self, gap: Field, tolerance: float) -> tuple[Field, float]:
        """The gap on the tiles after C s is laid on the indenter, and its natural residual.

        With C s the stress is s; K times the change of the gap is added. Laying leaves a residual
        of short waves, and points that are pressed but not laid. Projected Jacobi steps reduce both
        where they can reach the tolerance.
        """
        stiffness = self.contact.point_stiffness
        laid = np.where(self.s > stiffness * gap, 0.0, np.maximum(gap, 0.0))
        stress = self.s + self.map_displacement(laid - gap)
        for _ in range(MAX_JACOBI_STEPS):
            move = stress / stiffness
            relaxed = np.maximum(laid - JACOBI_DAMPING * move, 0.0)
            laid = np.where(laid < MAX_CLOSED_GAP * move, 0.0, relaxed)
            stress = self.s + self.map_displacement(laid - gap)
            residual = self.residual(laid, stress)
            if residual > MAX_JACOBI_REDUCTION * tolerance:
                break
            if residual < tolerance and not np.any((laid > 0) & (stress > stiffness * laid)):
                break
        return laid, residual


class FreeSolve(LocalSolve):
    """The solve with a free boundary; the iteration on the whole map starts from s."""

    contact: FreeContact
    operators_type = FreeOperators
    min_points: ClassVar[int] = 256
    max_exponent: ClassVar[float] = 1.55

    @staticmethod
    def max_fraction(exponent: float) -> float:
        """Smaller for larger n, as in a periodic cell."""
        return min(0.55 - 0.32 * exponent, 0.25)

    def compliance_everywhere(self, *, in_single_precision: bool) -> Field:
        """C s at all points, always in double precision."""
        values = self.grid.empty()
        self.tiles.put(self.s, values)
        self.transforms += self.contact.compliance.transforms
        return self.contact.compliance.displacement(values, out=values)

    def start(self, tolerance: float) -> Start:
        """The stress, and the displacement that it causes."""
        _, displacement = self.solve(tolerance)
        sigma = self.grid.empty()
        self.tiles.put(self.s, sigma)
        return Start(self.contact, self.transforms, displacement, sigma)


LOCAL_SOLVES: dict[str, type[LocalSolve]] = {"periodic": PeriodicSolve, "free": FreeSolve}
"""The solve on tiles, by the boundary of the contact."""
