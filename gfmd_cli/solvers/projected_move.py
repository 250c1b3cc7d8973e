"""The step length and the factor beta of the solvers that project their moves on the constraint.

The solvers in u and in sigma share the rule for the length of a move. The energy is a parabola
along the straight line to the projected point, lowest at the fraction `best` of it; all points on
the line are feasible.
"""

MIN_FULL_MOVE = 0.5  # a full move lowers the energy if its best fraction is above 1/2
"""With 0.7 the transforms are 0.98 to 1.21 times as many, with 1: 1.00 to 1.23 times (n = 0.5 to 4,
64^2 to 256^2, seeds 3 to 5): `scripts/solver_constants.py projected_move.MIN_FULL_MOVE 0.7 1`."""
MAX_HALVINGS = 60  # of a move along which the energy rises; beyond, it is rounding
LENGTH_CHANGE = (0.5, 2.0)  # range of the factor by which a projected move changes the next length
"""Transforms with 1/4 to 4 are 0.95 to 1.01 times as many (n = 0.5 to 4, 64^2 to 256^2, seeds 3 to
5), with 2/3 to 3/2 1.00 to 1.13 times:
`scripts/solver_constants.py projected_move.LENGTH_CHANGE "(0.25, 4)" "(0.67, 1.5)"`."""


def choose(best: float, is_unclipped: bool) -> tuple[float, float, bool]:
    """What to do with a move whose best fraction is `best`.

    `is_unclipped` says whether no point is stopped before `best`. Returns the fraction of the move
    to take, the length of the next move over that of this one, and whether the next direction is
    not conjugate to this one.
    """
    if is_unclipped:
        return best, best, False  # the exact step of conjugate gradients
    low, high = LENGTH_CHANGE
    is_full = best >= MIN_FULL_MOVE
    fraction = 1.0 if is_full else max(best, 0.0)
    return fraction, min(max(best, low), high), not is_full


def polak_ribiere(z_change: float, slope: float) -> float:
    """The factor beta >= 0 of the last direction, by Polak & Ribiere; zero without a last step.

    Parameters
    ----------
    z_change : the preconditioned force times the change of the force by the last step
    slope : the preconditioned force times the force at the last step
    """
    return max(0.0, z_change / slope) if slope > 0 else 0.0


def conjugation(
    slope: float,
    z_change: float,
    moved: float,
    best: float,
    curvature: float,
    least_determinant: float = 0.0,
) -> float:
    """The factor beta >= 0 for which z + beta d leads to the lowest energy in the plane of z and d.

    z is the preconditioned force f, and d the last direction; f and d are those on the free points.

    Parameters
    ----------
    slope : z f, positive
    z_change : z times the change of -f by the last move, which is `moved` K d
    moved : length of the last move along d
    best : length along d at which the energy was lowest
    curvature : d K d
    least_determinant : that of the plane of z and d, 1 if conjugate and 0 if parallel, up to which
        the factor is zero: z alone then leads about as low, and the factor would be so large that
        the indenter stops each move where it stopped the last

    With the lengths l of the move and l* of lowest energy, f d = (l* - l) d K d. z K z is not
    known. It is estimated as if the energy along z were lowest at the same length l*. At l = l*
    this is the formula of Hestenes & Stiefel (J. Res. Natl. Bur. Stand. 49, 409, 1952).
    """
    rest = best - moved
    coupling = z_change / (moved * curvature)  # z K d / d K d
    determinant = 1.0 - rest * curvature * coupling / slope
    if not determinant > least_determinant:
        return 0.0
    return max(0.0, (rest / best - coupling) / determinant)
