"""Each process holds its share of what NumPy, or a grid on one process, makes of the whole."""

import sys

import numpy as np
from mpi4py import MPI

from gfmd_cli.physics.contact import Contact, build_scene
from gfmd_cli.physics.elastomer import Power
from gfmd_cli.physics.grid import Grid
from gfmd_cli.physics.ranks import Ranks
from gfmd_cli.physics.slab_rows import SlabRows
from gfmd_cli.physics.slabs import SlabGrid
from gfmd_cli.physics.surface import Cone, SelfAffine
from gfmd_cli.physics.sweeps import PRESSED
from gfmd_cli.solvers.multigrid import Multigrid
from gfmd_cli.solvers.multilevel import Multilevel

ranks = Ranks(MPI.COMM_WORLD)
COLUMNS = 7


def check_transforms(points):
    whole, grid = Grid(points), SlabGrid(points, ranks=ranks)
    field = np.random.default_rng(points).standard_normal((points, points))
    mine, columns = field[grid.own], slice(*grid.span)
    modes = np.fft.rfft2(field) / points**2
    np.testing.assert_allclose(grid.forward(mine), modes[:, columns], atol=1e-16)
    np.testing.assert_allclose(grid.backward(modes[:, columns]), mine, atol=1e-14)
    assert grid.total(mine.size) == grid.size == points**2
    assert grid.total(mine.shape[0]) == points
    assert grid.total(columns.stop - columns.start) == points // 2 + 1
    assert np.array_equal(grid.wavenumber(), whole.wavenumber()[:, columns])
    assert np.array_equal(grid.line(grid.wavenumber()), whole.wavenumber()[0])
    weighted = np.abs(grid.forward(mine)) ** 2 * grid.multiplicity()
    assert np.isclose(grid.total(weighted.sum()), np.mean(field**2), rtol=1e-13)  # Parseval
    filtered = grid.operator(np.exp(-grid.wavenumber()))(mine, out=grid.empty())
    expected = whole.operator(np.exp(-whole.wavenumber()))(field, out=whole.empty())
    np.testing.assert_allclose(filtered, expected[grid.own], atol=1e-14)
    collected = grid.collect(mine)
    assert collected is None if ranks.rank else np.array_equal(collected, field)
    assert np.array_equal(grid.diagonal(mine), field.diagonal())
    assert np.array_equal(grid.below(mine), field[grid.own.stop % points])


def check_other_grids(points, other):
    """Shared out to shared out, to whole and from whole."""
    whole, grid = Grid(points), SlabGrid(points, ranks=ranks)
    field = np.random.default_rng(1).standard_normal((points, points))
    expected, target = whole.resample(field, Grid(other)), SlabGrid(other, ranks=ranks)
    for made in (grid.resample(field[grid.own], target), whole.resample(field, target)):
        np.testing.assert_allclose(made, expected[target.own], atol=1e-14)
    np.testing.assert_allclose(grid.resample(field[grid.own], Grid(other)), expected, atol=1e-14)
    if other < points:
        symbol, cut = whole.wavenumber(), whole.cut(whole.wavenumber(), Grid(other))
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
    rows = SlabRows(ranks, points, 1, lambda: np.zeros(points * COLUMNS * 2))
    framed, whole = rows.framed(field[rows.start : rows.stop]), field
    while points % 2 == 0 and points >= 8:
        points //= 2
        rows, coarse = rows.coarser(), np.empty((points, COLUMNS))
        target = rows.empty(COLUMNS, dtype=np.float64)
        rows.from_finer(number_three, (framed,), (target,))
        number_three(whole, coarse, 0, points)
        start = getattr(rows, "start", 0) if isinstance(rows, SlabRows) else 0
        inside = rows.inside(target)
        assert np.array_equal(inside, coarse[start : start + len(inside)])
        around = getattr(rows, "start", 4) - 4 + np.arange(len(rows.for_finer(target)))
        assert np.array_equal(rows.for_finer(target), coarse[around % points])
        framed, whole = target, coarse


def check_surfaces(points):
    for surface in (SelfAffine(cutoff=0.05), SelfAffine(cutoff=2 / points, h_std=2.0), Cone()):
        grid = SlabGrid(points, ranks=ranks)
        expected = surface.heights(points)
        np.testing.assert_allclose(surface.on(grid), expected[grid.own], atol=1e-13)
        scenes = [build_scene(surface, Power(n=1.5), points, 1, who) for who in (None, ranks)]
        for name in ("h_std", "delta_sigma", "mean_height"):
            one, many = (getattr(scene, name) for scene in scenes)
            assert np.isclose(one, many, rtol=1e-12, atol=1e-13), name
        one, many = (scene.shells.energy for scene in scenes)
        np.testing.assert_allclose(many, one, rtol=1e-10)


def check_preconditioners(points, n):
    """Both are the same on slabs as on one process, for any pattern of contacts."""
    draw = np.random.default_rng(4)
    force = draw.standard_normal((points, points))
    y, x = np.mgrid[:points, :points]
    for held in (draw.random((points, points)) < 0.02, (x - 9) ** 2 + (y - points + 2) ** 2 < 300):
        marks = np.where(held, PRESSED, 0).astype(np.int8)
        for kind in (Multigrid, Multilevel):
            found = []
            for grid in (Grid(points), SlabGrid(points, ranks=ranks)):
                k = Power(n=n).stiffness(grid.wavenumber()) / points**n
                contact = Contact(grid, force[grid.own], k, 1.0)
                framed = grid.rows.empty(points, dtype=np.int8)
                grid.rows.inside(framed)[...] = marks[grid.own]
                change = np.ones(grid.shape, np.float32)
                cycle, padded = kind(contact, grid.rows), np.zeros((grid.shape[0], points + 2))
                sums = cycle.apply(-force[grid.own], framed, PRESSED, change, padded)
                found.append((padded[:, :points], sums))
            (whole, sums), (mine, others) = found
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
    grid = SlabGrid(points, ranks=ranks)
    found = grid.forward(field[grid.own])
    full = np.zeros((points, points // 2 + 1), complex)
    full[modes.local_slice()] = modes
    summed = ranks.total(full)
    np.testing.assert_allclose(found, summed[:, slice(*grid.span)], atol=1e-16)
    print("mpi4py-fft agrees")


for size in (64, 96, 100, 128):
    check_transforms(size)
    check_surfaces(size)
for pair in ((64, 128), (128, 64), (100, 150), (96, 66)):
    check_other_grids(*pair)
for size in (64, 96, 100, 512):
    check_levels(size)
for size, exponent in ((64, 1), (96, 2), (128, 3), (160, 4)):
    check_preconditioners(size, exponent)
check_against_mpi4py_fft(64)
sys.exit(0)
