"""Heights between the points of a map, and which interpolation suits a map."""

import numpy as np
import pytest

from gfmd_cli import solve
from gfmd_cli.maps.interpolation import _jumps, _short_waves, _ties, monotone, suited_interpolation
from gfmd_cli.physics.elastomers import HalfSpace
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine

POINTS = 64


def rough(points_per_wave, seed=1, points=POINTS):
    """A random surface with this many points per shortest wave, unit rms height."""
    surface = SelfAffine(cutoff=points_per_wave / points, rolloff=0.25, seed=seed)
    heights = surface.heights(points)
    return heights / heights.std()


def steps(heights):
    return np.sign(heights)


def stripes(heights):
    return np.tile(np.sign(heights[0]), (len(heights), 1))


@pytest.mark.parametrize("points_per_wave", [2, 2.5, 4, 8])
@pytest.mark.parametrize("seed", [1, 2])
def test_band_limited_maps_are_interpolated_by_a_fourier_series(points_per_wave, seed):
    heights = rough(points_per_wave, seed)
    assert suited_interpolation(heights) == "fourier"
    assert suited_interpolation(heights.astype(np.float32).astype(float)) == "fourier"
    assert suited_interpolation(np.rint(heights * 2**11)) == "fourier"


@pytest.mark.parametrize("points_per_wave", [2, 4, 8])
@pytest.mark.parametrize(
    "worn", [steps, stripes, lambda h: np.minimum(h, 0.5), lambda h: np.maximum(h, -0.5)]
)
def test_plateaus_and_steps_are_not(points_per_wave, worn):
    assert suited_interpolation(worn(rough(points_per_wave))) == "monotone"


@pytest.mark.parametrize("shape", [(POINTS, POINTS), (2 * POINTS, POINTS)])
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("points_per_wave", [2, 4])
def test_rough_maps_with_a_step_along_an_axis_are_not(shape, axis, points_per_wave):
    """Neither in the corners of the spectrum nor by equal neighbours: mesa, trenches, one edge."""
    roughness = np.tile(rough(points_per_wave), (shape[0] // POINTS, 1))
    place = np.arange(shape[axis]) / shape[axis]
    for step in ((place > 0.2) & (place < 0.7), place * 4 % 1 < 0.5):
        profile = 20.0 * step
        heights = roughness + (profile if axis == 1 else profile[:, None])
        assert suited_interpolation(heights) == "monotone"
        assert suited_interpolation(np.pad(heights, [(0, n) for n in shape], "symmetric")) == (
            "monotone"
        )


@pytest.mark.parametrize("points", [8, 16, 32])
def test_jumps_of_roughness_are_not_steps(points):
    for seed in range(50):
        heights = rough(2, seed, points)
        assert suited_interpolation(heights) == "fourier"


@pytest.mark.parametrize("shape", [(32, 32), (21, 40), (60,)])
def test_the_measures_of_a_mirrored_map_are_those_of_its_cell(shape):
    rows = np.random.default_rng(4).normal(size=shape)
    for heights in (rows, np.cumsum(rows, axis=-1), np.round(rows), np.sign(rows) + 0.01 * rows):
        cell = np.pad(heights, [(0, points) for points in shape], mode="symmetric")
        for measure in (_jumps, _ties, lambda h, at: _short_waves(np.atleast_2d(h), at)):
            if len(shape) == 2 or measure is _jumps:
                of_cell = measure(cell, "wrap")
                assert measure(heights, "symmetric") == pytest.approx(of_cell, abs=1e-12)


def test_contact_on_a_mesa_is_not_on_ripples(tmp_path):
    """The area on a finer grid is that on the points of the map, and one grid gives no error."""
    x = np.arange(32) / 32
    heights = 0.03 * rough(6, points=32) + ((x > 0.2) & (x < 0.7))
    spec = {
        "elastomer": {"kind": "half-space", "E_star": 1.0},
        "load": {"pressure": 0.5},
        "accuracy": {"contact_area": 0.01},
    }
    map_itself, finer = (
        solve(spec | {"grid": {"points": points}}, heights=heights) for points in (32, 128)
    )
    assert map_itself.columns["a_r_verdict"] == "unknown"
    assert finer.a_r == pytest.approx(map_itself.a_r, rel=0.1)


def test_white_noise_is_not():
    assert suited_interpolation(np.random.default_rng(3).normal(size=(32, 48))) == "monotone"


def test_waves_along_one_axis_are_band_limited_though_neighbours_along_the_other_are_equal():
    wave = np.cos(2 * np.pi * np.arange(POINTS) / 16)
    assert suited_interpolation(np.tile(wave, (POINTS, 1))) == "fourier"


@pytest.mark.parametrize("shape", [(128, 128), (192, 64), (100, 90)])
def test_monotone_heights_stay_between_the_points_around_them(shape):
    """No overshoot: within the range of the four points around, up to nothing at all."""
    heights = np.random.default_rng(5).normal(size=(64, 64))
    fine = monotone(heights, shape)
    y, x = (np.arange(size) * (64 / size) for size in shape)
    corners = [
        heights[np.ix_((y.astype(int) + i) % 64, (x.astype(int) + j) % 64)]
        for i in (0, 1)
        for j in (0, 1)
    ]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    on_axis = np.ix_(y % 1 == 0, x % 1 == 0)
    assert (fine >= low - 1e-14).all()
    assert (fine <= high + 1e-14).all()
    np.testing.assert_array_equal(fine[on_axis], corners[0][on_axis])


def test_plateaus_remain_plateaus():
    heights = np.minimum(rough(4), 0.25)
    fine = monotone(heights, (256, 256))
    assert fine.max() == 0.25
    inside = heights == 0.25
    for axis in (0, 1):
        inside = inside & np.roll(inside, -1, axis)
    pixels = np.kron(inside, np.ones((4, 4), dtype=bool))
    assert np.all(fine[pixels] == 0.25)


def test_no_axis_is_preferred():
    heights = np.random.default_rng(6).normal(size=(32, 32))
    np.testing.assert_array_equal(
        monotone(heights.T.copy(), (96, 96)), monotone(heights, (96, 96)).T
    )


def test_a_line_is_interpolated_as_a_map_of_equal_rows():
    line = np.random.default_rng(9).normal(size=32)
    rows = monotone(np.tile(line, (4, 1)), (4, 96))
    np.testing.assert_allclose(rows, np.tile(monotone(line, (96,)), (4, 1)), atol=1e-14, rtol=0)


def test_the_monotone_surface_is_periodic_and_the_same_on_every_grid():
    heights = np.random.default_rng(7).normal(size=(32, 32))
    moved = monotone(np.roll(heights, (5, 9), (0, 1)), (96, 96))
    np.testing.assert_allclose(moved, np.roll(monotone(heights, (96, 96)), (15, 27), (0, 1)))
    finest = monotone(heights, (192, 192))
    np.testing.assert_allclose(finest[::2, ::2], monotone(heights, (96, 96)), atol=1e-15, rtol=0)


def test_a_smooth_map_converges():
    """Second order or better between the extremes, first order of the square there."""
    errors = []
    for points in (32, 64, 128):
        x = 2 * np.pi * np.arange(256) / 256
        exact = np.add.outer(np.cos(x), np.sin(x))
        step = 256 // points
        error = monotone(exact[::step, ::step], exact.shape) - exact
        errors.append(np.abs(error))
    assert errors[1].max() < errors[0].max() / 3.5
    assert errors[2].max() < errors[1].max() / 3.5


def test_some_rows_are_those_of_the_whole():
    heights = np.random.default_rng(8).normal(size=(32, 32))
    whole = monotone(heights, (64, 64))
    np.testing.assert_array_equal(monotone(heights, (64, 64), slice(10, 30)), whole[10:30])


def test_the_choice_is_named_and_can_be_overridden(tmp_path):
    path = tmp_path / "h.npy"
    np.save(path, np.minimum(rough(4), 0.25))
    surface = FileSurface(path=path)
    assert surface.parameters()["interpolation"] == "monotone"
    assert "finer grids: monotone" in surface.preparation()
    assert not surface.band_limited
    assert surface.heights(256).max() == 0.25
    forced = FileSurface(path=path, interpolation="fourier")
    assert forced.band_limited
    assert forced.heights(256).max() > 0.26
    np.testing.assert_array_equal(surface.heights(POINTS), forced.heights(POINTS))


def test_a_scene_on_the_points_of_the_map_needs_no_interpolation(tmp_path, monkeypatch):
    """Whether a map is band-limited takes a transform, and does not matter on its own points."""
    path = tmp_path / "h.npy"
    np.save(path, rough(4))
    surface = FileSurface(path=path)
    of_all_waves = build_scene(surface, HalfSpace(), 2 * POINTS).delta_sigma
    monkeypatch.setattr(FileSurface, "applied_interpolation", lambda self: pytest.fail("asked"))
    scene = build_scene(surface, HalfSpace(), POINTS)
    assert scene.delta_sigma == pytest.approx(of_all_waves, rel=1e-12)
