"""Contact patches, and percolation of contact and gap, in the periodic cell.

On a square lattice, 4-connectivity and 8-connectivity are dual: a region that is connected in one
sense separates its complement in the other sense. Fluid passes through edges that two points share,
so the gap has four neighbours and the contact has eight.

A region percolates along an axis if a closed path in it winds around the torus along that axis; the
path is then infinite in the periodic plane. (A path from edge to edge of one cell may end in the
next cell.) The method is that of Newman & Ziff, Phys. Rev. E 64, 016706 (2001), Sect. II D, after
Machta et al.: each region of a union-find tree stores its displacement to the root. A region
percolates if two of its branches meet with different displacements.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from gfmd_cli.grid.arrays import Field, Integers, Mask

AREA_EDGES = np.logspace(-11.0, 0.0, 111)
"""Edges of the bins of patch areas [L^2, or L in a line contact]: ten per decade to 1.

The last bin has the larger patches, too: on a cell that is longer along y."""


@dataclass(frozen=True)
class ConnectedRegions:
    """The connected regions of a mask."""

    sizes: Integers
    """Number of points of each region."""
    percolates: Mask
    """Whether any of the regions percolates, for each axis of the mask."""


def contact_patches(touching: Mask, *, periodic: bool = True) -> ConnectedRegions:
    """Contact patches: eight neighbours, two in a line contact."""
    return connected_regions(touching, corners=True, periodic=periodic)


def open_gap(touching: Mask, *, periodic: bool = True) -> ConnectedRegions:
    """Connected regions of the gap: four neighbours, two in a line contact."""
    return connected_regions(~touching, corners=False, periodic=periodic)


def connected_regions(mask: Mask, *, corners: bool, periodic: bool = True) -> ConnectedRegions:
    """Connected regions of a mask, with neighbours at corners if `corners`.

    In a mask that is not periodic, a region percolates if it reaches two opposite borders.
    """
    structure = ndimage.generate_binary_structure(mask.ndim, mask.ndim if corners else 1)
    labels, count = ndimage.label(mask, structure)
    if not periodic:
        return ConnectedRegions(
            np.bincount(labels.ravel(), minlength=count + 1)[1:], _spans(labels)
        )
    tree = _Tree(list(range(count + 1)), np.zeros((count + 1, mask.ndim), dtype=np.int64))
    percolates = np.zeros(mask.ndim, dtype=bool)
    for one, other, *cells in _bonds(labels, structure):
        percolates |= tree.join(one, other, np.array(cells)) != 0
    roots = [up if up == label else tree.find(label)[0] for label, up in enumerate(tree.parent)]
    points = np.zeros(count + 1, dtype=np.int64)
    np.add.at(points, roots, np.bincount(labels.ravel(), minlength=count + 1))
    sizes = points[1:]  # the first is the number of points outside the mask
    return ConnectedRegions(sizes[sizes > 0], percolates)


def _spans(labels: Integers) -> Mask:
    """Whether a region reaches both borders, for each axis."""
    borders = (np.moveaxis(labels, axis, 0)[[0, -1]] for axis in range(labels.ndim))
    return np.array([bool(np.any(np.intersect1d(a, b) > 0)) for a, b in borders])


def _bonds(labels: Integers, structure: Mask) -> Iterator[list[int]]:
    """Pairs of labels that meet across an edge of the cell, with the displacement in cells."""
    border = np.zeros(labels.shape, dtype=bool)
    for axis in range(labels.ndim):
        np.moveaxis(border, axis, 0)[[0, -1]] = True
    here = np.argwhere(border & (labels > 0))
    sides = np.array(labels.shape)
    bonds = []
    for step in np.argwhere(structure) - 1:
        cells, there = np.divmod(here + step, sides)
        pairs = np.column_stack([labels[tuple(here.T)], labels[tuple(there.T)], cells])
        bonds.append(pairs[np.any(cells != 0, axis=1) & (pairs[:, 1] > 0)])
    yield from np.unique(np.concatenate(bonds), axis=0).tolist()


@dataclass
class _Tree:
    """Union-find tree of regions, each with its displacement from its parent."""

    parent: list[int]
    shift: Integers
    """Shape (regions, axes)."""

    def find(self, region: int) -> tuple[int, Integers]:
        """Return the root of a region, and the displacement from the root to the region."""
        path = []
        while self.parent[region] != region:
            path.append(region)
            region = self.parent[region]
        total = np.zeros_like(self.shift[0])
        for below in reversed(path):
            total = total + self.shift[below]
            self.parent[below], self.shift[below] = region, total
        return region, total

    def join(self, one: int, other: int, cells: Integers) -> Integers:
        """Join two regions, `other` displaced by `cells`; return the winding of a closed loop."""
        (root, before), (other_root, after) = self.find(one), self.find(other)
        loop: Integers = before + cells - after
        if root != other_root:
            self.parent[other_root], self.shift[other_root] = root, loop
            return np.zeros_like(loop)
        return loop


def area_distribution(areas: Field) -> Field:
    """Pr(A): fraction of the patches per area in the bins of `AREA_EDGES`; zero without any."""
    counts = np.histogram(np.minimum(areas, AREA_EDGES[-1]), AREA_EDGES)[0]
    return counts / (max(areas.size, 1) * np.diff(AREA_EDGES))
