"""Contact stiffness from the linear response of a solved contact: one linear solve.

Periodic boundary: on the free points sigma = K u + p = 0, on the contact u = h. If p grows by dp,
the contact area stays the same to first order, except for points at which u = h and sigma = 0. Then
(K du)_free = -dp and du = 0 on the contact. With w from (K w)_free = 1 and w = 0 on the contact,
du = -w dp and du_g = <du> = -<w> dp. The contact stiffness is -dp/du_g = 1 / <w>.

K is positive definite on the free points if at least one point is held. Conjugate gradients
minimise Q(w) = <w K w> / 2 - <w>, whose minimum is -<w> / 2. A step to the lowest point along d
lowers Q by (d f)^2 / (2 d K d) with f = 1 - K w. The sum of these gains approaches <w> from below,
with the square of the error of w itself (Hestenes & Stiefel, J. Res. Natl. Bur. Stand. 49, 409,
1952, Theorem 6:1). The gain of the last step estimates the remaining error (Strakos & Tichy,
Electron. Trans. Numer. Anal. 13, 56, 2002). The field w itself is not needed.

Free boundary: on the contact u = C sigma + c = h, elsewhere sigma = 0. If the load grows by a
little, the contact area stays the same to first order, and the level c of the undeformed surface
falls by delta. With sigma_1 from (C sigma_1)_contact = 1 and sigma_1 = 0 elsewhere, dsigma =
sigma_1 delta. The mean pressure grows by <sigma_1> delta, and the mean gap falls by
<1 - C sigma_1> delta, to which the contact adds nothing. Hence

    -dp/du_g = <sigma_1> / <1 - C sigma_1>.

sigma_1 is the pressure, per displacement, under a flat punch of the shape of the contact. C is
positive definite, and conjugate gradients find sigma_1, with the preconditioner of `dual`. It is in
single precision, hence the Polak-Ribiere formula.
"""

from functools import singledispatch

import numpy as np

from gfmd_cli.grid.arrays import Mask
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.free_contact import FreeContact
from gfmd_cli.solvers.contact_state import FREE, PRESSED
from gfmd_cli.solvers.preconditioners import create, select
from gfmd_cli.solvers.projected_move import polak_ribiere
from gfmd_cli.solvers.stress_preconditioner import StressPreconditioner

MIN_RELATIVE_GAIN = 1e-10
"""Gain of a step over the sum of all gains that ends the iteration. The result then agrees with
dense solves to 1e-8 (tests/test_contact_stiffness.py)."""
TOLERANCE = 1e-9  # rms of 1 - C sigma_1 on the contact
MAX_STEPS = 5000


def contact_stiffness(contact: Contact, touching: Mask) -> float:
    """-dp/du_g [Delta_sigma / h_std] of a solved contact; `touching`: the points in contact.

    Infinite in full contact; NaN without contact or if the iteration does not converge.
    """
    if not np.any(touching):
        return np.nan
    if np.all(touching):
        return np.inf
    return _stiffness(contact, touching)


@singledispatch
def _stiffness(contact: Contact, touching: Mask) -> float:
    """1 / <w> by preconditioned conjugate gradients; NaN if the iteration does not converge."""
    grid = contact.grid
    free = ~np.atleast_2d(touching)
    contact_state = np.where(free, FREE, PRESSED).astype(np.int8)
    preconditioner = create(contact, grid, select(contact, contact_state, PRESSED))
    values, z = (field[:, : grid.points] for field in (grid.as_rows(grid.padded), preconditioner.z))
    stress = np.where(free, -1.0, 0.0)  # K w - 1 = -f
    direction, change = np.zeros_like(stress), np.zeros_like(stress)
    total, old_slope = 0.0, np.inf
    for _ in range(MAX_STEPS):
        slope, z_change = preconditioner.apply(stress, contact_state, PRESSED, change)
        direction *= polak_ribiere(-z_change, old_slope)
        np.add(direction, z, out=direction, where=free)
        descent, old_slope = -float(np.vdot(direction, stress)), slope
        values[...] = direction
        curvature = grid.filter_padded(contact.stiffness)
        length = descent / curvature if curvature > 0 else 0.0
        np.multiply(values, length, out=change, where=free)
        stress += change
        gain = descent * length
        total += gain
        if gain <= MIN_RELATIVE_GAIN * total:
            return 1.0 / (total / grid.size)
    return np.nan


@_stiffness.register
def _of_free_contact(contact: FreeContact, touching: Mask) -> float:
    """<sigma_1> / <1 - C sigma_1> by the same method; NaN if the iteration does not converge."""
    compliance, preconditioner = contact.compliance, StressPreconditioner(contact)
    as_rows = contact.grid.as_rows
    held = np.where(as_rows(touching), PRESSED, FREE).astype(np.int8), PRESSED
    rest = np.ones(contact.grid.shape)  # 1 - C sigma_1
    force, response = (contact.grid.empty() for _ in range(2))
    direction, z = np.zeros_like(rest), np.zeros(rest.shape, np.float32)
    total, slope, length = 0.0, 0.0, 0.0
    for _ in range(MAX_STEPS):
        np.multiply(rest, touching, out=force)
        if float(np.vdot(force, force)) <= TOLERANCE**2 * np.count_nonzero(touching):
            return total / float(rest[~touching].sum())
        preconditioner.apply(as_rows(force), *held, out=as_rows(z))
        z_change = -length * float(np.vdot(z, response))  # z times the change of the force
        direction *= polak_ribiere(z_change, slope)
        direction += z
        slope = float(np.vdot(z, force))
        compliance.displacement(direction, out=response)
        length = float(np.vdot(direction, force)) / float(np.vdot(direction, response))
        rest -= length * response
        total += length * float(direction.sum())
    return np.nan
