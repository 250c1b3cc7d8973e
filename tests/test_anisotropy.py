"""The ratio of the slopes along the principal axes."""

import numpy as np
import pytest

from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.power_spectra import anisotropy
from gfmd_cli.physics.self_affine import SelfAffine


def waves(grid, *pairs):
    """Sum of cosines: (m_y, m_x, amplitude) in waves per side."""
    y, x = (np.arange(size) / size for size in grid.shape)
    return sum(a * np.cos(2 * np.pi * (m_y * y[:, None] + m_x * x)) for m_y, m_x, a in pairs)


@pytest.mark.parametrize("points", [32, 33])
def test_two_crossed_waves(points):
    """Slopes 2 pi m a / sqrt 2 along their own axes."""
    grid = Grid(points)
    assert anisotropy(grid, waves(grid, (0, 4, 1.0), (4, 0, 1.0))) == pytest.approx(1.0, rel=1e-12)
    assert anisotropy(grid, waves(grid, (0, 4, 1.0), (2, 0, 0.5))) == pytest.approx(4.0, rel=1e-12)


def test_turned_waves_have_the_ratio_of_waves_along_the_axes():
    grid = Grid(64)
    turned = waves(grid, (5, 5, 1.0), (-5, 5, 0.25))
    assert anisotropy(grid, turned) == pytest.approx(4.0, rel=1e-12)


def test_stripes_and_lines_are_infinitely_anisotropic():
    assert anisotropy(Grid(32), waves(Grid(32), (3, 4, 1.0))) == np.inf
    assert anisotropy(Grid(32, 1), np.sin(np.arange(32.0))) == np.inf


@pytest.mark.parametrize("cutoff", [1 / 16, 1 / 8])
def test_a_random_surface_is_isotropic_up_to_two_points_per_wave(cutoff):
    surface = SelfAffine(cutoff=cutoff)
    assert anisotropy(Grid(32), surface.heights(32)) == pytest.approx(1.0, abs=0.1)


def test_a_side_is_a_length():
    """Waves of one length in a cell twice as long along y."""
    grid = Grid(32, length=1.0, points_y=64, length_y=2.0)
    assert anisotropy(grid, waves(grid, (0, 4, 1.0), (8, 0, 1.0))) == pytest.approx(1.0, rel=1e-12)
