"""Preparation of measured maps: levelling, periodic edges, and filling of missing heights.

Maps have shape (rows, columns), any numbers of both; line profiles have shape (points,).
"""

from typing import Any, Literal

import numpy as np

from gfmd_cli.grid.arrays import Field, Mask
from gfmd_cli.maps.interpolation import positions
from gfmd_cli.maps.pictures import block_sums

Levelling = Literal["none", "mean", "plane", "curvature"]
Edges = Literal["none", "window", "mirror"]

MAX_EXACT = 100_000  # missing heights; the sparse solution of more takes seconds
JACOBI_STEPS = 30  # a choice: the filling is then smooth over several points
LEVELLING_ROUNDING = 256 * float(np.finfo(float).eps)
"""Largest rounding error of `level`, over the largest height: measured up to 92 eps in planes of 16
to 3000 points a side, with and without missing heights."""
DEGREES: dict[Levelling, int] = {"mean": 0, "plane": 1, "curvature": 2}


def level(heights: Field, levelling: Levelling, known: Mask | None = None) -> Field:
    """Subtract the least-squares polynomial of total degree 0, 1 or 2 in x and y.

    "mean" subtracts 1; "plane" 1, x, y; "curvature" 1, x, y, x^2, x y, y^2; "none" nothing. The
    polynomial is fitted to the heights that are known, all of them by default, and subtracted
    everywhere. The coordinates run from -1 to 1.
    """
    if levelling == "none":
        return heights
    rows = np.atleast_2d(heights)
    basis_y, basis_x = (_polynomials(points, DEGREES[levelling]) for points in rows.shape)
    order = np.add.outer(np.arange(basis_y.shape[1]), np.arange(basis_x.shape[1]))
    terms = order <= DEGREES[levelling]
    coefficients = np.zeros(terms.shape)
    if known is None:  # products of orthonormal polynomials are orthonormal: a projection
        coefficients[terms] = (basis_y.T @ rows @ basis_x)[terms]
    else:
        weight = np.atleast_2d(known).astype(np.float64)
        right = (basis_y.T @ np.where(weight > 0, rows, 0.0) @ basis_x)[terms]
        products = _products(basis_y).T @ weight @ _products(basis_x)  # over the known heights
        sizes = (basis_y.shape[1],) * 2 + (basis_x.shape[1],) * 2
        gram = products.reshape(sizes).transpose(0, 2, 1, 3)[terms][:, terms]
        coefficients[terms] = np.linalg.lstsq(gram, right, rcond=None)[0]
    return heights - (basis_y @ coefficients @ basis_x.T).reshape(heights.shape)


def _polynomials(points: int, degree: int) -> Field:
    """Discrete orthonormal polynomials up to a degree, shape (points, degree + 1 at most)."""
    order = min(degree, points - 1) + 1
    basis, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, points), order, increasing=True))
    return basis


def _products(basis: Field) -> Field:
    """Products of all pairs of polynomials, shape (points, pairs)."""
    return (basis[:, :, None] * basis[:, None, :]).reshape(len(basis), -1)


def make_periodic(heights: Field, edges: Edges, taper: float = 0.1) -> Field:
    """Make levelled heights periodic, without a jump across the border of the cell.

    "window" : Tukey window, heights -> mean + w (heights - mean), see `window`. The cell keeps its
        size; the heights near the border change, and `h_std` decreases (by 12 % for white noise
        at taper = 0.1).
    "mirror" : even extension to twice the points and sides. All heights and `h_std` are kept; the
        copies are correlated, so they do not improve the statistics, and the slope is
        discontinuous along the mirror lines.
    "none" : unchanged.

    Parameters
    ----------
    heights : shape (rows, columns), or (points,) of a line
    taper : width of the tapered zone at each edge as a fraction of the side, 0 < taper <= 1/2
    """
    if edges == "none":
        return heights
    if edges == "mirror":
        return mirror(heights)
    mean = heights.mean()
    return mean + window(heights.shape, taper) * (heights - mean)


def mirror(values: np.ndarray[Any, Any]) -> Any:
    """Even extension to twice the points along each axis."""
    return np.pad(values, [(0, points) for points in values.shape], mode="symmetric")


def window(shape: tuple[int, ...], taper: float, finer: tuple[int, ...] | None = None) -> Field:
    """Tukey window: rises as a cosine from 0 at the border to 1 at `taper` of each side.

    Its values are those in the middle of the pixels of a map of this shape, so that it is the same
    from all sides; with `finer`, those at the points of a finer grid of the same cell.
    """
    weight: Field = np.ones(())
    for points, new in zip(shape, finer or shape, strict=True):
        middles = (positions(points, new) + 0.5) / points
        border = np.minimum(middles, np.abs(1 - middles))  # the last may lie beyond the border
        along = 0.5 - 0.5 * np.cos(np.pi * np.minimum(border / taper, 1.0))
        weight = np.multiply.outer(weight, along)
    return weight


def fill_missing(
    heights: Field,
    missing: Mask,
    *,
    spacing: tuple[float, ...] = (1.0, 1.0),
    periodic: bool = False,
) -> Field:
    """Fill missing heights in by the solution of the discrete Laplace equation.

    Each missing height is the mean of its neighbours (fewer than four at the edge of the map,
    unless it is periodic) with weights 1/distance^2, so that the filling has no maximum or minimum
    of its own. Known heights are the boundary values.
    Beyond `MAX_EXACT` missing heights, `JACOBI_STEPS` steps of the Jacobi iteration smooth the
    solution of a map of half the resolution, without solving the equation exactly.

    Parameters
    ----------
    heights : shape (rows, columns) or (points,), any value where missing
    missing : mask of the missing heights, of the same shape; at least one height is known
    spacing : distance of the points along each axis, in any unit
    periodic : whether points at opposite edges are neighbours
    """
    weights = np.resize(min(spacing) / np.array(spacing), 2) ** 2  # of both axes; a profile has one
    filled = _filled(np.atleast_2d(heights), np.atleast_2d(missing), weights, periodic)
    return filled.reshape(heights.shape)


def _filled(heights: Field, missing: Mask, weights: Field, periodic: bool) -> Field:
    """See `fill_missing`; `weights` of the neighbours along each of the two axes."""
    known = np.where(missing, 0.0, heights)
    if not missing.any():
        return known
    exact = np.count_nonzero(missing) <= MAX_EXACT
    filled = (_harmonic if exact else _smooth)(known, missing, weights, periodic)
    low = known.min(where=~missing, initial=np.inf)  # only rounding exceeds the known heights
    high = known.max(where=~missing, initial=-np.inf)
    return np.clip(filled, low, high, out=filled)


def _smooth(known: Field, missing: Mask, weights: Field, periodic: bool) -> Field:
    """Filling from a map of half the resolution; `known` is zero where missing."""
    count, total = block_sums((~missing).astype(np.float64), 2), block_sums(known, 2)
    coarse = _filled(total / np.maximum(count, 1.0), count == 0, weights, periodic)
    for axis in (0, 1):
        coarse = coarse.repeat(2, axis)
    filled = np.where(missing, coarse[: known.shape[0], : known.shape[1]], known)
    for _ in range(JACOBI_STEPS):
        around = np.pad(filled, 1, mode="wrap" if periodic else "edge")
        along_y = around[:-2, 1:-1] + around[2:, 1:-1]
        along_x = around[1:-1, :-2] + around[1:-1, 2:]
        mean = (weights[0] * along_y + weights[1] * along_x) / (2 * weights.sum())
        np.copyto(filled, mean, where=missing)
    return filled


def _harmonic(known: Field, missing: Mask, weights: Field, periodic: bool) -> Field:
    """Filling by the sparse linear system; `known` is zero where missing."""
    from scipy.sparse import coo_array  # a tenth of a second that most processes save
    from scipy.sparse.linalg import spsolve

    points = np.argwhere(missing)
    number = np.full(missing.shape, -1)
    number[missing] = diagonal = np.arange(len(points))
    totals, right = np.zeros((2, len(points)))
    pairs = []
    for step in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        weight = weights[np.flatnonzero(step)[0]]
        neighbours = (points + step) % missing.shape if periodic else points + step
        inside = np.flatnonzero(np.all((neighbours >= 0) & (neighbours < missing.shape), axis=1))
        indices = tuple(neighbours[inside].T)
        totals[inside] += weight
        right[inside] += weight * known[indices]
        is_missing = missing[indices]
        row, column = inside[is_missing], number[indices][is_missing]
        pairs.append((row, column, np.full(row.size, -weight)))
    row, column, values = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    matrix = coo_array(
        (
            np.concatenate([totals, values]),
            (np.concatenate([diagonal, row]), np.concatenate([diagonal, column])),
        )
    )
    filled = known.copy()
    filled[missing] = spsolve(matrix.tocsc(), right, permc_spec="MMD_AT_PLUS_A")
    return filled
