"""Warnings about maps whose numbers were read or saved wrongly, and none about sound maps."""

import numpy as np
import pytest
import scipy.ndimage

from gfmd_cli.maps.misread import filled_lines, interpolated, misread
from gfmd_cli.maps.topography import read_topography
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.self_affine import SelfAffine

POINTS = 128
Y, X = np.mgrid[:POINTS, :POINTS] / POINTS


def _scan(hurst, points=POINTS, cutoff=4, seed=3):
    """A part of a rough surface, wider than high, so that its borders do not fit each other."""
    surface = SelfAffine(hurst=hurst, rolloff=0.5, cutoff=cutoff / (2 * points), seed=seed)
    heights = np.array(surface.heights(2 * points)[:points, : points + 16])
    return 1e-8 * (heights - heights.mean()) / heights.std()


def _found(path, heights):
    np.save(path / "h.npy", heights)
    topography = read_topography(path / "h.npy")
    return misread(topography) or interpolated(topography)


def _counts(heights, levels):
    """Heights in counts from 0 to `levels`."""
    return np.round((heights - heights.min()) / np.ptp(heights) * levels)


def _reversed(heights):
    heights = heights.copy()
    heights[1::2] = heights[1::2, ::-1]
    return heights


def _displaced(heights, by):
    heights = heights.copy()
    heights[1::2] = np.roll(heights[1::2], by, axis=1)
    return heights


def _reshaped(heights, points):
    """The map as it is read with another number of points per line."""
    rows = heights.size // points
    return heights.ravel()[: rows * points].reshape(rows, points)


DAMAGES = [
    (lambda h: _counts(h, 330) % 256, "wrapped around"),
    (lambda h: np.round(h / h.std() * 20).astype(np.int16).astype(np.uint16), "wrapped around"),
    (_reversed, "lines along x fit the next line better in reverse"),
    (lambda h: _reversed(h.T), "lines along x fit the next line better in reverse"),
    (lambda h: _displaced(h, 1), "every second line along x is displaced"),
    (lambda h: _displaced(h, -1), "every second line along x is displaced"),
    (lambda h: np.concatenate([h[::2], h[1::2]]), "lines 64 to 127 along x fit between"),
    (lambda h: np.concatenate([h[1::2], h[::2]]), "lines 64 to 127 along x fit between"),
    (lambda h: _reshaped(h, POINTS + 17), "with 144 instead of 145 points per line"),
    (lambda h: _reshaped(h, POINTS + 15), "with 144 instead of 143 points per line"),
    (lambda h: h.astype(np.float32).view(np.int16), "numbers that were read as two each"),
    (lambda h: _counts(h, 60000).astype(np.uint16).byteswap(), "as much as distant ones"),
]


@pytest.mark.parametrize("hurst", [0.5, 0.9])
@pytest.mark.parametrize(("damage", "words"), DAMAGES)
def test_a_misread_map_gives_one_warning(tmp_path, damage, words, hurst):
    assert words in _found(tmp_path, damage(_scan(hurst)))
    assert words.replace("along x", "along y") in _found(tmp_path, damage(_scan(hurst)).T)


@pytest.mark.parametrize("points", [64, 256])
@pytest.mark.parametrize("hurst", [0.3, 0.9])
@pytest.mark.parametrize("cutoff", [2, 8])
def test_a_sound_scan_gives_none(tmp_path, points, hurst, cutoff):
    for heights in (
        _scan(hurst, points, cutoff),
        SelfAffine(hurst=hurst, cutoff=cutoff / points).heights(points),
    ):
        for sound in (heights, _counts(heights, 255), -heights.T):
            assert not _found(tmp_path, sound)
            assert not filled_lines(read_topography(tmp_path / "h.npy"))[0]


@pytest.mark.parametrize("hurst", [0.3, 0.9])
@pytest.mark.parametrize("points", [4, 6, 8, 12, 24])
def test_lines_that_were_broken_give_one_warning(tmp_path, hurst, points):
    """As in a file with at most so many numbers in a line."""
    heights = _scan(hurst)
    words = f"each line of {points} heights seems to continue in the next one"
    assert words in _found(tmp_path, heights.reshape(-1, points))
    for sound in (heights[:, :points], heights.T[:, :points], -heights[:, -points:]):
        assert not _found(tmp_path, sound)


STRUCTURES = {
    "grating": np.floor(16 * X) % 2,
    "oblique grating": np.floor(16 * (X + Y)) % 2,
    "saw teeth": (8 * X) % 1,
    "waves": np.sin(2 * np.pi * 24 * X) * np.sin(2 * np.pi * 24 * Y),
    "pillars": (np.floor(16 * X) % 2) * (np.floor(16 * Y) % 2),
    "step": (X > 0.4) * 1.0,
    "diagonal step": (X > Y) * 1.0,
    "mesa": 1.0 * ((abs(X - 0.5) < 0.2) & (abs(Y - 0.45) < 0.22)),
    "sphere": -((X - 0.5) ** 2) - (Y - 0.5) ** 2,
    "pyramid": -np.maximum(abs(X - 0.5), abs(Y - 0.5)),
    "turned": ((12 * X) % 1 - 0.5) ** 2,
    "ground": np.tile(_scan(0.5)[0, :POINTS] / 1e-8, (POINTS, 1)),
}


@pytest.mark.parametrize("noise", [0.0, 0.02])
@pytest.mark.parametrize("shape", STRUCTURES)
def test_a_structured_surface_gives_none(tmp_path, shape, noise):
    heights = STRUCTURES[shape] + noise * np.random.default_rng(2).normal(size=X.shape)
    for sound in (heights, heights.T, _counts(heights, 255)):
        assert not _found(tmp_path, sound)
        assert not filled_lines(read_topography(tmp_path / "h.npy"))[0]


@pytest.mark.parametrize("hurst", [0.5, 0.9])
@pytest.mark.parametrize("from_centres", [False, True])
@pytest.mark.parametrize("order", [1, 3])
@pytest.mark.parametrize(("factor", "period"), [(1.5, 3), (2, 2), (3, 3)])
def test_an_interpolated_map_gives_one_warning(
    tmp_path, factor, period, order, from_centres, hurst
):
    measured = _scan(hurst, cutoff=2)
    options = {"order": order, "mode": "nearest", "grid_mode": from_centres}
    heights = scipy.ndimage.zoom(measured, factor, **options)
    words = f"a period of {period} points along x and {period} along y"
    assert words in _found(tmp_path, heights)
    surface = FileSurface(path=tmp_path / "h.npy", length=1e-5, periodic=False)
    found = [each for each in surface.warnings() if "gradient" not in each]
    assert len(found) == 1
    assert words in found[0]
    heights[30:40, 50:90] = np.nan
    assert words in _found(tmp_path, heights)
    for sound in (measured, scipy.ndimage.gaussian_filter(measured, 1.0)):
        assert not _found(tmp_path, sound)


def test_spikes_are_not_wrapped_around(tmp_path):
    heights = _scan(0.9)
    for row, column in np.random.default_rng(1).integers(2, POINTS - 2, (5, 2)):
        heights[row, column] += 1e-7
    assert not _found(tmp_path, heights)


def test_missing_heights_do_not_hide_the_order_of_lines(tmp_path):
    heights = _scan(0.8)
    heights[30:40, 50:90] = np.nan
    assert not _found(tmp_path, heights)
    assert "better in reverse" in _found(tmp_path, _reversed(heights))


def test_few_known_heights_give_none(tmp_path):
    heights = np.full((300, 400), np.nan)
    heights[1, 100:102] = 1e-9, 2e-9
    assert not _found(tmp_path, heights)
    heights[100:110, 100:120] = _scan(0.8)[:10, :20]
    assert not _found(tmp_path, heights)
    assert not filled_lines(read_topography(tmp_path / "h.npy"))[0]


@pytest.mark.parametrize("value", [0.0, 3e-8, -1e-7])
def test_filled_lines_give_one_warning(tmp_path, value):
    heights = _scan(0.8)
    heights[40:43] = heights[90] = value
    np.save(tmp_path / "h.npy", heights)
    warning, known = filled_lines(read_topography(tmp_path / "h.npy"))
    assert f"4 lines along x of equal heights each, first line 40 with {value:g}" in warning
    assert known.missing.sum() == 4 * heights.shape[1]
    assert not misread(known)
    surface = FileSurface(path=tmp_path / "h.npy", length=1e-5, periodic=False)
    found = [each for each in surface.warnings() if "gradient" not in each]
    assert found == [warning]


@pytest.mark.parametrize("hurst", [0.3, 0.9])
@pytest.mark.parametrize(("where", "number"), [(slice(1), 0), (slice(-3, None), 125)])
def test_filled_lines_at_the_border(tmp_path, where, number, hurst):
    heights = _scan(hurst)
    for lines, along in ((heights, "x"), (heights.T, "y")):
        for value in (heights.mean(), heights.max() + 1e-9):
            damaged = lines.copy()
            damaged[where][:] = value
            np.save(tmp_path / "h.npy", damaged if along == "x" else damaged.T)
            warning, _ = filled_lines(read_topography(tmp_path / "h.npy"))
            first = number + len(lines) - POINTS if number else 0
            assert f"along {along} of equal heights each, first line {first} with" in warning


def test_a_frame_and_a_window_have_lines_of_one_height(tmp_path):
    """Opposite borders with the same height, to which the map falls at once, or in ten points."""
    heights = _scan(0.8)[:POINTS, :POINTS]
    ramp = np.clip(np.arange(POINTS) / 10, 0, 1) * np.clip(np.arange(POINTS)[::-1] / 10, 0, 1)
    weight = 0.5 - 0.5 * np.cos(np.pi * ramp)
    for sound in (np.pad(heights, 1), heights * np.outer(weight, weight)):
        np.save(tmp_path / "h.npy", sound)
        assert not filled_lines(read_topography(tmp_path / "h.npy"))[0]


@pytest.mark.parametrize(("damage", "words"), DAMAGES)
def test_a_misread_map_has_no_other_warning_about_lines_or_points(tmp_path, damage, words):
    np.save(tmp_path / "h.npy", damage(_scan(0.8)))
    surface = FileSurface(path=tmp_path / "h.npy", length=1e-5, periodic=False)
    found = surface.warnings()
    assert sum(words in each for each in found) == 1
    assert not any(word in each for each in found for word in ("scan?", "spikes?", "scars"))
