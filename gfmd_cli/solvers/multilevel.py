"""A multilevel preconditioner that knows where the contacts are.

The sum over levels of P_l P_l^T / D_l (Bramble, Pasciak & Xu, Math. Comput. 55, 1, 1990): P_l has
the bilinear hats of level l as columns, each twice as wide as those of the level below, and only
hats whose support meets no contact point take part. D_l = <phi_l K phi_l> is the energy of a hat,
so any k(q) will do. One application costs a few sweeps over the array and no transform.
"""

import numpy as np

from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.fields import Field, Marks, Mask
from gfmd_cli.physics.sweeps import Rows, kernel

COARSEST = 4  # hats a side on the last level: the next would overlap themselves


class Multilevel:
    """The preconditioner of one contact; `hold` binds it to a set of contact points."""

    def __init__(self, contact: Contact, rows: Rows) -> None:
        self.rows = rows
        self.energies = hat_energies(contact)
        side, share = contact.grid.points, rows
        self.shares: list[Rows] = []
        self.fields: list[Field] = []
        self.held: list[Mask] = []
        for level in range(1, len(self.energies)):
            share = share.coarser()
            self.shares.append(share)
            self.fields.append(share.empty(side >> level, dtype=np.float32))
            self.held.append(share.empty(side >> level, dtype=np.bool_))

    def apply(
        self, sigma: Field, marks: Marks, least: int, change: Field, padded: Field
    ) -> tuple[float, float]:
        """padded <- z, the preconditioned force -sigma of the free points.

        `marks` have a frame. Returns the sums of z times force and of z times `change`.
        """
        self.rows.meet(marks)
        bodies = (self.rows.framed(sigma), marks, least)
        depth = 0
        for depth, share in enumerate(self.shares):
            targets = (self.fields[depth], self.held[depth])
            if depth == 0:
                share.from_finer(first_restriction, bodies, targets)
            else:
                finer = (self.fields[depth - 1], self.held[depth - 1])
                share.from_finer(restriction, finer, targets)
            if share.every(self.held[depth]):
                break
        else:
            depth = len(self.fields)
        way = (self.energies[0], change, padded)
        if depth == 0:
            slope, turned = self.rows.framed_sums(2, only_level, *bodies, *way)
            return float(slope), float(turned)
        top = depth - 1
        self.fields[top] *= np.where(self.held[top], 0.0, 1.0 / self.energies[depth])
        for level in range(top - 1, -1, -1):
            coarse, fine = self.coarse(level + 1), self.fields[level]
            energy = self.energies[level + 1]
            self.shares[level].over(prolongation, coarse, self.held[level], energy, fine)
            self.shares[level].meet(fine)
        sums = self.rows.framed_sums(2, last_prolongation, self.coarse(0), *bodies, *way)
        return float(sums[0]), float(sums[1])

    def coarse(self, level: int) -> Field:
        """The field of a level as the next finer one takes it."""
        framed: Field = self.shares[level].for_finer(self.fields[level])
        return framed


def hat_energies(contact: Contact) -> list[float]:
    """<phi K phi> of a hat of each level; its Fourier transform is prod_j (1 + cos 2^j q dx)."""
    grid = contact.grid
    phase = 2 * np.pi * np.arange(grid.points // 2 + 1) / grid.points
    hats, side = [np.ones(phase.size)], grid.points
    while side % 2 == 0 and side // 2 >= COARSEST:
        hats.append(hats[-1] * (1 + np.cos((grid.points // side) * phase)))
        side //= 2
    count = np.full(phase.size, 2.0)
    count[0] = count[-1] = 1.0
    weighted = np.array(hats) ** 2 * count
    columns = weighted[:, slice(*grid.span)]
    k = contact.stiffness[: phase.size]  # the other rows mirror these
    energies = grid.total(np.einsum("li,li->l", weighted @ k, columns))
    return [float(energy) / grid.size for energy in energies]


@kernel
def _gather(column, column_held, coarse, coarse_held):  # type: ignore[no-untyped-def]
    """A coarse row from the sums over three fine rows."""
    m = coarse.size
    coarse[0] = 0.5 * (column[2 * m - 1] + column[1]) + column[0]
    coarse_held[0] = column_held[2 * m - 1] | column_held[0] | column_held[1]
    for j in range(1, m):
        coarse[j] = 0.5 * (column[2 * j - 1] + column[2 * j + 1]) + column[2 * j]
        coarse_held[j] = column_held[2 * j - 1] | column_held[2 * j] | column_held[2 * j + 1]


@kernel
def first_restriction(sigma, marks, least, coarse, coarse_held, a, b):  # type: ignore[no-untyped-def]
    """Restriction of the force -sigma of the free points."""
    height, m = sigma.shape[0], coarse.shape[1]
    column, column_held = np.empty(2 * m, dtype=coarse.dtype), np.empty(2 * m, dtype=np.bool_)
    for i in range(a, b):
        up, mid, down = (2 * i - 1) % height, 2 * i, 2 * i + 1
        for j in range(2 * m):
            above, here, below = (
                marks[up, j] >= least,
                marks[mid, j] >= least,
                marks[down, j] >= least,
            )
            outer = (0.0 if above else sigma[up, j]) + (0.0 if below else sigma[down, j])
            column[j] = -0.5 * outer - (0.0 if here else sigma[mid, j])
            column_held[j] = above | here | below
        _gather(column, column_held, coarse[i], coarse_held[i])


@kernel
def restriction(fine, held, coarse, coarse_held, a, b):  # type: ignore[no-untyped-def]
    """coarse <- P^T fine; a coarse hat is held where one of the hats it is made of is."""
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
    """fine <- fine / energy where not held, plus P coarse."""
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
def last_prolongation(coarse, sigma, marks, least, energy, change, padded, out, a, b):  # type: ignore[no-untyped-def]
    """padded <- z = -sigma / energy plus P coarse on the free points; sums as of `apply`."""
    rows, m = coarse.shape
    frame = (sigma.shape[0] - change.shape[0]) // 2
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
            z = 0.0 if marks[i, j] >= least else row[j] - s / energy
            padded[i - frame, j] = z
            slope -= z * s
            turned += z * change[i - frame, j]
        out[i, 0], out[i, 1] = slope, turned


@kernel
def only_level(sigma, marks, least, energy, change, padded, out, a, b):  # type: ignore[no-untyped-def]
    """padded <- z = -sigma / energy on the free points: no hat wider than a point fits in."""
    frame = (sigma.shape[0] - change.shape[0]) // 2
    for i in range(a, b):
        slope = turned = 0.0
        for j in range(sigma.shape[1]):
            s = sigma[i, j]
            z = 0.0 if marks[i, j] >= least else -s / energy
            padded[i - frame, j] = z
            slope -= z * s
            turned += z * change[i - frame, j]
        out[i, 0], out[i, 1] = slope, turned
