"""The texture of a surface: anisotropy, copies of a patch, waves of the Nyquist wavenumber."""

import numpy as np
import pytest

from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.discretisation_error import MAX_REPETITIONS
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.physics.waves import texture


def waves(grid, *pairs):
    """Sum of cosines: (m_y, m_x, amplitude) in waves per side."""
    y, x = (np.arange(size) / size for size in grid.shape)
    return sum(a * np.cos(2 * np.pi * (m_y * y[:, None] + m_x * x)) for m_y, m_x, a in pairs)


@pytest.mark.parametrize("points", [32, 33])
def test_two_crossed_waves(points):
    """Slopes 2 pi m a / sqrt 2 along their own axes."""
    grid = Grid(points)
    assert texture(grid, waves(grid, (0, 4, 1.0), (4, 0, 1.0))).anisotropy == pytest.approx(
        1.0, rel=1e-12
    )
    assert texture(grid, waves(grid, (0, 4, 1.0), (2, 0, 0.5))).anisotropy == pytest.approx(
        4.0, rel=1e-12
    )


def test_turned_waves_have_the_ratio_of_waves_along_the_axes():
    grid = Grid(64)
    turned = waves(grid, (5, 5, 1.0), (-5, 5, 0.25))
    assert texture(grid, turned).anisotropy == pytest.approx(4.0, rel=1e-12)


def test_stripes_and_lines_are_infinitely_anisotropic():
    assert texture(Grid(32), waves(Grid(32), (3, 4, 1.0))).anisotropy == np.inf
    assert texture(Grid(32, 1), np.sin(np.arange(32.0))).anisotropy == np.inf


@pytest.mark.parametrize("cutoff", [1 / 16, 1 / 8])
def test_a_random_surface_is_isotropic_up_to_two_points_per_wave(cutoff):
    surface = SelfAffine(cutoff=cutoff)
    assert texture(Grid(32), surface.heights(32)).anisotropy == pytest.approx(1.0, abs=0.1)


def test_a_side_is_a_length():
    """Waves of one length in a cell twice as long along y."""
    grid = Grid(32, length=1.0, points_y=64, length_y=2.0)
    assert texture(grid, waves(grid, (0, 4, 1.0), (8, 0, 1.0))).anisotropy == pytest.approx(
        1.0, rel=1e-12
    )


@pytest.mark.parametrize("cutoff", [1 / 32, 1 / 8, 1 / 4])
def test_a_random_surface_is_one_patch_and_tiles_of_it_are_copies(cutoff):
    patch = SelfAffine(cutoff=cutoff, rolloff=0.5).heights(64)
    assert texture(Grid(64), patch).repetitions == pytest.approx(1.0, abs=0.3)
    for copies in (2, 3, 4):
        tiled = np.tile(patch, (copies, copies))
        ratio = texture(Grid(64 * copies), tiled).repetitions / texture(Grid(64), patch).repetitions
        assert ratio == pytest.approx(copies**2, rel=0.35)
    row = np.tile(patch, (1, 3))
    ratio = texture(Grid(192, points_y=64), row).repetitions / texture(Grid(64), patch).repetitions
    assert ratio == pytest.approx(3, rel=0.35)


def test_gaussian_maps_are_below_the_limit_of_copies_and_tiles_above():
    m = np.hypot(np.fft.fftfreq(64, 1 / 64)[:, None], np.fft.rfftfreq(64, 1 / 64))
    for seed in range(50):
        noise = np.fft.rfft2(np.random.default_rng(seed).normal(size=(64, 64)))
        patch = np.fft.irfft2(noise * (m <= 14) * (1 + (m / 4) ** 2) ** -0.9, (64, 64))
        assert 0.7 < texture(Grid(64), patch).repetitions < 2.6 < MAX_REPETITIONS
        assert texture(Grid(192), np.tile(patch, (3, 3))).repetitions > MAX_REPETITIONS


def test_the_waves_of_two_points_are_found_along_each_axis():
    for points_y, m_y, m_x in ((32, 16, 3), (32, 2, 16), (33, 0, 16)):
        grid = Grid(32, points_y=points_y)
        long = waves(grid, (2, 3, 1.0), (15, 15, 1.0))
        assert not texture(grid, long).has_nyquist_waves
        assert texture(grid, long + waves(grid, (m_y, m_x, 1e-6))).has_nyquist_waves
    line = Grid(32, 1)
    assert texture(line, (-1.0) ** np.arange(32)).has_nyquist_waves
    assert not texture(line, np.cos(2 * np.pi * 15 * np.arange(32) / 32)).has_nyquist_waves
