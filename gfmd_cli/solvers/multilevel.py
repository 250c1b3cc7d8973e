"""A multilevel preconditioner that knows where the contacts are.

The sum over levels of P_l P_l^T / D_l (Bramble, Pasciak & Xu, Math. Comput. 55, 1, 1990): P_l has
the bilinear hats of level l as columns, each twice as wide as those of the level below, and only
hats whose support meets no contact point take part. D_l = <phi_l K phi_l> is the energy of a hat,
so any k(q) will do. One application costs a few sweeps over the array and no transform.
"""

import numpy as np

from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.fields import Field, Mask
from gfmd_cli.physics.sweeps import Rows, kernel

COARSEST = 4  # hats a side on the last level: the next would overlap themselves


class Multilevel:
    """The preconditioner of one contact; `hold` binds it to a set of contact points."""

    def __init__(self, contact: Contact, rows: Rows) -> None:
        self.rows = rows
        self.energies = hat_energies(contact)
        side = contact.grid.points
        sides = [side >> level for level in range(1, len(self.energies))]
        self.fields = [np.empty((n, n)) for n in sides]
        self.held = [np.empty((n, n), dtype=np.bool_) for n in sides]
        self.shares = [Rows(n, len(rows.parts)) if n >= 256 else Rows(n, 1) for n in sides]

    def apply(self, sigma: Field, held: Mask, padded: Field) -> None:
        """padded <- preconditioned force -sigma of the free points; `held` as of `sweeps.hold`."""
        depth = 0
        for depth, (field, mask) in enumerate(zip(self.fields, self.held, strict=True)):
            if depth == 0:
                self.shares[0](first_restriction, sigma, held, field, mask)
            else:
                self.shares[depth](
                    restriction, self.fields[depth - 1], self.held[depth - 1], field, mask
                )
            if mask.all():
                break
        else:
            depth = len(self.fields)
        if depth == 0:
            self.rows(only_level, sigma, held, self.energies[0], padded)
            return
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
        self.rows(last_prolongation, self.fields[0], sigma, held, self.energies[0], padded)


def hat_energies(contact: Contact) -> list[float]:
    """<phi K phi> of a hat of each level; its Fourier transform is prod_j (1 + cos 2^j q dx)."""
    grid = contact.grid
    weighted = contact.stiffness * grid.multiplicity()
    across = 2 * np.pi * np.fft.fftfreq(grid.points)
    along = 2 * np.pi * np.arange(grid.points // 2 + 1) / grid.points
    energies = []
    rows, columns = np.ones(grid.points), np.ones(grid.points // 2 + 1)
    width, side = 1, grid.points
    while True:
        energies.append(float(rows**2 @ weighted @ columns**2) / grid.size)
        if side % 2 or side // 2 < COARSEST:
            return energies
        rows = rows * (1 + np.cos(width * across))
        columns = columns * (1 + np.cos(width * along))
        width, side = 2 * width, side // 2


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
def first_restriction(sigma, held, coarse, coarse_held, a, b):  # type: ignore[no-untyped-def]
    """Restriction of the force -sigma of the free points."""
    n, m = sigma.shape[0], coarse.shape[1]
    column, column_held = np.empty(2 * m), np.empty(2 * m, dtype=np.bool_)
    for i in range(a, b):
        up, mid, down = (2 * i - 1) % n, 2 * i, 2 * i + 1
        for j in range(2 * m):
            outer = (0.0 if held[up, j] else sigma[up, j]) + (
                0.0 if held[down, j] else sigma[down, j]
            )
            column[j] = -0.5 * outer - (0.0 if held[mid, j] else sigma[mid, j])
            column_held[j] = held[up, j] | held[mid, j] | held[down, j]
        _gather(column, column_held, coarse[i], coarse_held[i])


@kernel
def restriction(fine, held, coarse, coarse_held, a, b):  # type: ignore[no-untyped-def]
    """coarse <- P^T fine; a coarse hat is held where one of the hats it is made of is."""
    n, m = fine.shape[0], coarse.shape[1]
    column, column_held = np.empty(2 * m), np.empty(2 * m, dtype=np.bool_)
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
def last_prolongation(coarse, sigma, held, energy, padded, a, b):  # type: ignore[no-untyped-def]
    """padded <- -sigma / energy plus P coarse on the free points."""
    m = coarse.shape[0]
    for i in range(a, b):
        one, other = i // 2, ((i + 1) // 2) % m
        for j in range(m):
            here = 0.5 * (coarse[one, j] + coarse[other, j])
            nxt = j + 1 if j + 1 < m else 0
            there = 0.5 * (coarse[one, nxt] + coarse[other, nxt])
            e, o = 2 * j, 2 * j + 1
            padded[i, e] = 0.0 if held[i, e] else here - sigma[i, e] / energy
            padded[i, o] = 0.0 if held[i, o] else 0.5 * (here + there) - sigma[i, o] / energy


@kernel
def only_level(sigma, held, energy, padded, a, b):  # type: ignore[no-untyped-def]
    """padded <- -sigma / energy on the free points: no hat wider than a point fits in."""
    for i in range(a, b):
        for j in range(sigma.shape[1]):
            padded[i, j] = 0.0 if held[i, j] else -sigma[i, j] / energy
