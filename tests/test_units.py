import pytest

from gfmd_cli.physics.elastomers import HalfSpace, Power
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.units import count, duration, labelled, percent


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (2e9, "Pa", "2 GPa"),
        (72.5e9, "Pa", "72.5 GPa"),
        (1e-5, "m", "10 µm"),
        (999e3, "Pa", "0.999 MPa"),
        (3e-9, "m", "3 nm"),
        (0.1, "N/m", "100 mN/m"),
        (1e-15, "m", "0.001 pm"),
        (1.7e308, "Pa", "1.7e+296 TPa"),
        (0.8, "1", "0.8"),
        (1e-6, "", "1e-06"),
    ],
)
def test_a_number_has_the_prefix_of_its_size(value, unit, text):
    assert labelled(value, unit) == text


def test_labels_have_units_where_the_keys_have():
    assert HalfSpace(E_star=2e9).label == "half-space E_star=2 GPa"
    assert SelfAffine(hurst=0.8, h_std=1e-6).label == "self-affine hurst=0.8 h_std=1 µm"
    assert Power(n=1, k_n=1e6).label == "power n=1 k_n=1000000"


def test_parameters_that_differ_have_labels_that_differ():
    assert HalfSpace(E_star=2e9).label != HalfSpace(E_star=2.0000001e9).label


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.4, "0 s"), (90, "90 s"), (150, "2 min"), (7000, "117 min"), (7300, "2 h"), (200000, "2 d")],
)
def test_a_time_is_given_in_its_largest_unit(seconds, text):
    assert duration(seconds) == text


def test_one_thing_is_in_the_singular():
    assert [count(n, "task") for n in (0, 1, 2)] == ["0 tasks", "1 task", "2 tasks"]


@pytest.mark.parametrize(
    ("fraction", "text"),
    [
        (0.0, "0%"),
        (1e-9, "under 1%"),
        (0.0049, "under 1%"),
        (0.006, "1%"),
        (0.2, "20%"),
        (0.994, "99%"),
        (0.996, "over 99%"),
        (1 - 1e-9, "over 99%"),
        (1.0, "100%"),
        (1.2, "120%"),
    ],
)
def test_a_percentage_is_not_rounded_to_all_or_none(fraction, text):
    assert percent(fraction) == text
