"""The grid: one Fourier convention, operators diagonal in q, trigonometric interpolation."""

import numpy as np
import pyfftw
import pytest

from gfmd_cli.physics.grid import Grid
from gfmd_cli.physics.surface import SelfAffine

ROUNDING = 1e-14  # a few units in the last place, times log2 of the size, for fields of order one
GRIDS = [(points, dimension) for points in (8, 10, 16, 50) for dimension in (1, 2)]


def noise(grid, seed=0):
    return np.random.default_rng(seed).standard_normal(grid.shape)


def polynomial(points, dimension, highest, seed=1):
    """A random trigonometric polynomial of modes |m| <= highest along each axis, from its sum."""
    draw = np.random.default_rng(seed)
    x = np.arange(points) / points
    m = np.arange(-highest, highest + 1)
    waves = np.exp(2j * np.pi * np.outer(m, x))
    shape = (m.size,) * dimension
    amplitude = draw.standard_normal(shape) + 1j * draw.standard_normal(shape)
    if dimension == 1:
        return (amplitude @ waves).real
    return (waves.T @ amplitude @ waves).real


@pytest.mark.parametrize(("points", "dimension"), GRIDS)
def test_the_coefficient_at_zero_is_the_mean(points, dimension):
    grid = Grid(points, dimension)
    field = 3.0 + noise(grid)
    assert grid.forward(field).flat[0] == pytest.approx(field.mean(), rel=ROUNDING)


@pytest.mark.parametrize(("points", "dimension"), GRIDS)
def test_the_coefficients_are_those_of_the_fourier_sum(points, dimension):
    grid = Grid(points, dimension)
    field = noise(grid)
    wave = np.exp(-2j * np.pi * np.outer(np.arange(points), np.arange(points)) / points) / points
    expected = wave @ field if dimension == 1 else wave @ field @ wave.T
    assert grid.forward(field) == pytest.approx(expected[..., : points // 2 + 1], abs=ROUNDING)


@pytest.mark.parametrize(("points", "dimension"), GRIDS)
def test_backward_undoes_forward_and_leaves_its_input_alone(points, dimension):
    grid = Grid(points, dimension)
    field = noise(grid)
    modes = grid.forward(field)
    kept = modes.copy()
    assert grid.backward(modes) == pytest.approx(field, abs=10 * ROUNDING)
    assert np.array_equal(modes, kept)


@pytest.mark.parametrize(("points", "dimension"), GRIDS)
def test_the_squares_of_all_modes_sum_to_the_mean_square(points, dimension):
    grid = Grid(points, dimension)
    field = noise(grid)
    total = np.sum(np.abs(grid.forward(field)) ** 2 * grid.multiplicity())
    assert total == pytest.approx(np.mean(field**2), rel=ROUNDING)


def test_every_mode_is_counted_once():
    for points, dimension in GRIDS:
        grid = Grid(points, dimension)
        count = np.broadcast_to(grid.multiplicity(), grid.spectral_shape)
        assert count.sum() == grid.size


def test_a_plane_wave_has_the_wavenumber_of_its_only_mode():
    grid = Grid(16, 2, length=3.0)
    x = np.arange(16) / 16 * 3.0
    field = np.cos(2 * np.pi / 3.0 * (-3 * x[:, None] + 4 * x))  # |m| = 5
    power = np.abs(grid.forward(field)) ** 2
    row, column = np.unravel_index(np.argmax(power), power.shape)
    assert (row, column) == (16 - 3, 4)
    assert power[row, column] == pytest.approx(0.25)
    assert grid.mode_number()[row, column] == 5
    assert grid.wavenumber()[row, column] == pytest.approx(5 * 2 * np.pi / 3.0, rel=ROUNDING)


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
    assert grid.operator(symbol)(field, out) is out
    assert out == pytest.approx(expected, abs=10 * ROUNDING)


def test_the_operator_on_a_line_is_the_convolution_with_its_kernel():
    grid = Grid(10, 1)
    symbol = np.random.default_rng(3).random(grid.spectral_shape)
    angle = 2 * np.pi * np.outer(np.arange(10), np.arange(6)) / 10
    kernel = (grid.multiplicity() * symbol * np.cos(angle)).sum(axis=1) / 10
    field = noise(grid)
    separation = (np.arange(10)[:, None] - np.arange(10)) % 10
    expected = kernel[separation] @ field
    assert grid.operator(symbol)(field, grid.empty()) == pytest.approx(expected, abs=10 * ROUNDING)


@pytest.mark.parametrize("dimension", [1, 2])
@pytest.mark.parametrize(("coarse", "fine"), [(8, 16), (10, 20), (32, 96)])
def test_interpolation_passes_through_the_coarse_points(coarse, fine, dimension):
    grid = Grid(coarse, dimension)
    field = noise(grid)
    finer = grid.resample(field, Grid(fine, dimension))
    shared = (slice(None, None, fine // coarse),) * dimension
    assert finer.shape == (fine,) * dimension
    assert finer[shared] == pytest.approx(field, abs=10 * ROUNDING)


@pytest.mark.parametrize("dimension", [1, 2])
@pytest.mark.parametrize(("source", "target"), [(16, 50), (50, 16), (18, 20), (20, 18), (16, 16)])
def test_resampling_a_band_limited_field_is_exact(source, target, dimension):
    highest = min(source, target) // 2 - 1  # what both grids resolve
    grid = Grid(source, dimension)
    resampled = grid.resample(polynomial(source, dimension, highest), Grid(target, dimension))
    expected = polynomial(target, dimension, highest)
    assert resampled == pytest.approx(expected, abs=10 * ROUNDING * np.abs(expected).max())


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
    modes = small.forward(field)
    modes[..., -1] = 0.0
    if dimension == 2:
        modes[coarse // 2] = 0.0
    assert back == pytest.approx(small.backward(modes), abs=10 * ROUNDING)


def test_two_threads_change_nothing():
    field = noise(Grid(64))
    one, two = Grid(64).forward(field), Grid(64, threads=2).forward(field)
    assert two == pytest.approx(one, abs=ROUNDING)


def test_a_plan_measured_for_the_first_time_destroys_nothing(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    known = SelfAffine(cutoff=0.05).heights(96)
    pyfftw.forget_wisdom()
    np.testing.assert_allclose(SelfAffine(cutoff=0.05).heights(96), known, atol=1e-14)
    field = np.random.default_rng(3).normal(size=(54, 54))
    pyfftw.forget_wisdom()
    fresh = Grid(54)
    np.testing.assert_allclose(fresh.backward(fresh.forward(field)), field, atol=1e-14)
