"""Warnings about scans with a blunt tip, and none about other maps."""

import re

import numpy as np
import pytest
from scipy.ndimage import grey_dilation

from gfmd_cli.api import solve
from gfmd_cli.maps.gaussian_filter import gaussian_filter
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.self_affine import SelfAffine

SPACING = 1e-8
RADIUS = 500e-9
WORDS = re.compile(r"shorter than about (\S+) m.*s_filter = (\S+) or more")


def _surface(hurst=0.8, cutoff=8, points=256, height=4e-9, seed=1):
    """Heights [m] of a random surface; the cut-off wavelength in points."""
    surface = SelfAffine(cutoff=cutoff / points, rolloff=0.25, hurst=hurst, seed=seed)
    heights = np.array(surface.heights(points))
    return height * heights / heights.std()


def _scanned(heights, radius=RADIUS, spacing=(SPACING, SPACING)):
    """The periodic heights that a paraboloid of this radius [m] touches."""
    for axis, step in enumerate(spacing):
        reach = int(np.sqrt(2 * radius * np.ptp(heights)) / step) + 1
        line = -((step * np.arange(-reach, reach + 1)) ** 2) / (2 * radius)
        structure = np.expand_dims(line, 1 - axis)
        heights = grey_dilation(heights, structure=structure, mode="wrap")
    return heights


def _warnings(path, heights, **keys):
    """The warnings about a tip of a map in a file, whose heights are in metres."""
    path /= f"{len(list(path.iterdir()))}.npy"  # a map is read once
    np.save(path, heights)
    surface = FileSurface(path=path, **{"length": SPACING * heights.shape[-1]} | keys)
    return [each for each in surface.warnings() if "tip" in each]


@pytest.mark.parametrize("hurst", [0.3, 0.8])
def test_the_tip_is_recognised_by_the_peaks_it_has_left(tmp_path, hurst):
    (warning,) = _warnings(tmp_path, _scanned(_surface(hurst)))
    radius = float(re.search(r"radius (\S+) m", warning)[1])
    assert RADIUS <= radius <= 1.1 * RADIUS


@pytest.mark.parametrize("known", [True, False])
def test_a_sphere_with_a_conical_shaft_is_recognised_on_steep_slopes(tmp_path, known):
    """The second difference of a sphere on a slope is larger than 1 / R, its curvature is not."""
    heights = _surface(points=128, height=100e-9)
    assert np.diff(heights, axis=1).std() > SPACING
    reach = SPACING * np.mgrid[-20:21, -20:21]
    distance, radius, shaft = np.hypot(*reach), 8 * SPACING, np.radians(20)
    end = radius * np.cos(shaft)
    sphere = radius - np.sqrt(radius**2 - np.minimum(distance, end) ** 2)
    tip = sphere + np.maximum(distance - end, 0.0) / np.tan(shaft)
    scan = grey_dilation(heights, structure=-tip, mode="wrap")
    (warning,) = _warnings(tmp_path, scan, **{"tip_radius": radius} if known else {})
    assert "blunted structures shorter than about" in warning
    assert "too small for an S-filter" in warning
    if not known:
        assert 0.7 * radius < float(re.search(r"radius (\S+) m", warning)[1]) < 1.1 * radius


def test_pins_much_thinner_than_the_tip_show_its_radius(tmp_path):
    random = np.random.default_rng(0)
    pins = np.where(random.random((128, 128)) < 0.01, random.normal(1e-8, 2e-9, (128, 128)), 0.0)
    (warning,) = _warnings(tmp_path, _scanned(pins))
    assert f"radius {RADIUS:.2g} m" in warning


@pytest.mark.parametrize("hurst", [0.3, 0.8])
@pytest.mark.parametrize("cutoff", [2, 8, 32])
def test_a_random_surface_shows_no_tip(tmp_path, hurst, cutoff):
    assert not _warnings(tmp_path, _surface(hurst, cutoff))


def test_noise_that_hides_the_tip_at_short_distances_does_not_hide_it_at_longer_ones(tmp_path):
    scan = _scanned(_surface())
    noisy = scan + 1e-3 * scan.std() * np.random.default_rng(2).normal(size=scan.shape)
    (warning,) = _warnings(tmp_path, noisy)
    assert float(re.search(r"radius (\S+) m", warning)[1]) == pytest.approx(RADIUS, rel=0.2)


def test_the_length_of_blunt_structures_is_about_that_of_surface_topography(tmp_path):
    """It takes the largest curvature along x at any length, not a quantile along x and y."""
    topography = pytest.importorskip("SurfaceTopography")
    for radius in (0.4 * RADIUS, 2 * RADIUS):
        scan = _scanned(_surface(cutoff=16), radius)
        (warning,) = _warnings(tmp_path, scan, tip_radius=radius)
        sides = (SPACING * len(scan),) * 2
        theirs = topography.Topography(scan.T, sides, periodic=True)
        cutoff = theirs.scanning_probe_reliability_cutoff(radius)
        assert 0.6 * cutoff <= float(WORDS.search(warning)[1]) <= 1.25 * cutoff + 2 * SPACING


def test_a_sharper_tip_blunts_nothing(tmp_path):
    heights = _surface(cutoff=32)
    assert not _warnings(tmp_path, heights, tip_radius=1e-8)
    assert _warnings(tmp_path, _scanned(heights, 1e-5), tip_radius=1e-5)


def test_the_filter_that_the_warning_names_removes_it(tmp_path):
    scan = _scanned(_surface())
    cutoff = float(WORDS.search(*_warnings(tmp_path, scan, tip_radius=RADIUS))[2])
    assert not _warnings(tmp_path, scan, tip_radius=RADIUS, s_filter=cutoff)
    assert _warnings(tmp_path, scan, tip_radius=RADIUS, s_filter=0.5 * cutoff)


def test_filtered_scan_and_filtered_surface_have_the_same_contact(tmp_path):
    """Without the filter the contact area of the scan is much too large."""
    heights = _surface()
    scan = _scanned(heights)
    cutoff = float(WORDS.search(*_warnings(tmp_path, scan))[2])
    filtered = [
        gaussian_filter(each, (SPACING, SPACING), cutoff, periodic=True) for each in (scan, heights)
    ]
    spec = {"elastomer": {"kind": "half-space"}, "surface": {"length": SPACING * len(scan)}}

    def areas(of_scan, of_surface):
        true = solve(spec | {"load": {"p_star": 0.03}}, heights=of_surface)
        load = {"pressure": true.nominal_pressure}
        return solve(spec | {"load": load}, heights=of_scan).a_r, true.a_r

    seen, true = areas(scan, heights)
    assert seen > 1.3 * true
    seen, true = areas(*filtered)
    assert seen == pytest.approx(true, rel=0.1)


def test_a_replica_that_is_turned_upside_down_is_compared_as_scanned(tmp_path):
    scan = _scanned(_surface())
    assert _warnings(tmp_path, scan, flip=True)
    assert not _warnings(tmp_path, -scan)


def test_a_radius_that_the_peaks_contradict_is_doubted(tmp_path):
    (warning,) = _warnings(tmp_path, _surface(), tip_radius=1.0)
    assert "is the radius wrong?" in warning


def test_units_pixels_missing_heights_and_profiles(tmp_path):
    """The heights in nanometres, at pixels of 2:1, with gaps, and along one line."""
    oblong = (SPACING, 2 * SPACING)
    scan = _scanned(_surface(), spacing=oblong)
    scan[100:110, 50:90] = np.nan
    side = {"length": 2 * SPACING * 256, "length_y": SPACING * 256, "scale": 1e-9}
    (warning,) = _warnings(tmp_path, 1e9 * scan, **side)
    assert RADIUS <= float(re.search(r"radius (\S+) m", warning)[1]) <= 1.4 * RADIUS
    line = _scanned(_surface())[7]
    (warning,) = _warnings(tmp_path, line, tip_radius=RADIUS)
    assert WORDS.search(warning)
    assert not _warnings(tmp_path, line)


@pytest.mark.parametrize("side", [1e-5, 4e-5])
def test_both_axes_are_compared_at_the_same_length(tmp_path, side):
    """Beyond a part of the shorter side nothing is compared, and no filter can be as long."""
    wave = -1e-7 * np.cos(2 * np.pi * np.arange(64) / 64)
    waves, sides = wave[:, None] + wave, {"length": 1e-5, "length_y": side}
    (warning,) = _warnings(tmp_path, waves, tip_radius=1.4e-5, **sides)
    assert 2e-6 < float(WORDS.search(warning)[1]) < 5e-6
    cutoff = float(WORDS.search(warning)[2])
    assert not _warnings(tmp_path, waves, tip_radius=1.4e-5, s_filter=cutoff, **sides)
    (warning,) = _warnings(tmp_path, waves, tip_radius=2e-5, **sides)
    assert "too small for an S-filter" in warning
