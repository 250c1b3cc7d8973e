"""Contact stiffness by the linear response of a solved contact: one linear solve, no other contact.

On the free points sigma = K u + p = 0, on the contact u = h. Let p grow by dp while the contact
stays as it is, which it does at first order but for points at which u = h and sigma = 0: then
(K du)_free = -dp and du = 0 on the contact, hence du = -w dp with (K w)_free = 1, w = 0 on the
contact, and du_g = <du> = -<w> dp. The contact stiffness is -dp/du_g = 1 / <w>.

K is positive definite on the free points as long as one point is held. Conjugate gradients minimise
Q(w) = <w K w> / 2 - <w>, which is -<w> / 2 at the solution; a step along d to its lowest point
brings Q down by (d f)^2 / (2 d K d), f = 1 - K w. Their sum is <w> from below, with the square of
the error of w itself (Hestenes & Stiefel, J. Res. Natl. Bur. Stand. 49, 409, 1952, Theorem 6:1),
and what the last few steps have brought estimates what is missing (Strakos & Tichy, Electron.
Trans. Numer. Anal. 13, 56, 2002). w is never needed.
"""

from collections import deque

import numpy as np

from gfmd_cli.physics import sweeps
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.fields import Field, Mask
from gfmd_cli.solvers.multigrid import Multigrid, suits
from gfmd_cli.solvers.multilevel import Multilevel
from gfmd_cli.solvers.pcg import prefers_levels, screening

DELAY = 8  # steps whose gain is looked at ...
ENOUGH = 1e-9  # ... and their share of the whole at which it ends
MOST_STEPS = 5000


def contact_stiffness(contact: Contact, touching: Mask) -> float:
    """-dp/du_g [Delta_sigma / h_std] of a solved contact, held at the points that carry load.

    Infinite in full contact; NaN without contact or where the iteration does not end.
    """
    if not np.any(touching):
        return np.nan
    if np.all(touching):
        return np.inf
    return 1.0 / _Response(contact, touching).mean()


class _Response:
    """Conjugate gradients for w, on arrays with two axes."""

    def __init__(self, contact: Contact, touching: Mask) -> None:
        self.contact, self.grid, self.rows = contact, contact.grid, contact.grid.rows
        self.stiffness = self.grid.as_rows(contact.stiffness)
        held = np.atleast_2d(touching)
        self.marks = np.where(held, sweeps.PRESSED, sweeps.FREE).astype(np.int8)
        self.padded = self.grid.as_rows(self.grid.padded)
        self.values = self.padded[:, : self.grid.points]
        counted = self.rows.sums(2, sweeps.pattern, self.marks, sweeps.PRESSED)
        self.screen, chord, exponent = screening(contact, *map(float, counted))
        self.levels: Multigrid | Multilevel | None = None
        even = self.grid.dimension == 2 and suits(contact)
        if prefers_levels(self.grid, even, chord, exponent):
            self.levels = (Multigrid if even else Multilevel)(contact, self.rows)

    def mean(self) -> float:
        """<w>, or NaN where the iteration does not end."""
        free = self.marks == sweeps.FREE
        stress = np.where(free, -1.0, 0.0)  # K w - 1 = -f
        direction, change = np.zeros_like(stress), np.zeros_like(stress)
        gains, total, former = deque([np.inf], DELAY), 0.0, np.inf
        for _ in range(MOST_STEPS):
            slope, turned = self.precondition(stress, change)
            direction *= max(0.0, -turned / former) if former > 0 else 0.0  # as in `pcg`
            np.add(direction, self.values, out=direction, where=free)
            descent, former = -float(np.vdot(direction, stress)), slope
            self.values[...] = direction
            curvature = self.grid.filter_padded(self.contact.stiffness)
            length = descent / curvature if curvature > 0 else 0.0
            np.multiply(self.values, length, out=change, where=free)
            stress += change
            gains.append(descent * length)
            total += gains[-1]
            if sum(gains) <= ENOUGH * total:
                return total / self.grid.size
        return np.nan

    def precondition(self, stress: Field, change: Field) -> tuple[float, float]:
        """padded <- z of the force on the free points; sums of z times force, times `change`."""
        bodies = (stress, self.marks, sweeps.PRESSED)
        if self.levels is not None:
            return self.levels.apply(*bodies, change, self.padded)
        self.rows(sweeps.free_force, *bodies, self.padded)
        self.grid.transform()
        modes = self.grid.as_rows(self.grid.spectrum)
        screened = (self.stiffness, self.screen, 1.0 / self.grid.size)
        self.grid.spectral_rows(sweeps.soften, modes, *screened)
        self.grid.transform_back()
        slope, turned = self.rows.sums(2, sweeps.slopes, *bodies, change, self.padded)
        return float(slope), float(turned)
