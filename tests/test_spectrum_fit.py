import tomllib

import numpy as np
import pytest
from scipy.ndimage import grey_dilation
from spectrum_fits import gaussian_roughness

from gfmd_cli.analysis.surface_summary import summarise, summary_text
from gfmd_cli.errors import InputError
from gfmd_cli.files.file_cache import forget_files
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.elastomers import HalfSpace
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.persson import Persson, shells
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.physics.spectrum_fit import fit, moments
from gfmd_cli.physics.surface_spectrum import spectrum
from gfmd_cli.physics.waves import radial_power


def shells_of(surface, points):
    return build_scene(surface, HalfSpace(), points).shells


@pytest.mark.parametrize(
    "keys",
    [
        {},
        {"hurst": 0.3, "rolloff": 0.25, "cutoff": 0.01},
        {"hurst": 0.6, "rolloff": 0.05, "cutoff": 0.01, "length": 1e-5, "h_std": 1e-8},
    ],
)
def test_the_fit_of_a_self_affine_surface_gives_what_it_was_made_from(keys):
    """The phases alone are random here: nothing scatters."""
    surface = SelfAffine(**keys)
    fitted = fit(shells_of(surface, surface.smallest_grid() + 20))
    assert fitted.hurst == pytest.approx(surface.hurst, abs=1e-5)
    assert 2 * np.pi / fitted.q_r == pytest.approx(surface.rolloff * surface.length, rel=1e-4)
    assert 2 * np.pi / fitted.q_s == pytest.approx(surface.cutoff * surface.length, rel=5e-3)
    assert fitted.scatter < 1e-8
    assert np.isnan(fitted.hurst_of_long_waves)


def test_the_bands_of_the_spectrum_add_up_to_the_height_and_its_moment():
    """sum of C(q) modes / A = <h^2>; the fit has the same C(q), as the phases alone are random."""
    surface, points = SelfAffine(cutoff=0.05, length=1e-5, h_std=1e-8, seed=3), 96
    scene = build_scene(surface, HalfSpace(), points)
    bands = spectrum(scene.shells, scene.grid.sides, scene.grid.whole_shape)
    heights = bands.density * bands.modes / surface.length**2
    power = np.abs(np.fft.fft2(surface.heights(points)) / points**2) ** 2
    m = np.fft.fftfreq(points, 1 / points)
    q = 2 * np.pi / surface.length * np.hypot(m, m[:, None])
    assert heights.sum() == pytest.approx(surface.h_std**2, rel=1e-9, abs=0)
    assert heights @ bands.q == pytest.approx(np.sum(power * q), rel=1e-9, abs=0)
    assert bands.modes.sum() == np.count_nonzero(power > 1e-9 * power.max())
    whole = bands.q < 0.9 * 2 * np.pi / (surface.cutoff * surface.length)
    assert bands.fitted[whole] == pytest.approx(bands.density[whole], rel=1e-3, abs=0)


def test_a_periodic_map_is_not_tapered(tmp_path):
    """A wave of the cell stays the only one."""
    wave = np.cos(2 * np.pi * np.arange(64) / 8)
    np.save(tmp_path / "wave.npy", 1e-8 * np.add.outer(wave, wave))
    summary = summarise(FileSurface(path=tmp_path / "wave.npy", length=1e-6))
    assert summary.spectrum.q == pytest.approx([2 * np.pi * 8 / 1e-6])
    assert summary.spectrum.modes.tolist() == [4]


@pytest.mark.parametrize("digits", [np.float32, "counts of 16 bits"])
def test_rounding_of_the_heights_does_not_change_the_fit(digits):
    """White noise of the rounding lies far below C(q), but has as many shells beyond q_s."""
    surface = SelfAffine(hurst=0.8, rolloff=0.25, cutoff=0.04)
    heights = surface.heights(256)
    step = np.ptp(heights) / 2**16
    rounded = heights.astype(digits) if digits is np.float32 else step * np.rint(heights / step)
    m, power, modes = radial_power(Grid(256), rounded.astype(float))
    fitted = fit(shells(2 * np.pi * m, power, m, m, modes))
    assert fitted.hurst == pytest.approx(0.8, abs=0.02)
    assert np.isnan(fitted.hurst_of_long_waves)
    assert 2 * np.pi / fitted.q_r == pytest.approx(0.25, rel=0.02)
    assert 2 * np.pi / fitted.q_s == pytest.approx(0.04, rel=0.02)


def test_standard_errors_hold_on_surfaces_that_the_fit_describes_exactly():
    """Random phases alone: no scatter, so that the error of the search is all there is."""
    draw = np.random.default_rng(0)
    for seed in range(12):
        hurst, rolloff = draw.uniform(0.05, 1.0), draw.uniform(0.15, 0.9)
        fitted = fit(
            shells_of(SelfAffine(hurst=hurst, rolloff=rolloff, cutoff=0.05, seed=seed), 64)
        )
        assert abs(fitted.hurst - hurst) < 3 * fitted.hurst_error < 1e-4
        assert abs(fitted.q_r - 2 * np.pi / rolloff) < 3 * fitted.q_r_error
        relative_error = fitted.rolloff_error / fitted.rolloff_wavelength
        assert relative_error == pytest.approx(fitted.q_r_error / fitted.q_r)


def test_a_power_law_shows_no_roll_off(tmp_path):
    surface = SelfAffine(spectrum="cutoff", rolloff=1.0, cutoff=0.02, hurst=0.7)
    fitted = fit(shells_of(surface, 128))
    assert fitted.q_r == 0
    assert fitted.hurst == pytest.approx(0.7, abs=1e-4)
    assert 2 * np.pi / fitted.q_s == pytest.approx(0.02, rel=5e-3)
    random = suggested(fit_of_map(surface.heights(128), tmp_path, periodic=True))
    assert (random.spectrum, random.rolloff) == ("cutoff", 1.0)  # its longest wave is the side


def test_standard_errors_hold_on_gaussian_roughness():
    """Forty surfaces: the distance to the truth, in standard errors, has mean 0 and width 1."""
    draw = np.random.default_rng(7)
    pulls, scatters, cut_offs = [], [], []
    for _ in range(40):
        m, power, modes = radial_power(Grid(256), gaussian_roughness(draw, 256, 0.7, 5.0, 64.0))
        fitted = fit(shells(2 * np.pi * m, power, m, m, modes))
        pulls.append(
            (
                (fitted.hurst - 0.7) / fitted.hurst_error,
                (fitted.q_r - 10 * np.pi) / fitted.q_r_error,
            )
        )
        scatters.append(fitted.scatter)
        cut_offs.append(fitted.q_s / (2 * np.pi))
    assert np.all(np.abs(np.mean(pulls, 0)) < 0.5)  # 3 / sqrt 40
    assert np.all(np.abs(np.std(pulls, 0) - 1) < 0.35)  # 3 / sqrt 80
    assert np.mean(scatters) == pytest.approx(1, abs=0.1)
    assert np.mean(cut_offs) == pytest.approx(64, rel=0.03)


@pytest.mark.parametrize("hurst", [0.3, 0.7])
def test_the_fit_has_the_gradient_of_a_surface_whose_spectrum_fills_the_grid(hurst):
    """The corners of the grid have modes of some directions only; the fitted surface has all."""
    height = gaussian_roughness(np.random.default_rng(1), 128, hurst, 5.0, np.inf)
    m, power, modes = radial_power(Grid(128), height)
    measured = shells(2 * np.pi * m, power, m, m, modes)
    spectrum = fit(measured, complete=2 * np.pi * 64)
    wavelengths = {"rolloff": 2 * np.pi / spectrum.q_r, "cutoff": 2 * np.pi / spectrum.q_s}
    fitted = SelfAffine(hurst=spectrum.hurst, h_std=height.std(), **wavelengths)
    expected = moments(measured).gradient
    assert spectrum.q_s > 2 * np.pi * 64
    gradient = moments(shells_of(fitted, 2 * fitted.smallest_grid())).gradient
    assert gradient == pytest.approx(expected, rel=0.01)


def fit_of_map(heights, tmp_path, pixel=1e-6, *, periodic=False):
    """The summary of a map, by default with borders, and an rms height of 0.1 um."""
    heights = 1e-7 * heights / heights.std()
    np.save(tmp_path / "map.npy", heights)
    forget_files()
    side = pixel * heights.shape[1]
    return summarise(FileSurface(path=tmp_path / "map.npy", periodic=periodic, length=side))


def part_of_roughness(seed, rolloff=2.0, hurst=0.8):
    draw = np.random.default_rng(seed)
    return gaussian_roughness(draw, 512, hurst, 2 * rolloff, 256.0)[:256, :256]


def with_noise(heights, share, seed=11):
    """White noise of a share of the rms difference of neighbours."""
    noise = np.random.default_rng(seed).standard_normal(heights.shape)
    return heights + share * np.diff(heights).std() * noise


def suggested(summary):
    """The random surface at the end of the summary."""
    table = tomllib.loads(summary_text(summary).partition("fitted spectrum:\n")[2])["surface"]
    return SelfAffine.model_validate(table)


@pytest.mark.parametrize("rolloff", [2.0, 0.5])
@pytest.mark.parametrize("seed", range(2))
def test_the_random_surface_of_a_mirrored_map_has_the_density_of_the_fit(seed, rolloff, tmp_path):
    """Its cell has four times the area, and waves of up to twice the length of those of the map.

    By Eqs. (3) and (40) |h(q)|^2 times the area is that of the fit: C(q) 256^2 on the map.
    """
    summary = fit_of_map(part_of_roughness(seed, rolloff), tmp_path)
    fitted, surface = summary.spectrum.fit, suggested(summary)
    scene = build_scene(surface, HalfSpace(), 2 * surface.smallest_grid())
    waves, side = scene.shells, surface.length
    middle = (waves.q > 4 * fitted.q_1) & (waves.q < 0.5 * fitted.q_s)
    density = waves.height[middle] / waves.modes[middle] * side**2
    of_fit = fitted.density(waves.q[middle]) * (side / 2) ** 2
    assert density == pytest.approx(of_fit, rel=0.01)
    assert moments(waves).gradient == pytest.approx(summary.moments.gradient, rel=0.1)


def test_the_gaps_of_the_fit_are_those_of_the_random_surface(tmp_path):
    summary = fit_of_map(part_of_roughness(0, 0.5), tmp_path)
    surface = suggested(summary)
    assert surface.h_std != pytest.approx(summary.spectrum.fit.rms_height, rel=0.05)
    theory = Persson(shells_of(surface, 2 * surface.smallest_grid()))
    rows = summary_text(summary).partition("gap, fit")[2].splitlines()[1:4]
    p, gaps = np.array([[float(row.split()[i]) for i in (0, -1)] for row in rows]).T
    assert gaps == pytest.approx(theory.mean_gap(p), rel=0.01)


def test_the_random_surface_of_equal_tiles_has_the_density_of_one(tmp_path):
    """On twice the sides |h(q)|^2 is a quarter; longer waves add to the rms height."""
    tile = SelfAffine(cutoff=0.05).heights(128)
    summary = fit_of_map(np.tile(tile, (2, 2)), tmp_path, periodic=True)
    larger = SelfAffine(rolloff=0.25, cutoff=0.025).heights(256)
    exact = 1e-7 * 0.5 * larger.std() / tile.std()
    assert suggested(summary).h_std == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("share", [0.3, 0.5, 1.0])
def test_the_error_of_h_contains_the_effect_of_noise(seed, share, tmp_path):
    summary = fit_of_map(with_noise(part_of_roughness(seed), share), tmp_path)
    fitted = summary.spectrum.fit
    assert fitted.hurst < 0.7
    assert fitted.hurst_of_long_waves > fitted.hurst
    assert fitted.hurst + 2 * fitted.hurst_error > 0.8
    assert "H depends on the wavenumber" in summary_text(summary)


@pytest.mark.parametrize("hurst", [0.3, 0.8, 1.0])
def test_h_does_not_depend_on_the_waves_of_a_self_affine_surface(hurst, tmp_path):
    for seed in range(6):
        for rolloff in (2.0, 5.0, 20.0):
            summary = fit_of_map(part_of_roughness(seed, rolloff, hurst), tmp_path)
            assert np.isnan(summary.spectrum.fit.hurst_of_long_waves)
            assert summary.spectrum.fit.hurst_error < 0.03


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("rolloff", "hurst"), [(1.0, 1.0), (2.0, 1.0), (20.0, 0.3)])
def test_the_fit_does_not_depend_on_the_unit_of_length(seed, rolloff, hurst, tmp_path):
    heights = part_of_roughness(seed, rolloff, hurst)
    fits = [fit_of_map(heights, tmp_path, pixel).spectrum.fit for pixel in (1e-2, 1e-6, 1e-8)]
    assert fits[0].q_r > 0
    for fitted in fits[1:]:
        assert fitted.hurst == pytest.approx(fits[0].hurst, abs=1e-6)
        assert fitted.q_r / fitted.q_1 == pytest.approx(fits[0].q_r / fits[0].q_1, rel=1e-5)


@pytest.mark.parametrize("seed", range(2))
def test_the_fit_of_a_surface_that_a_round_tip_has_scanned(seed, tmp_path):
    """The fit has the gradient of the map up to a likely q_s, not in its longest waves alone."""
    heights = part_of_roughness(seed)
    y, x = np.mgrid[-8:9, -8:9]
    tip = -0.075 * np.diff(heights).std() * (x**2 + y**2)
    fitted = fit_of_map(grey_dilation(heights, structure=tip), tmp_path).spectrum.fit
    assert fitted.cutoff_wavelength < 5e-6
    assert fitted.rms_height == pytest.approx(1e-7, rel=0.5)
    assert np.isfinite(fitted.hurst_of_long_waves)


def test_waves_at_the_ends_of_a_fit_count_whatever_the_unit_of_length():
    """Their wavenumbers are q_1 times whole numbers, up to rounding, as the limits are."""
    heights = gaussian_roughness(np.random.default_rng(2), 32, 0.7, 3.0, 12.0)
    m, power, modes = radial_power(Grid(32), heights)
    hursts = []
    for length in np.geomspace(1.0, 10.0, 8):
        q = 2 * np.pi * m / length
        hursts.append(fit(shells(q, power, q, q, modes), np.pi * 32 / length).hurst)
    assert hursts == pytest.approx(np.full(8, hursts[0]), abs=1e-5)


def test_moments_are_those_of_the_heights():
    """Against derivatives taken in Fourier space by NumPy."""
    surface = SelfAffine(cutoff=0.05, length=3.0)
    heights = surface.heights(64)
    q = 2 * np.pi * np.fft.fftfreq(64, 3.0 / 64)
    y, x = q[:, None], q[None, :]
    modes = np.fft.fft2(heights)
    slopes = [np.fft.ifft2(1j * k * modes).real for k in (y, x)]
    laplacian = np.fft.ifft2(-(x**2 + y**2) * modes).real
    values = moments(shells_of(surface, 64))
    assert values.height == pytest.approx(heights.std(), rel=1e-12)
    assert values.gradient == pytest.approx(np.sqrt(np.mean(slopes[0] ** 2 + slopes[1] ** 2)))
    assert values.curvature == pytest.approx(0.5 * laplacian.std(), rel=1e-3)  # shells have width


def test_the_density_is_that_of_single_modes():
    """Paper Eq. (3) with C = 1 m^2 at long wavelengths."""
    spectrum = shells_of(SelfAffine(cutoff=0.05), 64)
    expected = (1 + (spectrum.q * 0.5 / (2 * np.pi)) ** 2) ** -1.8
    np.testing.assert_allclose(spectrum.height / spectrum.modes, expected, rtol=2e-4)
    assert spectrum.modes.sum() == np.count_nonzero(
        (lambda m: (m > 0) & (m <= 20))(np.hypot(*np.mgrid[-31:33, -31:33]))
    )


def test_too_narrow_a_spectrum_is_refused():
    with pytest.raises(InputError, match="too narrow for a fit"):
        fit(shells_of(SelfAffine(cutoff=0.4), 32))


@pytest.mark.parametrize(
    ("hurst", "wavelength", "rolloff"),
    [(0.3, 2, 0.05), (0.3, 4, 0.05), (0.5, 4, 0.1), (0.8, 2, 0.2), (0.8, 8, 0.1), (0.8, 16, 0.1)],
)
def test_a_part_of_a_surface_has_the_spectrum_of_the_whole(hurst, wavelength, rolloff, tmp_path):
    """Without periodic borders; four seeds, the wavelength lambda_s in pixels."""
    ratios = []
    for seed in range(4):
        height = gaussian_roughness(
            np.random.default_rng(seed), 512, hurst, 1 / rolloff, 512 / wavelength
        )
        np.save(tmp_path / f"{seed}.npy", 1e-9 * height[:400, :300] / height.std())
        part = FileSurface(path=tmp_path / f"{seed}.npy", periodic=False, length=3e-6)
        spectrum = summarise(part).spectrum
        fitted = spectrum.fit
        assert fitted.hurst == pytest.approx(hurst, abs=max(0.02, 4 * fitted.hurst_error))
        assert fitted.cutoff_wavelength == pytest.approx(wavelength * 1e-8, rel=0.05)
        assert fitted.scatter < 2.5
        m, power, modes = radial_power(Grid(512), 1e-9 * height / height.std())
        q = 2 * np.pi * m / 512e-8
        ratios.append(
            (
                fitted.rolloff_wavelength / (512e-8 * rolloff),
                fitted.rms_height / 1e-9,
                np.sum(spectrum.modes * spectrum.fitted * spectrum.q**2)
                / (3e-6 * 4e-6 * moments(shells(q, power, q, q, modes)).gradient ** 2),
            )
        )
    assert np.mean(ratios, 0) == pytest.approx([1, 1, 1], abs=0.15)


@pytest.mark.parametrize("width", [10.0, 20.0, 40.0])
def test_smooth_heights_have_no_exponent_between_0_and_1(width):
    """C(q) is a Gauss function: H rises with the range of the fit."""
    q = np.arange(1.0, 100.0)
    with pytest.raises(InputError, match="not self-affine"):
        fit(shells(q, q * np.exp(-((q / width) ** 2)), q, q, 2 * np.pi * q))


def test_without_waves_between_roll_off_and_cut_off_there_is_no_fit():
    """The exponent has no influence there."""
    height = gaussian_roughness(np.random.default_rng(0), 256, 0.3, 40.0, 16.0)
    m, power, modes = radial_power(Grid(256), height)
    with pytest.raises(InputError, match="the slopes are of waves"):
        fit(shells(2 * np.pi * m, power, m, m, modes))
