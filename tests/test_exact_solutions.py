"""The exact solutions against quadrature of their stress, energy balances and known limits."""

import exact_solutions as reference
import mpmath
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import gamma, hyp2f1

K, R, A = 1.3, 2.0, 0.7  # stiffness, radius and contact radius of the Hertz tests


def riesz(n):
    """Prefactor I_n of the point-force displacement I_n F / (2 pi k r^(2-n)), 0 < n < 2."""
    return 2 ** (1 - n) * gamma(1 - n / 2) / gamma(n / 2)


def stress_moment(n, power):
    """Integral of the stress times r^power over 0 < r < a, the powers at both ends as weights."""
    peak = float(reference.hertz_peak_stress(n, K, R, A))
    # sigma r^power = peak (a - r)^nu (a + r)^nu r^power / a^(2 nu)
    nu = 1 - n / 2
    smooth, _ = quad(lambda r: (A + r) ** nu, 0, A, weight="alg", wvar=(power, nu))
    return peak * smooth / A ** (2 * nu)


@pytest.mark.parametrize("n", [0, 0.5, 1, 1.5, 2, 3, 3.5])
def test_the_hertz_stress_integrates_to_the_force(n):
    force = 2 * np.pi * stress_moment(n, 1)
    assert force == pytest.approx(float(reference.hertz_force(n, K, R, A)), rel=1e-9)
    assert float(reference.hertz_radius(n, K, R, force)) == pytest.approx(A, rel=1e-9)


@pytest.mark.parametrize("n", [0.25, 0.5, 1, 1.5])
def test_the_hertz_stress_pushes_its_centre_in_by_the_depth(n):
    centre = riesz(n) / K * stress_moment(n, n - 1)
    assert centre == pytest.approx(float(reference.hertz_depth(n, R, A)), rel=1e-9)


@pytest.mark.parametrize("n", [2.5, 3, 3.5])
def test_the_hertz_stress_gives_the_centre_the_curvature_of_the_tip(n):
    laplacian = riesz(n - 2) / K * stress_moment(n, n - 3)  # k q^n u = sigma, -lap u: k q^(n-2)
    assert laplacian == pytest.approx(2 / R, rel=1e-9)


@pytest.mark.parametrize("n", [0.5, 1, 1.5])
def test_the_hertz_stress_makes_a_parabola_off_the_centre(n):
    """Displacement at r = a/2 in polar coordinates around that point: 1/s^(2-n) is a weight."""
    r, peak = 0.5 * A, float(reference.hertz_peak_stress(n, K, R, A))
    nu = 1 - n / 2

    def chord(angle):
        middle = r * np.cos(angle)
        reach = np.sqrt(A**2 - (r * np.sin(angle)) ** 2)
        ahead, behind = reach - middle, reach + middle  # a^2 - r'^2 = (ahead - s) (behind + s)
        part, _ = quad(lambda s: (behind + s) ** nu, 0, ahead, weight="alg", wvar=(n - 1, nu))
        return part

    angles = np.pi * (np.arange(16) + 0.5) / 16  # periodic and smooth: the mid-point rule converges
    mean = np.mean([chord(angle) for angle in angles])
    displacement = riesz(n) / K * peak / A ** (2 * nu) * mean
    expected = float(reference.hertz_depth(n, R, A)) - r**2 / (2 * R)
    assert displacement == pytest.approx(expected, rel=1e-7)


POWERS = [(0.5, 1.0), (0.5, 4.0), (1, 1.0), (1, 3.0), (1.5, 1.5), (1.5, 4.0)]


def power_law_stress(n, m, r):
    """Stress under r^m / m, a = k = R = 1: flat punches of all radii b > r, pushed in one by one.

    A flat punch has the stress C (b^2 - r^2)^(-n/2); C from its displacement in the centre.
    """
    inner, _ = quad(lambda s: (1 + s) ** -(n / 2), 0, 1, weight="alg", wvar=(n - 1, -n / 2))
    punch = 1 / (riesz(n) * inner)
    depth = float(reference.power_law_depth(n, m, 1.0, 1.0))
    part, _ = quad(
        lambda b: b ** (m - 1) * (b + r) ** -(n / 2), r, 1, weight="alg", wvar=(-n / 2, 0)
    )
    return punch * depth * m * part


@pytest.mark.parametrize(("n", "m"), POWERS)
def test_the_stress_under_a_power_law_gives_its_force_and_its_depth(n, m):
    x, weight = np.polynomial.legendre.leggauss(60)
    t, weight = 0.5 * (x + 1), 0.5 * weight
    rho = 1 - (1 - t**4) ** 4  # both ends resolved
    change = 16 * t**3 * (1 - t**4) ** 3
    stress = np.array([power_law_stress(n, m, one) for one in rho])
    force = 2 * np.pi * np.sum(weight * change * stress * rho)
    assert force == pytest.approx(float(reference.power_law_force(n, m, 1.0, 1.0, 1.0)), rel=1e-6)
    centre = riesz(n) * np.sum(weight * change * stress * rho ** (n - 1))
    assert centre == pytest.approx(float(reference.power_law_depth(n, m, 1.0, 1.0)), rel=1e-6)


@pytest.mark.parametrize(("n", "m"), POWERS)
def test_the_stress_under_a_power_law_makes_its_shape(n, m):
    """Displacement at r = 0.4 over that in the centre: the mean of 1/s^(2-n) over a ring is 2F1."""
    r = 0.4

    def ring(x):
        near, far = min(x, r), max(x, r)
        return far ** (n - 2) * hyp2f1(1 - n / 2, 1 - n / 2, 1, (near / far) ** 2)

    total = 0.0
    for side in (-1, 1):  # towards r from both sides, and away from the ends
        reach = r if side < 0 else 1 - r
        x, weight = np.polynomial.legendre.leggauss(60)
        t, weight = 0.5 * (x + 1), 0.5 * weight
        whole = t**3 + (1 - t) ** 2
        s = t**3 / whole
        change = (3 * t**2 * whole - t**3 * (3 * t**2 - 2 * (1 - t))) / whole**2
        at = r + side * reach * s
        values = [one * power_law_stress(n, m, one) * ring(one) for one in at]
        total += reach * np.sum(weight * change * values)
    expected = float(reference.power_law_depth(n, m, 1.0, 1.0)) - r**m / m
    assert riesz(n) * total == pytest.approx(expected, rel=1e-5)


def test_power_laws_have_their_known_special_cases():
    for n in (0, 0.5, 1, 1.5, 2, 3):
        force = reference.power_law_force(n, 2.0, K, R, A)
        assert force == pytest.approx(float(reference.hertz_force(n, K, R, A)), rel=1e-13)
    assert reference.power_law_force(1, 1.0, K, R, A) == pytest.approx(np.pi * K * A**2)  # Sneddon
    springs = np.pi * K * A**5 / (5 * R**2)
    assert reference.power_law_force(0, 3.0, K, R, A) == pytest.approx(springs)
    membrane = 2 * np.pi * A * K * A**2 / R**2  # 2 pi a times the slope at a
    assert reference.power_law_force(2, 3.0, K, R, A) == pytest.approx(membrane)
    assert reference.kappa(1, 1.0) == pytest.approx(1.0)
    for m in (0.5, 1.0, 3.0):
        assert reference.kappa(0, m) == pytest.approx((m + 2) / (m * np.sqrt(m + 1)))


def test_power_laws_without_a_disc_of_contact_are_refused():
    for n, m in ((3, 4.0), (3, 0.5), (1, 0.0), (4, 2.0)):
        with pytest.raises(ValueError, match="got n"):
            reference.power_law_force(n, m, K, R, A)
    with pytest.raises(ValueError, match="n < m"):
        reference.kappa(2, 0.9)


def test_the_hertz_solution_has_its_known_special_cases():
    assert reference.hertz_peak_stress(0, K, R, A) == pytest.approx(K * A**2 / (2 * R))  # springs
    assert reference.hertz_force(1, K, R, A) == pytest.approx(8 * K * A**3 / (3 * R))  # E* = 2 k
    assert reference.hertz_depth(1, R, A) == pytest.approx(A**2 / R)
    assert reference.hertz_peak_stress(2, K, R, A) == pytest.approx(2 * K / R)  # tau lap h
    assert reference.hertz_force(3, K, R, A) == pytest.approx(8 * K * A / R)
    assert reference.hertz_profile(1, np.array([0, 0.6, 1, 2]), 1.0) == pytest.approx(
        [1, 0.8, 0, 0]
    )


def test_the_hertz_coefficients_are_the_tabulated_ones():
    n = (0, 0.25, 0.5, 1, 1.5, 2)
    first = (1.27324, 0.912464, 0.665416080, 0.375, 0.231146, 0.159155)
    second = (1.154701, 1.074772, 0.994573676, 0.833041, 0.669032, 0.5)
    assert [reference.kappa_prime(x) for x in n] == pytest.approx(first, rel=3e-6)
    assert [reference.kappa(x) for x in n] == pytest.approx(second, rel=1e-6)
    assert reference.kappa(0) == pytest.approx(2 / np.sqrt(3))
    assert reference.kappa(1) == pytest.approx(3 * np.pi / (8 * np.sqrt(2)))


@pytest.mark.parametrize("n", [0.25, 1, 1.5, 2, 3, 3.5])
def test_the_surface_leaves_the_tip_with_the_power_of_the_gap(n):
    outside = A * (1 + np.array([1e-3, 2e-3]))
    gap = outside**2 / (2 * R) - reference.hertz_sag(n, R, A, outside)
    assert np.log2(gap[1] / gap[0]) == pytest.approx(1 + n / 2, abs=4e-3)
    assert reference.hertz_sag(n, R, A, 0.5 * A) == A**2 / (8 * R)


def test_the_surface_around_the_contact_has_its_known_special_cases():
    r = np.array([1.1, 2.0, 5.0])
    boussinesq = (2 - r**2) * np.arcsin(1 / r) + np.sqrt(r**2 - 1)  # Johnson 1985, Eq. (3.42a)
    assert 1 - reference.hertz_sag(1, 1.0, 1.0, r) == pytest.approx(boussinesq / np.pi)
    assert reference.hertz_sag(0, R, A, r) == pytest.approx(A**2 / (2 * R))
    near = [reference.hertz_sag(n, R, A, r) for n in (2 - 1e-6, 2, 2 + 1e-6)]
    assert near[0] + near[2] == pytest.approx(2 * near[1], rel=1e-7)


X = np.array([0.07, 0.31, 0.5])


def test_a_periodic_line_force_has_its_closed_forms():
    def line(n):
        return reference.periodic_point_force(n, 3 * X, L=3.0) / 3 ** (n - 1)

    assert line(1) == pytest.approx(-np.log(2 * np.sin(np.pi * X)) / np.pi, abs=1e-14)
    assert line(2) == pytest.approx((X**2 - X + 1 / 6) / 2, abs=1e-14)
    assert line(4) == pytest.approx(-(X**4 - 2 * X**3 + X**2 - 1 / 30) / 24, abs=1e-14)
    for n in (0.25, 2.5, 3):
        series = [mpmath.polylog(n, mpmath.expjpi(2 * x)).real for x in X]
        expected = 2 * (2 * np.pi) ** -n * np.array([float(s) for s in series])
        assert line(n) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("n", [3.5, 4])
def test_a_periodic_point_force_is_the_sum_over_wave_vectors(n):
    m = np.arange(-300, 301)
    q = 2 * np.pi * np.hypot(m[:, None], m)
    q[300, 300] = np.inf
    wave = np.exp(2j * np.pi * m * 0.3)
    expected = (wave @ q**-n @ np.exp(2j * np.pi * m * 0.1)).real
    assert reference.periodic_point_force(n, 0.3, 0.1) == pytest.approx(expected, abs=2e-12)


@pytest.mark.parametrize("n", [0.25, 0.5, 1, 1.5, 2, 3])
def test_a_periodic_point_force_is_an_integral_over_heat_kernels(n):
    m, x, t = np.arange(-9, 10), (0.3, 0.1), 0.05  # waves serve from t on, images before

    def spread(time):
        waves = [np.exp(-4 * np.pi**2 * m**2 * time) @ np.cos(2 * np.pi * m * y) for y in x]
        return time ** (n / 2 - 1) * (waves[0] * waves[1] - 1)

    def imaged(time):
        images = [np.exp(-((y - m) ** 2) / (4 * time)).sum() for y in x]
        return time ** (n / 2 - 1) * images[0] * images[1] / (4 * np.pi * time)

    total = quad(spread, t, 1, epsabs=1e-13)[0] + quad(imaged, 1e-5, t, epsabs=1e-13)[0]
    expected = (total - t ** (n / 2) / (n / 2)) / gamma(n / 2)
    assert reference.periodic_point_force(n, *x) == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize("n", [0.5, 1, 2, 3, 4])
def test_the_laplacian_of_a_periodic_point_force_is_that_of_two_less(n):
    h = 1e-2
    step = h * np.array([0, 1, -1, 2, -2])
    weight = np.array([-30, 16, 16, -1, -1]) / (12 * h**2)  # fourth order
    along = weight @ reference.periodic_point_force(n, 0.3 + step, 0.4)
    across = weight @ reference.periodic_point_force(n, 0.3, 0.4 + step)
    assert along + across == pytest.approx(
        -float(reference.periodic_point_force(n - 2, 0.3, 0.4)), abs=1e-4
    )


@pytest.mark.parametrize("n", [0.25, 0.5, 1, 1.5, 2, 2.5, 3])
def test_near_the_force_the_images_add_a_parabola(n):
    r, L = 0.02, 2.0
    periodic = reference.periodic_point_force(n, r, 0.0, L=L)
    laplacian = -reference.point_force_of_images(n - 2, L)
    images = reference.point_force_of_images(n, L) + laplacian * r**2 / 4
    assert periodic - reference.point_force(n, r) == pytest.approx(images, abs=1e-7)


def test_the_images_of_a_boussinesq_force_have_the_madelung_constant_of_the_square():
    # of a charge in its neutralising background: -3.90026492 / L (Borwein et al. 2013)
    assert reference.point_force_of_images(1) == pytest.approx(-3.90026492 / (2 * np.pi), rel=1e-9)


def test_a_force_far_away_is_that_of_its_infinite_plane():
    assert reference.point_force(1, 0.4) == pytest.approx(1 / (2 * np.pi * 0.4))
    assert 2 * np.pi * reference.point_force(0.5, 1.0) == pytest.approx(0.477989, rel=1e-6)


def test_the_cell_flattens_the_membrane_as_it_does_exactly():
    p = 0.02
    curvature = 1 / R + reference.hertz_cell_curvature(2, K, p)
    radius = reference.hertz_radius(2, K, 1 / curvature, p)
    assert np.pi * radius**2 == pytest.approx(reference.membrane_area(p, K, R))
    assert reference.hertz_cell_curvature(0, K, p) == 0


@pytest.mark.parametrize("n", [0.5, 1, 1.5, 2, 2.5])
def test_the_line_stress_integrates_to_the_load(n):
    nu, peak = 1 - n / 2, float(reference.line_peak_stress(n, K, R, A))
    half, _ = quad(lambda x: (A + x) ** nu, 0, A, weight="alg", wvar=(0, nu))
    load = 2 * half * peak / A ** (2 * nu)
    assert load == pytest.approx(float(reference.line_load(n, K, R, A)), rel=1e-9)
    assert float(reference.line_half_width(n, K, R, load)) == pytest.approx(A, rel=1e-9)


@pytest.mark.parametrize("n", [0.25, 0.5, 0.75])
def test_the_line_stress_follows_the_ridge(n):
    """For n < 1 a line force displaces by Gamma(1-n) sin(pi n/2) / (pi k |x|^(1-n))."""
    nu, peak = 1 - n / 2, float(reference.line_peak_stress(n, K, R, A))
    green = gamma(1 - n) * np.sin(np.pi * n / 2) / (np.pi * K)

    def displacement(x):
        right, _ = quad(lambda s: (A + x + s) ** nu, 0, A - x, weight="alg", wvar=(n - 1, nu))
        left, _ = quad(lambda s: (A - x + s) ** nu, 0, A + x, weight="alg", wvar=(n - 1, nu))
        return green * peak / A ** (2 * nu) * (left + right)

    for x in (0.3 * A, 0.8 * A):
        assert displacement(0.0) - displacement(x) == pytest.approx(x**2 / (2 * R), rel=1e-8)


def test_the_line_stress_gives_the_centre_the_curvature_of_the_ridge():
    n = 2.5  # -u'' has the stiffness k |q|^(n - 2)
    nu, peak = 1 - n / 2, float(reference.line_peak_stress(n, K, R, A))
    half, _ = quad(lambda x: (A + x) ** nu, 0, A, weight="alg", wvar=(n - 3, nu))
    green = gamma(3 - n) * np.sin(np.pi * (n - 2) / 2) / (np.pi * K)
    assert 2 * green * half * peak / A ** (2 * nu) == pytest.approx(1 / R, rel=1e-9)


def test_the_line_contact_has_its_known_special_cases():
    E_star = 2 * K
    assert reference.line_load(1, K, R, A) == pytest.approx(np.pi * E_star * A**2 / (4 * R))
    assert reference.line_peak_stress(2, K, R, A) == pytest.approx(K / R)


def test_exponents_without_a_solution_are_refused():
    for call in (
        lambda: reference.kappa_prime(4),
        lambda: reference.hertz_depth(2, R, A),
        lambda: reference.line_load(3, K, R, A),
        lambda: reference.hertz_cell_curvature(4, K, 1.0),
        lambda: reference.periodic_point_force(4.5, 0.1, 0.1),
    ):
        with pytest.raises(ValueError, match="got n"):
            call()


def balance(gap, energy, p, step=1e-4):
    """dv + p du_g over a small change of p, relative to dv: zero to step^2 in equilibrium."""
    low, high = p * (1 - step), p * (1 + step)
    work = energy(high) - energy(low)
    return float((work + p * (gap(high) - gap(low))) / work)


@pytest.mark.parametrize("p_bar", [0.05, 0.4, 0.9])
def test_the_westergaard_wave_balances_its_energy(p_bar):
    residual = balance(reference.westergaard_gap, reference.westergaard_energy, p_bar)
    assert abs(residual) < 1e-6
    area = reference.westergaard_area(p_bar)
    assert reference.westergaard_pressure(area) == pytest.approx(p_bar, rel=1e-14)


def test_the_westergaard_wave_has_its_limits():
    assert reference.westergaard_gap(0.0) == 1
    assert reference.westergaard_energy(1.0) == 0.25  # k <h^2> / 2
    light = float(reference.westergaard_area(1e-10))  # a ridge: P = p L, q = 1, h_0 = 1
    width = reference.line_half_width(1, K, 1.0, 1e-10 * K * 2 * np.pi)
    assert light == pytest.approx(float(width) / np.pi, rel=1e-9)


def test_the_square_wave_has_its_limits():
    p_bar, full = 1e-6, 2 * K  # q = h_0 = 1: one paraboloid of R = 1 in each cell of (2 pi)^2
    radius = reference.hertz_radius(1, K, 1.0, p_bar * full * 4 * np.pi**2)
    area = np.pi * radius**2 / (4 * np.pi**2)
    assert reference.square_wave_area_light(p_bar) == pytest.approx(float(area), rel=1e-12)


def test_the_square_wave_opens_around_its_valleys_without_stress_intensity():
    gap_to_full = 1e-3  # a penny crack of radius b under the tension gap_to_full - r^2 / 4 (q = 1)
    b = np.sqrt(4 * np.pi * (1 - float(reference.square_wave_area_heavy(1 - gap_to_full))))
    angle = np.pi / 4 * (1 + np.polynomial.legendre.leggauss(20)[0])
    weight = np.polynomial.legendre.leggauss(20)[1] * np.sin(angle)  # r = b sin(angle)
    intensity = weight @ (gap_to_full - (b * np.sin(angle)) ** 2 / 4)
    assert abs(intensity) < 1e-12 * gap_to_full


def string_energy(p, tau, L):
    """v = tau <u'^2> / 2 of a string on a parabola: two straight-sloped pieces per period."""
    a = 0.5 * L * reference.string_area(p, tau, R)
    return tau / L * ((a / R) ** 2 * a / 3 + (p / tau) ** 2 * (L / 2 - a) ** 3 / 3)


@pytest.mark.parametrize("p", [0.01, 0.5, 20.0])
def test_the_string_on_a_parabola_balances_its_energy(p):
    tau, L = K, 3.0
    residual = balance(
        lambda x: reference.string_gap(x, tau, R, L), lambda x: string_energy(x, tau, L), p
    )
    assert abs(residual) < 1e-6


def test_the_string_on_a_wave_leaves_the_crest_without_a_kink():
    a_r = np.array([0.1, 0.5, 0.9])
    slope = np.sin(np.pi * a_r)  # of cos(x) at the edge, x = pi a_r
    assert reference.string_wave_pressure(a_r) * np.pi * (1 - a_r) == pytest.approx(slope)
    assert reference.string_wave_pressure(1.0) == 1


def test_the_membrane_carries_the_pressure_inside_the_contact():
    a_r = reference.membrane_area(0.3, K, R)  # sigma = p + 2 tau / R there, zero outside
    assert a_r * (0.3 + 2 * K / R) == pytest.approx(0.3)


def beam_energy(p, B, L):
    """v = B <u''^2> / 2: curvature 1/R where the beam lies on the tip, polynomial elsewhere."""
    l = float(reference.beam_free_half_length(p, B, R, L))
    if p < reference.beam_line_pressure(B, R, L):
        # B u'''' = -p, flat at both ends, no shear in the middle of the span
        curvature = np.polynomial.Polynomial([-p * l**2 / (3 * B), p * l / B, -p / (2 * B)])
    else:
        curvature = np.polynomial.Polynomial([-1 / R, p * l / B, -p / (2 * B)])
    span = (curvature**2).integ()(l)
    return B / L * (span + (L / 2 - l) / R**2)


@pytest.mark.parametrize("p_over_pc", [0.1, 0.9, 1.5, 40])
def test_the_beam_on_a_parabola_balances_its_energy(p_over_pc):
    B, L = 0.02, 3.0
    p = p_over_pc * reference.beam_line_pressure(B, R, L)
    residual = balance(lambda x: reference.beam_gap(x, B, R, L), lambda x: beam_energy(x, B, L), p)
    assert abs(residual) < 1e-6


def test_the_beam_changes_regime_continuously():
    B, L = 0.02, 3.0
    p = reference.beam_line_pressure(B, R, L) * np.array([1 - 1e-12, 1 + 1e-12])
    assert np.ptp(reference.beam_gap(p, B, R, L)) < 1e-10
    assert reference.beam_area(p, B, R, L) == pytest.approx(0, abs=1e-11)
    assert reference.beam_area(8 * p[1], B, R, L) == pytest.approx(0.5, rel=1e-9)
