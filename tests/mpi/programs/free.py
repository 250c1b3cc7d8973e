"""Parts of a free boundary on several processes: convolutions, averages, reflections, borders."""

import sys
import tempfile

import numpy as np
from mpi4py import MPI

from gfmd_cli.grid.distributed import create_grid
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.grid.ranks import Ranks
from gfmd_cli.physics.elastomers import HalfSpace, Layer, Power, Tabulated
from gfmd_cli.physics.free_contact import build_free_scene
from gfmd_cli.physics.observables import border_contact, contact_line
from gfmd_cli.physics.self_affine import SelfAffine

ranks = Ranks(MPI.COMM_WORLD)
SPACINGS = (0.3, 0.2)


def grids(*shape):
    """A whole grid and the same one as these processes hold it."""
    whole = Grid(shape[1], points_y=shape[0], length_y=0.7)
    return whole, create_grid(whole, ranks)


def check_convolution(shape):
    """Against the sum over all points, as a matrix for each distance along y."""
    _, grid = grids(*shape)
    draw = np.random.default_rng(1)
    kernel, field = draw.random(shape), draw.random(shape)
    distance = np.abs(np.subtract.outer(np.arange(shape[1]), np.arange(shape[1])))
    expected = np.zeros(shape)
    for i in range(shape[0]):
        for j in range(shape[0]):
            expected[i] += kernel[abs(i - j)][distance] @ field[j]
    transform = grid.padded_transform()
    assert transform.transposition is not None
    mine = field[grid.own]
    product = transform.apply(transform.symbol_of(kernel[grid.own]), mine, np.empty(grid.shape))
    np.testing.assert_allclose(product, expected[grid.own], rtol=1e-12)


def check_single_precision(shape):
    """Against the whole padded field."""
    whole, grid = grids(*shape)
    draw = np.random.default_rng(2)
    kernel, field = draw.random(shape), draw.random(shape)
    results = []
    for part in (whole, grid):
        transform = part.padded_transform()
        symbol = transform.symbol_of(kernel[part.own]).astype(np.float32)
        single = transform.in_single()
        results.append(single.apply(symbol, field[part.own], np.empty(part.shape)))
    expected, distributed = results
    size = np.abs(expected).max()
    np.testing.assert_allclose(distributed, expected[grid.own], rtol=0, atol=1e-5 * size)


def check_averages(shape, other):
    (whole, grid), (coarse, target) = grids(*shape), grids(*other)
    values = np.random.default_rng(3).random(shape)
    expected = whole.average(values, coarse)
    pairs = [(grid, target), (grid, coarse), (whole, target)]
    for source, to in pairs:
        averages = source.average(values[source.own], to)
        np.testing.assert_allclose(averages, expected[to.own], rtol=1e-13)


def check_compliance(shape):
    _, grid = grids(*shape)
    with tempfile.NamedTemporaryFile("w", suffix=".txt") as file:
        file.write("1 2\n10 30\n100 400\n")
        file.flush()
        table = Tabulated(path=file.name)
        expected = table.free_compliance(shape, SPACINGS)
        compliance = table.free_compliance(shape, SPACINGS, grid.own)
    np.testing.assert_allclose(compliance, expected[grid.own], rtol=1e-14)
    for elastomer in (HalfSpace(), Power(n=1.5), Layer(thickness=0.9, poisson=0.4)):
        expected = elastomer.free_compliance(shape, SPACINGS)
        compliance = elastomer.free_compliance(shape, SPACINGS, grid.own)
        np.testing.assert_allclose(compliance, expected[grid.own], rtol=1e-14)


def check_scene(shape):
    """Heights are those of one process, whether the map, twice the map, or neither is shared."""
    y, x = shape
    surface = SelfAffine(cutoff=0.3).on_cell(x, y)
    one, many = (
        build_free_scene(surface, HalfSpace(), x, 1, who, points_y=y) for who in (None, ranks)
    )
    np.testing.assert_allclose(many.height, one.height[many.grid.own], atol=1e-12, rtol=0)
    assert np.isclose(many.delta_sigma, one.delta_sigma, rtol=1e-12)
    assert many.grid.whole == (y < 16 * ranks.size)


def check_border(shape):
    whole, grid = grids(*shape)
    touching = np.random.default_rng(4).random(shape) < 0.4
    for periodic in (True, False):
        expected = contact_line(whole, touching, periodic=periodic)
        assert np.isclose(contact_line(grid, touching[grid.own], periodic=periodic), expected)
    outermost = np.ones(shape, dtype=bool)
    outermost[1:-1, 1:-1] = False
    assert np.isclose(border_contact(grid, touching[grid.own]), touching[outermost].mean())


for size in ((48, 32), (49, 37), (64, 90), (130, 49)):
    check_convolution(size)
    check_single_precision(size)
    check_compliance(size)
    check_border(size)
for pair in (((96, 64), (48, 32)), ((97, 64), (50, 34)), ((131, 50), (67, 50))):
    check_averages(*pair)
    check_averages(*pair[::-1])
for size in ((64, 64), (51, 60), (32, 32), (26, 30), (12, 16)):
    check_scene(size)
sys.exit(0)
