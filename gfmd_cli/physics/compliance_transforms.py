"""Displacements of an elastomer without borders whose stiffness is not a power law.

The compliance kernel G in two dimensions, and I, its integral over a disc divided by 2 pi, are the
Hankel transforms

    G(r) = int_0^inf phi J_0(phi) / k(phi / r) dphi / (2 pi r^2),
    I(r) = int_0^r G(r') r' dr' = int_0^inf J_1(phi) / k(phi / r) dphi / (2 pi)

of the compliance, with phi = q r and d[phi J_1(phi)]/dphi = phi J_0(phi). In one dimension

    I(x) = int_0^x G(x') dx' = int_0^inf sin(phi) / [phi k(phi / x)] dphi / pi.

The integrals over phi end at about CUT radians, where a smooth step turns the wave off (Abel's
summation): a smooth compliance adds nothing beyond. Each integral is Gauss's rule on intervals
that end at the knots of the stiffness, where its derivatives jump; below the first knot k is a
power law. The integral of G over the triangle between the x-axis, the line x = X and the direction
to the corner (X, Y) is that of I over the angle; with the distance X cosh(v) on this line it is

    int_0^asinh(Y/X) I(X cosh v) / cosh v dv,

and a second triangle makes the rectangle from the origin to the corner.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from math import hypot, inf

import numpy as np
from scipy.special import erfc, j0, j1

from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.free_compliance import FAR_NODES, NEAR_SIDES, Pixels, by_edges, overwrite

CUT, CUT_WIDTH = 300.0, 20.0  # radians; the step leaves exp(-CUT_WIDTH^2 / 4) of a wave
SMALLEST_PHASE = 1e-4  # radians up to which the wave is the first term of its series
INTERVAL_NODES = 12  # of Gauss's rule in an interval
WIDEST_INTERVAL, INTERVAL_RATIO = 2.0, 1.5  # largest width [radians] and ratio of the ends
MIN_KNOT_RATIO = 1.01  # ratio to the knot before, below which a knot needs no interval of its own
PER_E_FOLD = 80  # distances at which the transforms are computed; a cubic spline joins them
SPLINE_MARGIN = 3  # distances beyond the ends of the interval that is needed
POLAR_SIDES = 5  # sides of a pixel within which the integral over it is taken in polar coordinates
NEAR_NODES = 8  # of Gauss's rule along each side beyond, within `NEAR_SIDES`
ANGLE_NODES = 48  # of Gauss's rule within a triangle of a near pixel

WAVES: dict[str, tuple[Callable[[Field], Field], int, int]] = {
    "disc": (j1, 1, 0),
    "point": (lambda phi: phi * j0(phi), 1, -2),
    "line": (lambda phi: 2 * np.sinc(phi / np.pi), 0, 0),
}
"""The wave of a transform, the power of phi that it begins with, and the power of r in front."""


@dataclass(frozen=True, eq=False)
class Compliance:
    """1/k(q), and its transforms."""

    stiffness: Callable[[Field], Field]
    """k(q) for q > 0."""
    knots: Field
    """Wavenumbers [1/m] at which derivatives of k jump, rising; below them k is a power law."""
    lowest_exponent: float
    """Exponent of this power law, less than the dimension."""
    reach: float = inf
    """Distance from which displacements are below rounding [m]."""
    known: dict[tuple[str, int], float] = field(default_factory=dict)
    """Transforms that were computed, by wave and PER_E_FOLD ln r."""

    def displacements(self, pixels: Pixels) -> Field:
        """Displacements indexed by the distance of two pixels, in two dimensions or in one."""
        shape, spacings = pixels.shape, pixels.spacings
        if len(shape) == 1:
            low, high = 0.5 * spacings[0], (shape[0] - 0.5) * spacings[0]
            return by_edges(self.spline("line", low, high), *shape, *spacings)
        reached = pixels.within(self.reach / max(spacings) + 1)
        near = pixels.within(POLAR_SIDES + 1)
        out = np.zeros((len(range(*pixels.rows.indices(shape[0]))), shape[1]))
        if near != pixels:
            least = max(0.5 * min(spacings), POLAR_SIDES * max(spacings) - hypot(*spacings))
            kernel = self.spline("point", least, max(least, _diagonal(reached)))
            for part, nodes in ((reached, FAR_NODES), (reached.within(NEAR_SIDES), NEAR_NODES)):
                overwrite(out, part.integrals(lambda r: kernel(np.maximum(r, least)), nodes))
        disc = self.spline("disc", 0.5 * min(spacings), _diagonal(near))
        return overwrite(out, near.by_corners(partial(_corner, disc)))

    def spline(self, wave: str, low: float, high: float) -> Callable[[Field], Field]:
        """A transform as a function of the distance, from `low` to `high` [m]."""
        from scipy.interpolate import CubicSpline  # half a second that most processes save

        first = int(np.floor(PER_E_FOLD * np.log(low))) - SPLINE_MARGIN
        last = int(np.ceil(PER_E_FOLD * np.log(high))) + SPLINE_MARGIN
        steps = range(first, last + 1)
        for i in steps:
            if (wave, i) not in self.known:
                self.known[wave, i] = self.transform(wave, float(np.exp(i / PER_E_FOLD)))
        values = [self.known[wave, i] for i in steps]
        cubic = CubicSpline(np.array(steps) / PER_E_FOLD, values)
        return lambda r: np.asarray(cubic(np.log(r)))

    def transform(self, name: str, r: float) -> float:
        """r^m int_0^inf wave(phi) / k(phi / r) dphi / 2 pi, with the power m of `WAVES`."""
        wave, power, in_front = WAVES[name]
        knots, end = self.knots * r, CUT + 6 * CUT_WIDTH
        begin = min(SMALLEST_PHASE, knots[0])
        ends = np.unique([*_intervals(begin, end), *knots[(knots > begin) & (knots < end)]])
        nodes, weights = np.polynomial.legendre.leggauss(INTERVAL_NODES)
        half = 0.5 * np.diff(ends)
        phi = (ends[:-1] + half)[:, None] + np.multiply.outer(half, nodes)
        values = wave(phi) * (0.5 * erfc((phi - CUT) / CUT_WIDTH)) / self.stiffness(phi / r)
        first = np.array(begin)  # below, wave / k is phi^(power - n)
        series = wave(first) * first / self.stiffness(first / r)
        total = half @ (values @ weights) + series / (1 + power - self.lowest_exponent)
        return float(total * r**in_front / (2 * np.pi))


def separated(knots: Field) -> Field:
    """The first and last knot, and those that are not close to the one before.

    The kinks of a table with close rows are small.
    """
    chosen = np.ones(knots.size, dtype=bool)
    chosen[1:-1] = knots[1:-1] > MIN_KNOT_RATIO * knots[:-2]
    return knots[chosen]


def _intervals(low: float, high: float) -> Field:
    """Ends of intervals that are short against a wave and against the distance to zero."""
    turn = WIDEST_INTERVAL / (INTERVAL_RATIO - 1)
    count = int(np.ceil(np.log(turn / low) / np.log(INTERVAL_RATIO)))
    wide = np.arange(turn, high, WIDEST_INTERVAL)[1:]
    return np.concatenate([np.geomspace(low, turn, count), wide])


def _diagonal(pixels: Pixels) -> float:
    """Diagonal of a map of these pixels [m]."""
    return hypot(*np.multiply(pixels.shape, pixels.spacings))


def _corner(disc: Callable[[Field], Field], y: Field, x: Field) -> Field:
    """Integral of the kernel over the rectangle from the origin to each corner, odd in x and y."""
    nodes, weights = np.polynomial.legendre.leggauss(ANGLE_NODES)
    total = np.zeros(np.broadcast_shapes(y.shape, x.shape))
    for across, along in ((np.abs(x), np.abs(y)), (np.abs(y), np.abs(x))):
        half = 0.5 * np.arcsinh(along / across)
        for node, weight in zip(nodes, weights, strict=True):
            stretch = np.cosh(half * (1 + node))
            total += weight * half * disc(across * stretch) / stretch
    return np.sign(y) * np.sign(x) * total
