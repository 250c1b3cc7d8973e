"""Surfaces and indenters: spectra, phases, one surface on many grids, shapes and curvatures."""

import numpy as np
import pytest
from fourier import forward
from pydantic import ValidationError
from scipy.stats import kstest

from gfmd_cli.errors import InputError
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.elastomers import HalfSpace, Plate, Power, Slab
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.indenters import (
    Cone,
    LineParabola,
    Parabola,
    PowerLawIndenter,
    Punch,
    Ridge,
    Wave,
)
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.physics.surfaces import sample

BODIES = [
    Parabola(radius=3.0),
    PowerLawIndenter(exponent=4.0, radius=3.0),
    Cone(slope=0.2),
    Punch(),
    Ridge(),
    LineParabola(),
    Wave(),
]


def spectrum(points):
    """|h(q)|^2 and the mode numbers m_y, m_x of all modes, by NumPy."""
    m = np.fft.fftfreq(points, 1 / points)
    return m[:, None] + 0 * m, 0 * m[:, None] + m


def amplitudes(surface, points):
    return np.abs(np.fft.fft2(surface.heights(points))) / points**2


@pytest.mark.parametrize("hurst", [0.05, 0.3, 0.8, 1.0])
def test_every_amplitude_is_the_root_of_the_rolloff_spectrum(hurst):
    surface = SelfAffine(hurst=hurst, rolloff=0.3, cutoff=0.02)
    m = np.hypot(*spectrum(128))
    expected = np.sqrt((1 + (0.3 * m) ** 2) ** (-1 - hurst))
    expected[(m == 0) | (m > 50)] = 0.0
    assert amplitudes(surface, 128) == pytest.approx(expected, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("hurst", [0.05, 0.3, 0.8, 1.0])
def test_every_amplitude_is_the_root_of_the_cutoff_spectrum(hurst):
    surface = SelfAffine(hurst=hurst, rolloff=0.2, cutoff=0.02, spectrum="cutoff")
    m = np.hypot(*spectrum(128))
    known = (m >= 5) & (m <= 50)  # 5 = 1/0.2 and 50 = 1/0.02 belong to it
    expected = np.where(known, np.where(known, 0.2 * m, 1.0) ** (-1 - hurst), 0.0)
    assert amplitudes(surface, 128) == pytest.approx(expected, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("cutoff", [1 / 3, 0.03, 0.01, 1 / 49, 1.0])
def test_the_cutoff_wavelength_belongs_to_the_surface(cutoff):
    surface = SelfAffine(cutoff=cutoff)
    highest = int(np.floor(1 / cutoff + 1e-9))
    along = amplitudes(surface, 256)[0]
    assert surface.highest_modes[1] == highest
    assert along[highest] > 1e-6
    assert along[highest + 1] < 1e-15


@pytest.mark.parametrize("spectrum", ["rolloff", "cutoff"])
@pytest.mark.parametrize(("coarse", "fine"), [(100, 200), (100, 300), (200, 250), (128, 256)])
def test_one_seed_is_one_surface_on_every_grid(spectrum, coarse, fine):
    surface = SelfAffine(cutoff=0.02, spectrum=spectrum, seed=3)  # 100 points resolve it just so
    one, other = surface.heights(coarse), surface.heights(fine)
    shared = np.gcd(coarse, fine)
    difference = one[:: coarse // shared, :: coarse // shared]
    difference = difference - other[:: fine // shared, :: fine // shared]
    assert np.abs(difference).max() < 1e-13 * other.std()


def test_a_smaller_cutoff_only_adds_modes():
    rough, smooth = SelfAffine(cutoff=0.01, seed=5), SelfAffine(cutoff=0.025, seed=5)
    many, few = np.fft.fft2(rough.heights(256)), np.fft.fft2(smooth.heights(256))
    m = np.hypot(*spectrum(256))
    assert many[m <= 40] == pytest.approx(few[m <= 40], abs=1e-12 * np.abs(few).max())
    added = np.abs(many[(m > 40) & (m <= 100)])
    assert np.all(added > 1e-6 * np.abs(few).max())


def test_the_default_surface_has_its_variance():
    assert np.var(SelfAffine().heights(512)) == pytest.approx(14.6986420768, rel=1e-11)


@pytest.mark.parametrize(
    ("n", "unit"),
    [(0.5, 5.3119243), (1, 58.440646), (2, 33460.453), (3, 31058544), (4, 3.2358048e10)],
)
def test_the_default_surface_has_its_unit_of_pressure(n, unit):
    scene = build_scene(SelfAffine(), Power(n=n, k_n=3.0), 512)
    assert scene.h_std**2 == pytest.approx(14.6986420768, rel=1e-11)
    # known to eight digits, half a unit in the last of which is 1.6e-8 at worst
    assert scene.delta_sigma / (3.0 * scene.h_std) == pytest.approx(unit, rel=1.6e-8)


def test_the_unit_of_pressure_is_h_std_for_springs():
    scene = build_scene(SelfAffine(cutoff=0.02), Power(n=0, k_n=3.0), 128)
    assert scene.delta_sigma == pytest.approx(3.0 * scene.h_std, rel=1e-13)


def test_the_unit_of_pressure_of_a_slab_is_that_of_the_half_space():
    surface = SelfAffine(cutoff=0.02)
    half_space = build_scene(surface, HalfSpace(E_star=3.0), 128)
    for thickness in (0.001, 0.1, 10.0):
        slab = build_scene(surface, Slab(thickness=thickness, E_star=3.0), 128)
        assert slab.delta_sigma == pytest.approx(half_space.delta_sigma, rel=1e-13)


@pytest.mark.parametrize("seed", [0, 7])
def test_the_surface_can_be_scaled_to_a_height(seed):
    own = SelfAffine(cutoff=0.02, seed=seed).heights(128)
    scaled = SelfAffine(cutoff=0.02, seed=seed, h_std=1e-9).heights(128)
    assert scaled.std() == pytest.approx(1e-9, rel=1e-13, abs=0)
    assert scaled / scaled.std() == pytest.approx(own / own.std(), abs=1e-13)


def test_scenes_are_reduced_to_mean_zero_and_height_one():
    scene = build_scene(SelfAffine(cutoff=0.02, h_std=2e-7), HalfSpace(E_star=1e9), 128)
    assert abs(scene.height.mean()) < 1e-14
    assert scene.height.std() == pytest.approx(1, rel=1e-14)
    assert scene.h_std == pytest.approx(2e-7, rel=1e-13, abs=0)
    power = np.abs(forward(scene.grid, scene.height)) ** 2 * scene.grid.multiplicity()
    assert np.sum(power * scene.stiffness**2) == pytest.approx(1, rel=1e-13)
    k = HalfSpace(E_star=1e9).stiffness(scene.grid.wavenumber())
    assert scene.stiffness * scene.delta_sigma / scene.h_std == pytest.approx(k, rel=1e-13)


def test_scenes_know_the_mean_height_of_their_indenter():
    indenter = Parabola(radius=3.0, length=2.0)
    scene = build_scene(indenter, Power(n=1), 64)
    heights = indenter.heights(64)
    assert scene.mean_height == pytest.approx(heights.mean(), rel=1e-13)
    restored = scene.height * scene.h_std + scene.mean_height
    assert restored == pytest.approx(heights, abs=1e-14)


@pytest.mark.parametrize("factor", [1e-90, 1e-30, 1e30, 1e90])
def test_scenes_of_any_scale_are_the_same_scene(factor):
    plain = build_scene(SelfAffine(cutoff=0.02, h_std=1.0), Power(n=2), 128)
    scaled = build_scene(SelfAffine(cutoff=0.02, h_std=factor), Power(n=2), 128)
    assert scaled.height == pytest.approx(plain.height, abs=1e-12)
    assert scaled.delta_sigma == pytest.approx(plain.delta_sigma * factor, rel=1e-12, abs=0)


def test_a_stiffness_that_overflows_is_refused():
    with pytest.raises(InputError, match="out of range"):
        build_scene(SelfAffine(cutoff=0.02), Power(n=4, k_n=1e305), 128)


def test_scenes_know_their_spectrum():
    elastomer = Plate(thickness=0.1, E_star=12.0)
    scene = build_scene(SelfAffine(cutoff=0.02, length=2.0), elastomer, 128)
    shells = scene.shells
    assert shells.height.sum() == pytest.approx(scene.h_std**2, rel=1e-12)
    assert shells.variance.sum() == pytest.approx(scene.delta_sigma**2, rel=1e-12)
    assert shells.q[0] == pytest.approx(np.pi, rel=1e-12)
    assert shells.q[-1] <= 50 * np.pi * (1 + 1e-12)


def test_different_seeds_are_different_surfaces():
    one, other = (SelfAffine(cutoff=0.02, seed=seed).heights(128) for seed in (0, 1))
    assert abs(np.mean(one * other)) < 0.5 * one.var()  # some 20 modes carry most of the height
    assert np.abs(one - other).max() > one.std()


def phases(seed):
    """Phases of one of each pair q, -q within the cut-off."""
    m_y, m_x = spectrum(256)
    chosen = (np.hypot(m_y, m_x) <= 100) & ((m_x > 0) | ((m_x == 0) & (m_y > 0)))
    return np.angle(np.fft.fft2(SelfAffine(cutoff=0.01, seed=seed).heights(256))[chosen])


@pytest.mark.parametrize("seed", [0, 1, 2**63 - 1])
def test_phases_are_even(seed):
    angles = phases(seed)
    assert angles.size > 15000
    assert kstest(angles, "uniform", args=(-np.pi, 2 * np.pi)).pvalue > 0.01
    assert np.diff(np.sort(angles)).min() > 1e-11  # each has a random number of its own


def test_phases_of_neighbouring_modes_and_seeds_are_independent():
    one, other = phases(0), phases(1)
    spread = 1 / np.sqrt(one.size)  # of the mean of unit vectors
    assert abs(np.exp(1j * (one - other)).mean()) < 3 * spread
    assert abs(np.exp(1j * np.diff(one)).mean()) < 3 * spread


@pytest.mark.parametrize("surface", [SelfAffine(), SelfAffine(cutoff=0.03)], ids=["400", "66"])
def test_a_grid_too_coarse_is_refused_and_told_which_one_does(surface):
    needed = surface.smallest_grid()
    assert needed == 2 * int(1 / surface.cutoff)
    with pytest.raises(InputError, match=rf"grid\.points.* {needed} or more"):
        build_scene(surface, Power(n=1), needed - 2)
    scene = build_scene(surface, Power(n=1), needed)
    assert np.all(np.isfinite(scene.height))


def test_a_surface_without_modes_is_refused():
    with pytest.raises(ValidationError, match="no mode is left"):
        SelfAffine(spectrum="cutoff", rolloff=0.2, cutoff=0.4)


@pytest.mark.parametrize("h_std", [None, 1.0])
def test_a_surface_with_no_mode_between_its_wavelengths_is_refused(h_std):
    surface = SelfAffine(spectrum="cutoff", rolloff=0.85, cutoff=0.8, h_std=h_std)  # 1 < m < 1.25
    text = r"surface\.rolloff: 0\.85 .* cutoff = 0\.8, .* the nearest ones are 1 and 0\.70711"
    with pytest.raises(InputError, match=text):
        sample(surface, 64)


@pytest.mark.parametrize("length_y", [None, 0.7, 2.5])
def test_a_surface_is_refused_only_if_no_mode_lies_between_its_wavelengths(length_y):
    number_y, number_x = np.mgrid[:40, :16]
    m = np.unique(np.hypot(number_y / (length_y or 1.0), number_x))[1:]
    generator = np.random.default_rng(0)
    refused = 0
    for longest in generator.uniform(1, 15, size=200):
        shortest = longest * generator.uniform(1, 1.05)
        rolloff, cutoff = 1 / longest, 1 / shortest
        surface = SelfAffine(spectrum="cutoff", rolloff=rolloff, cutoff=cutoff, length_y=length_y)
        if ((m >= longest) & (m <= shortest)).any():
            assert np.ptp(surface.heights(64, 160)) > 0
            continue
        refused += 1
        below, above = m[m < longest][-1], m[m > shortest][0]
        with pytest.raises(InputError, match=f"ones are {1 / below:.5g} and {1 / above:.5g}:"):
            surface.smallest_grid()
    assert 20 < refused < 180


def test_the_ends_of_the_band_belong_to_it():
    for m in (1.0, np.sqrt(2), 3.0, np.hypot(3, 2), 7.0, np.hypot(20, 1)):
        surface = SelfAffine(spectrum="cutoff", rolloff=1 / m, cutoff=1 / m)
        assert np.ptp(surface.heights(64)) > 0


@pytest.mark.parametrize("options", [{"hurst": 0.0}, {"hurst": 1.1}, {"cutoff": 0.0}, {"seed": -1}])
def test_surfaces_out_of_range_are_refused(options):
    with pytest.raises(ValidationError):
        SelfAffine(**options)


@pytest.mark.parametrize("indenter", BODIES, ids=lambda indenter: indenter.kind)
@pytest.mark.parametrize("points", [8, 30, 64])
def test_indenters_are_highest_in_the_middle_and_symmetric(indenter, points):
    grid, h = sample(indenter, points)
    assert h.shape == grid.shape
    assert h[(points // 2,) * h.ndim] == h.max()
    mirrored = h[(slice(None, 0, -1),) * h.ndim]  # about the middle; row 0 is its own image
    assert h[(slice(1, None),) * h.ndim] == pytest.approx(mirrored, abs=1e-15)
    if h.ndim == 2:
        assert np.array_equal(h, h.T)


@pytest.mark.parametrize(("length", "radius"), [(1.0, 1.0), (2.0, 3.0)])
def test_the_parabola_has_its_radius_of_curvature(length, radius):
    h, step = Parabola(length=length, radius=radius).heights(32), length / 32
    curvature = np.diff(h, 2, axis=0) / step**2
    assert curvature == pytest.approx(np.full((30, 32), -1 / radius), rel=1e-10)
    line = LineParabola(length=length, radius=radius).heights(32)
    assert np.diff(line, 2) / step**2 == pytest.approx(np.full(30, -1 / radius), rel=1e-10)
    assert h[16] == pytest.approx(line, abs=1e-15)


def test_the_power_law_indenter_of_exponent_two_is_the_parabola():
    indenter = PowerLawIndenter(exponent=2.0, radius=3.0, length=2.0).heights(32)
    assert indenter == pytest.approx(Parabola(radius=3.0, length=2.0).heights(32), abs=1e-15)


@pytest.mark.parametrize("exponent", [0.5, 1.0, 3.0, 10.0])
def test_the_power_law_indenter_follows_its_formula(exponent):
    h = PowerLawIndenter(exponent=exponent, radius=3.0, length=2.0).heights(32)
    r = np.abs(np.arange(32) - 16) / 16
    expected = -(r**exponent) / (exponent * 3.0 ** (exponent - 1))
    assert h[16] == pytest.approx(expected, rel=1e-13, abs=0)


def test_the_cone_has_its_slope():
    h = Cone(slope=0.2, length=2.0).heights(32)
    assert np.diff(h[16, 16:]) == pytest.approx(np.full(15, -0.2 * 2 / 32), rel=1e-12)
    assert h[16 + 3, 16 + 4] == pytest.approx(-0.2 * 5 * 2 / 32, rel=1e-14)


def test_the_punch_has_its_face():
    h = Punch(radius=0.25, depth=2.0).heights(256)
    assert set(np.unique(h)) == {-2.0, 0.0}
    assert h[128, 128 + 64] == 0  # the rim belongs to it
    assert h[128, 128 + 65] == -2
    assert np.mean(h == 0) == pytest.approx(np.pi / 16, rel=2e-3)  # circle problem: ~ N^(-4/3)


def test_a_ridge_has_a_grid_point_on_its_flanks_or_foot():
    ridge = Ridge(width=0.02)
    assert ridge.smallest_grid() == 100
    assert np.count_nonzero(ridge.heights(100) > ridge.heights(100).min()) == 1
    with pytest.raises(InputError, match=r"width = 0\.02: two spacings or more.*use 100 or more"):
        sample(ridge, 98)
    with pytest.raises(InputError, match=r"surface\.width is relative to surface\.length"):
        sample(Ridge(width=1e-6), 98)


def test_the_ridge_has_its_width_and_slope():
    h = Ridge(slope=0.5, width=0.5, length=2.0).heights(16)
    assert h[8:] == pytest.approx([0, -1 / 16, -1 / 8, -3 / 16, *[-1 / 4] * 4])


def test_the_wave_is_one_mode():
    modes = forward(Grid(32, 1), Wave(amplitude=3.0).heights(32))
    assert abs(modes[1]) == pytest.approx(1.5)
    assert np.abs(np.delete(modes, 1)).max() < 1e-15


def test_indenters_stand_on_any_grid_from_the_smallest():
    with pytest.raises(InputError, match="8 or more"):
        sample(Cone(), 6)


def test_a_map_from_a_file_is_used_as_it_is_and_interpolated_on_a_finer_grid(tmp_path):
    surface = SelfAffine(cutoff=0.05, seed=2)
    np.save(tmp_path / "h.npy", surface.heights(64))
    from_file = FileSurface(path=tmp_path / "h.npy")
    assert np.array_equal(sample(from_file, 64)[1], surface.heights(64))
    assert sample(from_file, 128)[1] == pytest.approx(surface.heights(128), abs=1e-13)
    with pytest.raises(InputError, match="64 or more"):
        sample(from_file, 62)


def test_a_map_from_a_file_can_be_scaled_and_sized(tmp_path):
    heights = SelfAffine(cutoff=0.05).heights(64)
    np.save(tmp_path / "h.npy", heights)
    grid, h = sample(FileSurface(path=tmp_path / "h.npy", scale=1e-9, length=2e-5), 64)
    assert grid.length == 2e-5
    assert h == pytest.approx(1e-9 * heights, rel=1e-15, abs=0)


def test_a_window_levels_a_map_and_fades_it_to_its_mean(tmp_path):
    x = np.arange(64) / 64
    tilted = SelfAffine(cutoff=0.05).heights(64) + 50 * x
    np.save(tmp_path / "h.npy", tilted)
    _, h = sample(FileSurface(path=tmp_path / "h.npy", periodic=False, edges="window"), 64)
    assert max(np.abs(h[end]).max() for end in (0, -1)) < 0.02 * np.abs(h).max()  # at the border
    assert abs(np.polynomial.polynomial.polyfit(x, h.mean(axis=0), 1)[1]) < 5  # of 50


@pytest.mark.parametrize(("periodic", "words"), [(True, ", periodic,"), (False, "as it is,")])
def test_only_a_map_that_is_periodic_is_called_periodic(tmp_path, periodic, words):
    np.save(tmp_path / "h.npy", SelfAffine(cutoff=0.05).heights(64))
    surface = FileSurface(path=tmp_path / "h.npy", periodic=periodic, edges="none")
    assert surface.parameters()["periodic"] == periodic
    assert words in surface.preparation("periodic")
    assert (", periodic," in surface.preparation("periodic")) == periodic


def test_a_mirrored_map_has_a_cell_of_twice_the_side(tmp_path):
    np.save(tmp_path / "h.npy", SelfAffine(cutoff=0.05).heights(64))
    mirrored = FileSurface(path=tmp_path / "h.npy", length=3.0, edges="mirror")
    grid, h = sample(mirrored, 128)
    assert (grid.points, grid.length) == (128, 6.0)
    assert np.array_equal(h, h[::-1, ::-1])


@pytest.mark.parametrize("points", [4, 31])
def test_heights_on_too_few_points_are_refused(points):
    """Two points per lambda_s take 32."""
    assert SelfAffine(cutoff=1 / 16).heights(32).shape == (32, 32)
    with pytest.raises(InputError, match=f"{points} points along x do not resolve the surface"):
        SelfAffine(cutoff=1 / 16).heights(points)
