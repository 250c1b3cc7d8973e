"""ISO 25178 parameters against closed forms and against SurfaceTopography."""

import warnings

import numpy as np
import pytest

from gfmd_cli.maps.roughness_parameters import autocorrelation, roughness_parameters


def parameters(heights, *spacing):
    return roughness_parameters(np.ma.masked_invalid(heights), spacing)


def test_a_sine_wave_has_the_moments_of_its_integrals():
    """<z^2> = a^2 / 2, <|z|> = 2 a / pi, <z^4> = 3 a^4 / 8, over whole periods."""
    x = np.arange(3000) / 1000
    wave = parameters(np.tile(2e-6 * np.sin(2 * np.pi * x), (5, 1)), 1e-6, 1e-6)
    assert wave["Sq"] == pytest.approx(2e-6 / np.sqrt(2), rel=1e-12, abs=0)
    assert wave["Sa"] == pytest.approx(4e-6 / np.pi, rel=1e-5, abs=0)
    assert wave["Ssk"] == pytest.approx(0, abs=1e-12)
    assert wave["Sku"] == pytest.approx(1.5, rel=1e-12)
    assert wave["Sz"] == pytest.approx(4e-6, rel=1e-12, abs=0)
    assert wave["Sdq"] == pytest.approx(2 * np.pi * 2e-6 / 1e-3 / np.sqrt(2), rel=1e-3)


@pytest.mark.parametrize("spacing", [(1.0, 1.0), (0.5, 2.0)])
def test_a_plane_has_its_own_slope_and_area(spacing):
    y, x = np.mgrid[:20, :30] * np.reshape(spacing, (2, 1, 1))
    tilted = parameters(0.3 * x - 0.4 * y, *spacing)
    assert tilted["Sdq"] == pytest.approx(0.5, rel=1e-12)
    assert tilted["Sdr"] == pytest.approx(np.sqrt(1.25) - 1, rel=1e-12)


@pytest.mark.parametrize("row", [1, 100, 163, 164, 165, 399])
def test_every_step_has_the_same_gradient(row):
    """Also where a block of rows ends: one of 399 rows of triangles has a slope of 6."""
    heights = np.zeros((400, 200))
    heights[row:] = 3.0
    assert parameters(heights, 0.5, 1.0)["Sdq"] == pytest.approx(6 / np.sqrt(399), rel=1e-12)


def test_the_area_of_gentle_slopes_is_half_their_square():
    heights = 1e-9 * np.random.default_rng(0).normal(size=(40, 50))
    gentle = parameters(heights, 1.0, 1.0)
    assert gentle["Sdr"] == pytest.approx(0.5 * gentle["Sdq"] ** 2, rel=1e-9, abs=0)


def test_a_line_has_the_length_of_its_segments():
    rng = np.random.default_rng(1)
    heights = rng.normal(size=200)
    line = parameters(heights, 0.5)
    length = np.hypot(np.diff(heights), 0.5).sum()
    assert line["Pdr"] == pytest.approx(length / (199 * 0.5) - 1, rel=1e-12)
    assert set(line) == {"Pq", "Pa", "Psk", "Pku", "Pt", "Pdq", "Pdr", "Pal"}


def test_map_parameters_agree_with_surfacetopography():
    library = pytest.importorskip("SurfaceTopography")
    heights = np.random.default_rng(2).normal(size=(64, 48)).cumsum(0).cumsum(1)
    ours = parameters(heights, 0.2, 0.1)
    theirs = library.Topography(heights.T, (4.8, 12.8))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        assert ours["Sq"] == pytest.approx(theirs.rms_height_from_area(), rel=1e-12)
    assert ours["Sdq"] == pytest.approx(theirs.rms_gradient(), rel=0.02)  # other pairs at edges


def test_missing_heights_do_not_count():
    heights = np.random.default_rng(3).normal(size=(30, 40))
    part = parameters(heights[:, :25], 1.0, 1.0)
    heights[:, 25:] = np.nan
    whole = parameters(heights, 1.0, 1.0)
    for name, value in part.items():
        assert whole[name] == pytest.approx(value, rel=1e-10), name


@pytest.mark.parametrize("shape", [(400,), (50, 400), (400, 50)])
def test_a_cosine_decorrelates_at_the_arc_cosine(shape):
    """cos(q r) = 0.2."""
    axis = int(np.argmax(shape))
    along = [-1 if i == axis else 1 for i in range(len(shape))]
    wave = np.cos(2 * np.pi * np.arange(400) / 100).reshape(along) + np.zeros(shape)
    length = parameters(wave, *(0.1,) * len(shape))["Sal" if len(shape) == 2 else "Pal"]
    exact = 10 * np.arccos(0.2) / (2 * np.pi)
    assert exact <= length <= exact + 0.1


@pytest.mark.parametrize("lowest", [-1, -9])
def test_the_autocorrelation_is_the_mean_over_pairs(lowest):
    """With missing heights and without."""
    heights = np.ma.masked_less(np.random.default_rng(4).normal(size=(6, 7)), lowest)
    z = heights - heights.mean()
    correlation = autocorrelation(heights)
    for dy, dx in ((0, 0), (1, 2), (3, -1)):
        left = z[: 6 - dy, max(0, -dx) : 7 - max(0, dx)]
        right = z[dy:, max(0, dx) : 7 + min(0, dx)]
        expected = (left * right).mean() / (z * z).mean()
        assert correlation[dy, dx] == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("height", [0.0, 0.1, 3.3])
def test_equal_heights_have_no_correlation_length(height):
    assert parameters(np.full((7, 8), height), 1, 1)["Sal"] is None
