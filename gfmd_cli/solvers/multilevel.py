"""A multilevel preconditioner that takes the contact points into account.

It is the sum over levels of P_l P_l^T / D_l (Bramble, Pasciak & Xu, Math. Comput. 55, 1, 1990). The
columns of P_l are the bilinear hats of level l, each twice as wide as those of the next finer
level. Only hats whose support contains no contact point take part. D_l = <phi_l K phi_l> is the
energy of a hat, so that any k(q) is possible. One application takes a few kernels over the array
and no transform.
"""

import numpy as np

from gfmd_cli.grid.arrays import Field, Mask
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.grid.modes import multiplicity
from gfmd_cli.grid.rows import LocalRows
from gfmd_cli.physics.contact import Contact
from gfmd_cli.solvers import preconditioner_kernels as kernels
from gfmd_cli.solvers.contact_state import ContactState
from gfmd_cli.solvers.multigrid import level_count

MIN_LEVEL_HATS = 4  # hats per side on the coarsest level; wider hats would overlap themselves


class Multilevel:
    """The multilevel preconditioner of one contact."""

    transforms = 0

    def __init__(self, contact: Contact, grid: Grid) -> None:
        self.rows = contact.grid.rows
        self.z = grid.as_rows(grid.padded)
        self.energies = hat_energies(contact)
        side, rows = contact.grid.points, self.rows
        self.coarse_rows: list[LocalRows] = []
        self.fields: list[Field] = []
        self.held: list[Mask] = []
        for level in range(1, len(self.energies)):
            rows = rows.coarser()
            self.coarse_rows.append(rows)
            self.fields.append(rows.empty_with_halo(side >> level, dtype=np.float32))
            self.held.append(rows.empty_with_halo(side >> level, dtype=np.bool_))

    def apply(
        self, sigma: Field, contact_state: ContactState, threshold: int, change: Field
    ) -> tuple[float, float]:
        """See `preconditioners.Preconditioner.apply`."""
        self.rows.exchange_halo(contact_state)
        fields = (self.rows.with_halo(sigma), contact_state, threshold)
        top = 0  # the coarsest level of which some hat is free
        for level, rows in enumerate(self.coarse_rows):
            targets = (self.fields[level], self.held[level])
            if level == 0:
                rows.run_from_finer(kernels.first_restriction, fields, targets)
            else:
                finer = (self.fields[level - 1], self.held[level - 1])
                rows.run_from_finer(kernels.restriction, finer, targets)
            if rows.all_true(self.held[level]):
                break
            top = level
        self.fields[top] *= np.where(self.held[top], 0.0, 1.0 / self.energies[top + 1])
        for level in range(top - 1, -1, -1):
            coarse, fine = self.coarse(level + 1), self.fields[level]
            energy = self.energies[level + 1]
            self.coarse_rows[level].run_with_halo(
                kernels.prolongation, coarse, self.held[level], energy, fine
            )
            self.coarse_rows[level].exchange_halo(fine)
        arguments = (self.coarse(0), *fields, self.energies[0], change, self.z)
        slope, z_change = self.rows.sums_with_halo(2, kernels.last_prolongation, *arguments)
        return float(slope), float(z_change)

    def coarse(self, level: int) -> Field:
        """The field of a level, aligned with the next finer level."""
        return self.coarse_rows[level].aligned_with_finer(self.fields[level])


def hat_energies(contact: Contact) -> list[float]:
    """<phi K phi> of a hat of each level, whose transform is prod_j (1 + cos 2^j q dx)."""
    grid = contact.grid
    levels = level_count(grid, MIN_LEVEL_HATS)
    rows, columns = (_squared_hats(points, levels) for points in grid.whole_shape)
    k = contact.stiffness[: rows.shape[1]]  # the other rows mirror these
    energies = grid.total(np.einsum("li,li->l", rows @ k, columns[:, slice(*grid.span)]))
    return [float(energy) / grid.size for energy in energies]


def _squared_hats(points: int, levels: int) -> Field:
    """Squares of the transforms of the hats along one axis, times the multiplicity of q >= 0."""
    phase = 2 * np.pi * np.arange(points // 2 + 1) / points
    hats = [np.ones(phase.size)]
    for level in range(levels - 1):
        hats.append(hats[-1] * (1 + np.cos(2**level * phase)))
    return np.array(hats) ** 2 * multiplicity(points)
