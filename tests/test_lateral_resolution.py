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
    """A map of waves along x and y with a number of points in each and an rms gradient."""

    def waves(gradients, **keys):
        x = np.arange(POINTS)
        heights = np.zeros((POINTS, POINTS))
        for i, (points, gradient) in enumerate(gradients.items()):
            wave = np.sin(2 * np.pi * x / points + i) * gradient * points * SPACING / (2 * np.pi)
            heights += wave[:, None] + wave
        np.save(tmp_path / f"{len(list(tmp_path.iterdir()))}.npy", heights)
        path = max(tmp_path.glob("*.npy"), key=lambda each: int(each.stem))
        return FileSurface(path=path, length=LENGTH, **keys)

    return waves


def noise_of(surface):
    return [each for each in surface.warnings() if "lateral_resolution" in each]


def test_the_factor_of_short_waves_is_that_of_one_to_two_resolutions(waves):
    """Delta_sigma of a half-space is proportional to the rms gradient; shorter waves are noise."""
    surface = waves({24: 3, 10: 4, 6: 9}, lateral_resolution=8 * SPACING)
    assert short_wave_factor(surface, HalfSpace()) == pytest.approx(5 / 3, rel=1e-9)
    assert short_wave_factor(waves({24: 3, 10: 4}), HalfSpace()) == pytest.approx(1, rel=1e-9)


def test_a_resolution_below_two_points_is_that_of_the_map(waves):
    for resolution in (None, 0.5 * SPACING, 2 * SPACING):
        surface = waves({24: 3, 3: 4}, lateral_resolution=resolution)
        assert short_wave_factor(surface, HalfSpace()) == pytest.approx(5 / 3, rel=1e-9)
        assert not noise_of(surface)


def test_waves_below_the_resolution_are_noise_until_they_are_filtered(waves):
    gradients, resolution = {40: 3, 5: 4}, 8 * SPACING
    (warning,) = noise_of(waves(gradients, lateral_resolution=resolution))
    gradient = 4 * np.sinc(1 / 5)  # that of the differences of neighbours
    assert f"rms gradient by a factor of {np.hypot(1, gradient / 3):.2g}." in warning
    assert "surface.s_filter = 8e-07 or more" in warning
    left = waves(gradients, lateral_resolution=resolution, s_filter=resolution)
    assert not noise_of(left)  # 2^-(8/5)^2 of 4 is left
    assert not noise_of(waves({40: 3, 5: 2}, lateral_resolution=resolution))  # factor 1.2


def test_a_blurred_map_looks_resolved_unless_the_resolution_is_given(tmp_path):
    surface = SelfAffine(cutoff=1 / 256, rolloff=1 / 4, hurst=0.8, h_std=1e-6, seed=1)
    heights = surface.heights(1024)
    blurred = gaussian_filter(heights, (1 / 1024, 1 / 1024), 1 / 64, periodic=True)[::2, ::2]
    np.save(tmp_path / "map.npy", blurred)
    seen = FileSurface(path=tmp_path / "map.npy", length=1e-4)
    assert not unresolved(short_wave_factor(seen, HalfSpace()))
    seen = seen.model_copy(update={"lateral_resolution": 1e-4 / 64})
    warning = unresolved(short_wave_factor(seen, HalfSpace()), seen.resolution())
    assert "the waves of 1.5625 µm to 3.125 µm (surface.lateral_resolution) increase" in warning
    assert not noise_of(seen)


def test_a_map_has_two_wavelengths_of_its_resolution_or_more(waves):
    surface = waves({24: 3}, lateral_resolution=0.6 * LENGTH)
    with pytest.raises(InputError, match=r"surface.lateral_resolution = 1.44e-05 m.*1.2e-05 m"):
        surface.smallest_grid()
