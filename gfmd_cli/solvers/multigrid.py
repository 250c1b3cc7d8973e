"""A multigrid preconditioner that knows where the contacts are.

One V-cycle for a local stand-in of K on the free points: the squared five-point Laplacian on every
level, scaled there to k(q) of the waves which that level resolves, so that any k(q) will do. On the
finest level the points of contact are held. As in truncated multigrid (Kornhuber, Numer. Math. 69,
167, 1994) hats are cut off at them, and no coarse hat is lost because a contact lies under it; what
cutting costs is not computed, but stood in for: springs tie the coarse hats to zero at the points
held, as stiff as the coarse plate itself. Springs are cheaper to keep than Galerkin stencils, four
bytes a coarse point, and the levels are not too stiff, as bilinear hats would be for a plate.

The cycle is symmetric, and it is positive as long as no level is smoothed too far, that is while
the eigenvalues of the sweeps, `DAMPING` times A over its diagonal, stay below 2: the plate alone
has 1.76, and springs, which pull at waves that the plate hardly resists, do not add to that.
"""

from itertools import pairwise
from math import inf
from typing import Any

import numpy as np

from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.fields import Field, Marks
from gfmd_cli.physics.sweeps import Rows
from gfmd_cli.solvers import multigrid_sweeps as sweeps

COARSEST = 4  # points a side on the last level
SPRING = 5.0  # springs in these units, times k(2 q) / k(q); measured: best for n = 1.5 to 4
GROWTH = 20.0  # of k(q) from one level to the next, 16 at n = 4, up to which the cycle will do
LAST_SWEEPS = 4  # pairs of them on the last level
UNIT = 1.0 / 64  # of the ties


def suits(contact: Contact) -> bool:
    """Whether k(q) of two-dimensional `contact` grows as evenly as the cycle needs."""
    levels = _levels(contact)
    return len(levels) > 1 and all(growth < GROWTH for _, _, growth in levels)


def _levels(contact: Contact) -> list[tuple[int, float, float]]:
    """Of each level: points a side, scale of its operator, k(2 q) / k(q).

    Scaled at the wave of four points a period; energies are sums over the points of the finest.
    """
    line, side = contact.line, contact.grid.points
    sides = [side]
    while sides[-1] % 2 == 0 and sides[-1] // 2 >= COARSEST:
        sides.append(sides[-1] // 2)
    found = []
    for level, n in enumerate(sides):
        k = float(line[n // 4])
        growth = float(line[n // 2]) / k if k > 0 else inf
        found.append((n, 4.0**level * k, growth))
    return found


class Multigrid:
    """The preconditioner of one contact."""

    def __init__(self, contact: Contact, rows: Rows) -> None:
        self.rows = rows
        sides, scales, growths = zip(*_levels(contact), strict=True)
        self.scale = 1.0 / scales[0]
        self.ratios = [finer / coarser for finer, coarser in pairwise(scales)]
        self.springs = [np.float32(UNIT * SPRING * growth) for growth in growths[1:]]
        self.shares = [rows.coarser()]
        while len(self.shares) < len(sides) - 1:
            self.shares.append(self.shares[-1].coarser())
        levels = list(zip(self.shares, sides[1:], strict=True))
        self.right, self.x, self.y = (
            [share.empty(n, dtype=np.float32) for share, n in levels] for _ in range(3)
        )
        self.weights = [share.empty(n, dtype=np.int8) for share, n in levels]
        self.ties = [share.empty(4, n + 1, dtype=np.uint8) for share, n in levels]

    def apply(
        self, sigma: Field, marks: Marks, least: int, change: Field, padded: Field
    ) -> tuple[float, float]:
        """padded <- z, the preconditioned force -sigma of the free points.

        `marks` have a frame. Returns the sums of z times force and of z times `change`.
        """
        self.rows.meet(marks)
        self.tie(marks, least)
        bodies = (self.rows.framed(sigma), marks, least)
        self.shares[0].from_finer(sweeps.first_residual, bodies, self.right[:1])
        self.descend()
        for level in range(len(self.shares) - 2, -1, -1):
            right, x, y, ties, spring = self.level(level)
            coarse = (self.shares[level + 1].for_finer(self.y[level + 1]), self.ratios[level + 1])
            self.smooth(level, sweeps.smooth_corrected, right, y, ties, spring, *coarse, x)
            self.smooth(level, sweeps.smooth, right, x, ties, spring, y)
        coarse = (self.shares[0].for_finer(self.y[0]), self.ratios[0])
        slope, turned = self.rows.framed_sums(
            2, sweeps.last_smooth, *bodies, *coarse, self.scale, change, padded
        )
        return float(slope), float(turned)

    def descend(self) -> None:
        """From the finest of the coarse levels to the last, smoothing on each."""
        last = len(self.shares) - 1
        for level in range(last + 1):
            right, x, y, ties, spring = self.level(level)
            self.smooth(level, sweeps.smooth_first, right, ties, spring, y)
            if level < last:
                finer, coarser = (right, y, ties, spring), self.right[level + 1 : level + 2]
                self.shares[level + 1].from_finer(sweeps.residual, finer, coarser)
        for _ in range(LAST_SWEEPS):
            self.smooth(last, sweeps.smooth, right, y, ties, spring, x)
            self.smooth(last, sweeps.smooth, right, x, ties, spring, y)

    def smooth(self, level: int, sweep: Any, *arguments: Any) -> None:
        """Run a sweep that writes to the last of its arguments."""
        self.shares[level].over(sweep, *arguments)
        self.shares[level].meet(arguments[-1])

    def level(self, level: int) -> tuple[Any, ...]:
        """Right-hand side, two fields to work in, ties and the stiffness of springs of a level."""
        fields = (self.right, self.x, self.y, self.ties, self.springs)
        return tuple(field[level] for field in fields)

    def tie(self, marks: Marks, least: int) -> None:
        """Tie the coarse levels to the points held."""
        for level, share in enumerate(self.shares):
            targets = (self.ties[level], self.weights[level])
            if level == 0:
                share.from_finer(sweeps.first_ties, (marks, least), targets)
            else:
                share.from_finer(sweeps.further_ties, self.weights[level - 1 : level], targets)
