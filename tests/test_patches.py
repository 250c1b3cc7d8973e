"""Connected regions of periodic masks against constructed ones, tiled copies and each other."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import ndimage

from gfmd_cli.physics.patches import (
    AREA_EDGES,
    area_distribution,
    connected_regions,
    contact_patches,
    open_gap,
)

N = 12
I, J = np.indices((N, N))


def percolates(touching):
    """Whether the gap percolates along y and along x."""
    return tuple(open_gap(touching).percolates.tolist())


def blocks(*corners, side=2):
    mask = np.zeros((N, N), dtype=bool)
    for i, j in corners:
        mask[np.ix_(np.arange(i, i + side) % N, np.arange(j, j + side) % N)] = True
    return mask


def test_without_contact_the_gap_percolates_and_there_is_no_patch():
    nothing = np.zeros((N, N), dtype=bool)
    assert percolates(nothing) == (True, True)
    assert contact_patches(nothing).sizes.size == 0


def test_in_full_contact_nothing_leaks_and_one_patch_is_all():
    full = np.ones((N, N), dtype=bool)
    assert percolates(full) == (False, False)
    assert contact_patches(full).sizes.tolist() == [N * N]


def test_stripes_of_contact_leave_a_way_along_them():
    assert percolates(I == 3) == (False, True)
    assert percolates(J == 0) == (True, False)
    assert percolates((I == 3) | (J == 0)) == (False, False)


def test_a_spot_of_contact_or_many_let_fluid_through_both_ways():
    assert percolates(blocks((4, 4))) == (True, True)
    assert percolates(blocks((0, 0), (4, 4), (N - 1, 7))) == (True, True)


def test_a_single_open_spot_does_not_percolate():
    assert percolates(~blocks((4, 4))) == (False, False)
    assert percolates(~blocks((N - 1, N - 1))) == (False, False)  # it lies across the corner


def test_a_checkerboard_of_contact_is_one_patch_that_seals():
    board = (I + J) % 2 == 0
    assert contact_patches(board).sizes.tolist() == [N * N // 2]
    assert percolates(board) == (False, False)
    assert open_gap(board).sizes.tolist() == [1] * (N * N // 2)


def test_a_diagonal_channel_leaks_along_both_axes():
    assert percolates(~((I - J) % N < 2)) == (True, True)


def test_a_channel_that_closes_after_two_cells_percolates_though_it_spans_none_alone():
    """It steps down half a cell for each cell along x."""
    channel = (I - J // 2) % (N // 2) < 2
    assert percolates(~channel) == (True, True)
    steep = channel.T
    assert percolates(~steep) == (True, True)


def test_to_span_the_cell_is_not_to_percolate():
    """The channel reaches from edge to edge but meets contact in the next cell."""
    open_cells = np.zeros((N, N), dtype=bool)
    open_cells[2, :6] = open_cells[2:9, 5] = open_cells[8, 5:] = True
    assert percolates(~open_cells) == (False, False)
    open_cells[2:9, 0] = True
    assert percolates(~open_cells) == (False, True)


def test_patches_join_across_edges_and_corners_of_the_cell():
    assert contact_patches(blocks((N - 1, N - 1))).sizes.tolist() == [4]
    assert sorted(contact_patches(blocks((N - 1, 3), (5, 5), side=3)).sizes) == [9, 9]
    corner = np.zeros((N, N), dtype=bool)
    corner[0, 0] = corner[-1, -1] = True
    assert contact_patches(corner).sizes.tolist() == [2]
    assert sorted(connected_regions(corner, corners=False).sizes) == [1, 1]


def test_on_a_line_scene_the_gap_is_parted_by_any_contact():
    line = np.zeros(16, dtype=bool)
    assert open_gap(line).percolates.tolist() == [True]
    line[[0, 1, 7, 15]] = True
    assert open_gap(line).percolates.tolist() == [False]
    assert sorted(contact_patches(line).sizes) == [1, 3]


def tiled_percolates(mask, corners, copies=7):
    """Whether a region of a tiled plane holds a point of the middle cell and its image."""
    n = len(mask)
    structure = np.ones((3, 3)) if corners else None
    labels = ndimage.label(np.tile(mask, (copies, copies)), structure)[0]
    cells = labels.reshape(copies, n, copies, n).transpose(0, 2, 1, 3)
    middle = cells[copies // 2, copies // 2]
    same = ((cells == middle) & (middle > 0)).any(axis=(2, 3))
    same[copies // 2, copies // 2] = False
    away = np.arange(copies) != copies // 2
    return bool(same[away].any()), bool(same[:, away].any())


@pytest.mark.parametrize("corners", [False, True])
def test_random_masks_percolate_as_their_tiled_copies_do(corners):
    random = np.random.default_rng(0)
    results = []
    for _ in range(400):
        mask = random.random((6, 6)) < random.uniform(0.3, 0.8)
        directions = tuple(connected_regions(mask, corners=corners).percolates.tolist())
        assert directions == tiled_percolates(mask, corners)
        results.append(directions)
    assert len(set(results)) == 4  # along none, one, the other, both


@given(arrays(bool, st.tuples(st.integers(3, 9), st.integers(3, 9))))
@settings(max_examples=200)
def test_contact_percolates_where_the_gap_leaves_it_a_way(touching):
    """Duality on a torus: one of both alone percolates, in all directions, or both do in one."""
    gap, contact = open_gap(touching).percolates, contact_patches(touching).percolates
    if not gap.any():
        assert contact.all()
    if not contact.any():
        assert gap.all()
    if gap.sum() == 1:
        assert contact.tolist() == gap.tolist()


@given(arrays(bool, (7, 7)), st.integers(0, 6), st.integers(0, 6))
@settings(max_examples=100)
def test_regions_do_not_depend_on_where_the_cell_is_cut(mask, i, j):
    for corners in (False, True):
        one = connected_regions(mask, corners=corners)
        other = connected_regions(np.roll(mask, (i, j), axis=(0, 1)), corners=corners)
        assert sorted(one.sizes) == sorted(other.sizes)
        assert one.percolates.tolist() == other.percolates.tolist()
        turned = connected_regions(mask.T, corners=corners)
        assert turned.percolates.tolist() == one.percolates.tolist()[::-1]
        assert one.sizes.sum() == mask.sum()


def test_the_distribution_of_areas_is_normalised():
    shares = np.array([2.0**-34, 1e-3, 1e-3, 0.2, 1.0])
    density = area_distribution(shares)
    assert np.sum(density * np.diff(AREA_EDGES)) == pytest.approx(1, rel=1e-14)
    assert not area_distribution(np.empty(0)).any()


def test_the_last_bin_counts_patches_larger_than_the_square_of_the_side():
    """Of a cell that is longer along y, and of full contact, whose area is rounded."""
    for areas in ([3.5], [1 + 2**-52], [3.5, 0.9]):
        density = area_distribution(np.array(areas))
        assert density[-1] * np.diff(AREA_EDGES)[-1] == pytest.approx(1, rel=1e-14)
