"""The grid: one Fourier convention, operators diagonal in q, trigonometric interpolation."""

import gc
from types import SimpleNamespace
from weakref import ref

import numpy as np
import pyfftw
import pytest
from fourier import backward, forward

from gfmd_cli.grid import plans, shared_transforms
from gfmd_cli.grid.distributed import DistributedGrid
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.free_contact import build_free_scene
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.physics.surface_spectrum import map_spectrum
from gfmd_cli.solvers import nested_grids
from gfmd_cli.solvers.auto import Auto

ROUNDING = 1e-14  # a few units in the last place, times log2 of the size, for fields of order one
GRIDS = [
    *(Grid(points, dimension) for points in (8, 9, 10, 50) for dimension in (1, 2)),
    Grid(16, points_y=10),
    Grid(10, length=2.0, points_y=16, length_y=3.2),
    Grid(9, length=0.1, points_y=12, length_y=0.7),
    Grid(8, points_y=15),
]


def noise(grid, seed=0):
    return np.random.default_rng(seed).standard_normal(grid.shape)


def waves(points, highest, sign=1):
    """exp(+-2 pi i m x) for -highest <= m <= highest at the points of one axis."""
    m, x = np.arange(-highest, highest + 1), np.arange(points) / points
    return np.exp(2j * np.pi * sign * np.outer(m, x))


def polynomial(shape, highest, seed=1):
    """A random trigonometric polynomial of modes |m| <= highest along each axis, from its sum."""
    draw = np.random.default_rng(seed)
    number = tuple(2 * m + 1 for m in highest)
    amplitude = draw.standard_normal(number) + 1j * draw.standard_normal(number)
    field = amplitude @ waves(shape[-1], highest[-1])
    return field.real if len(shape) == 1 else (waves(shape[0], highest[0]).T @ field).real


@pytest.mark.parametrize("grid", GRIDS, ids=str)
def test_the_coefficient_at_zero_is_the_mean(grid):
    field = 3.0 + noise(grid)
    assert forward(grid, field).flat[0] == pytest.approx(field.mean(), rel=ROUNDING)


def dense_transform(points):
    """The matrix of the Fourier sum along one axis."""
    number = np.arange(points)
    return np.exp(-2j * np.pi * np.outer(number, number) / points) / points


@pytest.mark.parametrize("grid", GRIDS, ids=str)
def test_the_coefficients_are_those_of_the_fourier_sum(grid):
    field = noise(grid)
    expected = field @ dense_transform(grid.points)
    if grid.dimension == 2:
        expected = dense_transform(grid.points_y) @ expected
    assert forward(grid, field) == pytest.approx(
        expected[..., : grid.points // 2 + 1], abs=ROUNDING
    )


@pytest.mark.parametrize("grid", GRIDS, ids=str)
def test_backward_undoes_forward_and_leaves_its_input_alone(grid):
    field = noise(grid)
    modes = forward(grid, field)
    copy = modes.copy()
    assert backward(grid, modes) == pytest.approx(field, abs=10 * ROUNDING)
    assert np.array_equal(modes, copy)


@pytest.mark.parametrize("grid", GRIDS, ids=str)
def test_the_squares_of_all_modes_sum_to_the_mean_square(grid):
    field = noise(grid)
    total = np.sum(np.abs(forward(grid, field)) ** 2 * grid.multiplicity())
    assert total == pytest.approx(np.mean(field**2), rel=ROUNDING)


def test_every_mode_is_counted_once():
    for grid in GRIDS:
        count = np.broadcast_to(grid.multiplicity(), grid.spectral_shape)
        assert count.sum() == grid.size


def test_a_plane_wave_has_the_wavenumber_of_its_only_mode():
    grid = Grid(16, 2, length=3.0)
    x = np.arange(16) / 16 * 3.0
    field = np.cos(2 * np.pi / 3.0 * (-3 * x[:, None] + 4 * x))  # |m| = 5
    power = np.abs(forward(grid, field)) ** 2
    row, column = np.unravel_index(np.argmax(power), power.shape)
    assert (row, column) == (16 - 3, 4)
    assert power[row, column] == pytest.approx(0.25)
    assert grid.mode_number()[row, column] == 5
    assert grid.wavenumber()[row, column] == pytest.approx(5 * 2 * np.pi / 3.0, rel=ROUNDING)


def test_a_wave_on_an_oblong_cell_has_the_wavenumber_of_its_periods():
    grid = Grid(15, length=3.0, points_y=20, length_y=0.5)
    x, y = np.arange(15) / 15 * 3.0, np.arange(20) / 20 * 0.5
    q_x, q_y = 2 * np.pi * 6 / 3.0, -2 * np.pi * 4 / 0.5
    power = np.abs(forward(grid, np.cos(q_x * x + q_y * y[:, None]))) ** 2
    row, column = np.unravel_index(np.argmax(power), power.shape)
    assert (row, column) == (20 - 4, 6)
    assert power[row, column] == pytest.approx(0.25)
    assert grid.wavenumber()[row, column] == pytest.approx(np.hypot(q_x, q_y), rel=ROUNDING)
    assert grid.wavenumber(slice(16, 17))[0, 6] == grid.wavenumber()[16, 6]


def test_sides_follow_from_the_points_and_one_spacing():
    assert Grid(8).sides == (1.0, 1.0)
    assert Grid(8, 1, length=3.0).sides == (3.0,)
    assert Grid(8, points_y=12, length=2.0).sides == (3.0, 2.0)
    assert Grid(8, points_y=12, length=2.0, length_y=0.6).spacings == pytest.approx((0.05, 0.25))
    assert Grid(8, points_y=12, length=2.0, length_y=0.6).area == pytest.approx(1.2)
    assert Grid(64, points_y=48, length_y=0.5).coarser((12, 32)).sides == (0.5, 1.0)


@pytest.mark.parametrize("shape", [(8, 8), (8, 12), (9, 27), (40, 15)])
def test_the_diagonal_passes_from_corner_to_corner(shape):
    grid = Grid(shape[1], points_y=shape[0])
    rows, columns = (grid.diagonal(index) for index in np.indices(shape))
    steps = max(shape)
    for index, points in ((rows, shape[0]), (columns, shape[1])):
        away = index / points - np.arange(steps) / steps
        assert np.abs(away - np.rint(away)).max() <= 0.5 / points
    field = noise(grid)
    assert np.array_equal(grid.diagonal(field), field[rows, columns])


def test_the_operator_is_the_product_of_dense_matrices():
    grid = Grid(12)
    symbol = np.random.default_rng(2).random(grid.spectral_shape)
    symbol[7:, (0, -1)] = symbol[5:0:-1][:, (0, -1)]  # +q and -q: one real map
    full = np.empty(grid.shape)
    full[:, :7] = symbol
    full[:, 7:] = symbol[-np.arange(12) % 12, :][:, 5:0:-1]
    wave = np.exp(-2j * np.pi * np.outer(np.arange(12), np.arange(12)) / 12)
    field = noise(grid)
    expected = (wave.conj() @ (full * (wave @ field @ wave)) @ wave.conj()).real / grid.size
    out = grid.empty()
    assert grid.apply(symbol, field, out) is out
    assert out == pytest.approx(expected, abs=10 * ROUNDING)


@pytest.mark.parametrize("grid", GRIDS, ids=str)
def test_transforms_in_single_precision_work_in_the_same_memory(grid):
    symbol, field = np.exp(-grid.mode_number()), noise(grid)
    expected = grid.apply(symbol, field, out=grid.empty())
    single = grid.in_single()
    values = single.padded[..., : grid.points]
    values[...] = field
    single.filter_padded(symbol)
    assert values == pytest.approx(expected, abs=1e-6)
    assert values.dtype == np.float32
    assert np.shares_memory(values, grid.padded)
    assert np.array_equal(grid.apply(symbol, field, out=grid.empty()), expected)


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize(("shape", "threads"), [((64, 63), 1), ((60, 64), 1), ((512, 512), 2)])
def test_rows_of_zeros_need_no_transform(shape, precision, threads):
    """Of 60 rows, which are no whole number of blocks of 8, all are transformed."""
    size = {"points": shape[1], "points_y": shape[0]}
    grid = Grid(**size, precision=precision, threads=threads)
    field, k = np.zeros(shape, grid.real), grid.mode_number()
    for block in (1, 3, 6):
        field[8 * block : 8 * block + 8] = np.random.default_rng(block).normal(size=(8, shape[1]))
    values = grid.padded[:, : shape[1]]
    for operator in (grid.filter_padded, grid.unfilter_padded):
        grid.padded[...] = np.nan  # of earlier work
        values[...] = field
        operator(k)
        expected = values.copy()
        grid.padded[...] = np.nan
        values[...] = field
        operator(k, [1, 3, 6])
        eps = np.finfo(grid.real).eps
        np.testing.assert_allclose(values, expected, atol=20 * eps * abs(expected).max(), rtol=0)


@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize(("shape", "threads"), [((64, 64), 1), ((45, 50), 1), ((512, 512), 2)])
def test_columns_may_be_copied_in_blocks(monkeypatch, shape, precision, threads):
    """The last block of columns is narrower than the others."""
    size = {"points": shape[1], "points_y": shape[0]}
    grids = [Grid(**size, precision=precision, threads=threads)]
    grids[0].work  # noqa: B018 - plans columns in place
    for name, value in (("MIN_COPIED_BYTES", 0), ("BLOCK_COEFFICIENTS", 100)):
        monkeypatch.setattr(shared_transforms, name, value)
    monkeypatch.setattr(shared_transforms, "MIN_BLOCK_COLUMNS", 8)
    grids.append(Grid(**size, precision=precision, threads=threads))
    field, k = noise(grids[0]), grids[0].mode_number()
    results = []
    for grid in grids:
        values = grid.padded[:, : shape[1]]
        values[...] = field
        energy = grid.filter_padded(k)
        results.append((energy, values.copy()))
        eps = float(np.finfo(grid.real).eps)
        assert energy == pytest.approx(float(np.vdot(field, values)), rel=100 * eps)
    assert (
        grids[0]._transforms.along_columns.is_copied < grids[1]._transforms.along_columns.is_copied
    )
    assert len(grids[1]._transforms.along_columns.blocks) > 2
    np.testing.assert_allclose(
        results[1][1], results[0][1], atol=50 * eps * abs(values).max(), rtol=0
    )


@pytest.mark.parametrize("kept", [1, 9, 17, 33])
def test_blocks_of_columns_of_zeros_are_not_transformed(monkeypatch, kept):
    for name, value in (("MIN_COPIED_BYTES", 0), ("BLOCK_COEFFICIENTS", 100)):
        monkeypatch.setattr(shared_transforms, name, value)
    monkeypatch.setattr(shared_transforms, "MIN_BLOCK_COLUMNS", 8)
    grid = Grid(64, points_y=48)
    draw = np.random.default_rng(2).normal(size=(2, 48, kept))
    grid.work[...] = 0.0
    grid.work[:, :kept] = draw[0] + 1j * draw[1]
    grid.work[:, [0, -1]] = 0.0  # only the coefficients of real fields
    modes, transformed = grid.work.copy(), []
    for columns in grid._transforms.along_columns.blocks:

        def note(columns=columns, backward=columns.backward):
            transformed.append(columns.part.start)
            backward()

        columns.backward = note
    field = grid.field_of_work(kept=kept)
    np.testing.assert_allclose(field, np.fft.irfft2(modes, field.shape) * grid.size, atol=1e-11)
    starts = [columns.part.start for columns in grid._transforms.along_columns.blocks]
    assert sorted(transformed) == [start for start in starts if start < kept]
    assert len(starts) > 2


def test_the_operator_on_a_line_is_the_convolution_with_its_kernel():
    grid = Grid(10, 1)
    symbol = np.random.default_rng(3).random(grid.spectral_shape)
    angle = 2 * np.pi * np.outer(np.arange(10), np.arange(6)) / 10
    kernel = (grid.multiplicity() * symbol * np.cos(angle)).sum(axis=1) / 10
    field = noise(grid)
    separation = (np.arange(10)[:, None] - np.arange(10)) % 10
    expected = kernel[separation] @ field
    assert grid.apply(symbol, field, grid.empty()) == pytest.approx(expected, abs=10 * ROUNDING)


@pytest.mark.parametrize("dimension", [1, 2])
@pytest.mark.parametrize(("coarse", "fine"), [(8, 16), (10, 20), (32, 96)])
def test_interpolation_passes_through_the_coarse_points(coarse, fine, dimension):
    grid = Grid(coarse, dimension)
    field = noise(grid)
    finer = grid.resample(field, Grid(fine, dimension))
    shared = (slice(None, None, fine // coarse),) * dimension
    assert finer.shape == (fine,) * dimension
    assert finer[shared] == pytest.approx(field, abs=10 * ROUNDING)


SHAPES = [
    *((n,) * dimension for n in (16, 17, 18, 50) for dimension in (1, 2)),
    (16, 9),
    (9, 50),
    (17, 16),
]


@pytest.mark.parametrize("source", SHAPES)
@pytest.mark.parametrize("target", SHAPES)
def test_resampling_a_band_limited_field_is_exact(source, target):
    if len(source) != len(target):
        return
    highest = tuple((min(pair) - 1) // 2 for pair in zip(source, target, strict=True))
    grid, other = (Grid(s[-1], len(s), points_y=s[0], length_y=2.0) for s in (source, target))
    resampled = grid.resample(polynomial(source, highest), other)
    expected = polynomial(target, highest)
    assert resampled == pytest.approx(expected, abs=10 * ROUNDING * np.abs(expected).max())


@pytest.mark.parametrize("grid", GRIDS, ids=str)
@pytest.mark.parametrize("shape", [(8, 8), (8, 7), (7, 8), (9, 8)])
def test_a_symbol_cut_to_a_coarser_grid_is_that_of_the_coarser_grid(grid, shape):
    if any(n < m for n, m in zip(grid.whole_shape, shape[-grid.dimension :], strict=True)):
        return
    coarser = grid.coarser(shape[-grid.dimension :])
    assert np.array_equal(grid.cut(grid.wavenumber(), coarser), coarser.wavenumber())


@pytest.mark.parametrize("dimension", [1, 2])
def test_the_highest_mode_becomes_a_cosine_on_a_finer_grid(dimension):
    coarse, x = Grid(8, dimension), np.arange(32) / 32
    highest = np.cos(2 * np.pi * 4 * x)
    wave = highest if dimension == 1 else np.outer(highest, highest)
    field = wave[(slice(None, None, 4),) * dimension]
    assert coarse.resample(field, Grid(32, dimension)) == pytest.approx(wave, abs=10 * ROUNDING)


@pytest.mark.parametrize("dimension", [1, 2])
@pytest.mark.parametrize(("coarse", "fine"), [(8, 16), (10, 26), (64, 128)])
def test_coarse_to_fine_and_back_loses_the_highest_mode_only(coarse, fine, dimension):
    small, large = Grid(coarse, dimension), Grid(fine, dimension)
    field = noise(small)
    back = large.resample(small.resample(field, large), small)
    modes = forward(small, field)
    modes[..., -1] = 0.0
    if dimension == 2:
        modes[coarse // 2] = 0.0
    assert back == pytest.approx(backward(small, modes), abs=10 * ROUNDING)


@pytest.mark.parametrize("shape", [(513, 512), (512, 777), (600, 600), (1, 300000)])
@pytest.mark.parametrize("precision", ["single", "double"])
def test_threads_change_nothing(shape, precision):
    """Grids that are large enough for two threads; the shares of three are of different size."""
    size = {"points": shape[1], "points_y": shape[0], "precision": precision}
    one, *others = [Grid(**size, threads=threads) for threads in (1, 2, 3)]
    field = np.random.default_rng(3).normal(size=one.shape).astype(one.real)
    modes, eps = forward(one, field), np.finfo(one.real).eps
    for other in others:
        assert other._threads > 1
        np.testing.assert_allclose(
            forward(other, field), modes, atol=8 * eps * abs(modes).max(), rtol=0
        )
        np.testing.assert_allclose(backward(other, modes), field, atol=50 * eps, rtol=0)


@pytest.fixture
def sizes(monkeypatch):
    """Sizes of the transforms that are planned; 0 for those of temporary grids."""
    make, sizes = shared_transforms.planned_transforms, []

    def note(plan, size, is_temporary):
        sizes.append(0 if is_temporary else size)
        return make(plan, size, is_temporary=is_temporary)

    monkeypatch.setattr(shared_transforms, "planned_transforms", note)
    return sizes


def test_a_surface_is_drawn_and_reduced_on_one_grid(sizes):
    """Each grid takes time for its plans and its memory."""
    build_scene(SelfAffine(cutoff=0.1), Power(n=1), 32)
    assert sizes == [32**2]


@pytest.mark.parametrize("build", [build_scene, build_free_scene])
def test_only_the_plans_of_the_finest_grid_are_measured(sizes, monkeypatch, build):
    """The coarser ones make few transforms, in little time."""
    monkeypatch.setattr(nested_grids, "COARSEST_POINTS", 8)
    contact = build(SelfAffine(cutoff=0.1), Power(n=1), 32).contact(0.1)
    nested_grids.solve_contact(contact, Auto(tolerance=1e-6))
    assert 0 in sizes
    assert min(set(sizes) - {0}) >= 32**2


@pytest.fixture
def planning(tmp_path, monkeypatch, small_plans_measured):
    """How transforms were planned since the last call: the flags of FFTW."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(plans, "_estimates", {})
    plans.plan_with(None)
    flags, make = set(), pyfftw.FFTW

    def note(*arrays, **options):
        flags.add(options["flags"][0])
        return make(*arrays, **options)

    def planning():
        seen = flags.copy()
        flags.clear()
        return seen

    monkeypatch.setattr(pyfftw, "FFTW", note)
    return planning


def test_plans_of_small_and_of_temporary_grids_are_estimated(planning, monkeypatch):
    monkeypatch.setattr(plans, "MIN_MEASURED_POINTS", 40 * 36)
    for points, is_temporary, effort in [
        (40, False, "FFTW_MEASURE"),
        (39, False, "FFTW_ESTIMATE"),
        (40, True, "FFTW_ESTIMATE"),
    ]:
        grid = Grid(points, points_y=36, is_temporary=is_temporary)
        for each in (grid, grid.in_single()):
            each.padded[...] = 0.0
            assert planning() == {effort}


def test_blocks_of_rows_are_planned_like_the_grid_when_they_are_needed(planning):
    for is_temporary, effort in ((False, "FFTW_MEASURE"), (True, "FFTW_ESTIMATE")):
        grid = Grid(40, is_temporary=is_temporary)
        grid.padded[...] = 0.0
        planning()
        grid.filter_padded(np.ones(grid.spectral_shape))
        assert planning() == set()
        grid.filter_padded(np.ones(grid.spectral_shape), [1, 2])
        assert planning() == {effort}


@pytest.mark.parametrize(("rows", "lengths"), [(48, {16}), (40, {8}), (46, {46}), (16, {16})])
def test_rows_are_transformed_in_equal_blocks(monkeypatch, rows, lengths):
    """Of at most 23 rows here, so that they are of 8 or 16, or of all rows."""
    monkeypatch.setattr(shared_transforms, "PLANNED_COEFFICIENTS", 23 * 7)
    blocks = shared_transforms._equal_blocks(100, 100 + rows, 7)
    assert {block.stop - block.start for block in blocks} == lengths
    assert [i for block in blocks for i in range(block.start, block.stop)] == [
        *range(100, 100 + rows)
    ]
    grid = Grid(12, points_y=rows)
    field = noise(grid)
    expected = np.fft.rfft2(field) / grid.size
    np.testing.assert_allclose(forward(grid, field), expected, atol=ROUNDING, rtol=0)
    np.testing.assert_allclose(backward(grid, expected), field, atol=ROUNDING, rtol=0)


@pytest.mark.parametrize(("points", "grid_points"), [(30, 30), (30, 60)])
def test_a_free_scene_measures_no_plans(planning, tmp_path, points, grid_points):
    """It makes one transform of each of its grids."""
    np.save(tmp_path / "map.npy", SelfAffine(cutoff=0.1).heights(2 * points)[:points, :points])
    planning()
    build_free_scene(SelfAffine(cutoff=0.2), Power(n=1), points)
    surface = FileSurface(path=str(tmp_path / "map.npy"), length=1.0, periodic=False)
    build_free_scene(surface, Power(n=1), grid_points)
    assert map_spectrum(surface.mirrored()) is not None
    assert planning() == {"FFTW_ESTIMATE"}
    build_scene(SelfAffine(cutoff=0.1), Power(n=1), points)
    assert planning() == {"FFTW_MEASURE"}


@pytest.mark.usefixtures("small_plans_measured")
def test_a_plan_measured_for_the_first_time_destroys_nothing(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    known = SelfAffine(cutoff=0.05).heights(96)
    pyfftw.forget_wisdom()
    np.testing.assert_allclose(SelfAffine(cutoff=0.05).heights(96), known, atol=1e-14, rtol=0)
    field = np.random.default_rng(3).normal(size=(54, 54))
    pyfftw.forget_wisdom()
    fresh = Grid(54)
    np.testing.assert_allclose(backward(fresh, forward(fresh, field)), field, atol=1e-14, rtol=0)


def test_a_grid_that_is_shared_is_freed_with_its_last_reference():
    """Without a search for cycles of references, which may come much later."""
    gc.disable()
    try:
        grid = DistributedGrid(64, ranks=SimpleNamespace(rank=0, size=2))
        assert grid.rows.count == 32
        memory = ref(grid._memory[0])
        del grid
        assert memory() is None
    finally:
        gc.enable()
