"""Power spectra and autocorrelations of fields, averaged over directions, and their anisotropy.

The shells are those of Persson theory, Mueser, "Elastic contacts of randomly rough surfaces across
the spatial dimensions", Sect. 4.1.1: exact shells at long waves, then logarithmic bins. They
contain all waves of the grid, because displacement and stress have waves that the surface lacks.
By Parseval's theorem the sum over the shells of a field is its variance.
"""

from collections.abc import Mapping
from math import inf, sqrt

import numpy as np

from gfmd_cli.grid.arrays import BLOCK_POINTS, Field, row_blocks
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.maps.roughness_parameters import autocorrelation, distances
from gfmd_cli.physics.contact import ROUNDING_POWER, radial_power
from gfmd_cli.physics.free_contact import doubled_grid
from gfmd_cli.physics.persson import bin_edges


def spectra(grid: Grid, fields: Mapping[str, Field]) -> tuple[Field, Field, dict[str, Field]]:
    """Sum |f(q)|^2 over the shells of all waves of the grid except q = 0.

    Returns the mean wavenumber q of each shell [1/m], rising, its number of waves, and the sums
    [squared unit of the field] by name of the field, all of shape (shells,).
    """
    point = np.zeros(grid.shape)
    point.flat[0] = grid.size  # every wave of a single point has |f(q)| = 1
    m, count, _ = radial_power(grid, point)
    edges = bin_edges(m.copy())

    def binned(at: Field, values: Field) -> Field:
        return np.asarray(np.bincount(np.searchsorted(edges, at), values, edges.size + 1), float)

    waves = binned(m, count)
    occupied = waves > 0
    powers = {name: binned(*radial_power(grid, f)[:2])[occupied] for name, f in fields.items()}
    q = binned(m, m * count)[occupied] / waves[occupied] * (2 * np.pi / grid.length)
    return q, waves[occupied], powers


def autocorrelations(
    grid: Grid, fields: Mapping[str, Field], *, periodic: bool = True
) -> tuple[Field, dict[str, Field]]:
    """Autocorrelation C(r) / C(0), C(r) = <(f(x) - <f>)(f(x + r) - <f>)>, averaged over rings.

    The rings are one grid spacing wide, the wider of those along x and y, with radii of 0, 1, ...
    spacings up to half the shorter side. Returns the mean distance r of each ring [m] and the mean
    C(r) / C(0) by name of the field (NaN for a constant field), all of shape (rings,). Fields that
    are not periodic have the mean over the pairs of points of the grid at each displacement.
    """
    step = max(grid.spacings)
    cell = grid if periodic else doubled_grid(grid)
    distance = distances(cell.whole_shape, (spacing / step for spacing in cell.spacings))
    rings = int(0.5 * min(grid.sides) / step * (1 + 1e-12)) + 1
    ring = np.rint(distance).astype(np.int64).ravel()
    count = np.bincount(ring)

    def mean(values: Field) -> Field:
        return np.bincount(ring, values.ravel())[:rings] / count[:rings]

    def correlated(field: Field) -> Field:
        return correlation(grid, field) if periodic else autocorrelation(np.ma.asarray(field))

    means = {name: mean(correlated(values)) for name, values in fields.items()}
    return mean(distance) * step, means


def correlation(grid: Grid, field: Field) -> Field:
    """C(r) / C(0) at every displacement r of the grid, shape `grid.shape`.

    This is the transform of |f(q)|^2 without q = 0, by the Wiener-Khinchin theorem.
    """
    modes = grid.forward_into_work(field)
    for rows in row_blocks(modes):
        modes[rows] *= modes[rows].conj()
    modes.flat[0] = 0.0
    products = grid.empty()
    grid.backward_into(products)
    variance = float(products.flat[0])
    return np.divide(products, variance if variance > 0 else np.nan, out=products)


def anisotropy(grid: Grid, height: Field) -> float:
    """Ratio of the rms slopes along the principal axes: 1 if isotropic, infinite for a line.

    From the eigenvalues of the tensor <grad h grad h>, summed over the waves of the surface. The
    cost is one transform.
    """
    if grid.dimension == 1:
        return inf
    modes = grid.forward_into_work(height)
    x = np.arange(*grid.span, dtype=np.float64)
    weight = grid.multiplicity()
    sums = np.zeros(3)
    for rows in row_blocks(modes, max(modes.size // 16, BLOCK_POINTS)):
        y = grid.mode_number_y(rows)[:, None]
        power = weight * np.abs(modes[rows]) ** 2
        # the waves with the highest q_y of an even number of points have both signs of q_y
        mixed = np.where(np.abs(y) * grid.length_y < 0.5 * grid.points_y * grid.length, x * y, 0.0)
        sums += [float(np.sum(power * term)) for term in (x * x, y * y, mixed)]
    xx, yy, xy = grid.total(sums)
    middle, half = 0.5 * (xx + yy), sqrt((0.5 * (xx - yy)) ** 2 + xy**2)
    return sqrt((middle + half) / (middle - half)) if middle - half > 1e-12 * middle else inf


def repetitions(grid: Grid, height: Field) -> float:
    """How many copies of one patch a surface resembles: 1 if it is random, m^2 for m x m copies.

    The slopes of copies are spread over fewer waves: over every m-th along each axis. The number of
    waves is (sum s)^2 / sum s^2, with the power s of the slope of a wave. It is compared with the
    number that the same power would have if it were the same for all waves of a half octave. The
    cost is one transform.
    """
    m, power, count = radial_power(grid, height)
    slopes = power * m**2
    half_octave = np.rint(2 * np.log2(m)).astype(np.int64)
    first = int(half_octave.min())
    sums = np.bincount(half_octave - first, slopes)
    edges = 2.0 ** (0.5 * (np.arange(sums.size + 1) + first) - 0.25)
    waves = np.pi * np.diff(edges**2) * (grid.length_y / grid.length)
    return float(np.sum(slopes**2 / count) / np.sum(sums**2 / waves))


def has_nyquist_waves(grid: Grid, height: Field) -> bool:
    """Whether a field has waves of the Nyquist wavenumber of an axis, beyond rounding errors.

    A grid shows only their part that is even about its points: a finer grid has another field. The
    cost is one transform.
    """
    modes = grid.as_rows(grid.forward_into_work(height))
    largest = grid.max(max(float(np.abs(modes[rows]).max()) for rows in row_blocks(modes)))
    along_x = modes[:, -1:] if grid.ends[1] else modes[:, :0]
    along_y = modes[len(modes) // 2] if len(modes) % 2 == 0 else modes[0, :0]
    highest = max(float(np.abs(waves).max(initial=0.0)) for waves in (along_x, along_y))
    return grid.max(highest) > sqrt(ROUNDING_POWER) * largest
