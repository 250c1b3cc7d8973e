"""The S-filter of a measured map: its transmission, its borders, and where it takes part."""

import re

import numpy as np
import pytest

from gfmd_cli import solve
from gfmd_cli.errors import InputError
from gfmd_cli.maps.gaussian_filter import gaussian_filter
from gfmd_cli.maps.noise import noisy
from gfmd_cli.maps.topography import read_topography
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.self_affine import SelfAffine

SQUARE = (1.0, 1.0)
BOTH = pytest.mark.parametrize("periodic", [True, False])


def _noise(*shape):
    return np.random.default_rng(8).normal(size=shape)


def _map(path, heights, **keys):
    np.save(path / "h.npy", heights)
    return FileSurface(path=path / "h.npy", **{"length": float(heights.shape[-1])} | keys)


def _below(path):
    (path / "below").mkdir()
    return path / "below"


@pytest.mark.parametrize("points", [60, 75])
@pytest.mark.parametrize("wavelength", [3, 5, 15])
def test_a_periodic_wave_of_the_cutoff_wavelength_is_halved(points, wavelength):
    wave = np.cos(2 * np.pi * np.arange(points) / wavelength + 1)
    filtered = gaussian_filter(wave, (0.1,), 0.1 * wavelength, periodic=True)
    np.testing.assert_allclose(filtered, wave / 2, atol=1e-14, rtol=0)


@pytest.mark.parametrize("spacings", [3, 4, 5, 12])
def test_a_wave_far_from_the_borders_keeps_the_sum_over_its_aliases(spacings):
    """The points of the weights make the transform periodic (Poisson summation)."""
    aliases = spacings * np.arange(-5, 6)
    kept = np.exp2(-((1.0 + aliases) ** 2)).sum() / np.exp2(-(aliases**2.0)).sum()
    wave = np.cos(2 * np.pi * np.arange(400) / spacings)
    filtered = gaussian_filter(wave, (0.1,), 0.1 * spacings, periodic=False)
    np.testing.assert_allclose(filtered[120:-120], kept * wave[120:-120], atol=1e-12, rtol=0)
    assert kept == pytest.approx({3: 0.560, 4: 0.5019}.get(spacings, 0.5), abs=5e-4)


@BOTH
def test_the_transmission_depends_on_the_wavelength_alone(periodic):
    """Along any direction, on pixels that are not square: 2^-(cutoff / wavelength)^2."""
    shape, spacing, cutoff = (80, 96), (0.5, 0.25), 2.5
    y, x = (np.arange(n) / n for n in shape)
    for m_y, m_x in ((6, 0), (0, 7), (5, -8), (9, 4)):
        wave = np.cos(2 * np.pi * (m_y * y[:, None] + m_x * x))
        frequency = np.hypot(m_y / (shape[0] * spacing[0]), m_x / (shape[1] * spacing[1]))
        filtered = gaussian_filter(wave, spacing, cutoff, periodic=periodic)
        expected = 2 ** -((cutoff * frequency) ** 2) * wave
        inner = np.s_[:] if periodic else np.s_[16:-16, 32:-32]
        np.testing.assert_allclose(filtered[inner], expected[inner], atol=2e-5, rtol=0)


def test_the_weights_are_those_of_the_standard():
    """Of a single point: exp(-pi (r / alpha lambda_c)^2) / (alpha lambda_c)^2, ISO 16610-61."""
    point, cutoff = np.zeros((61, 61)), 12.0
    point[30, 30] = 1.0
    y, x = np.mgrid[-30:31, -30:31]
    width = np.sqrt(np.log(2) / np.pi) * cutoff
    expected = np.exp(-np.pi * (x**2 + y**2) / width**2) / width**2
    for periodic in (True, False):
        filtered = gaussian_filter(point, SQUARE, cutoff, periodic=periodic)
        np.testing.assert_allclose(filtered, expected, atol=1e-10, rtol=0)


@pytest.mark.parametrize("cutoff", [3, 7, 19])
def test_a_plane_stays_a_plane_up_to_the_borders(cutoff):
    y, x = np.mgrid[:20, :33]
    plane = 2 + 0.3 * x - 0.7 * y
    np.testing.assert_allclose(
        gaussian_filter(plane, SQUARE, cutoff, periodic=False), plane, atol=1e-12, rtol=0
    )
    line = 4 - 0.5 * np.arange(20)
    filtered = gaussian_filter(line, (1.0,), cutoff, periodic=False)
    np.testing.assert_allclose(filtered, line, atol=1e-12, rtol=0)


@BOTH
def test_a_constant_stays(periodic):
    heights = np.full((20, 30), 5.0)
    np.testing.assert_allclose(gaussian_filter(heights, SQUARE, 6, periodic=periodic), 5, 1e-12)


@pytest.mark.parametrize("cutoff", [4.0, 11.0, 40.0])
def test_every_height_is_a_weighted_least_squares_fit(cutoff):
    heights, x = _noise(40), np.arange(40)
    filtered = gaussian_filter(heights, (1.0,), cutoff, periodic=False)
    for place, value in enumerate(filtered):
        weight = np.exp(-((np.pi * (x - place) / cutoff) ** 2) / np.log(2))
        fit = np.polyfit(x - place, heights, 1, w=np.sqrt(weight))
        assert value == pytest.approx(fit[1], abs=1e-9)


@BOTH
def test_a_product_of_profiles_is_filtered_as_the_profiles(periodic):
    """The weights are products; with more points than a block of rows has."""
    along_y, along_x = _noise(2, 250)
    y, x = (gaussian_filter(line, (1.0,), 20, periodic=periodic) for line in (along_y, along_x))
    filtered = gaussian_filter(np.outer(along_y, along_x), SQUARE, 20, periodic=periodic)
    np.testing.assert_allclose(filtered, np.outer(y, x), atol=1e-13, rtol=0)


@BOTH
def test_a_turned_map_is_filtered_alike(periodic):
    heights = _noise(24, 31)
    filtered = gaussian_filter(heights, (1.0, 2.0), 5, periodic=periodic)
    turned = gaussian_filter(heights[::-1].T, (2.0, 1.0), 5, periodic=periodic)
    np.testing.assert_allclose(turned, filtered[::-1].T, atol=1e-13, rtol=0)


def test_an_axis_with_points_too_far_apart_is_left():
    heights = _noise(12, 40)
    filtered = gaussian_filter(heights, (100.0, 1.0), 5, periodic=False)
    lines = [gaussian_filter(line, (1.0,), 5, periodic=False) for line in heights]
    np.testing.assert_allclose(filtered, lines, atol=1e-14, rtol=0)


@pytest.mark.parametrize("cutoff", [2.9, 41])
def test_a_cutoff_that_the_map_cannot_have_is_refused(tmp_path, cutoff):
    surface = _map(tmp_path, _noise(40, 50), s_filter=cutoff)
    with pytest.raises(InputError, match=r"s_filter = .* between 3 spacings .*, 3 m, .* 40 m"):
        surface.smallest_grid()


@pytest.mark.parametrize(("key", "count"), [("s_filter", 2), ("lateral_period_limit", 1)])
@pytest.mark.parametrize("side", [0.7123457, 0.7137])
def test_the_limits_of_a_length_that_a_message_shows_are_allowed(tmp_path, key, count, side):
    def points(length):
        return _map(tmp_path, _noise(17, 23), length=side, **{key: length}).smallest_grid()

    with pytest.raises(InputError) as error:
        points(1e3)
    limits = re.findall(r", (\S+) m\b", str(error.value))
    assert len(limits) == count
    assert [points(float(limit)) for limit in limits] == count * [23]


def test_a_cutoff_of_three_spacings_is_allowed(tmp_path):
    for side in (0.1, 0.7, 20e-6):
        surface = _map(tmp_path, _noise(49, 49), length=side, s_filter=side / 49 * 3)
        assert surface.smallest_grid() == 49


@pytest.mark.parametrize("edges", ["none", "window", "mirror"])
@BOTH
def test_a_map_is_filtered_before_its_edges_are_changed(tmp_path, edges, periodic):
    heights = _noise(24, 32)
    keys = {"edges": edges, "periodic": periodic, "level": "none"}
    is_repeated = periodic and edges == "none"
    filtered = gaussian_filter(heights, SQUARE, 5, periodic=is_repeated)
    solved = _map(tmp_path, heights, s_filter=5.0, **keys)
    expected = _map(_below(tmp_path), filtered, **keys)
    points = (expected.smallest_grid(), expected.smallest_grid_y())
    np.testing.assert_allclose(
        solved.heights(*points), expected.heights(*points), atol=1e-13, rtol=0
    )


def test_the_side_of_the_map_sets_the_unit_of_the_cutoff(tmp_path):
    heights = _noise(32, 32)
    filtered = gaussian_filter(heights, SQUARE, 4, periodic=True)
    surface = _map(tmp_path, heights, length=8e-6, s_filter=1e-6, scale=1e-9)
    np.testing.assert_allclose(surface.heights(32), 1e-9 * filtered, atol=1e-23, rtol=0)


def test_missing_heights_are_filled_in_before_the_filter(tmp_path):
    """They have no peak or pit of their own; in a plane the filling and the filter change none."""
    y, x = np.mgrid[:30, :40]
    plane = np.where((x - 20) ** 2 + (y - 12) ** 2 < 16, np.nan, 0.2 * x + 0.1 * y)
    surface = _map(tmp_path, plane, s_filter=6.0, periodic=False, level="none")
    heights, _ = surface.measured_map()
    known = ~np.ma.getmaskarray(heights)
    assert np.count_nonzero(~known) == np.count_nonzero(np.isnan(plane))
    far = (x - 20) ** 2 + (y - 12) ** 2 > 15**2
    np.testing.assert_allclose(heights[far], plane[far], atol=1e-10, rtol=0)
    assert np.nanmin(plane) - 1e-10 <= surface.heights(40, 30).min()


def test_a_filtered_profile_is_solved(tmp_path):
    heights = _noise(64)
    filtered = gaussian_filter(heights, (1.0,), 8, periodic=True)
    surface = _map(tmp_path, heights, s_filter=8.0)
    np.testing.assert_allclose(surface.heights(64), filtered, atol=1e-13, rtol=0)


def test_the_cutoff_is_part_of_the_description_of_a_map(tmp_path):
    surface = _map(tmp_path, _noise(32, 32), length=32e-6, s_filter=4e-6)
    assert "s_filter=4 µm" in surface.label
    assert "S-filter 4 µm" in surface.preparation()
    assert "S-filter" not in _map(tmp_path, _noise(32, 32)).preparation()
    assert surface.parameters()["s_filter"] == 4e-6


def test_a_filter_against_noise_restores_the_contact_area():
    sound = SelfAffine(hurst=0.8, cutoff=10 / 128, seed=3).heights(128)
    scan = sound + 1.5 * np.diff(sound).std() * _noise(128, 128)
    spec = {"elastomer": {"kind": "half-space"}, "load": {"p_star": 0.05}}
    exact = solve(spec, heights=sound)
    spec["load"] = {"pressure": exact.nominal_pressure}
    with_noise = solve(spec, heights=scan).a_r
    filtered = solve(spec | {"surface": {"s_filter": 5 / 128}}, heights=scan).a_r
    assert with_noise < 0.6 * exact.a_r
    assert filtered == pytest.approx(exact.a_r, rel=0.1)


def _scan(level):
    cell = SelfAffine(hurst=0.8, rolloff=0.5, cutoff=8 / 320, seed=3).heights(320)
    heights = np.array(cell[:160, :160])
    return heights + level * np.diff(heights).std() / np.sqrt(2) * _noise(160, 160)


def test_the_warning_of_noise_names_a_filter_that_ends_it(tmp_path):
    keys = {"periodic": False, "length": 160e-9, "scale": 1e-9}
    heights = _scan(3)
    [warning] = [each for each in _map(tmp_path, heights, **keys).warnings() if "noise" in each]
    cutoff = float(re.search(r"surface.s_filter = (\S+) or more", warning)[1])
    assert 3e-9 <= cutoff < 7e-9
    for s_filter in (cutoff, 2 * cutoff):
        surface = FileSurface(path=tmp_path / "h.npy", **keys, s_filter=s_filter)
        assert not any("noise" in each for each in surface.warnings())
    short = FileSurface(path=tmp_path / "h.npy", **keys, s_filter=3e-9)
    assert any("the rms gradient after the S-filter is" in each for each in short.warnings())


def test_a_filter_that_smooths_the_offsets_of_lines_ends_their_warning(tmp_path):
    heights = _scan(0) + np.diff(_scan(0)).std() * _noise(160, 1)
    np.save(tmp_path / "h.npy", heights)
    topography = read_topography(tmp_path / "h.npy")
    warning = noisy(topography, SQUARE, 1.0)
    assert "offsets" in warning
    assert "s_filter" not in warning
    assert "after the S-filter" in noisy(topography, SQUARE, 1.0, 3.0)
    assert not noisy(topography, SQUARE, 1.0, 8.0)


def test_a_point_without_a_height_never_touches_a_filtered_map(tmp_path):
    heights = np.ma.masked_array(_noise(32, 32), False)
    heights[10:14, 20:25] = np.ma.masked
    spec = {
        "surface": {"s_filter": 4 / 32},
        "elastomer": {"kind": "half-space"},
        "load": {"p_star": 1.0},
    }
    contact = solve(spec, heights=heights)
    assert not contact.pressure[10:14, 20:25].any()
    assert contact.a_r > 0.5


def test_a_tilt_does_not_change_the_filter_that_a_warning_names(tmp_path):
    keys = {"periodic": False, "length": 160e-9, "scale": 1e-12}
    heights = _scan(3)
    tilt = 10 * heights.std() * np.linspace(0, 1, 160)
    words = [
        next(each for each in _map(folder, each_map, **keys).warnings() if "noise" in each)
        for folder, each_map in ((tmp_path, heights), (_below(tmp_path), heights + tilt))
    ]
    assert words[0] == words[1]
