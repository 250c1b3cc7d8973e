"""The waves of a field: their power by wavenumber, and what it says of the texture of a surface."""

from math import inf, prod, sqrt
from typing import NamedTuple

import numpy as np
from scipy.fft import dctn

from gfmd_cli.grid.arrays import BLOCK_POINTS, Field, Mask, Modes, row_blocks
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.grid.modes import multiplicity
from gfmd_cli.physics.highest_point import highest_point

ROUNDING_POWER = 1e-28  # |h(q)|^2 of a mode that only rounding has excited, relative to the largest
ROUNDED = 1e-9  # relative error by rounding of a sum over all waves; a choice
MIRRORED_CONCENTRATION = (1, 4 / 3, 2)
"""<s^2> / <s>^2 of the power s of random waves +-q_x, +-q_y over that without mirrors, 3/2, by the
number of mirrors."""


class Texture(NamedTuple):
    """How the waves of a surface are distributed."""

    anisotropy: float
    """Ratio of the rms slopes along the principal axes: 1 if isotropic, infinite for a line."""
    along_x: float
    """Share of the squared slope that is along x: 1/2 if isotropic, 1 for a line."""
    tiles: int
    """Number of equal tiles that the cell consists of, along both axes together."""
    mirrors: int
    """Number of axes along which the surface is its own mirror image: two of a mirrored map."""
    repetitions: float
    """How many copies of one patch a tile resembles: 1 if it is random, m^2 for m x m copies."""
    has_nyquist_waves: bool
    """Whether it has waves of the Nyquist wavenumber of an axis, beyond rounding errors.

    A grid shows only their part that is even about its points: a finer grid has another field."""

    @property
    def copies(self) -> int:
        """Number of parts of the cell with the same contacts."""
        return int(self.tiles * 2**self.mirrors)


def texture(grid: Grid, height: Field) -> Texture:
    """The texture of a surface. The cost is one transform."""
    modes = grid.forward_into_work(height)
    has_nyquist_waves, power = _has_nyquist_waves(grid, modes), _power(grid, modes)
    # of m tiles along an axis, only every m-th mode is not zero
    modes_along = [np.flatnonzero(_occupied(power).any(axis=axis)) for axis in range(2)]
    tiles = prod(max(int(np.gcd.reduce(numbers)), 1) for numbers in modes_along)
    if grid.dimension == 1:
        return Texture(inf, 1.0, tiles, _line_mirrors(grid, modes), 1.0, has_nyquist_waves)
    mirrors = _mirrors(grid, modes)
    repetitions = _concentration(grid, power) / (tiles * MIRRORED_CONCENTRATION[mirrors])
    return Texture(*_directions(grid, modes), tiles, mirrors, repetitions, has_nyquist_waves)


def radial_power(grid: Grid, height: Field) -> tuple[Field, Field, Field]:
    """Sums of |h(q)|^2 over the modes (+-q_x, +-q_y), where they exceed rounding errors.

    Returns |q| L / 2 pi, where L is the side along x, the sums, and their numbers of modes, each
    of shape (sums,).
    """
    return _by_wavenumber(grid, _power(grid, grid.forward_into_work(height)))


def mirrored_power(grid: Grid, height: Field) -> tuple[Field, Field, Field]:
    """`radial_power` of heights that are mirrored to twice the sides of their grid.

    L is the side of the grid itself. Up to phases, the coefficients are those of a discrete cosine
    transform of type II of the heights (Makhoul, IEEE Trans. Acoust. Speech Signal Process. 28, 27,
    1980). Processes that share the grid transform the mirrored heights instead.
    """
    doubled = grid.doubled()
    if grid.whole:
        power = np.atleast_2d(dctn(height, type=2))
        power *= power
        power[1:] *= 2.0  # of q_y and -q_y
        power[:, 1:] *= 2.0
        power[0, 0] = 0.0
        m, power, count = _by_wavenumber(doubled, power)
    else:
        m, power, count = radial_power(doubled, _reflected(grid, height, doubled))
    return 0.5 * m, power, count


def _reflected(grid: Grid, values: Field, doubled: Grid) -> Field:
    """Values at the points of a grid, reflected at its borders, on twice the grid."""
    rows = np.arange(*doubled.row_span)
    rows = np.minimum(rows, 2 * grid.points_y - 1 - rows)
    first = int(rows.min())
    values = grid.gather_rows(grid.as_rows(values), (first, int(rows.max()) + 1))[rows - first]
    return np.concatenate([values, values[:, ::-1]], axis=1).reshape(doubled.shape)


def _power(grid: Grid, modes: Modes) -> Field:
    """Sums of |h|^2 over the modes (+-q_x, +-q_y), zero for q = 0."""
    power = _opposite_rows_added(modes.reshape(grid.points_y, -1))
    power *= grid.multiplicity()
    power = grid.gather_columns(power)
    power[0, 0] = 0.0
    return power


def _occupied(power: Field) -> Mask:
    """Where power exceeds rounding errors."""
    return power > ROUNDING_POWER * power.max()


def _by_wavenumber(grid: Grid, power: Field) -> tuple[Field, Field, Field]:
    """See `radial_power`."""
    row, column = np.divmod(np.flatnonzero(_occupied(power)), power.shape[1])
    m_y = row * (grid.length / grid.length_y) if grid.dimension == 2 else row
    count = multiplicity(grid.points_y)[row] * multiplicity(grid.points)[column]
    return np.sqrt(m_y**2 + column**2), power[row, column] / float(grid.size) ** 2, count


def _opposite_rows_added(modes: Modes) -> Field:
    """Sums of |h|^2 over q_y and -q_y, for q_y >= 0."""
    count = len(modes)
    power = np.zeros((count // 2 + 1, modes.shape[1]))
    with_opposite, opposite = power[1 : (count + 1) // 2], modes[: count // 2 : -1]
    for rows in row_blocks(power):
        power[rows] += _squared(modes[: len(power)][rows])
        with_opposite[rows] += _squared(opposite[rows])
    return power


def _squared(modes: Modes) -> Field:
    return np.square(modes.real) + np.square(modes.imag)


def _directions(grid: Grid, modes: Modes) -> tuple[float, float]:
    """Anisotropy and share along x, from the tensor <grad h grad h> of the waves of the surface."""
    x = np.arange(*grid.span, dtype=np.float64)
    weight = grid.multiplicity()
    sums = np.zeros(3)
    for rows in row_blocks(modes, max(modes.size // 16, BLOCK_POINTS)):
        y = grid.mode_number_y(rows)[:, None]
        power = weight * np.abs(modes[rows]) ** 2
        mixed = x * y
        # the waves with the highest q_y of an even number of points have both signs of q_y
        mixed[2 * np.arange(grid.points_y)[rows] == grid.points_y] = 0.0
        sums += [float(np.sum(power * term)) for term in (x * x, y * y, mixed)]
    xx, yy, xy = grid.total(sums)
    middle, half = 0.5 * (xx + yy), sqrt((0.5 * (xx - yy)) ** 2 + xy**2)
    is_line = not middle - half > 1e-12 * middle
    anisotropy = inf if is_line else sqrt((middle + half) / (middle - half))
    return anisotropy, 0.5 * float(xx / middle) if middle > 0 else 1.0


def _concentration(grid: Grid, power: Field) -> float:
    """Number of waves over which the slopes would be spread, over that of those which have them.

    The slopes of copies are spread over fewer waves: over every m-th along each axis. The number of
    waves is (sum s)^2 / sum s^2, with the power s of the slope of a wave. It is compared with the
    number that the same power would have if it were the same for all waves of a half octave. Half
    octaves count from the root of the area of the cell, which a turned cell has, too.
    """
    m, power, count = _by_wavenumber(grid, power)
    m *= sqrt(grid.length_y / grid.length)
    slopes = power * m**2
    half_octave = np.rint(2 * np.log2(m)).astype(np.int64)
    first = int(half_octave.min())
    sums = np.bincount(half_octave - first, slopes)
    edges = 2.0 ** (0.5 * (np.arange(sums.size + 1) + first) - 0.25)
    waves = np.pi * np.diff(edges**2)
    return float(np.sum(slopes**2 / count) / np.sum(sums**2 / waves))


def _mirrors(grid: Grid, modes: Modes) -> int:
    """Number of axes along which a surface is its own mirror image.

    h(x, y) = h(2 a - x, y) if h(q_x, q_y) h(q_x, -q_y) has the phase -2 q_x a at all q_y: the
    absolute value of its sum over q_y is then the sum of the absolute values. Along y it is the sum
    over q_x of h(q_x, q_y) h(q_x, -q_y)*.
    """
    count = len(modes)
    waves, opposite = modes[1 : (count + 1) // 2], modes[: count // 2 : -1]
    along_x, along_y = np.zeros(modes.shape[1], modes.dtype), np.zeros(len(waves), modes.dtype)
    largest = 0.0
    for rows in row_blocks(waves):
        products = waves[rows] * opposite[rows]
        along_x += products.sum(axis=0)
        largest += float(np.abs(products).sum())
        along_y[rows] = (waves[rows] * opposite[rows].conj()).sum(axis=1)
    x, largest = grid.total(np.array([np.abs(along_x).sum(), largest]))
    y = np.abs(grid.total(along_y)).sum()
    return sum(bool(value >= (1 - ROUNDED) * largest > 0) for value in (x, y))


def _line_mirrors(grid: Grid, modes: Modes) -> int:
    """1 if a line is its own mirror image, h(x) = h(2 a - x); overwrites the modes.

    The integral of h(x) h(2 a - x), the transform of h(q)^2, is then that of h^2 at some a, which
    may lie between two points.
    """
    modes[0] = 0.0
    power = float(grid.multiplicity() @ _squared(modes))
    modes *= modes
    return int(highest_point(grid.field_of_work()) >= (1 - ROUNDED) * power > 0)


def _has_nyquist_waves(grid: Grid, modes: Modes) -> bool:
    """See `Texture`."""
    modes = grid.as_rows(modes)
    largest = grid.max(max(float(np.abs(modes[rows]).max()) for rows in row_blocks(modes)))
    along_x = modes[:, -1:] if grid.ends[1] else modes[:, :0]
    along_y = modes[len(modes) // 2] if len(modes) % 2 == 0 else modes[0, :0]
    highest = max(float(np.abs(waves).max(initial=0.0)) for waves in (along_x, along_y))
    return grid.max(highest) > sqrt(ROUNDING_POWER) * largest
