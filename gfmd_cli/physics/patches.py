"""Patches of contact, and whether the gap between them percolates, on the periodic cell.

On a square lattice neighbours by edge and neighbours by edge or corner are dual: where one region
is connected in one sense it parts the other in the other sense. Fluid passes through the edges that
two cells share, so the gap has four neighbours and contact has eight.

A region percolates along an axis where a path in it comes back to where it began displaced by a
whole number of cells, not zero, along that axis: it winds round the torus, and goes on for ever in
the periodic plane. (To span one cell from edge to edge is less: such a path may end in the next.)
Newman & Ziff, Phys. Rev. E 64, 016706 (2001), Sect. II D, after Machta et al.: in a tree of joined
regions each keeps its displacement to the root, and two that meet again with another one wind.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gfmd_cli.physics.fields import Field, Mask

Whole = NDArray[np.signedinteger[Any]]
"""Whole numbers: labels, counts, displacements in cells with one number an axis."""


@dataclass(frozen=True)
class Regions:
    """The connected regions of a mask."""

    sizes: Whole
    """Points of each region."""
    winds: Mask
    """Whether some region percolates, by axis of the mask."""


def contact_patches(touching: Mask) -> Regions:
    """Patches of contact: eight neighbours, two on a line."""
    return regions(touching, corners=True)


def open_gap(touching: Mask) -> Regions:
    """Regions of the gap: four neighbours, two on a line."""
    return regions(~touching, corners=False)


def regions(mask: Mask, *, corners: bool) -> Regions:
    """Connected regions of a periodic mask; `corners`: neighbours by corner count as well."""
    structure = ndimage.generate_binary_structure(mask.ndim, mask.ndim if corners else 1)
    labels, count = ndimage.label(mask, structure)
    tree = _Tree(list(range(count + 1)), np.zeros((count + 1, mask.ndim), dtype=np.int64))
    winds = np.zeros(mask.ndim, dtype=bool)
    for one, other, *cells in _bonds(labels, structure):
        winds |= tree.join(one, other, np.array(cells)) != 0
    roots = [up if up == label else tree.find(label)[0] for label, up in enumerate(tree.parent)]
    points = np.zeros(count + 1, dtype=np.int64)
    np.add.at(points, roots, np.bincount(labels.ravel(), minlength=count + 1))
    sizes = points[1:]  # the first are the points outside
    return Regions(sizes[sizes > 0], winds)


def _bonds(labels: Whole, structure: Mask) -> Iterator[list[int]]:
    """Labels that meet across the edges of the cell: of both sides, and the cells between them."""
    frame = np.zeros(labels.shape, dtype=bool)
    for axis in range(labels.ndim):
        np.moveaxis(frame, axis, 0)[[0, -1]] = True
    here = np.argwhere(frame & (labels > 0))
    sides = np.array(labels.shape)
    found = []
    for step in np.argwhere(structure) - 1:
        cells, there = np.divmod(here + step, sides)
        pairs = np.column_stack([labels[tuple(here.T)], labels[tuple(there.T)], cells])
        found.append(pairs[np.any(cells != 0, axis=1) & (pairs[:, 1] > 0)])
    yield from np.unique(np.concatenate(found), axis=0).tolist()


@dataclass
class _Tree:
    """Regions that were joined, each with its displacement to the one it hangs on."""

    parent: list[int]
    shift: Whole
    """Shape (regions, axes)."""

    def find(self, region: int) -> tuple[int, Whole]:
        """The root of a region, and the displacement from it to the region."""
        path = []
        while self.parent[region] != region:
            path.append(region)
            region = self.parent[region]
        total = np.zeros_like(self.shift[0])
        for below in reversed(path):
            total = total + self.shift[below]
            self.parent[below], self.shift[below] = region, total
        return region, total

    def join(self, one: int, other: int, cells: Whole) -> Whole:
        """Join two regions, `other` lying some cells further; the winding where they were one."""
        (root, before), (other_root, after) = self.find(one), self.find(other)
        loop: Whole = before + cells - after
        if root != other_root:
            self.parent[other_root], self.shift[other_root] = root, loop
            return np.zeros_like(loop)
        return loop


def area_edges() -> Field:
    """Edges of the bins of patch areas [L^2; of a line scene: L], ten a decade from 1e-11 to 1."""
    return np.logspace(-11.0, 0.0, 111)


def area_distribution(shares: Field) -> Field:
    """Pr(A): share of the patches per area, in logarithmic bins; zero without patches."""
    counts = np.histogram(shares, area_edges())[0]
    return np.asarray(counts / (max(shares.size, 1) * np.diff(area_edges())))
