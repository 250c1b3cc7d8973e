"""How far a solver goes along a move that is projected on its constraint, and the next length.

The solvers in u and in sigma share this rule. The energy is a parabola along the straight way to
the projected point, lowest at the fraction `best` of it; all points on the way are feasible.
"""

from typing import NamedTuple

FULL_MOVE = 0.5  # a projected move lowers the energy if its best fraction is above 1/2
LENGTH_CHANGE = (
    0.6,
    1.6,
)  # range of the factor by which one projected move changes the next length


class MoveChoice(NamedTuple):
    """What to do with a move."""

    fraction: float
    """Fraction of the move to take."""
    factor: float
    """Length of the next move over that of this one."""
    restart: bool
    """Whether the next direction is not conjugate to this one."""


def choose(best: float, exact: bool) -> MoveChoice:
    """The choice for a move; `exact` tells that no point is stopped on the way to `best`."""
    if exact:
        return MoveChoice(best, best, False)  # the exact step of conjugate gradients
    if best >= FULL_MOVE:
        low, high = LENGTH_CHANGE
        return MoveChoice(1.0, min(max(best, low), high), False)
    return MoveChoice(best, best, True) if best > 0 else MoveChoice(0.0, 0.5, True)
