"""Each process holds its share of what NumPy, or a grid on one process, makes of the whole."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from mpi4py import MPI

from gfmd_cli.grid.distributed import DistributedGrid, create_grid
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.grid.halo import DistributedRows
from gfmd_cli.grid.ranks import Ranks
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.indenters import Cone
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.physics.waves import texture
from gfmd_cli.solvers import multigrid
from gfmd_cli.solvers.contact_state import PRESSED
from gfmd_cli.solvers.multigrid import Multigrid

sys.path.append(str(Path(__file__).parents[2]))
from fourier import backward, forward

ranks = Ranks(MPI.COMM_WORLD)
COLUMNS = 7


def check_transforms(points, points_y):
    cell = {"points_y": points_y, "length_y": 0.7}
    whole, grid = Grid(points, **cell), DistributedGrid(points, **cell, ranks=ranks)
    field = np.random.default_rng(points).standard_normal((points_y, points))
    mine, columns = field[grid.own], slice(*grid.span)
    modes = np.fft.rfft2(field) / field.size
    np.testing.assert_allclose(forward(grid, mine), modes[:, columns], atol=1e-16, rtol=0)
    np.testing.assert_allclose(backward(grid, modes[:, columns]), mine, atol=1e-14, rtol=0)
    assert grid.total(mine.size) == grid.size == field.size
    assert grid.total(mine.shape[0]) == points_y
    assert grid.total(columns.stop - columns.start) == points // 2 + 1
    assert np.array_equal(grid.wavenumber(), whole.wavenumber()[:, columns])
    assert np.array_equal(grid.along_x(grid.wavenumber()), whole.wavenumber()[0])
    weighted = np.abs(forward(grid, mine)) ** 2 * grid.multiplicity()
    assert np.isclose(grid.total(weighted.sum()), np.mean(field**2), rtol=1e-13)  # Parseval
    filtered = grid.apply(np.exp(-grid.wavenumber()), mine, out=grid.empty())
    expected = whole.apply(np.exp(-whole.wavenumber()), field, out=whole.empty())
    np.testing.assert_allclose(filtered, expected[grid.own], atol=1e-14, rtol=0)
    single = grid.in_single()
    single.padded[:, :points] = mine
    single.filter_padded(np.exp(-grid.wavenumber()))
    np.testing.assert_allclose(single.padded[:, :points], expected[grid.own], atol=1e-6, rtol=0)
    assert np.shares_memory(single.padded, grid.padded)
    collected = grid.collect(mine)
    assert collected is None if ranks.rank else np.array_equal(collected, field)
    assert np.array_equal(grid.diagonal(mine), whole.diagonal(field))
    following = grid.own.stop % points_y
    assert np.array_equal(grid.gather_rows(mine, (following, following + 1))[0], field[following])


def check_other_grids(shape, other):
    """Shared out to shared out, to whole and from whole."""
    whole, coarse = (Grid(s[1], points_y=s[0], length_y=1.0) for s in (shape, other))
    grid, target = create_grid(whole, ranks), create_grid(coarse, ranks)
    assert not grid.whole
    assert not target.whole
    field = np.random.default_rng(1).standard_normal(shape)
    expected = whole.resample(field, coarse)
    for resampled in (grid.resample(field[grid.own], target), whole.resample(field, target)):
        np.testing.assert_allclose(resampled, expected[target.own], atol=1e-14, rtol=0)
    np.testing.assert_allclose(grid.resample(field[grid.own], coarse), expected, atol=1e-14, rtol=0)
    if other[0] <= shape[0] and other[1] <= shape[1]:
        assert grid.coarser(other) == create_grid(replace(coarse, is_temporary=True), ranks)
        symbol, cut = whole.wavenumber(), whole.cut(whole.wavenumber(), coarse)
        mine = grid.cut(symbol[:, slice(*grid.span)], target)
        assert np.array_equal(mine, cut[:, slice(*target.span)])


def number_three(fine, coarse, a, b):
    """A stencil over the three fine rows that a coarse row lies on."""
    height = fine.shape[0]
    for i in range(a, b):
        coarse[i] = fine[(2 * i - 1) % height] + 2 * fine[2 * i] + fine[2 * i + 1]


def check_levels(points):
    """Down to whole levels and up again, by stencils, as on one process."""
    field = np.random.default_rng(2).standard_normal((points, COLUMNS))
    rows = DistributedRows(ranks, points, 1, lambda: np.zeros(points * COLUMNS * 2))
    with_halo, whole = rows.with_halo(field[rows.start : rows.stop]), field
    while points % 2 == 0 and points >= 8:
        points //= 2
        rows, coarse = rows.coarser(points), np.empty((points, COLUMNS))
        target = rows.empty_with_halo(COLUMNS, dtype=np.float64)
        rows.run_from_finer(number_three, (with_halo,), (target,))
        number_three(whole, coarse, 0, points)
        start = getattr(rows, "start", 0) if isinstance(rows, DistributedRows) else 0
        inside = rows.interior(target)
        assert np.array_equal(inside, coarse[start : start + len(inside)])
        around = getattr(rows, "start", 4) - 4 + np.arange(len(rows.aligned_with_finer(target)))
        assert np.array_equal(rows.aligned_with_finer(target), coarse[around % points])
        with_halo, whole = target, coarse


def check_surfaces(points):
    for surface in (SelfAffine(cutoff=0.05), SelfAffine(cutoff=2 / points, h_std=2.0), Cone()):
        grid = DistributedGrid(points, ranks=ranks)
        expected = surface.heights(points)
        np.testing.assert_allclose(surface.heights_on(grid), expected[grid.own], atol=1e-13, rtol=0)
        scenes = [build_scene(surface, Power(n=1.5), points, 1, who) for who in (None, ranks)]
        for name in ("h_std", "delta_sigma", "mean_height"):
            one, many = (getattr(scene, name) for scene in scenes)
            assert np.isclose(one, many, rtol=1e-12, atol=1e-13), name
        one, many = (scene.shells.energy for scene in scenes)
        np.testing.assert_allclose(many, one, rtol=1e-10)


def check_v_cycle(points, n, has_long_waves=False):
    """The V-cycle is the same on row blocks as on one process, for any pattern of contacts."""
    draw = np.random.default_rng(4)
    force = draw.standard_normal((points, points))
    y, x = np.mgrid[:points, :points]
    for held in (draw.random((points, points)) < 0.02, (x - 9) ** 2 + (y - points + 2) ** 2 < 300):
        state = np.where(held, PRESSED, 0).astype(np.int8)
        results = []
        for grid in (Grid(points), DistributedGrid(points, ranks=ranks)):
            k = Power(n=n).stiffness(grid.wavenumber()) / points**n
            contact = Contact(grid, force[grid.own], k, 1.0)
            with_halo = grid.rows.empty_with_halo(points, dtype=np.int8)
            grid.rows.interior(with_halo)[...] = state[grid.own]
            change = np.ones(grid.shape, np.float32)
            v_cycle = Multigrid(contact, grid)
            assert (len(v_cycle.finer) > 1) == has_long_waves
            sums = v_cycle.apply(-force[grid.own], with_halo, PRESSED, change)
            results.append((v_cycle.z[:, :points], sums))
        (whole, sums), (mine, others) = results
        size = np.abs(whole).max()
        own = grid.own
        np.testing.assert_allclose(mine, whole[own], rtol=0, atol=2e-6 * size)
        np.testing.assert_allclose(others, sums, rtol=1e-5, atol=1e-5 * size * points)


def check_against_mpi4py_fft(points):
    """Another library's distributed transform, where it could be built."""
    try:
        from mpi4py_fft import PFFT, newDistArray
    except ImportError:
        return
    field = np.random.default_rng(3).standard_normal((points, points))
    other = PFFT(ranks.comm, (points, points), axes=(0, 1), dtype=np.float64, slab=True)
    array = newDistArray(other, forward_output=False)
    array[...] = field[array.local_slice()]
    modes = other.forward(array)
    grid = DistributedGrid(points, ranks=ranks)
    own_modes = forward(grid, field[grid.own])
    full = np.zeros((points, points // 2 + 1), complex)
    full[modes.local_slice()] = modes
    summed = ranks.total(full)
    np.testing.assert_allclose(own_modes, summed[:, slice(*grid.span)], atol=1e-16, rtol=0)
    print("mpi4py-fft agrees")


def check_textures(points, tiles, mirrors):
    """Of a map that consists of tiles and mirror images."""
    patch = np.random.default_rng(points).standard_normal((points, points))
    if mirrors > 0:
        patch = np.hstack([patch, patch[:, ::-1]])
    if mirrors > 1:
        patch = np.vstack([patch, patch[::-1]])
    height = np.tile(patch, (tiles, 1))
    points_y, points = height.shape
    whole = Grid(points, points_y=points_y)
    grid = DistributedGrid(points, points_y=points_y, ranks=ranks)
    expected, own = texture(whole, height), texture(grid, height[grid.own])
    assert (expected.tiles, expected.mirrors) == (own.tiles, own.mirrors) == (tiles, mirrors)
    np.testing.assert_allclose(own, expected, rtol=1e-12)


for size in (64, 96, 100, 128):
    check_transforms(size, size)
    check_surfaces(size)
for shape in ((65, 64), (64, 101), (20, 96), (129, 87)):
    check_transforms(*shape)
for pair in ((64, 128), (128, 64), (100, 150), (96, 66)):
    check_other_grids(*((size, size) for size in pair))
check_other_grids((96, 64), (72, 33))
check_other_grids((72, 33), (97, 64))
check_other_grids((67, 50), (67, 40))
for size in (64, 96, 100, 512):
    check_levels(size)
for tiling in ((64, 1, 0), (33, 1, 1), (50, 2, 0), (40, 1, 2), (32, 3, 2)):
    check_textures(*tiling)
for size, exponent in ((64, 1), (96, 2), (128, 3), (160, 4), (88, 2)):
    check_v_cycle(size, exponent)
multigrid.MIN_LONG_WAVE_POINTS = 8
for size in (64, 128, 512):  # every process holds the level of long waves, or a part of it
    check_v_cycle(size, 1, has_long_waves=True)
check_against_mpi4py_fft(64)
sys.exit(0)
