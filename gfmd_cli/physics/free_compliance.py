"""Displacements of an elastomer without borders under a pressure that is constant on one pixel.

The elastomer has the compliance 1/k(q). In real space this is a kernel G(r), and the displacement
at the middle of a pixel, due to unit pressure on another pixel, is the integral of G over that
pixel (Love, Phil. Trans. R. Soc. A 228, 377, 1929, for the half-space).

For k = k_n q^n, G is the Riesz kernel c_n r^(n-d) / k_n in d dimensions; G decays for 0 < n < d. In
two dimensions, from int_0^inf q^(1-n) J_0(q r) dq (paper Eq. (10b), which holds for 0 < n < 2),

    c_n = 2^(1-n) Gamma(1 - n/2) / (2 pi Gamma(n/2)),

and in one dimension c_n = Gamma(1 - n) sin(pi n / 2) / pi, from int_0^inf q^(-n) cos(q x) dq.

Shapes and spacings are in the order (y, x). Arrays of displacements are indexed by the distance of
the two pixels in points, [y, x].
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gamma, gammainc, hyp2f1, rgamma

from gfmd_cli.grid.arrays import Field
from gfmd_cli.grid.fft_grid import Shape

NEAR_SIDES = 64  # sides of a pixel within which the integral over it is in closed form
FAR_NODES = 2  # of Gauss's rule along each side beyond: relative error below 2e-9 (tested)
SMALLEST_ARGUMENT = 1e-12  # (alpha r)^2, below which the smooth part is that at r = 0 to 1e-12

Spacings = tuple[float, ...]


@dataclass(frozen=True)
class Pixels:
    """The pixels of a map by their distances from one of them, shape (y, x)."""

    shape: Shape
    spacings: Spacings
    rows: slice
    """The rows to compute, in two dimensions."""

    def within(self, sides: float) -> "Pixels":
        """The pixels within so many sides of a pixel."""
        reach = sides * max(self.spacings)
        pairs = zip(self.shape, self.spacings, strict=True)
        return replace(self, shape=tuple(int(min(m, np.ceil(reach / side))) for m, side in pairs))

    def integrals(self, kernel: Callable[[Field], Field], nodes_per_side: int = FAR_NODES) -> Field:
        """Integrals over each pixel of a kernel G(r), by Gauss's rule."""
        nodes, weights = (0.5 * each for each in np.polynomial.legendre.leggauss(nodes_per_side))
        dy, dx = self.spacings
        y, x = np.arange(self.shape[0])[self.rows] * dy, np.arange(self.shape[1]) * dx
        out = np.zeros((y.size, x.size))
        for shift_y, weight_y in zip(nodes * dy, weights * dy, strict=True):
            for shift_x, weight_x in zip(nodes * dx, weights * dx, strict=True):
                r = np.sqrt(np.add.outer((y + shift_y) ** 2, (x + shift_x) ** 2))
                out += weight_y * weight_x * kernel(r)
        return out

    def by_corners(self, corner: Callable[[Field, Field], Field]) -> Field:
        """Integrals over each pixel, from those over the rectangles from the origin to its corners.

        `corner` has the coordinates y, shape (rows + 1, 1), and x, shape (1, columns + 1).
        """
        pairs = zip(self.shape, self.spacings, strict=True)
        y, x = ((np.arange(m + 1) - 0.5) * side for m, side in pairs)
        return np.diff(np.diff(corner(y[:, None], x[None, :]), axis=0), axis=1)[self.rows]


def power_law(n: float, pixels: Pixels) -> Field:
    """Displacements for k = q^n, 0 <= n < 2; in one dimension 0 <= n <= 1.

    There, G = -ln(|x| / L) / pi at n = 1 is known up to a constant, the level of reference: here it
    is the displacement at the distance of the length L of the line.
    """
    if len(pixels.shape) == 2:
        return _plane(n, pixels)
    (points,), (spacing,) = pixels.shape, pixels.spacings
    if n == 1:
        length = points * spacing
        return by_edges(lambda x: x * (1 - np.log(x / length)) / np.pi, points, spacing)
    prefactor = gamma(1 - n) * np.sinc(n / 2) / 2  # sin(pi n / 2) / (pi n), also at n = 0
    return by_edges(lambda x: prefactor * x**n, points, spacing)


def smooth_part(n: float, alpha: float, r: Field) -> Field:
    """The part of G(r) whose transform is Q(n/2, q^2 / 4 alpha^2) / q^n, for 0 < n < 2.

    Q is the regularised upper incomplete gamma function. With q^(-n) as the integral of
    t^(n/2-1) exp(-q^2 t) / Gamma(n/2), this is the part t > 1 / 4 alpha^2, in two dimensions

        c_n r^(n-2) P(1 - n/2, alpha^2 r^2),    P = 1 - Q,

    which is finite at r = 0. For n = 1 it is erf(alpha r) / (2 pi r).
    """
    power = 1 - n / 2
    far = 2 ** (1 - n) * gamma(power) * rgamma(n / 2) / (2 * np.pi)
    x = np.maximum((alpha * r) ** 2, SMALLEST_ARGUMENT)
    values: Field = far * alpha ** (2 * power) * gammainc(power, x) * x**-power
    return values


def _plane(n: float, pixels: Pixels) -> Field:
    """Displacements for k = q^n, 0 <= n < 2, in two dimensions.

    Near pixels: with div(x r^(n-2)) = n r^(n-2), the integral over a rectangle from the origin to
    the corner (X, Y) is F = [X int_0^Y (X^2 + t^2)^(n/2-1) dt + Y int_0^X (Y^2 + t^2)^(n/2-1) dt]
    / n, and the integral over a pixel is the sum of +-F over its four corners.
    """
    prefactor = 2 ** (1 - n) * gamma(1 - n / 2) / (2 * np.pi)
    far = prefactor * rgamma(n / 2)
    closed = 0.5 * prefactor * rgamma(n / 2 + 1)  # 1 / (n Gamma(n/2)), also at n = 0

    def corner(y: Field, x: Field) -> Field:
        return closed * (_side_integral(n, x, y) + _side_integral(n, y, x))

    out = pixels.integrals(lambda r: far * r ** (n - 2))
    return overwrite(out, pixels.within(NEAR_SIDES).by_corners(corner))


def _side_integral(n: float, distance: Field, end: Field) -> Field:
    """X int_0^Y (X^2 + t^2)^(n/2 - 1) dt with X = `distance`, Y = `end`."""
    ratio = end / distance
    integral = hyp2f1(1 - n / 2, 0.5, 1.5, -(ratio**2))
    return np.sign(distance) * np.abs(distance) ** (n - 1) * end * integral


def by_edges(integral: Callable[[Field], Field], points: int, spacing: float) -> Field:
    """Integrals over each pixel of a line, from those from the origin to a distance x > 0."""
    edges = (np.arange(points + 1) - 0.5) * spacing
    return np.diff(np.sign(edges) * integral(np.abs(edges)))


def overwrite(values: Field, nearer: Field) -> Field:
    """The displacements with those of the nearer pixels written over them, in place."""
    values[: nearer.shape[0], : nearer.shape[1]] = nearer
    return values
