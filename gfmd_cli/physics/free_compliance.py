"""Displacements of an elastomer without borders under a pressure that is constant on one pixel.

The elastomer has the compliance 1/k(q). In real space this is a kernel G(r), and the displacement
at the middle of a pixel, due to unit pressure on another pixel, is the integral of G over that
pixel (Love, Phil. Trans. R. Soc. A 228, 377, 1929, for the half-space).

For k = k_n q^n, G is the Riesz kernel c_n r^(n-d) / k_n in d dimensions; G decays for 0 < n < d. In
two dimensions, from int_0^inf q^(1-n) J_0(q r) dq (errata of the paper, Eq. 10b),

    c_n = 2^(1-n) Gamma(1 - n/2) / (2 pi Gamma(n/2)),

and in one dimension c_n = Gamma(1 - n) sin(pi n / 2) / pi, from int_0^inf q^(-n) cos(q x) dq.

Shapes and spacings are in the order (y, x). Arrays of displacements are indexed by the distance of
the two pixels in points, [y, x]. In two dimensions `rows` are the rows of such an array to compute.
"""

from collections.abc import Callable

import numpy as np
from scipy.special import gamma, hyp2f1, j0, rgamma

from gfmd_cli.grid.arrays import Field

NEAR = 64  # sides of a pixel within which the integral over it is in closed form
NODES = 2  # of Gauss's rule along each side beyond: relative error below 1e-9 (tested)
LAYER_NODES = 3  # of the rule for a layer, on parts of a pixel of at most
SMOOTH = 0.25  # thicknesses: relative error of all displacements below 1e-7 (tested)
MAX_PARTS = 64  # of the side of a pixel; such a layer is 1/16 of it
DECAYED = 25.0  # thicknesses from which the displacement of a layer is below rounding
LONGEST = 20.0  # q t from which a layer is a half-space: exp(-2 q t) is below rounding
ALL_ROWS = slice(None)

Shape = tuple[int, ...]
Spacings = tuple[float, ...]


def power_law(n: float, shape: Shape, spacings: Spacings, rows: slice = ALL_ROWS) -> Field:
    """Displacements for k = q^n, 0 <= n < 2, in two dimensions.

    Near pixels: with div(x r^(n-2)) = n r^(n-2), the integral over a rectangle from the origin to
    the corner (X, Y) is F = [X int_0^Y (X^2 + t^2)^(n/2-1) dt + Y int_0^X (Y^2 + t^2)^(n/2-1) dt]
    / n, and the integral over a pixel is the sum of +-F over its four corners.
    """
    prefactor = 2 ** (1 - n) * gamma(1 - n / 2) / (2 * np.pi)
    far = prefactor * rgamma(n / 2)
    out = pixel_averages(lambda r: far * r ** (n - 2), shape, spacings, rows)
    out *= spacings[0] * spacings[1]
    near = near_shape(shape, spacings)
    y, x = ((np.arange(m + 1) - 0.5) * side for m, side in zip(near, spacings, strict=True))
    corner = _side_integral(n, x[None, :], y[:, None]) + _side_integral(n, y[:, None], x[None, :])
    corner *= 0.5 * prefactor * rgamma(n / 2 + 1)  # 1 / (n Gamma(n/2)), also at n = 0
    closed = np.diff(np.diff(corner, axis=0), axis=1)[rows]
    out[: len(closed), : near[1]] = closed
    return out


def _side_integral(n: float, distance: Field, end: Field) -> Field:
    """X int_0^Y (X^2 + t^2)^(n/2 - 1) dt with X = `distance`, Y = `end`."""
    ratio = end / distance
    integral = hyp2f1(1 - n / 2, 0.5, 1.5, -(ratio**2))
    return np.asarray(np.sign(distance) * np.abs(distance) ** (n - 1) * end * integral)


def near_shape(shape: Shape, spacings: Spacings) -> Shape:
    """The pixels within NEAR sides of a pixel, as a part of an array of displacements."""
    reach = NEAR * max(spacings)
    return tuple(
        min(m, int(np.ceil(reach / side))) for m, side in zip(shape, spacings, strict=True)
    )


def pixel_averages(
    kernel: Callable[[Field], Field],
    shape: Shape,
    spacings: Spacings,
    rows: slice = ALL_ROWS,
    nodes_per_part: int = NODES,
    parts: int = 1,
) -> Field:
    """Averages over each pixel of a kernel G(r), by Gauss's rule on `parts` parts of its sides.

    The average over the pixel itself is of use if G is smooth at r = 0.
    """
    nodes, weights = _gauss_rule(nodes_per_part, parts)
    y, x = (np.arange(m) * side for m, side in zip(shape, spacings, strict=True))
    y = y[rows]
    out = np.zeros((y.size, x.size))
    for shift_y, weight_y in zip(nodes * spacings[0], weights, strict=True):
        for shift_x, weight_x in zip(nodes * spacings[1], weights, strict=True):
            r = np.sqrt(np.add.outer((y + shift_y) ** 2, (x + shift_x) ** 2))
            out += weight_y * weight_x * kernel(r)
    return out


def _gauss_rule(count: int, parts: int) -> tuple[Field, Field]:
    """Nodes in (-1/2, 1/2) and weights of a composite rule; the weights add up to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    middles = (np.arange(parts) + 0.5) / parts - 0.5
    return np.add.outer(middles, 0.5 * nodes / parts).ravel(), np.tile(0.5 * weights, parts) / parts


def power_law_line(n: float, points: int, spacing: float) -> Field:
    """Displacements for k = q^n, 0 <= n < 1, in one dimension."""
    prefactor = gamma(1 - n) * np.sinc(n / 2) / 2  # sin(pi n / 2) / (pi n), also at n = 0
    edges = (np.arange(points + 1) - 0.5) * spacing
    return np.asarray(np.diff(prefactor * np.sign(edges) * np.abs(edges) ** n))


def logarithmic_line(points: int, spacing: float) -> Field:
    """Displacements for k = q in one dimension, G = -ln(|x| / L) / pi, zero at x = L.

    G is known up to a constant, the level of reference. Here it is the displacement at the distance
    of the length L = points * spacing of the line.
    """
    edges = (np.arange(points + 1) - 0.5) / points
    antiderivative = edges * (1 - np.log(np.abs(edges)))
    return np.asarray(np.diff(antiderivative) * points * spacing / np.pi)


def layer(
    softening: Callable[[Field], Field],
    thickness: float,
    shape: Shape,
    spacings: Spacings,
    rows: slice = ALL_ROWS,
) -> Field:
    """Displacements for k = q / c(q t) of a layer on a rigid base, in two dimensions.

    `softening` is c(q t), the compliance relative to the half-space k = q: zero for q t = 0, one
    for q t >> 1. The kernel of 1/k is that of the half-space and a smooth rest,

        G(r) = 1 / (2 pi r) + int_0^inf [c(s) - 1] J_0(s r / t) ds / (2 pi t),

    and decays exponentially over the thickness. Raises ValueError for a layer that is much thinner
    than a pixel.
    """
    parts = _parts(thickness, max(spacings))
    reach = DECAYED * thickness
    near = tuple(
        min(m, int(np.ceil(reach / side)) + 1) for m, side in zip(shape, spacings, strict=True)
    )
    smooth = _wave_integral(lambda s: (softening(s) - 1) / (2 * np.pi), j0)

    def rest(r: Field) -> Field:
        beyond = -1 / (2 * np.pi * np.maximum(r, DECAYED))
        return np.where(r < DECAYED, smooth(np.minimum(r, DECAYED)), beyond)

    inside = pixel_averages(
        lambda r: rest(r / thickness) / thickness, near, spacings, rows, LAYER_NODES, parts
    )
    inside *= spacings[0] * spacings[1]
    inside += power_law(1.0, near, spacings, rows)
    y, x = (np.arange(m) * side for m, side in zip(near, spacings, strict=True))
    inside[np.add.outer(y[rows] ** 2, x**2) > reach**2] = 0.0
    out = np.zeros((len(range(*rows.indices(shape[0]))), shape[1]))
    out[: len(inside), : near[1]] = inside
    return out


def layer_line(
    softening: Callable[[Field], Field], thickness: float, points: int, spacing: float
) -> Field:
    """The same in one dimension. With int_0^inf tanh(s) cos(s y) ds / s = ln coth(pi y / 4),

        G(x) = ln coth(pi x / 4 t) / pi + int_0^inf [c(s) - tanh(s)] cos(s x / t) ds / (pi s),

    where the singular part -ln(x) is integrated over a pixel in closed form.
    """
    nodes, weights = _gauss_rule(LAYER_NODES, _parts(thickness, spacing))
    rest = _wave_integral(lambda s: (softening(s) - np.tanh(s)) / (np.pi * s), np.cos)
    x = np.arange(points) * spacing
    r = np.abs(x[:, None] + nodes * spacing) / thickness
    z = np.maximum(0.25 * np.pi * r, 1e-300)
    smooth = rest(np.minimum(r, DECAYED)) + np.log(z / np.tanh(z)) / np.pi
    edges = 0.25 * np.pi / thickness * (np.arange(points + 1) - 0.5) * spacing
    singular = np.diff(edges * (1 - np.log(np.abs(edges)))) * (4 * thickness / np.pi**2)
    return np.where(x < DECAYED * thickness, spacing * (smooth @ weights) + singular, 0.0)


def _parts(thickness: float, spacing: float) -> int:
    """Parts of the side of a pixel on which the kernel of a layer is smooth. Raises ValueError."""
    parts = int(np.ceil(spacing / (SMOOTH * thickness)))
    if parts > MAX_PARTS:
        raise ValueError(f"the thickness is less than 1/{int(MAX_PARTS * SMOOTH)} of the spacing")
    return parts


def _wave_integral(
    density: Callable[[Field], Field], wave: Callable[[Field], Field]
) -> Callable[[Field], Field]:
    """int_0^inf density(s) wave(s r) ds as a function of r up to DECAYED.

    `wave` is the cosine in one dimension and J_0 in two.
    """
    from scipy.interpolate import CubicSpline  # half a second that most processes save

    nodes, weights = np.polynomial.legendre.leggauss(16)
    panels = int(LONGEST * DECAYED / np.pi)  # at most half a wave in each
    ends = np.linspace(0.0, LONGEST, panels + 1)
    s = np.add.outer(0.5 * (ends[1:] + ends[:-1]), 0.5 * (ends[1] - ends[0]) * nodes).ravel()
    weight = np.tile(0.5 * (ends[1] - ends[0]) * weights, panels) * density(s)
    r = np.linspace(0.0, DECAYED, 1251)  # steps of 0.02
    spline: Callable[[Field], Field] = CubicSpline(
        r, [weight @ wave(s * distance) for distance in r]
    )
    return spline
