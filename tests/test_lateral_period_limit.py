"""Maps of a microscope that does not resolve their shortest waves."""

import numpy as np
import pytest

from gfmd_cli.errors import InputError
from gfmd_cli.maps.gaussian_filter import gaussian_filter
from gfmd_cli.maps.map_warnings import unresolved
from gfmd_cli.physics.elastomers import HalfSpace
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.physics.surface_spectrum import short_wave_factor

POINTS, SPACING = 240, 1e-7
LENGTH = POINTS * SPACING


@pytest.fixture
def waves(tmp_path):
    """A map of diagonal waves with a number of points along each axis and an rms gradient.

    The wavelength is this number over the square root of two.
    """

    def waves(gradients, **keys):
        y, x = np.mgrid[:POINTS, :POINTS]
        heights = np.zeros(x.shape)
        for i, (points, gradient) in enumerate(gradients.items()):
            amplitude = gradient * points / np.sqrt(2) * SPACING / (2 * np.pi)
            for along in (x + y, x - y):
                heights += amplitude * np.sin(2 * np.pi * along / points + i)
        path = tmp_path / f"{len(list(tmp_path.iterdir()))}.npy"  # a map is read once
        np.save(path, heights)
        return FileSurface(path=path, length=LENGTH, **keys)

    return waves


def noise_of(surface):
    return [each for each in surface.warnings() if "lateral_period_limit" in each]


def test_the_factor_of_short_waves_is_that_of_one_to_two_limits(waves):
    """Delta_sigma of a half-space is proportional to the rms gradient; shorter waves are noise."""
    surface = waves({40: 3, 16: 4, 8: 9}, lateral_period_limit=8 * SPACING)
    assert short_wave_factor(surface, HalfSpace()) == pytest.approx(5 / 3, rel=1e-9)
    assert short_wave_factor(waves({40: 3, 16: 4}), HalfSpace()) == pytest.approx(1, rel=1e-9)


def test_a_limit_below_two_points_is_that_of_the_map(waves):
    for limit in (None, 0.5 * SPACING, 2 * SPACING):
        surface = waves({40: 3, 4: 4}, lateral_period_limit=limit)
        assert short_wave_factor(surface, HalfSpace()) == pytest.approx(5 / 3, rel=1e-9)
        assert not noise_of(surface)


def test_waves_below_the_limit_are_noise_until_they_are_filtered(waves):
    """The rms gradient is that of the differences of neighbours, a factor of sinc(1 / points)."""
    gradients, limit = {40: 3e-3, 8: 4e-3}, 8 * SPACING
    (warning,) = noise_of(waves(gradients, lateral_period_limit=limit))
    factor = np.hypot(1, 4 / 3 * np.sinc(1 / 8) / np.sinc(1 / 40))
    assert f"rms gradient by a factor of {factor:.2g}, more than" in warning
    assert "surface.s_filter = 8.4e-07 or more" in warning
    assert not noise_of(waves(gradients, lateral_period_limit=limit, s_filter=limit))  # a quarter
    assert not noise_of(waves({40: 3e-3, 8: 2e-3}, lateral_period_limit=limit))  # factor 1.2


def test_a_blurred_map_looks_resolved_unless_the_limit_is_given(tmp_path):
    surface = SelfAffine(cutoff=1 / 256, rolloff=1 / 4, hurst=0.8, h_std=1e-6, seed=1)
    heights = surface.heights(1024)
    blurred = gaussian_filter(heights, (1 / 1024, 1 / 1024), 1 / 64, periodic=True)[::2, ::2]
    np.save(tmp_path / "map.npy", blurred)
    seen = FileSurface(path=tmp_path / "map.npy", length=1e-4)
    assert not unresolved(short_wave_factor(seen, HalfSpace()))
    seen = seen.model_copy(update={"lateral_period_limit": 1e-4 / 64})
    warning = unresolved(short_wave_factor(seen, HalfSpace()), seen.period_limit())
    assert (
        "the waves of 1.5625 µm (surface.lateral_period_limit, at least two points) to 3.125 µm"
        in warning
    )
    assert not noise_of(seen)


def test_a_map_has_two_wavelengths_of_the_limit_or_more(waves):
    surface = waves({24: 3}, lateral_period_limit=0.6 * LENGTH)
    with pytest.raises(InputError, match=r"surface.lateral_period_limit = 1.44e-05 m.*1.2e-05 m"):
        surface.smallest_grid()
