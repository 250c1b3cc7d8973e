"""The Einstein solid, n = 0: one scalar equation instead of iterations."""

from collections.abc import Iterator
from math import inf
from typing import ClassVar, Literal

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.grid.arrays import Field
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.linear_elastomer import LinearElastomer
from gfmd_cli.solvers.loop import Solver, State

WAVENUMBERS = np.logspace(-3, 12, 46)
"""Wavenumbers of real surfaces [1/m], at which k(q) of an elastomer is compared."""


class Sort(Solver):
    """Exact solution for constant k = k_0 (n = 0): sigma = k_0 max(h - c, 0), with <sigma> = p.

    u = max(h, c): the points do not interact. Paper Sect. 4.2.
    """

    kind: Literal["sort"] = "sort"

    fields_in_memory: ClassVar[float] = 5.0
    iterative: ClassVar[bool] = False
    max_exponent: ClassVar[float] = 0.0

    def check_elastomer(self, elastomer: LinearElastomer) -> None:
        """Raise InputError for a stiffness that depends on q."""
        if not is_constant(elastomer.stiffness(WAVENUMBERS)):
            raise InputError(
                f'solver.kind: "sort" given, but the stiffness of {elastomer.label} depends on the '
                'wavenumber (1e-3 to 1e12 1/m); "sort" is for n = 0, "auto" for every elastomer'
            )

    def begin(self, contact: Contact, u: Field) -> State:
        """The solution; `u` is overwritten. Raises InputError if k(q) depends on q."""
        if not is_flat(contact):
            raise InputError('solver.kind: "sort" needs a stiffness that does not depend on q')
        displaced = contact.pressure / float(contact.k_along_x[-1])
        known = contact.height if contact.may_touch is None else contact.height[contact.may_touch]
        level = non_contact_height(contact.grid, known, displaced)
        np.maximum(contact.obstacle, level, out=u)
        sigma = u - level  # not K u + p, whose rounding exceeds p where the contact is small
        if not contact.grid.any(sigma > 0):  # p is far below the rounding of the heights
            sigma[...] = contact.obstacle >= level
        sigma *= contact.pressure / contact.grid.mean(sigma)
        return State(u=u, sigma=sigma)

    def iterate(self, contact: Contact, state: State) -> Iterator[State]:
        """Yield the solution."""
        state.residual = contact.residual(state.u, state.sigma)
        yield state


def is_flat(contact: Contact) -> bool:
    """Whether k(q) is constant for all q > 0, up to rounding."""
    grid, k = contact.grid, contact.stiffness.ravel()
    waves = k[1:] if grid.ends[0] else k
    return is_constant(np.array([grid.min(float(waves.min())), grid.max(float(waves.max()))]))


def is_constant(k: Field) -> bool:
    """Whether all values are the same, up to rounding."""
    return bool(np.ptp(k) <= 8 * np.finfo(float).eps * k.min())


def non_contact_height(grid: Grid, h: Field, displaced: float) -> float:
    """The level c at which <max(h - c, 0)> = `displaced`, for the heights that can touch.

    Newton's method on a convex, piecewise linear function, started below the root: the iterates
    increase and reach the root exactly in the step in which no point crosses the level.
    """
    level, above = -inf, h.ravel()
    while True:
        above = above[above > level]
        count, height = grid.total(np.array([above.size, above.sum()]))
        if count == 0:  # rounding of a pressure far below the spacing of the heights
            return level
        better = float(height / count - displaced * grid.size / count)
        if better <= level:
            return level
        level = better
