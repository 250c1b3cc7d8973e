"""Persson theory against quadrature, its own identities and tabulated values of one surface."""

import mpmath as mp
import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.special import exp1

from gfmd_cli.physics import persson
from gfmd_cli.physics.elastomers import Slab
from gfmd_cli.physics.gap_theories import FittedWeight
from gfmd_cli.physics.persson import Persson, Shells, gamma_n, gamma_slab, ierfc, shells

P_STAR = np.array([0.001, 0.01, 0.1, 0.3, 1, 2, 3])
# default surface: Delta_sigma / (k_n h_std), then u_g / h_std at P_STAR, as rounded in the table
TABLE = {
    0: (1.0, [2.823219, 1.908721, 1.005350, 0.544801, 0.094119, 0.004944, 1.2557e-4]),
    0.5: (5.3119243, [3.040160, 2.035861, 1.008598, 0.468609, 0.057051, 0.002113, 4.2223e-5]),
    1: (58.440646, [2.736923, 1.785352, 0.649285, 0.211653, 0.014312, 4.4314e-4, 9.0800e-6]),
    2: (33460.453, [1.473135, 0.552464, 0.107153, 0.034970, 0.003831, 1.6652e-4, 3.9025e-6]),
    3: (31058544, [0.487565, 0.184535, 0.052340, 0.021036, 0.002759, 1.2716e-4, 3.0346e-6]),
    4: (3.2358048e10, [0.231576, 0.106871, 0.037255, 0.016391, 0.002324, 1.0975e-4, 2.6375e-6]),
}

FEW = Shells(
    q=np.array([1.0, 2.0, 3.0, 4.0]),
    height=np.array([1.0, 0.5, 0.2, 0.1]),
    energy=np.array([1.0, 0.8, 0.4, 1e-7]),
    variance=np.array([0.01, 1.0, 2.0, 1e-6]),
    gamma=np.array([0.3, 0.2, 0.2, 0.1]),
    modes=np.ones(4),
)


@pytest.fixture(scope="module")
def default():
    """Wavenumbers and |h(q)|^2 of the default surface on the full integer lattice, |m| <= 200."""
    m = np.arange(-200, 201)
    squared = np.add.outer(m**2, m**2).ravel()
    q = 2 * np.pi * np.sqrt(squared[(squared > 0) & (squared <= 200**2)])
    return q, (1 + (q / (4 * np.pi)) ** 2) ** -1.8


def theory(surface, n):
    q, power = surface
    ones = np.ones_like(q)
    return Persson(shells(q, power, q**n, float(gamma_n(n)) * ones, ones))


@pytest.mark.parametrize("n", TABLE)
def test_exact_shells_reproduce_the_table(default, n, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr(persson, "EXACT_SHELLS", default[0].size)
        exact = theory(default, n)
    h_std = np.sqrt(exact.shells.height.sum())
    delta_sigma, gaps = TABLE[n]
    assert h_std**2 == pytest.approx(14.6986420768, rel=1e-11)
    assert exact.delta_sigma / h_std == pytest.approx(delta_sigma, rel=2e-8)
    gap = exact.mean_gap(P_STAR * exact.delta_sigma) / h_std
    last_digit = np.where(gap > 1e-3, 1e-6, 1e-4 * 10 ** np.floor(np.log10(gap)))
    assert np.all(np.abs(gap - gaps) < 0.501 * last_digit)

    binned = theory(default, n)
    error = np.abs(binned.mean_gap(P_STAR * exact.delta_sigma) / h_std / gap - 1)
    assert np.all(error[P_STAR <= 0.1] < 3.5e-5)
    assert np.all(error < 1.3e-3)


def digits(p, s):
    """F of Eq. (32), corrected."""
    if s == 0:
        return p**2
    width = mp.sqrt(2 * s)
    return (p**2 + s) * mp.erf(p / width) + p * width * mp.exp(-((p / width) ** 2)) / mp.sqrt(mp.pi)


def energy(p):
    """Elastic energy of FEW, Eqs. (29)-(32) corrected, in many digits."""
    total = low = mp.mpf(0)
    for e, variance, gamma in zip(FEW.energy, FEW.variance, FEW.gamma, strict=True):
        high = low + mp.mpf(float(variance))
        a = (digits(p, high) - digits(p, low)) / (high - low)
        total += float(e) / 2 * (float(gamma) + (1 - mp.mpf(float(gamma))) * a * a) * a
        low = high
    return total


@pytest.mark.parametrize("p_star", [1e-4, 0.1, 1, 6])
def test_the_gap_agrees_with_arithmetic_in_30_digits(p_star):
    few = Persson(FEW)
    p = p_star * few.delta_sigma
    ends = [
        p_star,
        *(x for x in (1e-3, 0.01, 0.05, 0.2, 0.6, 1.2, 2, 3, 4.5, 6, 8, 11) if x > p_star),
    ]
    with mp.workdps(30):
        ln_p = [mp.log(mp.mpf(x) * few.delta_sigma) for x in ends]
        gap = mp.quad(
            lambda t: mp.diff(energy, mp.exp(t)), ln_p, method="gauss-legendre", maxdegree=3
        )
    assert few.mean_gap(p) == pytest.approx(float(gap), rel=1e-11, abs=0)


def test_the_bin_average_is_the_integral_of_the_contact_area_over_the_variance():
    p, low, high = mp.mpf("0.3"), mp.mpf("0.04"), mp.mpf("1.7")
    integral = mp.quad(lambda s: mp.erf(p / mp.sqrt(2 * s)), [low, high])
    assert float(digits(p, high) - digits(p, low)) == pytest.approx(float(integral), rel=1e-12)


@pytest.mark.parametrize("width", [1e-2, 1e-4, 1e-6, 1e-9, 1e-18])
def test_a_thin_bin_is_a_single_wavenumber(width):
    """All energy at variance 1, W = a_r: u_g = int dp' a_r'(p') / p' = E_1(p^2/2) / sqrt(2 pi)."""
    two = np.ones(2)
    variance = np.array([1 - width / 2, width])
    thin = Persson(Shells(two, two, np.array([0.0, 2.0]), variance, two, two))
    p = np.array([1e-5, 0.1, 1, 6])
    rel = 1e-10 + 50 * width**2  # the curvature of a_r across the bin, (p^2/2)^2 w^2 / 24
    assert thin.mean_gap(p) == pytest.approx(exp1(p**2 / 2) / np.sqrt(2 * np.pi), rel=rel, abs=0)


def test_slices_of_a_bin_add_up():
    def linear(slices):
        even = np.full(slices, 1 / slices)
        return Persson(Shells(even, even, even, even, np.ones(slices), even))  # W = a_r

    p = np.array([1e-5, 0.1, 1, 6])
    for obtained in (linear(10), linear(1000)):
        assert obtained.mean_gap(p) == pytest.approx(linear(1).mean_gap(p), rel=1e-11, abs=0)


def test_the_gap_integrates_over_pressure_to_the_energy_of_full_contact():
    few = Persson(FEW)
    t = np.linspace(-25, 2.5, 551)  # ln p*; the trapezoidal rule converges beyond any power
    p = few.delta_sigma * np.exp(t)
    integral = trapezoid(few.mean_gap(p) * p, t)
    assert integral == pytest.approx(0.5 * FEW.energy.sum(), rel=1e-8)


def test_the_gap_grows_as_the_logarithm_of_a_small_pressure():
    few = Persson(FEW)
    gap = few.mean_gap(few.delta_sigma * np.array([1e-10, 1e-11, 1e-12, 1e-13]))
    assert np.diff(gap, 2) == pytest.approx(0, abs=1e-9 * gap[0])


def test_the_tail_of_the_gap_stays_positive_and_steepens(default):
    surface = theory(default, 1)
    p_star = np.array([0.99, 1.01, 1.99, 2.01, 2.99, 3.01, 3.99, 4.01, 6, 7, 8, 20])
    gap = surface.mean_gap(p_star * surface.delta_sigma)
    assert np.all(gap > 0)
    assert np.all(np.diff(gap) < 0)
    slope = np.log(gap[1:8:2] / gap[:8:2]) / 0.02
    assert slope == pytest.approx([-3.46, -3.62, -4.19, -4.93], abs=0.005)


def test_the_gap_does_not_depend_on_the_pressures_asked_with_it():
    few = Persson(FEW)
    p = few.delta_sigma * np.geomspace(1e-5, 6, 12).reshape(3, 4)
    alone = np.array([few.mean_gap(x) for x in p.ravel()]).reshape(3, 4)
    assert few.mean_gap(p) == pytest.approx(alone, rel=1e-12, abs=0)


@pytest.mark.parametrize("p", [0.05, 0.5, 1.5, 3])
def test_the_stress_density_has_first_moment_p(p):
    even = np.array([1.0])
    unit = Persson(Shells(*6 * [even]))
    node, weight = np.polynomial.legendre.leggauss(80)
    sigma, weight = 0.5 * (p + 10) * (1 + node), 0.5 * (p + 10) * weight
    density = unit.stress_density(sigma, p)
    assert weight @ density == pytest.approx(float(unit.contact_area(p)), rel=1e-12)
    assert weight @ (sigma * density) == pytest.approx(p, rel=1e-12)
    second = weight @ ((sigma - p) ** 2 * density) + p**2 * (1 - unit.contact_area(p))
    assert unit.stress_deviation(p) ** 2 == pytest.approx(float(second), rel=1e-12)
    assert np.all(unit.stress_density(np.array([-1.0, 0.0]), p) == 0)


def test_nothing_breaks_at_the_ends_of_the_pressure_scale():
    few = Persson(FEW)
    p = np.array([0, 1e-300, 1e3, 1e100])
    gap = few.mean_gap(p)
    assert gap[0] == np.inf
    assert gap[1] > few.mean_gap(1e-5)
    assert np.all(gap[2:] == 0)
    assert few.stress_deviation(np.array([0, 1e3])) == pytest.approx([0, few.delta_sigma])
    assert few.mean_gap(np.array([])).shape == (0,)


def test_an_unknown_pressure_has_no_prediction():
    few = Persson(FEW)
    for predict in (few.contact_area, few.stress_deviation, few.mean_gap):
        assert np.isnan(predict(np.array([np.nan, 1.0]))).tolist() == [True, False]
    assert few.mean_gap(0.0) == np.inf
    assert few.contact_area(0.0) == 0.0


def test_the_shells_keep_every_sum_and_separate_the_longest_waves(monkeypatch):
    monkeypatch.setattr(persson, "EXACT_SHELLS", 20)
    monkeypatch.setattr(persson, "LOGARITHMIC_BINS", 30)
    rng = np.random.default_rng(1)
    m = np.arange(-40, 41)
    q = np.sqrt(np.add.outer(m**2, m**2).ravel().astype(float))
    q = q[q > 0] * (1 + 1e-13 * rng.standard_normal(m.size**2 - 1))  # rounding of |q|
    power, gamma = rng.random(q.size), rng.random(q.size)
    power[q > 35] = 0
    result = shells(q, power, q**2, gamma, np.ones_like(q))
    assert result.q[:20] ** 2 == pytest.approx(
        [1, 2, 4, 5, 8, 9, 10, 13, 16, 17, 18, 20, 25, 26, 29, 32, 34, 36, 37, 40]
    )
    assert result.q.size == 50
    assert np.all(np.diff(result.q) > 0)
    assert result.q[-1] < 35
    assert result.height.sum() == pytest.approx(power.sum())
    assert result.energy.sum() == pytest.approx((q**2 * power).sum())
    assert result.variance.sum() == pytest.approx((q**4 * power).sum())
    assert result.gamma @ result.energy == pytest.approx(gamma @ (q**2 * power))


def test_a_line_of_few_modes_gets_one_shell_for_each():
    q = np.arange(1.0, 11.0)
    power = np.where(q % 2 == 0, q**-2, 0.0)
    result = shells(q, power, q, np.ones(10), np.ones(10))
    assert result.q == pytest.approx([2, 4, 6, 8, 10])
    assert result.energy == pytest.approx(1 / result.q)


def test_gamma_passes_monotonically_through_its_table():
    nodes = np.array([0, 0.5, 1, 2, 3, 4])
    assert gamma_n(nodes) == pytest.approx([0.5, 0.45, 0.35, 0.2, 0.1, 0.02])
    assert np.all(np.diff(gamma_n(np.linspace(0, 4, 401))) < 0)
    for n in (-0.1, 4.1):
        with pytest.raises(ValueError, match="gamma_n is known"):
            gamma_n(n)


def test_the_slab_goes_from_sheet_to_half_space():
    assert gamma_slab(np.array([0.0, 6.0, 1e9])) == pytest.approx(
        [0.02, 0.02 + 0.33 * np.tanh(1), 0.35]
    )


def test_the_integral_of_erfc_keeps_its_digits():
    x = np.array([-1e3, -3, 0, 0.5, 5, 20, 26])
    with mp.workdps(400):
        exact = [float(mp.exp(-(mp.mpf(t) ** 2)) / mp.sqrt(mp.pi) - t * mp.erfc(t)) for t in x]
    assert ierfc(x) == pytest.approx(exact, rel=1e-12, abs=0)


@pytest.mark.parametrize("n", [0, 1, 4])
def test_area_and_gap_give_their_pressure_back(default, n):
    of_n = theory(default, n)
    p = np.array([1e-3, 0.02, 0.3, 2.5]) * of_n.delta_sigma
    np.testing.assert_allclose(of_n.pressure_at_area(of_n.contact_area(p)), p, rtol=1e-12)
    np.testing.assert_allclose(of_n.pressure_at_gap(of_n.mean_gap(p)), p, rtol=1e-4)
    smallest, largest = of_n.gap_range
    assert of_n.pressure_at_gap([smallest, largest]) == pytest.approx(
        [20 * of_n.delta_sigma, 1e-6 * of_n.delta_sigma], rel=1e-6
    )
    assert np.isnan(of_n.pressure_at_gap([0.0, 0.99 * smallest, 1.01 * largest])).all()


@pytest.mark.parametrize("n", [0, 0.5, 2, 3.7])
def test_the_exponent_of_the_stiffness_is_read_off_the_shells(default, n):
    assert theory(default, n).shells.exponents() == pytest.approx(n, abs=0.02)


def test_the_exponent_of_a_slab_is_read_off_the_shells(default):
    q, power = default
    slab = Slab(thickness=0.03)
    binned = shells(q, power, slab.stiffness(q), np.full(q.size, 0.35), np.ones_like(q))
    exponents, exact = binned.exponents(), slab.local_exponent(binned.q)
    assert exact[0] > 3.5
    assert exact[-1] < 1.01
    assert np.abs(exponents - exact)[1:-1].max() < 0.05


def test_one_shell_has_no_exponent_and_no_fitted_gap():
    one = shells(*(np.array([value]) for value in (6.0, 1.0, 2.0, 0.3, 4.0)))
    assert np.isnan(one.exponents()).all()
    fitted = FittedWeight(one, one.exponents())
    assert np.isnan(fitted.mean_gap([0.1, 1.0])).all()
    assert np.isnan(fitted.pressure_at_gap([0.1, 1.0])).all()
    assert np.isnan(fitted.gap_range).all()
    assert np.isfinite(FittedWeight(one, np.ones(1)).mean_gap([0.1, 1.0])).all()
