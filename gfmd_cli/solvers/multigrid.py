"""A multigrid preconditioner that takes the contact points into account.

One V-cycle for a local approximation of K on the free points: on every level the squared five-point
Laplacian, scaled to k(q) of the waves that the level resolves, so that any k(q) is possible. On the
finest level the points of contact are held. As in truncated multigrid (Kornhuber, Numer. Math. 69,
167, 1994), the hat functions of coarser levels are truncated at these points, so that no hat is
lost because a contact lies under it. The energy of the truncation is not computed, but approximated
by a penalty: springs tie the coarse hats to zero at the points held, as stiff as the operator of
the level itself. This takes four bytes per coarse point, less than Galerkin stencils, and the
levels are not too stiff, as bilinear hats would be for a plate.

The cycle is symmetric. It is positive as long as the eigenvalues of the damped Jacobi iteration,
`DAMPING` times A over its diagonal, are below 2. They are at most 1.76 for the operator without
springs, and springs do not increase them, because they act on waves for which the operator is soft.
"""

from itertools import pairwise
from math import inf

import numpy as np

from gfmd_cli.grid.arrays import Field, SingleField
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.contact import Contact
from gfmd_cli.solvers import multigrid_kernels as kernels
from gfmd_cli.solvers.contact_state import ContactState
from gfmd_cli.solvers.multigrid_kernels import WHOLE_WEIGHT, ZERO

COARSEST = 4  # points along the shorter side on the coarsest level
ASPECT = 1.5  # of pixels up to which the levels have the same Laplacian along x and y
SPRING = 5.0  # penalty stiffness relative to k(2 q) / k(q); measured: best for n = 1.5 to 4
GROWTH = 20.0  # largest growth of k(q) between levels that the cycle permits; 16 at n = 4
COARSEST_SWEEPS = 4  # pairs of Jacobi sweeps on the coarsest level
UNIT = 1.0 / 64  # of the integers in `ties`


def suits(contact: Contact) -> bool:
    """Whether pixels are about square, and k(q) grows evenly enough between the levels."""
    levels, (dy, dx) = _levels(contact), contact.grid.spacings
    has_levels = len(levels) > 1 and max(dy, dx) <= ASPECT * min(dy, dx)
    return has_levels and all(growth < GROWTH for _, _, growth in levels)


def _levels(contact: Contact) -> list[tuple[int, float, float]]:
    """Points along x, scale of the operator and k(2 q) / k(q) of each level.

    The operator equals k(q) at a period of four points. Energies are sums over the finest points.
    """
    line, levels = contact.line, []
    for level in range(level_count(contact.grid, COARSEST)):
        n = contact.grid.points >> level
        k = float(line[n // 4])
        growth = float(line[n // 2]) / k if k > 0 else inf
        levels.append((n, 4.0**level * k, growth))
    return levels


def level_count(grid: Grid, coarsest: int) -> int:
    """Number of levels, each with half the points of the last one along x and y.

    The coarsest has at least `coarsest` points along either.
    """
    count, shape = 1, grid.whole_shape
    while all(points % 2 == 0 and points // 2 >= coarsest for points in shape):
        count, shape = count + 1, tuple(points // 2 for points in shape)
    return count


class Multigrid:
    """The preconditioner of one contact."""

    transforms = 0

    def __init__(self, contact: Contact) -> None:
        self.rows = contact.grid.rows
        self.z = contact.grid.as_rows(contact.grid.padded)
        sides, scales, growths = zip(*_levels(contact), strict=True)
        self.scale = np.float32(1.0 / scales[0])
        self.ratios = [np.float32(finer / coarser) for finer, coarser in pairwise(scales)]
        self.springs = [np.float32(UNIT * SPRING * growth) for growth in growths[1:]]
        self.coarse_rows = [self.rows.coarser()]
        while len(self.coarse_rows) < len(sides) - 1:
            self.coarse_rows.append(self.coarse_rows[-1].coarser())
        shapes = list(zip(self.coarse_rows, sides[1:], strict=True))
        self.rhs, self.x, self.y = (
            [rows.empty_with_halo(n, dtype=np.float32) for rows, n in shapes] for _ in range(3)
        )
        self.weights = [rows.empty_with_halo(n, dtype=np.int8) for rows, n in shapes]
        self.ties = [rows.empty_with_halo(4, n + 1, dtype=np.uint8) for rows, n in shapes]

    def apply(
        self, sigma: Field, contact_state: ContactState, threshold: int, change: Field
    ) -> tuple[float, float]:
        """See `preconditioners.Preconditioner.apply`."""
        self.rows.exchange_halo(contact_state)
        self.set_ties(contact_state, threshold)  # [1] penalty terms
        fields = (self.rows.with_halo(sigma), contact_state, threshold)
        # [2] one Jacobi sweep from zero on the finest level, and the restriction of its residual
        self.coarse_rows[0].run_from_finer(kernels.first_residual, fields, self.rhs[:1])
        self.descend()  # [3] pre-smoothing
        for level in range(len(self.coarse_rows) - 2, -1, -1):  # [4] correction, post-smoothing
            y = self.coarse_rows[level + 1].aligned_with_finer(self.y[level + 1])
            self.smooth(level, self.y[level], self.x[level], y, self.ratios[level + 1])
            self.smooth(level, self.x[level], self.y[level])
        coarse = (self.coarse_rows[0].aligned_with_finer(self.y[0]), self.ratios[0])
        # [5] correction and one sweep on the finest level, and the sums
        slope, turned = self.rows.sums_with_halo(
            2, kernels.last_smooth, *fields, *coarse, self.scale, change, self.z
        )
        return float(slope), float(turned)

    def descend(self) -> None:
        """Smooth and restrict, from the finest of the coarse levels to the coarsest."""
        last = len(self.coarse_rows) - 1
        for level in range(last + 1):
            self.smooth(level, None, self.y[level])
            if level < last:
                finer = (self.rhs[level], self.y[level], self.ties[level], self.springs[level])
                coarser = self.rhs[level + 1 : level + 2]
                self.coarse_rows[level + 1].run_from_finer(kernels.residual, finer, coarser)
        for _ in range(COARSEST_SWEEPS):
            self.smooth(last, self.y[last], self.x[last])
            self.smooth(last, self.x[last], self.y[last])

    def smooth(
        self,
        level: int,
        old: SingleField | None,
        new: SingleField,
        coarse: SingleField | None = None,
        ratio: np.float32 = ZERO,
    ) -> None:
        """Write the result of a Jacobi sweep on `old` plus P coarse to `new`.

        Without `old` it is that of two sweeps from zero.
        """
        rhs, rows = self.rhs[level], self.coarse_rows[level]
        matrix = (rhs, self.ties[level], self.springs[level])
        start = (rhs if old is None else old, rhs if coarse is None else coarse, ratio, old is None)
        rows.run_with_halo(kernels.smooth, *matrix, *start, new)
        rows.exchange_halo(new)

    def set_ties(self, contact_state: ContactState, threshold: int) -> None:
        """Compute the penalty terms of the coarse levels from the points held."""
        for level, rows in enumerate(self.coarse_rows):
            targets = (self.ties[level], self.weights[level])
            if level == 0:
                source = (contact_state, threshold, 0)
            else:
                source = (self.weights[level - 1], WHOLE_WEIGHT, 1)
            rows.run_from_finer(kernels.compute_ties, source, targets)
