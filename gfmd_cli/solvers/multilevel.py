"""A multilevel preconditioner that knows where the contacts are.

The sum over levels of P_l P_l^T / D_l (Bramble, Pasciak & Xu, Math. Comput. 55, 1, 1990): P_l has
the bilinear hats of level l as columns, each twice as wide as those of the level below, and only
hats whose support meets no contact point take part. D_l = <phi_l K phi_l> is the energy of a hat,
so any k(q) will do. One application costs a few sweeps over the array and no transform.
"""

import numpy as np

from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.fields import Field, Marks
from gfmd_cli.physics.sweeps import Rows, kernel

COARSEST = 4  # hats a side on the last level: the next would overlap themselves


class Multilevel:
    """The preconditioner of one contact; `hold` binds it to a set of contact points."""

    def __init__(self, contact: Contact, rows: Rows) -> None:
        self.rows = rows
        self.energies = hat_energies(contact)
        side = contact.grid.points
        sides = [side >> level for level in range(1, len(self.energies))]
        self.fields = [np.empty((n, n), dtype=np.float32) for n in sides]
        self.held = [np.empty((n, n), dtype=np.bool_) for n in sides]
        self.shares = [Rows(n, len(rows.parts)) if n >= 256 else Rows(n, 1) for n in sides]

    def apply(
        self, sigma: Field, marks: Marks, least: int, change: Field, padded: Field
    ) -> tuple[float, float]:
        """padded <- z, the preconditioned force -sigma of the free points.

        Returns the sums of z times force and of z times `change`.
        """
        bodies = (sigma, marks, least)
        depth = 0
        for depth, (field, mask) in enumerate(zip(self.fields, self.held, strict=True)):
            if depth == 0:
                self.shares[0](first_restriction, *bodies, field, mask)
            else:
                self.shares[depth](
                    restriction, self.fields[depth - 1], self.held[depth - 1], field, mask
                )
            if mask.all():
                break
        else:
            depth = len(self.fields)
        if depth == 0:
            slope, turned = self.rows.sums(2, only_level, *bodies, self.energies[0], change, padded)
            return float(slope), float(turned)
        top = depth - 1
        self.fields[top] *= np.where(self.held[top], 0.0, 1.0 / self.energies[depth])
        for level in range(top - 1, -1, -1):
            self.shares[level](
                prolongation,
                self.fields[level + 1],
                self.held[level],
                self.energies[level + 1],
                self.fields[level],
            )
        slope, turned = self.rows.sums(
            2, last_prolongation, self.fields[0], *bodies, self.energies[0], change, padded
        )
        return float(slope), float(turned)


def hat_energies(contact: Contact) -> list[float]:
    """<phi K phi> of a hat of each level; its Fourier transform is prod_j (1 + cos 2^j q dx)."""
    grid = contact.grid
    phase = 2 * np.pi * np.arange(grid.points // 2 + 1) / grid.points
    hats, side = [np.ones(phase.size)], grid.points
    while side % 2 == 0 and side // 2 >= COARSEST:
        hats.append(hats[-1] * (1 + np.cos((grid.points // side) * phase)))
        side //= 2
    weighted = np.array(hats) ** 2 * grid.multiplicity()
    k = contact.stiffness[: phase.size]  # the other rows mirror these
    return [float(energy) / grid.size for energy in np.einsum("li,li->l", weighted @ k, weighted)]


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
    n, m = sigma.shape[0], coarse.shape[1]
    column, column_held = np.empty(2 * m, dtype=coarse.dtype), np.empty(2 * m, dtype=np.bool_)
    for i in range(a, b):
        up, mid, down = (2 * i - 1) % n, 2 * i, 2 * i + 1
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
    n, m = fine.shape[0], coarse.shape[1]
    column, column_held = np.empty(2 * m, dtype=coarse.dtype), np.empty(2 * m, dtype=np.bool_)
    for i in range(a, b):
        up, mid, down = (2 * i - 1) % n, 2 * i, 2 * i + 1
        for j in range(2 * m):
            column[j] = 0.5 * (fine[up, j] + fine[down, j]) + fine[mid, j]
            column_held[j] = held[up, j] | held[mid, j] | held[down, j]
        _gather(column, column_held, coarse[i], coarse_held[i])


@kernel
def prolongation(coarse, held, energy, fine, a, b):  # type: ignore[no-untyped-def]
    """fine <- fine / energy where not held, plus P coarse."""
    m = coarse.shape[0]
    for i in range(a, b):
        one, other = i // 2, ((i + 1) // 2) % m
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
    m = coarse.shape[0]
    row = np.empty(2 * m, dtype=coarse.dtype)
    for i in range(a, b):
        one, other = i // 2, ((i + 1) // 2) % m
        for j in range(m):
            row[2 * j] = 0.5 * (coarse[one, j] + coarse[other, j])
        for j in range(m - 1):
            row[2 * j + 1] = 0.5 * (row[2 * j] + row[2 * j + 2])
        row[2 * m - 1] = 0.5 * (row[2 * m - 2] + row[0])
        slope = turned = 0.0
        for j in range(2 * m):
            s = sigma[i, j]
            z = 0.0 if marks[i, j] >= least else row[j] - s / energy
            padded[i, j] = z
            slope -= z * s
            turned += z * change[i, j]
        out[i, 0], out[i, 1] = slope, turned


@kernel
def only_level(sigma, marks, least, energy, change, padded, out, a, b):  # type: ignore[no-untyped-def]
    """padded <- z = -sigma / energy on the free points: no hat wider than a point fits in."""
    for i in range(a, b):
        slope = turned = 0.0
        for j in range(sigma.shape[1]):
            s = sigma[i, j]
            z = 0.0 if marks[i, j] >= least else -s / energy
            padded[i, j] = z
            slope -= z * s
            turned += z * change[i, j]
        out[i, 0], out[i, 1] = slope, turned
