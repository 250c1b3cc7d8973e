"""Transforms of padded fields, against sums."""

import numpy as np
import pytest

from gfmd_cli.grid.convolution import PaddedTransform, padded_shape

SHAPES = [(16, 16), (15, 22), (9, 64), (1, 6), (33,), (64,)]


def direct(kernel, field):
    """sum_j G(|i - j|) s_j by a loop over all pairs of points."""
    out = np.zeros(field.shape)
    for load in np.ndindex(field.shape):
        distance = [np.abs(np.arange(n) - j) for n, j in zip(field.shape, load, strict=True)]
        out += field[load] * kernel[np.ix_(*distance)]
    return out


@pytest.mark.parametrize("shape", SHAPES)
def test_a_convolution_is_the_sum_over_all_points(shape):
    generator = np.random.default_rng(1)
    kernel, field = generator.random(shape), generator.random(shape)
    transform = PaddedTransform(shape, padded_shape(shape))
    out = transform.apply(transform.symbol_of(kernel), field, np.empty(shape))
    assert out == pytest.approx(direct(kernel, field), rel=1e-12)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_symbol_acts_on_the_field_padded_by_zeros(shape):
    """Against numpy.fft on the whole padded field; also where padding is less than twofold."""
    field, padded = np.random.default_rng(2).random(shape), tuple(n + n // 4 + 1 for n in shape)
    transform = PaddedTransform(shape, padded)
    symbol = np.random.default_rng(5).random(transform.symbol_shape)
    whole = np.zeros((1, *padded)[-2:])
    inside = slice(transform.field_rows), slice(transform.field_columns)
    whole[inside] = field
    rows = np.abs(np.fft.fftfreq(len(whole), 1 / len(whole))).astype(int)
    expected = np.fft.irfft2(symbol[rows] * np.fft.rfft2(whole), whole.shape)
    out = transform.apply(symbol, field, np.empty(shape))
    assert out.ravel() == pytest.approx(expected[inside].ravel(), rel=0, abs=1e-12)


def test_single_precision_is_as_good_as_that():
    shape, generator = (40, 30), np.random.default_rng(3)
    kernel, field = generator.random(shape), generator.random(shape)
    double, single = (
        PaddedTransform(shape, padded_shape(shape), precision) for precision in ("double", "single")
    )
    expected, computed = (
        t.apply(t.symbol_of(kernel), field, np.empty(shape)) for t in (double, single)
    )
    assert single.symbol_of(kernel).dtype == np.float32
    assert 0 < np.abs(computed / expected - 1).max() < 1e-5


def test_the_map_can_be_applied_in_place():
    shape = (12, 20)
    field = np.random.default_rng(4).random(shape)
    transform = PaddedTransform(shape, padded_shape(shape))
    kernel = np.zeros(shape)
    kernel[0, 0] = 3.0
    expected = 3 * field
    assert transform.apply(transform.symbol_of(kernel), field, field) is field
    assert field == pytest.approx(expected, rel=0, abs=1e-13)
