"""The texture of a surface: anisotropy, copies of a patch, waves of the Nyquist wavenumber."""

from dataclasses import astuple

import numpy as np
import pytest

from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.maps.map_preparation import mirror
from gfmd_cli.physics import scenes
from gfmd_cli.physics.discretisation_error import MAX_REPETITIONS
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.indenters import Parabola, Wave
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.physics.surfaces import sample
from gfmd_cli.physics.waves import mirrored_power, radial_power, texture


def waves(grid, *pairs):
    """Sum of cosines: (m_y, m_x, amplitude) in waves per side."""
    y, x = (np.arange(size) / size for size in grid.shape)
    return sum(a * np.cos(2 * np.pi * (m_y * y[:, None] + m_x * x)) for m_y, m_x, a in pairs)


@pytest.mark.parametrize("points", [32, 33])
def test_two_crossed_waves(points):
    """Slopes 2 pi m a / sqrt 2 along their own axes."""
    grid = Grid(points)
    assert texture(grid, waves(grid, (0, 4, 1.0), (4, 0, 1.0))).anisotropy == pytest.approx(
        1.0, rel=1e-12
    )
    assert texture(grid, waves(grid, (0, 4, 1.0), (2, 0, 0.5))).anisotropy == pytest.approx(
        4.0, rel=1e-12
    )


def test_turned_waves_have_the_ratio_of_waves_along_the_axes():
    grid = Grid(64)
    turned = waves(grid, (5, 5, 1.0), (-5, 5, 0.25))
    assert texture(grid, turned).anisotropy == pytest.approx(4.0, rel=1e-12)


def test_stripes_and_lines_are_infinitely_anisotropic():
    assert texture(Grid(32), waves(Grid(32), (3, 4, 1.0))).anisotropy == np.inf
    assert texture(Grid(32, 1), np.sin(np.arange(32.0))).anisotropy == np.inf


@pytest.mark.parametrize(
    ("length_y", "along_x"), [(1.0, 16 / 25), (0.5, 16 / 52), (4.0, 256 / 265)]
)
def test_the_share_of_the_slopes_along_x_is_that_of_the_wave_vector(length_y, along_x):
    grid = Grid(32, length_y=length_y, points_y=32)
    assert texture(grid, waves(grid, (3, 4, 1.0))).along_x == pytest.approx(along_x, rel=1e-12)


@pytest.mark.parametrize("cutoff", [1 / 16, 1 / 8])
def test_a_random_surface_is_isotropic_up_to_two_points_per_wave(cutoff):
    surface = SelfAffine(cutoff=cutoff)
    assert texture(Grid(32), surface.heights(32)).anisotropy == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("length_y", [0.2135, 0.333, 0.9630815953297361, 1.9])
def test_mirrored_fields_have_the_same_anisotropy_on_oblong_cells(length_y):
    """The highest wave along y has both signs of q_y, whichever of them the transform stores."""
    draw = np.random.default_rng(0)
    for points, points_y in ((27, 14), (16, 36), (28, 26), (8, 30)):
        field = draw.normal(size=(points_y, points))
        grid = Grid(points, points_y=points_y, length_y=length_y)
        one, other = (texture(grid, f).anisotropy for f in (field, field[:, ::-1].copy()))
        assert other == pytest.approx(one, rel=1e-12)


def test_a_side_is_a_length():
    """Waves of one length in a cell twice as long along y."""
    grid = Grid(32, length=1.0, points_y=64, length_y=2.0)
    assert texture(grid, waves(grid, (0, 4, 1.0), (8, 0, 1.0))).anisotropy == pytest.approx(
        1.0, rel=1e-12
    )


@pytest.mark.parametrize("cutoff", [1 / 32, 1 / 8, 1 / 4])
def test_tiles_are_counted_and_copies_that_differ_are_found(cutoff):
    patch = SelfAffine(cutoff=cutoff, rolloff=0.5).heights(64)
    noise = 1e-6 * np.random.default_rng(0).normal(size=(256, 256))
    alone = texture(Grid(64), patch)
    assert (alone.copies, alone.tiles, alone.mirrors) == (1, 1, 0)
    assert alone.repetitions == pytest.approx(1.0, abs=0.3)
    for down, right in ((2, 2), (3, 3), (4, 4), (1, 3)):
        grid = Grid(64 * right, points_y=64 * down)
        tiled = np.tile(patch, (down, right))
        equal, nearly = (
            texture(grid, h) for h in (tiled, tiled + noise[: grid.points_y, : grid.points])
        )
        assert (equal.copies, equal.tiles, nearly.tiles) == (down * right, down * right, 1)
        assert equal.repetitions == pytest.approx(alone.repetitions, rel=0.35)  # half octaves
        assert nearly.repetitions == pytest.approx(equal.tiles * equal.repetitions, rel=1e-3)


@pytest.mark.parametrize("length_y", [0.3, 0.75, 1.7, 3.0])
def test_a_turned_cell_resembles_as_many_copies(length_y):
    heights = np.tile(_random(0), (1, 2))
    heights += heights.std() * np.random.default_rng(1).normal(size=heights.shape)
    points_y, points = heights.shape
    grid = Grid(points, points_y=points_y, length_y=length_y)
    turned = Grid(points_y, points_y=points, length=length_y, length_y=1.0)
    expected = texture(grid, heights).repetitions
    assert texture(turned, np.rot90(heights)).repetitions == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("points", [64, 65])
def test_copies_of_a_line_are_counted(points):
    m = np.arange(points // 2 + 1)
    phases = np.exp(2j * np.pi * np.random.default_rng(0).random(m.size))
    line = np.fft.irfft(((m > 0) & (m < 20)) * phases, points)
    mirrored = np.roll(np.append(line, line[::-1]), 7)
    inverted = np.append(line, -line[::-1])
    for h, tiles, mirrors in (
        (line, 1, 0),
        (np.tile(line, 3), 3, 0),
        (mirrored, 1, 1),
        (np.fft.irfft(np.fft.rfft(mirrored)[:-1], 3 * points) * 1.5, 1, 1),  # axis off the points
        (np.tile(mirrored, 2), 2, 1),
        (inverted, 1, 0),
    ):
        measured = texture(Grid(h.size, 1), h)
        assert (measured.tiles, measured.mirrors) == (tiles, mirrors)
        assert (measured.along_x, measured.repetitions) == (1, 1)


def _random(seed, points=64):
    """Gaussian heights."""
    m = np.hypot(np.fft.fftfreq(points, 1 / points)[:, None], np.fft.rfftfreq(points, 1 / points))
    noise = np.fft.rfft2(np.random.default_rng(seed).normal(size=(points, points)))
    return np.fft.irfft2(noise * (m <= 14) * (1 + (m / 4) ** 2) ** -0.9, (points, points))


def test_mirror_images_are_counted_along_each_axis():
    """Wherever the axis is; two mirrors are not one inversion, which changes no amplitude."""
    patch = _random(0)
    for seed, (by_x, by_y) in enumerate([(0, 0), (1, 0), (0, 1), (1, 1)]):
        h = np.hstack([patch, patch[:, ::-1]]) if by_x else patch
        h = np.vstack([h, h[::-1]]) if by_y else h
        h = np.roll(h, np.random.default_rng(seed).integers(64, size=2), axis=(0, 1))
        measured = texture(Grid(h.shape[1], points_y=h.shape[0]), h)
        assert (measured.mirrors, measured.copies) == (by_x + by_y, 2 ** (by_x + by_y))
    inverted = patch + patch[::-1, ::-1]
    assert texture(Grid(64), inverted).mirrors == 0


def test_gaussian_maps_are_below_the_limit_of_copies_also_mirrored():
    """On average, mirror images do not change the estimate (error by the draw: 2 %)."""
    of_maps = []
    for seed in range(50):
        patch = _random(seed)
        whole = np.hstack([patch, patch[:, ::-1]])
        maps = patch, whole, np.vstack([whole, whole[::-1]])
        grids = [Grid(h.shape[1], points_y=h.shape[0]) for h in maps]
        of_maps.append([texture(*pair).repetitions for pair in zip(grids, maps, strict=True)])
        assert 0.7 < min(of_maps[-1]) <= max(of_maps[-1]) < 2.6 < MAX_REPETITIONS
        noise = 1e-3 * patch.std() * np.random.default_rng(seed).normal(size=(192, 192))
        assert texture(Grid(192), np.tile(patch, (3, 3)) + noise).repetitions > MAX_REPETITIONS
    alone, *mirrored = np.mean(of_maps, axis=0)
    np.testing.assert_allclose(mirrored, alone, rtol=0.1)


def test_the_waves_of_two_points_are_found_along_each_axis():
    for points_y, m_y, m_x in ((32, 16, 3), (32, 2, 16), (33, 0, 16)):
        grid = Grid(32, points_y=points_y)
        long = waves(grid, (2, 3, 1.0), (15, 15, 1.0))
        assert not texture(grid, long).has_nyquist_waves
        assert texture(grid, long + waves(grid, (m_y, m_x, 1e-6))).has_nyquist_waves
    line = Grid(32, 1)
    assert texture(line, (-1.0) ** np.arange(32)).has_nyquist_waves
    assert not texture(line, np.cos(2 * np.pi * 15 * np.arange(32) / 32)).has_nyquist_waves


@pytest.mark.parametrize(
    ("kind", "points", "points_y", "transformed"),
    [
        ("self-affine", 64, 64, (64, 64)),  # half of them are two points per lambda_s
        ("self-affine", 256, 256, (64, 64)),
        ("self-affine", 72, 160, (40, 36)),
        ("wave", 128, 1, (16,)),
        ("map", 96, 48, (12, 24)),
        ("mirrored map", 96, 48, (24, 48)),
        ("profile", 96, 1, (24,)),
        ("parabola", 64, 64, (64, 64)),  # it has waves of any length
    ],
)
def test_waves_are_counted_on_the_coarsest_grid_that_has_them_all(
    tmp_path, monkeypatch, kind, points, points_y, transformed
):
    heights = np.random.default_rng(1).normal(size=(10, 20))
    path = tmp_path / "h.npy"
    np.save(path, heights[0] if kind == "profile" else heights)
    scan = {"path": path, "interpolation": "fourier", "length": 2.0}
    surface = {
        "self-affine": SelfAffine(cutoff=1 / 16, length_y=1.0),
        "wave": Wave(),
        "map": FileSurface(periodic=True, length_y=1.0, **scan),
        "mirrored map": FileSurface(periodic=False, edges="mirror", length_y=1.0, **scan),
        "profile": FileSurface(periodic=True, **scan),
        "parabola": Parabola(radius=1.0),
    }[kind]
    shapes = []

    def note(grid, height):
        shapes.append(grid.whole_shape)
        return radial_power(grid, height)

    monkeypatch.setattr(scenes, "radial_power", note)
    scene = scenes.build_scene(surface, Power(n=2), points, points_y=points_y)
    grid, heights = sample(surface, points, points_y)
    all_points = scenes.reduce_scene(grid, heights, Power(n=2))
    assert shapes == [transformed, scene.grid.whole_shape]
    assert scene.delta_sigma == pytest.approx(all_points.delta_sigma, rel=1e-12)
    for one, other in zip(astuple(scene.shells), astuple(all_points.shells), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9)


@pytest.mark.parametrize("shape", [(12, 16), (9, 15), (20,)])
def test_waves_of_mirrored_heights_are_those_of_twice_the_cell(shape):
    heights = np.random.default_rng(4).normal(size=shape)
    heights -= heights.mean()
    grid = Grid(shape[-1], len(shape), length=2.0, points_y=shape[0], length_y=3.0)
    m, power, modes = mirrored_power(grid, heights)
    cell = Grid(2 * shape[-1], len(shape), length=4.0, points_y=2 * shape[0], length_y=6.0)
    expected = radial_power(cell, mirror(heights))
    np.testing.assert_allclose(2 * m, expected[0], rtol=1e-14)
    np.testing.assert_allclose(power, expected[1], rtol=1e-9)
    np.testing.assert_array_equal(modes, expected[2])
    assert power.sum() == pytest.approx(np.mean(heights**2), rel=1e-12)
