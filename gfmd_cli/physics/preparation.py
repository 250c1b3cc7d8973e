"""What is done to a measured map: holes filled in, trends taken off, edges made to meet."""

from typing import Literal

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve

from gfmd_cli.physics.fields import Field, Mask

Levelling = Literal["none", "mean", "plane", "curvature"]
Edges = Literal["none", "window", "mirror"]

DEGREES: dict[Levelling, int] = {"mean": 0, "plane": 1, "curvature": 2}


def level(heights: Field, degree: Levelling) -> Field:
    """Heights less the least-squares polynomial of total degree 0, 1 or 2 in x and y.

    "mean" takes off 1; "plane" 1, x, y; "curvature" 1, x, y, x^2, x y, y^2; "none" nothing.
    On a full grid the products of discrete orthonormal polynomials are orthonormal, so the
    fit is a projection. The coordinates run from -1 to 1.
    """
    if degree == "none":
        return heights
    order = np.arange(DEGREES[degree] + 1)
    coordinate = np.linspace(-1.0, 1.0, len(heights))
    basis, _ = np.linalg.qr(np.vander(coordinate, len(order), increasing=True))
    coefficients = basis.T @ heights @ basis
    coefficients[np.add.outer(order, order) > order[-1]] = 0.0
    trend: Field = basis @ coefficients @ basis.T
    return heights - trend


def make_periodic(heights: Field, how: Edges, taper: float = 0.1) -> Field:
    """Heights without a jump across the border of the cell; level them first.

    "window" : Tukey window, heights -> mean + w (heights - mean), where w rises as a cosine from
        0 at the border to 1 at `taper` of the side. The cell keeps its size; the heights in the
        frame change, and `h_std` drops (white roughness loses 12 % at taper = 0.1).
    "mirror" : even extension to 2N x 2N points and twice the length. Every height stays, and so
        does `h_std`; the four copies are correlated, so they are no better statistics than
        one, and the slope has kinks along the mirror lines.
    "none" : unchanged.

    Parameters
    ----------
    heights : (N, N)
    taper : width of the frame on each edge as a share of the side, 0 < taper <= 1/2
    """
    if how == "none":
        return heights
    if how == "mirror":
        return np.pad(heights, (0, len(heights)), mode="symmetric")
    if how != "window" or not 0.0 < taper <= 0.5:
        raise ValueError(f"how = {how!r}, taper = {taper}: window with 0 < taper <= 0.5, or mirror")
    points = len(heights)
    border = np.minimum(np.arange(points), points - np.arange(points)) / points
    window = 0.5 - 0.5 * np.cos(np.pi * np.minimum(border / taper, 1.0))
    mean = heights.mean()
    tapered: Field = mean + np.outer(window, window) * (heights - mean)
    return tapered


def border_step(heights: Field) -> float:
    """The rms step across the border over that between neighbours inside: 1 for a periodic map."""
    across = np.concatenate([heights[0] - heights[-1], heights[:, 0] - heights[:, -1]])
    inside = np.mean([np.mean(np.diff(heights, axis=axis) ** 2) for axis in (0, 1)])
    return float(np.sqrt(np.mean(across**2) / inside)) if inside > 0 else 1.0


def fill_missing(heights: Field, missing: Mask) -> Field:
    """Heights with the missing ones filled in so that each is the mean of its neighbours.

    The discrete Laplace equation with the known heights as boundary values: the smoothest surface
    across every hole, without a new peak or valley. At the edge of the map fewer neighbours count.

    Parameters
    ----------
    heights : (N, N), anything where missing
    missing : (N, N)
    """
    number = np.full(missing.shape, -1)
    number[missing] = np.arange(np.count_nonzero(missing))
    known = np.where(missing, 0.0, heights)
    neighbours, right = np.zeros((2, np.count_nonzero(missing)))
    pairs = []
    for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
        inside = [slice(None)] * 2
        beside = [slice(None)] * 2
        inside[axis] = slice(None, -1) if step > 0 else slice(1, None)
        beside[axis] = slice(1, None) if step > 0 else slice(None, -1)
        here, there = number[tuple(inside)], number[tuple(beside)]
        chosen = here >= 0
        np.add.at(neighbours, here[chosen], 1.0)
        np.add.at(right, here[chosen], known[tuple(beside)][chosen])
        chosen &= there >= 0
        pairs.append((here[chosen], there[chosen]))
    row, column = np.hstack(pairs)
    diagonal = np.arange(neighbours.size)
    matrix = coo_array(
        (
            np.concatenate([neighbours, -np.ones(row.size)]),
            (np.concatenate([diagonal, row]), np.concatenate([diagonal, column])),
        )
    )
    filled = known
    filled[missing] = spsolve(matrix.tocsc(), right)
    return filled
