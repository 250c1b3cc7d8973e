"""Warnings about noise of a map, and none about maps without noise."""

import re

import numpy as np
import pytest

from gfmd_cli.maps.noise import noisy
from gfmd_cli.maps.topography import read_topography
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.self_affine import SelfAffine

POINTS = 160
SPACING = 1e-8


def _noise(*shape):
    return np.random.default_rng(5).normal(size=shape)


def _scan(hurst=0.8, cutoff=4, seed=3):
    """A part of a rough surface, in nanometres."""
    surface = SelfAffine(hurst=hurst, rolloff=0.5, cutoff=cutoff / (2 * POINTS), seed=seed)
    heights = np.array(surface.heights(2 * POINTS)[:POINTS, :POINTS])
    return (heights - heights.mean()) / heights.std()


def _change(heights):
    """The rms difference of neighbours along x."""
    return np.diff(heights, axis=1).std()


def _found(path, heights, spacing=(SPACING, SPACING)):
    np.save(path / "h.npy", heights)
    return noisy(read_topography(path / "h.npy"), spacing, 1e-9)


@pytest.mark.parametrize("level", [2, 4])
def test_the_noise_of_a_scan_is_named_with_its_size(tmp_path, level):
    sound = _scan()
    added = level * _change(sound) / np.sqrt(2)
    warning = _found(tmp_path, sound + added * _noise(*sound.shape))
    noise = float(re.search(r"^white noise of (\S+) m \(rms\) in the heights", warning)[1])
    assert noise == pytest.approx(added * 1e-9, rel=0.15)
    times = float(re.search(r"the rms gradient is (\S+) times", warning)[1])
    assert 0.65 < times / np.hypot(1, level) < 1.05  # too small rather than too large


def test_noise_that_is_most_of_the_gradient_has_no_ratio(tmp_path):
    sound = _scan()
    warning = _found(tmp_path, sound + 15 * _change(sound) * _noise(*sound.shape))
    assert "the rms gradient is more than 10 times" in warning


def test_offsets_of_lines_are_told_from_noise_of_points(tmp_path):
    sound = _scan()
    offsets = _change(sound) * _noise(POINTS, 1)
    warning = _found(tmp_path, sound + offsets)
    assert re.search(r"^random offsets of \S+ m \(rms\) of the lines along x,", warning)
    assert "align the lines" in warning
    assert "of the lines along y," in _found(tmp_path, (sound + offsets).T)


def test_pixels_that_are_not_square_weigh_the_axes(tmp_path):
    """Noise between lines that are far apart is a small part of the gradient."""
    sound = _scan()
    heights = sound + _change(sound) * _noise(POINTS, 1)
    assert _found(tmp_path, heights)
    assert not _found(tmp_path, heights, (10 * SPACING, SPACING))


def test_the_noise_beside_missing_heights_is_named(tmp_path):
    heights = _scan() + 0.2 * _noise(POINTS, POINTS)
    heights[20:60, 10:50] = np.nan
    noise = float(re.search(r"white noise of (\S+) m", _found(tmp_path, heights))[1])
    assert noise == pytest.approx(2e-10, rel=0.1)


def test_short_profiles_and_small_maps_give_none(tmp_path):
    """Self-affine ones without a roll-off resemble noise by chance."""
    heights = _scan() + _noise(POINTS, POINTS)
    assert _found(tmp_path, heights[:64])
    assert not _found(tmp_path, heights[:63])
    profile = np.sin(np.arange(4096) / 100) + 0.1 * _noise(4096)
    assert _found(tmp_path, profile, (SPACING,))
    assert not _found(tmp_path, profile[:1023], (SPACING,))


@pytest.mark.parametrize("missing", [0, 300])
def test_the_noise_of_a_profile_is_named_with_its_size(tmp_path, missing):
    """White noise of 0.1 nm on a wave."""
    profile = np.sin(np.arange(4096) / 100) + 0.1 * _noise(4096)
    profile[1000 : 1000 + missing] = np.nan
    warning = _found(tmp_path, profile, (SPACING,))
    noise = float(re.search(r"^white noise of (\S+) m \(rms\) in the heights", warning)[1])
    assert noise == pytest.approx(1e-10, rel=0.1)


def test_the_filter_of_a_profile_takes_its_noise(tmp_path):
    """After the filter that the warning names, the gradient is that of the wave or less."""
    wave = np.sin(np.arange(4096) / 20)
    np.save(tmp_path / "profile.npy", wave + 0.1 * _noise(4096))
    surface = FileSurface(path=tmp_path / "profile.npy", length=4096.0, periodic=False)
    (warning,) = [each for each in surface.warnings() if "white noise" in each]
    cutoff = float(re.search(r"s_filter = (\S+) or more", warning)[1])
    filtered = surface.model_copy(update={"s_filter": cutoff})
    assert not any("white noise" in each for each in filtered.warnings())
    changes = (np.diff(each).std() for each in (filtered.measured_map()[0], wave))
    assert next(changes) < 1.1 * next(changes)


def test_few_known_heights_give_none(tmp_path):
    heights = np.full((300, 400), np.nan)
    heights[1, 100:102] = 1e-9, 2e-9
    assert not _found(tmp_path, heights)
    heights[100:110, 100:120] = _noise(10, 20)
    assert not _found(tmp_path, heights)


@pytest.mark.parametrize("hurst", [0.1, 0.5, 1.0])
@pytest.mark.parametrize("cutoff", [2, 4, 16])
def test_a_sound_scan_gives_none(tmp_path, hurst, cutoff):
    heights = _scan(hurst, cutoff)
    y, x = np.mgrid[:POINTS, :POINTS] / POINTS
    pillars = (np.floor(8 * x) % 2) * (np.floor(8 * y) % 2)
    for sound in (
        heights,
        heights + 100 * x,
        heights - 20 * ((x - 0.5) ** 2 + (y - 0.5) ** 2),
        heights + 30 * pillars,
        heights + 3 * np.floor(7 * x + 2 * y),
        heights.clip(max=0.5),
        np.exp(heights),
        np.tile(heights[0], (POINTS, 1)) + 0.1 * heights,
    ):
        assert not _found(tmp_path, sound)


def test_noise_that_another_warning_explains_is_not_named_twice(tmp_path):
    sound = _scan()
    shifted = sound + 3 * _change(sound) * _noise(POINTS, 1)
    rounded = np.round(sound / (2 * _change(sound)))
    only_noise = _noise(POINTS, POINTS)
    for name, heights, words in (
        ("shifted", shifted, "shifted against each other"),
        ("rounded", rounded, "neighbouring heights are equal"),
        ("only noise", only_noise, "as much as distant ones"),
    ):
        np.save(tmp_path / f"{name}.npy", heights)
        surface = FileSurface(path=tmp_path / f"{name}.npy", length=1e3, periodic=False)
        found = surface.warnings()
        assert any(words in each for each in found)
        assert not any("white noise" in each or "random offsets" in each for each in found)
