"""The preconditioners of conjugate gradients on the free points of a contact, and their selection.

- The screened Green's function 1 / (k(q) + k(q_c)) takes two transforms. Contact holds the
  displacement at distances of a few patches. Waves longer than that are therefore not softer than
  k(q_c). With the plain Green's function 1 / k(q), the method degrades at n = 2 and fails from
  n = 3 on.
- The V-cycle of `multigrid` takes the contact points into account and needs no transform of the
  whole grid.
"""

from typing import Protocol

import numpy as np

from gfmd_cli.grid.arrays import Field
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.contact import Contact
from gfmd_cli.solvers import preconditioner_kernels as kernels
from gfmd_cli.solvers.contact_state import ContactState
from gfmd_cli.solvers.multigrid import Multigrid, has_coarser_level

V_CYCLE_EXPONENT = {1: 2.7, 2: 0.45}
"""Exponent of k(q) above which the V-cycle is faster than the Green's function, by the dimension.

Measured. At n = 0.5 the Green's function takes 1.7 times as many transforms on 256^2 and 2.1 times
on 1024^2 (`scripts/solver_constants.py preconditioners.V_CYCLE_EXPONENT "{1: 2.7, 2: 0.7}" --points
256 1024 --exponents 0.5`), and about as much time on small grids of smooth surfaces, half as much
where the pixels are oblong (`scripts/grid_shapes.py --exponents 0.5`, also with
`--without-v-cycle`). On lines a transform is cheap: at n = 3 both take as long at 8192 points. At
n = 4 the Green's function takes up to 1200 steps at 2048 points, and thousands beyond."""


class Preconditioner(Protocol):
    """A positive, nearly symmetric approximation of the inverse of K on the free points."""

    z: Field
    """The preconditioned force, which `apply` writes; rows as of `Grid.padded`."""
    transforms: float
    """Transforms in double precision that take as long as those of one application."""

    def apply(
        self, sigma: Field, contact_state: ContactState, threshold: int, change: Field
    ) -> tuple[float, float]:
        """Write the preconditioned force -sigma of the free points to `z`, zero on those held.

        `contact_state` has a halo, which is filled here. Returns the sums of z times force and of
        z times `change`.
        """


class GreensFunction:
    """The screened Green's function, in the precision of the grid that `z` belongs to."""

    def __init__(self, contact: Contact, screening: float, grid: Grid) -> None:
        self.grid, self.rows = grid, contact.grid.rows
        self.stiffness, self.screening = contact.stiffness, screening
        self.z = grid.as_rows(grid.padded)
        self.transforms = float(grid.pair_cost)

    def apply(
        self, sigma: Field, contact_state: ContactState, threshold: int, change: Field
    ) -> tuple[float, float]:
        """See `Preconditioner.apply`."""
        grid, rows = self.grid, self.rows
        fields = (sigma, rows.interior(contact_state), threshold)
        rows.run(kernels.free_force, *fields, self.z)
        grid.unfilter_padded(self.stiffness, shift=self.screening)
        slope, z_change = rows.sums(2, kernels.slopes, *fields, change, self.z)
        return float(slope), float(z_change)


def select(contact: Contact, contact_state: ContactState, threshold: int) -> float:
    """k(q_c) of the Green's function for the points held; 0 where the V-cycle is faster.

    `contact_state` has a halo.
    """
    grid = contact.grid
    grid.rows.exchange_halo(contact_state)
    fields = (contact_state, threshold)
    held, changes = grid.rows.sums(2, kernels.pattern, *fields, first=grid.rows.halo)
    screening, exponent = _screening(contact, float(held), float(changes))
    is_steep = exponent > V_CYCLE_EXPONENT[grid.dimension]
    return 0.0 if is_steep and has_coarser_level(grid) else screening


def create(contact: Contact, grid: Grid, screening: float) -> Preconditioner:
    """The selected preconditioner; `z` is `padded` of `grid`, that of the contact or in single."""
    return GreensFunction(contact, screening, grid) if screening else Multigrid(contact, grid)


def _screening(contact: Contact, held: float, changes: float) -> tuple[float, float]:
    """Screening stiffness k(q_c), and exponent n of k(q).

    `held` is the number of points held, `changes` the number of changes along rows and columns. n
    is the mean from the mean free chord l of the contact to the shortest wave.

    q_c = c pi / l with c = 2^((n - 2)(1 - a_r)). Measured on the default surface of the paper at
    512^2, p* = 0.01, 0.1, 1: the smallest number of transforms, within 20 %, was reached at c = 1/2
    for n = 1, 1 for n = 2, 2 for n = 3, 3 to 4 for n = 4 at small a_r, and 1 for n >= 2 near full
    contact.
    """
    grid, (log_m, log_k) = contact.grid, map(np.log, contact.dispersion)
    log_k = np.minimum.accumulate(log_k[::-1])[::-1]  # the softest of the shorter waves
    area = held / grid.size
    # Rows and columns that the changes are counted along have this length together, in units of L.
    length = grid.points_y + grid.points * grid.length_y / grid.length
    chord = 2 * (1 - area) * length / changes if changes > 0 else 1.0  # in units of L
    log_mode = min(float(np.log(0.5 / max(chord, 1e-9))), log_m[-1])
    start = min(max(log_mode, log_m[0]), log_m[-1] - 0.1)  # of the exponent
    n = float((log_k[-1] - np.interp(start, log_m, log_k)) / (log_m[-1] - start))
    log_mode = min(log_mode + float(np.log(2)) * (n - 2) * (1 - area), log_m[-1])
    extrapolation = n * min(log_mode - log_m[0], 0.0)  # power law beyond the longest wave
    screening = float(np.exp(np.interp(log_mode, log_m, log_k) + extrapolation))
    return screening, n
