"""A multilevel preconditioner that takes the contact points into account.

It is the sum over levels of P_l P_l^T / D_l (Bramble, Pasciak & Xu, Math. Comput. 55, 1, 1990). The
columns of P_l are the bilinear hats of level l, each twice as wide as those of the next finer
level. Only hats whose support contains no contact point take part. D_l = <phi_l K phi_l> is the
energy of a hat, so that any k(q) is possible. One application takes a few kernels over the array
and no transform.
"""

import numpy as np

from gfmd_cli.grid.arrays import Field, Mask
from gfmd_cli.grid.compilation import kernel, part_of_kernel
from gfmd_cli.grid.fft_grid import Grid, multiplicity
from gfmd_cli.grid.rows import LocalRows
from gfmd_cli.physics.contact import Contact
from gfmd_cli.solvers.contact_state import ContactState
from gfmd_cli.solvers.multigrid import level_count

COARSEST = 4  # hats per side on the coarsest level; wider hats would overlap themselves


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
        depth = 0
        for depth, rows in enumerate(self.coarse_rows):
            targets = (self.fields[depth], self.held[depth])
            if depth == 0:
                rows.run_from_finer(first_restriction, fields, targets)
            else:
                finer = (self.fields[depth - 1], self.held[depth - 1])
                rows.run_from_finer(restriction, finer, targets)
            if rows.all_true(self.held[depth]):
                break
        else:
            depth = len(self.fields)
        arguments = (self.energies[0], change, self.z)
        if depth == 0:
            slope, turned = self.rows.sums_with_halo(2, only_level, *fields, *arguments)
            return float(slope), float(turned)
        top = depth - 1
        self.fields[top] *= np.where(self.held[top], 0.0, 1.0 / self.energies[depth])
        for level in range(top - 1, -1, -1):
            coarse, fine = self.coarse(level + 1), self.fields[level]
            energy = self.energies[level + 1]
            self.coarse_rows[level].run_with_halo(
                prolongation, coarse, self.held[level], energy, fine
            )
            self.coarse_rows[level].exchange_halo(fine)
        sums = self.rows.sums_with_halo(2, last_prolongation, self.coarse(0), *fields, *arguments)
        return float(sums[0]), float(sums[1])

    def coarse(self, level: int) -> Field:
        """The field of a level, aligned with the next finer level."""
        return self.coarse_rows[level].aligned_with_finer(self.fields[level])


def hat_energies(contact: Contact) -> list[float]:
    """<phi K phi> of a hat of each level, whose transform is prod_j (1 + cos 2^j q dx)."""
    grid = contact.grid
    levels = level_count(grid, COARSEST)
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


@part_of_kernel
def _gather(column, column_held, coarse, coarse_held):  # type: ignore[no-untyped-def]
    """Compute a coarse row from the weighted sums of three fine rows."""
    m = coarse.size
    coarse[0] = 0.5 * (column[2 * m - 1] + column[1]) + column[0]
    coarse_held[0] = column_held[2 * m - 1] | column_held[0] | column_held[1]
    for j in range(1, m):
        coarse[j] = 0.5 * (column[2 * j - 1] + column[2 * j + 1]) + column[2 * j]
        coarse_held[j] = column_held[2 * j - 1] | column_held[2 * j] | column_held[2 * j + 1]


@kernel
def first_restriction(sigma, contact_state, threshold, coarse, coarse_held, a, b):  # type: ignore[no-untyped-def]
    """Restrict the force -sigma of the free points."""
    height, m = sigma.shape[0], coarse.shape[1]
    column, column_held = np.empty(2 * m, dtype=coarse.dtype), np.empty(2 * m, dtype=np.bool_)
    for i in range(a, b):
        up, mid, down = (2 * i - 1) % height, 2 * i, 2 * i + 1
        for j in range(2 * m):
            above, here, below = (
                contact_state[up, j] >= threshold,
                contact_state[mid, j] >= threshold,
                contact_state[down, j] >= threshold,
            )
            outer = (0.0 if above else sigma[up, j]) + (0.0 if below else sigma[down, j])
            column[j] = -0.5 * outer - (0.0 if here else sigma[mid, j])
            column_held[j] = above | here | below
        _gather(column, column_held, coarse[i], coarse_held[i])


@kernel
def restriction(fine, held, coarse, coarse_held, a, b):  # type: ignore[no-untyped-def]
    """Write P^T fine to `coarse`; a coarse hat is held if one of its fine hats is held."""
    height, m = fine.shape[0], coarse.shape[1]
    column, column_held = np.empty(2 * m, dtype=coarse.dtype), np.empty(2 * m, dtype=np.bool_)
    for i in range(a, b):
        up, mid, down = (2 * i - 1) % height, 2 * i, 2 * i + 1
        for j in range(2 * m):
            column[j] = 0.5 * (fine[up, j] + fine[down, j]) + fine[mid, j]
            column_held[j] = held[up, j] | held[mid, j] | held[down, j]
        _gather(column, column_held, coarse[i], coarse_held[i])


@kernel
def prolongation(coarse, held, energy, fine, a, b):  # type: ignore[no-untyped-def]
    """Divide `fine` by the energy of its hats, zero for hats held, and add P coarse."""
    rows, m = coarse.shape
    for i in range(a, b):
        one, other = i // 2, ((i + 1) // 2) % rows
        for j in range(m):
            here = 0.5 * (coarse[one, j] + coarse[other, j])
            nxt = j + 1 if j + 1 < m else 0
            there = 0.5 * (coarse[one, nxt] + coarse[other, nxt])
            e, o = 2 * j, 2 * j + 1
            fine[i, e] = here + (0.0 if held[i, e] else fine[i, e] / energy)
            fine[i, o] = 0.5 * (here + there) + (0.0 if held[i, o] else fine[i, o] / energy)


@kernel
def last_prolongation(coarse, sigma, contact_state, threshold, energy, change, padded, out, a, b):  # type: ignore[no-untyped-def]
    """Write z = -sigma / energy + P coarse on the free points; sums of `Multilevel.apply`."""
    rows, m = coarse.shape
    halo = (sigma.shape[0] - change.shape[0]) // 2
    row = np.empty(2 * m, dtype=coarse.dtype)
    for i in range(a, b):
        one, other = i // 2, ((i + 1) // 2) % rows
        for j in range(m):
            row[2 * j] = 0.5 * (coarse[one, j] + coarse[other, j])
        for j in range(m - 1):
            row[2 * j + 1] = 0.5 * (row[2 * j] + row[2 * j + 2])
        row[2 * m - 1] = 0.5 * (row[2 * m - 2] + row[0])
        slope = turned = 0.0
        for j in range(2 * m):
            s = sigma[i, j]
            z = 0.0 if contact_state[i, j] >= threshold else row[j] - s / energy
            padded[i - halo, j] = z
            slope -= z * s
            turned += z * change[i - halo, j]
        out[i, 0], out[i, 1] = slope, turned


@kernel
def only_level(sigma, contact_state, threshold, energy, change, padded, out, a, b):  # type: ignore[no-untyped-def]
    """Write z = -sigma / energy on the free points, if all hats of coarser levels are held."""
    halo = (sigma.shape[0] - change.shape[0]) // 2
    for i in range(a, b):
        slope = turned = 0.0
        for j in range(sigma.shape[1]):
            s = sigma[i, j]
            z = 0.0 if contact_state[i, j] >= threshold else -s / energy
            padded[i - halo, j] = z
            slope -= z * s
            turned += z * change[i - halo, j]
        out[i, 0], out[i, 1] = slope, turned
