"""Displacements of elastomers without borders, against quadrature and sum rules."""

import mpmath as mp
import numpy as np
import pytest

from gfmd_cli.errors import InputError
from gfmd_cli.physics.elastomers import HalfSpace, Layer, Membrane, Plate, Power, Slab
from gfmd_cli.physics.free_compliance import NEAR_SIDES

SIDES = (0.7, 1.0)  # of a pixel, y and x


def riesz(n):
    """Prefactor of the compliance kernel r^(n-2) of k = q^n in two dimensions."""
    return float(2 ** (1 - n) * mp.gamma(1 - n / 2) / mp.gamma(n / 2) / (2 * mp.pi))


def riesz_line(n):
    """Prefactor of the compliance kernel |x|^(n-1) of k = q^n in one dimension."""
    return float(mp.gamma(1 - n) * mp.sin(mp.pi * n / 2) / mp.pi)


def mean_over(kernel, ranges):
    """Mean of a kernel over a rectangle or a line, by Gauss's rule with 60 nodes a side."""
    nodes, weights = np.polynomial.legendre.leggauss(60)
    points = [0.5 * (a + b) + 0.5 * (b - a) * nodes for a, b in ranges]
    values = kernel(np.sqrt(sum(x**2 for x in np.meshgrid(*points, indexing="ij"))))
    for _ in ranges:
        values = 0.5 * weights @ values
    return values


def moment(s):
    """int_0^inf x^(s-1) exp(-x^2 / 2) dx."""
    return float(2 ** (s / 2 - 1) * mp.gamma(s / 2))


@pytest.mark.parametrize("n", [0.25, 0.5, 0.9, 1.5])
def test_riesz_kernel_is_the_fourier_transform_of_the_compliance(n):
    """Parseval with the Gaussian f = exp(-r^2 / 2), whose transform is (2 pi)^(d/2) exp(-q^2 / 2):
    int G f = int q^(-n) f(q) over all waves / (2 pi)^d.
    """
    assert 2 * np.pi * riesz(n) * moment(n) == pytest.approx(moment(2 - n), rel=1e-14)
    if n < 1:
        waves = np.sqrt(2 / np.pi) * moment(1 - n)
        assert 2 * riesz_line(n) * moment(n) == pytest.approx(waves, rel=1e-14)


@pytest.mark.parametrize(("n", "error"), [(0.05, 2e-9), (0.5, 1e-9), (1.0, 1e-9), (1.7, 1e-9)])
@pytest.mark.parametrize("pixel", [(0, 1), (3, 2), (0, NEAR_SIDES), (70, 3), (80, 90)])
def test_pressure_on_a_pixel_displaces_others_as_its_integral(n, error, pixel):
    """Closed form close to the pixel, Gauss's rule far from it."""
    ranges = [((j - 0.5) * side, (j + 0.5) * side) for j, side in zip(pixel, SIDES, strict=True)]
    mean = mean_over(lambda r: riesz(n) * r ** (n - 2), ranges)
    computed = Power(n=n, k_n=2.0).free_compliance((81, 91), SIDES)[pixel]
    assert computed == pytest.approx(mean * np.prod(SIDES) / 2, rel=error)


@pytest.mark.parametrize("n", [0.5, 1.0, 1.7])
def test_pressure_on_a_pixel_displaces_the_pixel_itself(n):
    """In polar coordinates the integral over r^(n-1) is R^n / n up to the border R(phi)."""
    b, a = (side / 2 for side in SIDES)
    corner = mp.atan2(b, a)
    along_x = mp.quad(lambda phi: (a / mp.cos(phi)) ** n / n, [0, corner])
    along_y = mp.quad(lambda phi: (b / mp.sin(phi)) ** n / n, [corner, mp.pi / 2])
    exact = 4 * (along_x + along_y) * riesz(n)
    computed = Power(n=n).free_compliance((2, 2), SIDES)[0, 0]
    assert computed == pytest.approx(float(exact), rel=1e-13)


def test_half_space_displaces_as_boussinesq():
    """u = F / (pi E* r) far from the load F."""
    u = HalfSpace(E_star=3.0).free_compliance((2, 400), SIDES)
    assert u[0, 399] == pytest.approx(0.7 / (np.pi * 3.0 * 399), rel=1e-6)


def test_springs_displace_themselves_alone():
    for shape in ((6, 5), (7,)):
        u = Power(n=0, k_n=4.0).free_compliance(shape, SIDES[-len(shape) :])
        assert u.ravel()[0] == pytest.approx(0.25)
        assert np.abs(u.ravel()[1:]).max() < 1e-14


@pytest.mark.parametrize("n", [0.5, 0.8])
def test_line_load_displaces_as_its_integral(n):
    u = Power(n=n).free_compliance((5,), (0.5,))
    mean = mean_over(lambda x: riesz_line(n) * x ** (n - 1), [(1.25, 1.75)])
    assert u[3] == pytest.approx(0.5 * mean, rel=1e-12)
    assert u[0] == pytest.approx(2 * riesz_line(n) * 0.25**n / n, rel=1e-12)


def test_line_load_on_a_half_space_displaces_relative_to_the_distance_l():
    """G = -2 ln(x / L) / (pi E*), Johnson, Contact Mechanics, Eq. (2.19)."""
    u = HalfSpace(E_star=2.0).free_compliance((1000,), (0.01,))
    assert u[100] == pytest.approx(-np.log(0.1) / np.pi * 0.01, rel=1e-5)
    own = 2 * mp.quad(lambda x: -mp.log(x / 10) / mp.pi, [0, 0.005])
    assert u[0] == pytest.approx(float(own), rel=1e-12)


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.49])
@pytest.mark.parametrize("base", ["bonded", "sliding"])
def test_layer_displaces_by_its_compliance(base, poisson):
    """Sums over all pixels: a uniform pressure gives 1 / k(0), a wave along x the sum over 1/k(q)
    of all waves with the same values at the pixels, times the mean of each over a pixel.
    """
    sides = (0.5, 0.25)
    layer = Layer(thickness=1.0, E_star=2.0, poisson=poisson, base=base)
    u = layer.free_compliance((54, 108), sides)
    u[1:] *= 2
    rows = u.sum(axis=0)
    rows[1:] *= 2  # pixels on both sides
    assert rows.sum() == pytest.approx(1 / layer.uniform_stiffness, abs=1e-7)
    for q in (0.5, 2.0):
        waves = np.abs(q + np.arange(-100_000, 100_001) * 2 * np.pi / sides[1])
        exact = np.sum(np.sinc(waves * sides[1] / (2 * np.pi)) / layer.stiffness(waves))
        wave = rows @ np.cos(q * sides[1] * np.arange(rows.size))
        assert wave == pytest.approx(exact, rel=2e-6)


@pytest.mark.parametrize("spacing", [0.05, 0.4, 2.0])
@pytest.mark.parametrize(
    "keys", [{"base": "sliding"}, {"poisson": 0.0}, {"poisson": 0.3}, {"poisson": 0.49}]
)
def test_line_of_a_layer_displaces_by_its_compliance(keys, spacing):
    """As above, in one dimension."""
    layer = Layer(thickness=1.5, E_star=2.0, **keys)
    u = layer.free_compliance((int(60 / spacing),), (spacing,))
    u[1:] *= 2
    assert u.sum() == pytest.approx(1 / layer.uniform_stiffness, rel=1e-7)
    for q in (0.3, 1.2):
        waves = np.abs(q + np.arange(-100_000, 100_001) * 2 * np.pi / spacing)
        exact = np.sum(np.sinc(waves * spacing / (2 * np.pi)) / layer.stiffness(waves))
        wave = u @ np.cos(q * spacing * np.arange(u.size))
        assert wave == pytest.approx(exact, rel=2e-6)


def test_line_is_the_sum_of_the_rows_of_pixels():
    layer = Layer(thickness=0.1, poisson=0.4)
    pixels = layer.free_compliance((80, 40), (0.05, 0.02))
    line = layer.free_compliance((40,), (0.02,))
    assert pixels[0] + 2 * pixels[1:].sum(axis=0) == pytest.approx(line, abs=1e-7 * line[0])


def test_thick_layer_is_a_half_space():
    shape = (20, 30)
    layer = Layer(thickness=1e4, E_star=2.0, base="sliding").free_compliance(shape, SIDES)
    half_space = HalfSpace(E_star=2.0).free_compliance(shape, SIDES)
    assert np.ptp(layer - half_space) < 1e-6 * half_space[0, 0]
    assert layer == pytest.approx(half_space, rel=1e-2)


@pytest.mark.parametrize(
    "elastomer", [Power(n=2), Membrane(), Plate(thickness=1.0), Slab(thickness=0.1)]
)
def test_elastomers_that_do_not_decay_are_refused(elastomer):
    with pytest.raises(InputError, match=r"grid\.boundary.*decays.*periodic"):
        elastomer.free_compliance((4, 4), SIDES)


def test_line_contacts_that_do_not_decay_are_refused():
    for elastomer in (Power(n=1.5), Membrane()):
        with pytest.raises(InputError, match="in 1 dimension does not"):
            elastomer.free_compliance((4,), (1.0,))


def test_layer_far_thinner_than_a_pixel_is_refused():
    layer = Layer(thickness=1e-3, base="sliding")
    for shape, spacings, points in (((4, 4), SIDES, 250), ((4,), (0.1,), 25)):
        words = rf"thickness is less than 1/16 of .* pixels of {spacings[-1]:g} m; use {points} "
        with pytest.raises(InputError, match=words):
            layer.free_compliance(shape, spacings)
    assert layer.free_compliance((25,), (0.4 / 25,)).size == 25
