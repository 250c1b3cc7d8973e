"""Levelling, edge treatment and filling of measured maps."""

import numpy as np
import pytest

from gfmd_cli import solve
from gfmd_cli.errors import InputError
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.maps import map_preparation
from gfmd_cli.maps.map_preparation import fill_missing, level, make_periodic
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.self_affine import SelfAffine


@pytest.fixture
def heights():
    return np.random.default_rng(1).normal(size=(16, 16))


def border_jump(heights):
    return max(abs(heights[0] - heights[-1]).max(), abs(heights[:, 0] - heights[:, -1]).max())


def inner_step(heights):
    return max(abs(np.diff(heights, axis=axis)).max() for axis in (0, 1))


@pytest.mark.parametrize(("degree", "removed"), [("mean", 1), ("plane", 3), ("curvature", 6)])
def test_levelling_removes_its_polynomial_to_rounding(degree, removed):
    y, x = np.mgrid[:32, :32] / 32
    terms = [np.ones_like(x), x, y, x * x, x * y, y * y, x**3]
    trend = sum(c * t for c, t in zip((5, -2, 1, 3, -1, 2), terms[:removed], strict=False))
    assert abs(level(trend, degree)).max() < 1e-13
    assert level(terms[removed], degree).std() > 1e-3


def test_levelling_is_least_squares(heights):
    y, x = np.mgrid[:16, :16]
    design = np.stack([np.ones(256), x.ravel(), y.ravel()], axis=1)
    fit, *_ = np.linalg.lstsq(design, heights.ravel(), rcond=None)
    np.testing.assert_allclose(
        level(heights, "plane"), heights - (design @ fit).reshape(16, 16), atol=1e-13, rtol=0
    )


@pytest.mark.parametrize("degree", ["mean", "plane", "curvature"])
@pytest.mark.parametrize("shape", [(16, 9), (5, 40), (30,), (2, 3)])
def test_levelling_around_holes_is_least_squares_of_the_known_heights(degree, shape):
    rng = np.random.default_rng(7)
    heights, known = rng.normal(size=shape), rng.random(shape) > 0.3
    axes = np.meshgrid(*(np.arange(n) for n in shape), indexing="ij")
    orders = {"mean": 0, "plane": 1, "curvature": 2}[degree] + 1
    terms = [
        np.prod([axis**i for axis, i in zip(axes, powers, strict=True)], axis=0).astype(float)
        for powers in np.ndindex(*(orders,) * len(shape))
        if sum(powers) < orders
    ]
    design = np.stack([term[known] for term in terms], axis=1)
    levelled = level(heights, degree, known)[known]
    solution, *_ = np.linalg.lstsq(design, heights[known], rcond=None)
    np.testing.assert_allclose(levelled, heights[known] - design @ solution, atol=1e-10, rtol=0)


@pytest.mark.parametrize("shape", [(16, 9), (5, 40), (30,)])
def test_levelling_with_nothing_missing_is_that_of_the_whole_map(shape):
    heights = np.random.default_rng(8).normal(size=shape)
    whole = level(heights, "curvature")
    np.testing.assert_allclose(level(heights, "curvature", heights < 99), whole, atol=1e-13, rtol=0)


def test_levelling_keeps_its_input(heights):
    before = heights.copy()
    level(heights, "curvature")
    np.testing.assert_array_equal(heights, before)
    np.testing.assert_array_equal(level(heights, "none"), before)


def test_the_window_takes_the_border_to_the_mean():
    y, x = np.mgrid[:64, :64] / 64
    slope = 3 + x + 2 * y
    windowed = make_periodic(slope, "window")
    border = np.sin(np.pi / 2 * (0.5 / 64) / 0.1) ** 2  # the middles of pixels are half a point in
    for ends in ((0, ...), (-1, ...), (..., 0), (..., -1)):
        left = abs(windowed[ends] - slope.mean()).max()
        assert left <= border * abs(slope - slope.mean()).max() < 0.016 * np.ptp(slope)
    assert border_jump(slope) > 10 * inner_step(slope)
    assert border_jump(windowed) <= inner_step(windowed)


@pytest.mark.parametrize("shape", [(16, 16), (17, 12), (31,)])
def test_the_window_is_the_same_from_all_sides(shape):
    heights = np.random.default_rng(2).normal(size=shape)
    windowed, turned = (make_periodic(h, "window", 0.3) for h in (heights, np.flip(heights)))
    np.testing.assert_allclose(np.flip(turned), windowed, atol=1e-14, rtol=0)


def test_the_window_keeps_the_inner_heights_and_lowers_h_std(heights):
    windowed = make_periodic(heights, "window", taper=0.25)
    np.testing.assert_allclose(windowed[4:12, 4:12], heights[4:12, 4:12], atol=1e-14, rtol=0)
    assert windowed.std() < heights.std()


@pytest.mark.parametrize("taper", [0.0, 0.6, np.nan])
def test_a_taper_outside_its_range_is_refused(taper):
    with pytest.raises(ValueError, match="taper"):
        FileSurface(path="map.npy", edges="window", taper=taper)


def test_the_mirror_keeps_every_height_four_times(heights):
    mirrored = make_periodic(heights, "mirror")
    assert mirrored.shape == (32, 32)
    np.testing.assert_array_equal(mirrored[:16, :16], heights)
    np.testing.assert_array_equal(
        np.sort(mirrored, axis=None), np.repeat(np.sort(heights, None), 4)
    )
    np.testing.assert_array_equal(mirrored, mirrored[::-1, ::-1])
    assert border_jump(mirrored) == 0


def test_no_edge_treatment_leaves_the_heights(heights):
    assert make_periodic(heights, "none") is heights


def test_a_hole_in_a_harmonic_surface_is_filled_exactly():
    """x y and x^2 - y^2 solve the discrete Laplace equation."""
    y, x = np.mgrid[:20, :20].astype(float)
    for exact in (x * y, x**2 - y**2, 3 + x - 2 * y):
        missing = np.zeros(exact.shape, dtype=bool)
        missing[5:12, 3:15] = missing[16, 16] = True
        holed = np.where(missing, np.nan, exact)
        np.testing.assert_allclose(fill_missing(holed, missing), exact, atol=1e-10, rtol=0)


@pytest.mark.parametrize("largest", [10, 10**6])
def test_a_hole_in_a_harmonic_surface_is_filled_on_oblong_pixels(monkeypatch, largest):
    monkeypatch.setattr(map_preparation, "MAX_EXACT", largest)
    spacing = (0.1, 0.25)
    y, x = np.meshgrid(*(step * np.arange(24) for step in spacing), indexing="ij")
    for exact in (x * y, x**2 - y**2, 3 + x - 2 * y):
        missing = np.zeros(exact.shape, dtype=bool)
        missing[5:12, 3:15] = missing[16, 16] = True
        tolerance = 1e-10 if largest > missing.sum() else 0.03 * np.ptp(exact)
        holed = np.where(missing, np.nan, exact)
        filled = fill_missing(holed, missing, spacing=spacing)
        np.testing.assert_allclose(filled, exact, atol=tolerance, rtol=0)
        metres = fill_missing(holed, missing, spacing=(1e-7, 2.5e-7))
        np.testing.assert_allclose(metres, filled, atol=1e-12, rtol=0)


def test_a_filled_hole_lies_between_its_rim(heights):
    """The maximum principle, at the border of the map, too."""
    missing = np.random.default_rng(3).random(heights.shape) < 0.15
    missing[0, 0] = missing[-1, 5:8] = True
    filled = fill_missing(np.where(missing, np.nan, heights), missing)
    assert filled.min() == heights[~missing].min()
    assert filled.max() == heights[~missing].max()


def test_a_large_hole_is_filled_smoothly(monkeypatch, heights):
    """The filling of many points approaches the exact one, and keeps between the known heights."""
    y, x = np.mgrid[:60, :90] / 60
    exact = 3 * x - y
    missing = np.random.default_rng(4).random(exact.shape) < 0.5
    missing[10:50, 20:80] = True
    monkeypatch.setattr(map_preparation, "MAX_EXACT", 200)
    filled = fill_missing(np.where(missing, np.nan, exact), missing)
    np.testing.assert_array_equal(filled[~missing], exact[~missing])
    assert abs(filled - exact).max() < 0.05 * np.ptp(exact)
    assert exact[~missing].min() <= filled.min()
    assert filled.max() <= exact[~missing].max()


def test_many_lone_missing_heights_are_the_means_of_their_neighbours(monkeypatch):
    """The map of half the resolution has no holes then."""
    monkeypatch.setattr(map_preparation, "MAX_EXACT", 200)
    y, x = np.mgrid[:40, :40]
    missing = np.zeros(x.shape, dtype=bool)
    missing[1:-1:2, 1:-1:2] = True
    filled = fill_missing(np.where(missing, np.nan, 3 * x - y), missing)
    np.testing.assert_allclose(filled, 3 * x - y, atol=1e-12, rtol=0)


@pytest.mark.parametrize("largest", [200, 10**6])
def test_a_hole_across_the_border_of_a_periodic_map_is_filled_as_inside(monkeypatch, largest):
    monkeypatch.setattr(map_preparation, "MAX_EXACT", largest)
    heights = SelfAffine(cutoff=1 / 8).heights(32)
    missing = np.zeros(heights.shape, dtype=bool)
    missing[6:24, 4:26] = missing[28, 28] = True
    inside = fill_missing(heights, missing, periodic=True)
    np.testing.assert_allclose(inside, fill_missing(heights, missing), atol=1e-12, rtol=0)
    for shift in ((16, 0), (0, 16), (16, 16)):
        moved = (np.roll(field, shift, (0, 1)) for field in (heights, missing))
        filled = fill_missing(*moved, periodic=True)
        np.testing.assert_allclose(filled, np.roll(inside, shift, (0, 1)), atol=1e-12, rtol=0)


def test_a_line_is_filled_by_straight_segments():
    heights = np.array([0.0, np.nan, np.nan, 3.0, 1.0, np.nan])
    filled = fill_missing(heights, np.isnan(heights))
    np.testing.assert_allclose(filled, [0, 1, 2, 3, 1, 1], atol=1e-14, rtol=0)
    filled = fill_missing(heights, np.isnan(heights), periodic=True)
    np.testing.assert_allclose(filled, [0, 1, 2, 3, 1, 0.5], atol=1e-14, rtol=0)


@pytest.mark.parametrize("missing", ["fill", "void"])
def test_a_periodic_map_with_a_hole_across_its_border_has_the_contact_of_the_moved_map(missing):
    heights = SelfAffine(cutoff=1 / 8).heights(32)
    heights[10:18, 8:20] = np.nan
    spec = {
        "surface": {"missing": missing},
        "elastomer": {"kind": "half-space"},
        "load": {"p_star": 0.2},
        "solver": {"tolerance": 1e-10},
    }
    names = ("a_r", "sigma_p", "u_g", "h_std", "delta_sigma")
    inside, across = (
        solve(spec, heights=each).columns for each in (heights, np.roll(heights, (17, 19), (0, 1)))
    )
    assert [across[key] for key in names] == pytest.approx([inside[key] for key in names], rel=1e-8)


def test_lines_are_made_periodic_along_their_axis():
    line = np.arange(20.0)
    np.testing.assert_array_equal(make_periodic(line, "mirror"), [*line, *line[::-1]])
    windowed = make_periodic(line, "window")
    border = np.sin(np.pi / 8) ** 2  # a quarter of the tapered zone of two points
    np.testing.assert_allclose(windowed[0], (1 - border) * line.mean())
    np.testing.assert_allclose(windowed[2:18], line[2:18])


PLANE = np.add.outer(3 + np.arange(24) / 7, np.arange(20) / 9)
NOISE = np.random.default_rng(0).normal(size=PLANE.shape)


@pytest.mark.parametrize("heights", [0.3 + 0 * PLANE, PLANE, PLANE.astype(np.float32)])
@pytest.mark.parametrize("scale", [1.0, 1e-9])
@pytest.mark.parametrize("hole", [False, True])
def test_a_map_that_is_flat_after_levelling_is_refused(tmp_path, heights, scale, hole):
    """What is left is rounding, which would be solved as roughness."""
    heights = heights.copy()
    if hole:
        heights[3:6, 4] = np.nan
    np.save(tmp_path / "h.npy", heights)
    surface = FileSurface(path=tmp_path / "h.npy", periodic=False, scale=scale)
    with pytest.raises(InputError, match="the map is flat") as error:
        surface.smallest_grid()
    left = float(np.ptp(surface.heights_on(Grid(20, points_y=24))))
    assert ("is the rounding of heights of up to" in str(error.value)) == (left > 0)


@pytest.mark.parametrize(
    ("level", "least"), [("none", 2), ("mean", 2), ("plane", 4), ("curvature", 7)]
)
def test_too_few_known_heights_are_refused_with_their_number(tmp_path, level, least):
    heights = np.full(NOISE.shape, np.nan)
    places = [(2, 3), (20, 5), (7, 17), (11, 8), (4, 9), (15, 2), (22, 18)]
    for known, place in enumerate(places[:least], 1):
        heights[place] = NOISE[place]
        np.save(tmp_path / f"{known}.npy", heights)
        surface = FileSurface(path=tmp_path / f"{known}.npy", level=level)
        if known == least:
            assert surface.smallest_grid() == 20
            return
        number = f"{known}.npy: surface.path: the map has {known} known height"
        with pytest.raises(InputError, match=f"{number}.* needs {least} or more"):
            surface.smallest_grid()


def test_roughness_in_single_precision_far_from_zero_is_used(tmp_path):
    """Heights of 1 nm beside an offset of 2 mm, which is rounded to 0.2 nm."""
    rough = 2e-3 + 1e-9 * np.random.default_rng(0).normal(size=(24, 20))
    np.save(tmp_path / "h.npy", rough.astype(np.float32))
    assert FileSurface(path=tmp_path / "h.npy", periodic=False).smallest_grid() == 20


@pytest.mark.parametrize(
    ("heights", "is_rounded"),
    [
        (np.round(PLANE, 1), True),
        (np.round(10 * PLANE).astype(int), True),
        (PLANE.astype(np.float32).astype(float), True),
        (np.round(100 * PLANE + 0.1 * NOISE, 1), True),
        ((1e6 * PLANE + 0.1 * NOISE).astype(np.float32), True),
        ((1e6 * PLANE + 10 * NOISE).astype(np.float32), False),
        (1e6 * PLANE + 0.1 * NOISE, False),
        (np.round(PLANE + 0.2 * NOISE, 1), False),
        (PLANE + 1e-4 * NOISE, False),
    ],
)
def test_a_tilt_of_rounded_heights_gives_a_warning(tmp_path, heights, is_rounded):
    """It could be meant: the terraces of a vicinal surface."""
    np.save(tmp_path / "h.npy", heights)
    warnings = FileSurface(path=tmp_path / "h.npy", periodic=False, scale=1e-9).warnings()
    assert any("part of the roughness is rounding" in each for each in warnings) == is_rounded
