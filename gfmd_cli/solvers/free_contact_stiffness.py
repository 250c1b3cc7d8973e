"""Contact stiffness of a solved contact with a free boundary: one linear solve.

On the contact u = C sigma + c = h, elsewhere sigma = 0. If the load grows by a little, the contact
area stays the same to first order, and the level c of the undeformed surface falls by dd. With t
from (C t)_contact = 1 and t = 0 elsewhere, dsigma = t dd. The mean pressure grows by <t> dd, and
the mean gap falls by <1 - C t> dd, to which the contact adds nothing. Hence

    -dp/du_g = <t> / <1 - C t>.

t is the pressure of a flat punch of the shape of the contact. C is positive definite, and conjugate
gradients find t, preconditioned by the stiffness as in `dual`, with the Polak-Ribiere formula, as
the preconditioner has single precision.
"""

from collections.abc import Callable

import numpy as np

from gfmd_cli.grid.arrays import Mask
from gfmd_cli.physics.free_contact import FreeContact
from gfmd_cli.solvers.contact_stiffness import MAX_STEPS, contact_stiffness

TOLERANCE = 1e-9  # rms of 1 - C t on the contact


def free_contact_stiffness(contact: FreeContact, touching: Mask) -> float:
    """-dp/du_g [Delta_sigma / h_std] of a solved contact; `touching`: the points in contact.

    Infinite in full contact; NaN without contact or if the iteration does not converge.
    """
    if not np.any(touching):
        return np.nan
    if np.all(touching):
        return np.inf
    free = contact.free
    rest = np.ones(contact.grid.shape)  # 1 - C t
    force, z, response = (contact.grid.empty() for _ in range(3))
    direction = np.zeros_like(rest)
    total, slope, length = 0.0, 0.0, 0.0
    for _ in range(MAX_STEPS):
        np.multiply(rest, touching, out=force)
        if float(np.vdot(force, force)) <= TOLERANCE**2 * np.count_nonzero(touching):
            return total / float(rest[~touching].sum())
        free.approximate_stress(force, out=z)
        z *= touching
        turned = -length * float(np.vdot(z, response))  # z times the change of the force
        direction *= max(0.0, turned / slope) if slope > 0 else 0.0
        direction += z
        slope = float(np.vdot(z, force))
        free.displacement(direction, out=response)
        length = float(np.vdot(direction, force)) / float(np.vdot(direction, response))
        rest -= length * response
        total += length * float(direction.sum())
    return np.nan


STIFFNESS: dict[str, Callable[..., float]] = {
    "periodic": contact_stiffness,
    "free": free_contact_stiffness,
}
"""Contact stiffness, by the boundary of the contact."""
