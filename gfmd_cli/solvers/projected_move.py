"""How far a solver goes along a move that is projected on its constraint, and the next length.

The solvers in u and in sigma share this rule. The energy is a parabola along the straight way to
the projected point, lowest at the fraction `best` of it; all points on the way are feasible.
"""

from typing import NamedTuple

FULL_MOVE = 0.5  # a projected move lowers the energy if its best fraction is above 1/2
LENGTH_CHANGE = (0.5, 2.0)  # range of the factor by which a projected move changes the next length


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
    low, high = LENGTH_CHANGE
    is_full = best >= FULL_MOVE
    fraction = 1.0 if is_full else max(best, 0.0)
    return MoveChoice(fraction, min(max(best, low), high), not is_full)
