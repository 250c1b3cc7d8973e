"""The Einstein solid, n = 0: no iteration, one root."""

from collections.abc import Iterator
from typing import Literal

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.physics.choice import Choice
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.grid import Grid
from gfmd_cli.solvers.loop import State


class Sort(Choice):
    """Exact solution for a flat stiffness: sigma = k0 max(h - c, 0), c such that <sigma> = p.

    u = max(h, c): each point stands for itself. Paper Sect. 4.2.
    """

    kind: Literal["sort"] = "sort"

    def begin(self, contact: Contact, u: Field) -> State:
        """The solution; `u` is overwritten. Raises InputError where k(q) is not flat."""
        if not is_flat(contact):
            raise InputError('solver.kind: "sort" solves bodies of flat stiffness (n = 0) only')
        displaced = contact.pressure / float(contact.line[-1])
        level = non_contact_height(contact.grid, contact.height, displaced)
        np.maximum(contact.height, level, out=u)
        return State(u, contact.stress(u, out=contact.grid.empty()), transforms=2)

    def iterate(self, contact: Contact, state: State) -> Iterator[State]:
        """Yield the solution."""
        state.residual = contact.residual(state.u, state.sigma)
        yield state


def is_flat(contact: Contact) -> bool:
    """Whether k(q) is the same for all q > 0, up to rounding."""
    grid, k = contact.grid, contact.stiffness.ravel()
    waves = k[1:] if grid.ends[0] else k
    highest, lowest = grid.most(float(waves.max())), -grid.most(-float(waves.min()))
    return bool(highest - lowest <= 8 * np.finfo(float).eps * lowest)


def non_contact_height(grid: Grid, h: Field, displaced: float) -> float:
    """The level c at which <max(h - c, 0)> = `displaced`.

    Newton's method on this convex, piecewise linear function from below: it rises to the root
    and ends in it as soon as no point changes sides.
    """
    level = grid.total(float(h.sum())) / grid.size - displaced
    above = h.ravel()
    while True:
        above = above[above > level]
        count, height = grid.total(np.array([above.size, above.sum()]))
        if count == 0:  # rounding of a pressure far below the spacing of the heights
            return level
        better = float(height / count - displaced * grid.size / count)
        if better <= level:
            return level
        level = better
