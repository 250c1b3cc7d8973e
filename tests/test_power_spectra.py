"""Spectra and autocorrelations against identities and sums over the points."""

import numpy as np
import pytest

from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.maps.roughness_parameters import autocorrelation
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.power_spectra import autocorrelations, correlation, spectra
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine


def noise(grid, seed=0):
    return np.random.default_rng(seed).normal(3.0, 2.0, grid.shape)


GRIDS = [Grid(32), Grid(48, length=2.5), Grid(64, 1, 3.0), Grid(256)]


@pytest.mark.parametrize("grid", GRIDS)
def test_the_shells_of_a_field_sum_up_to_its_variance(grid):
    field = noise(grid)
    _, _, power = spectra(grid, {"f": field})
    assert power["f"].sum() == pytest.approx(field.var(), rel=1e-12)


@pytest.mark.parametrize("grid", GRIDS)
def test_the_shells_hold_all_waves_but_the_mean(grid):
    q, waves, _ = spectra(grid, {})
    assert waves.sum() == pytest.approx(grid.size - 1, rel=1e-12)
    assert waves == pytest.approx(np.rint(waves), rel=1e-12)
    assert np.all(np.diff(q) > 0)
    assert q[0] == pytest.approx(2 * np.pi / grid.length, rel=1e-14)


def test_a_wave_lies_in_the_shell_of_its_length():
    grid = Grid(32, length=2.0)
    x = np.arange(32) / 32
    wave = np.cos(2 * np.pi * (3 * x[:, None] + 4 * x)) + 5.0
    q, waves, power = spectra(grid, {"f": wave})
    (shell,) = np.flatnonzero(power["f"] > 1e-12)
    assert q[shell] == pytest.approx(5 * np.pi, rel=1e-12)
    assert power["f"][shell] == pytest.approx(0.5, rel=1e-12)
    assert waves[shell] == 12  # (5, 0), (0, 5), (3, 4), (4, 3) with all signs


def test_the_spectrum_of_a_surface_is_that_of_its_scene():
    """Below the 64 exact shells both have the same ones."""
    scene = build_scene(SelfAffine(cutoff=0.1), Power(n=1), 128)
    q, _, power = spectra(scene.grid, {"h": scene.height * scene.h_std})
    held = power["h"] > 1e-12
    np.testing.assert_allclose(q[held][:40], scene.shells.q[:40], rtol=1e-12)
    np.testing.assert_allclose(power["h"][held][:40], scene.shells.height[:40], rtol=1e-10)


@pytest.mark.parametrize("shape", [(24,), (12, 12)])
def test_the_correlation_is_the_mean_product_with_the_field_moved(shape):
    grid = Grid(shape[0], len(shape))
    field = noise(grid)
    centred = field - field.mean()
    values = correlation(grid, field)
    for step in ((0,) * len(shape), (1,) * len(shape), (5, 3)[: len(shape)], (7, 11)[: len(shape)]):
        moved = np.roll(centred, step, axis=tuple(range(len(shape))))
        expected = np.mean(centred * moved) / field.var()
        assert values[step] == pytest.approx(expected, abs=1e-12)


def test_the_correlation_over_all_displacements_sums_up_to_nothing():
    """Its mean is |f(q = 0)|^2, which is left out."""
    grid = Grid(32)
    assert correlation(grid, noise(grid)).sum() == pytest.approx(0, abs=1e-10)


def test_a_wave_on_a_line_is_correlated_as_a_wave():
    grid = Grid(64, 1, 4.0)
    r, values = autocorrelations(grid, {"f": np.cos(2 * np.pi * 3 * np.arange(64) / 64)})
    np.testing.assert_allclose(r, np.arange(33) * 4.0 / 64, rtol=1e-14)
    np.testing.assert_allclose(values["f"], np.cos(2 * np.pi * 3 * r / 4.0), atol=1e-12, rtol=0)


def test_a_bump_is_correlated_as_a_wider_one():
    """A Gauss bump of width w has the correlation exp(-r^2 / 4 w^2), a small cell's mean aside."""
    grid = Grid(256)
    x = (np.arange(256) - 128) / 256
    w = 0.03
    bump = np.exp(-(x[:, None] ** 2 + x**2) / (2 * w**2))
    r, values = autocorrelations(grid, {"f": bump})
    mean = np.pi * w**2 * 4  # <f>^2 / <f^2> of a cell of side 1
    expected = (np.exp(-(r**2) / (4 * w**2)) - mean) / (1 - mean)
    np.testing.assert_allclose(values["f"][1:], expected[1:], atol=2e-3, rtol=0)
    assert values["f"][0] == 1.0
    assert r[0] == 0.0


@pytest.mark.parametrize("is_periodic", [True, False])
@pytest.mark.parametrize("length", [1.0, 0.03563018112166582, 7.0])
def test_rings_of_oblong_pixels_begin_at_no_displacement(is_periodic, length):
    """With pixels of 2:1, displacements lie half-way between rings, up to rounding."""
    grid = Grid(31, length=length, points_y=32, length_y=0.5 * length / 31 * 32)
    field = np.random.default_rng(2).standard_normal(grid.shape)
    r, values = autocorrelations(grid, {"f": field}, periodic=is_periodic)
    assert r[0] == 0.0
    assert values["f"][0] == 1.0
    doubled = Grid(31, length=2.0, points_y=32, length_y=32 / 31)
    r_doubled, expected = autocorrelations(doubled, {"f": field}, periodic=is_periodic)
    np.testing.assert_allclose(r / length, r_doubled / 2.0, rtol=1e-12)
    np.testing.assert_allclose(values["f"], expected["f"], atol=1e-12, rtol=0)


@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize("value", [0.0, 0.1, 3.3])
def test_a_constant_field_has_no_correlation(value, periodic):
    grid = Grid(16)
    _, values = autocorrelations(grid, {"f": np.full(grid.shape, value)}, periodic=periodic)
    assert np.all(np.isnan(values["f"]))


@pytest.mark.parametrize("grid", [Grid(9, points_y=6), Grid(10, dimension=1)], ids=str)
def test_without_repetition_the_correlation_is_that_of_pairs_within_the_map(grid):
    field = np.random.default_rng(2).standard_normal(grid.shape)
    values = autocorrelation(np.ma.asarray(field))
    change = field - field.mean()
    for shift in np.ndindex(*(n // 2 + 1 for n in grid.shape)):
        first = tuple(slice(0, n - d) for n, d in zip(grid.shape, shift, strict=True))
        second = tuple(slice(d, n) for n, d in zip(grid.shape, shift, strict=True))
        expected = np.mean(change[first] * change[second]) / change.var()
        assert values[shift] == pytest.approx(expected, abs=1e-12)


def test_rings_of_a_map_without_repetition_end_at_half_of_its_side():
    grid = Grid(16, length=2.0)
    r, means = autocorrelations(grid, {"ramp": np.tile(np.arange(16.0), (16, 1))}, periodic=False)
    assert r[-1] == pytest.approx(1.0, rel=0.1)
    assert r.shape == autocorrelations(grid, {})[0].shape
    assert means["ramp"][0] == 1.0
