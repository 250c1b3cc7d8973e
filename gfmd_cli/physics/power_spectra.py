"""Power spectra and autocorrelations of fields, averaged over directions.

The shells are those of Persson theory, Mueser, "Elastic contacts of randomly rough surfaces across
the spatial dimensions", Sect. 4.1.1: exact shells at long waves, then logarithmic bins. They
contain all waves of the grid, because displacement and stress have waves that the surface lacks.
By Parseval's theorem the sum over the shells of a field is its variance.
"""

from collections.abc import Mapping

import numpy as np

from gfmd_cli.grid.arrays import Field, row_blocks
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.maps.roughness_parameters import autocorrelation, distances
from gfmd_cli.physics.persson import bin_edges
from gfmd_cli.physics.waves import radial_power

ROUNDING = 1e-9  # of distances, in spacings


def spectra(grid: Grid, fields: Mapping[str, Field]) -> tuple[Field, Field, dict[str, Field]]:
    """Sum |f(q)|^2 over the shells of all waves of the grid except q = 0.

    Returns the mean wavenumber q of each shell [1/m], rising, its number of waves, and the sums
    [squared unit of the field] by name of the field, all of shape (shells,).
    """
    point = np.zeros(grid.shape)
    point.flat[0] = grid.size  # every wave of a single point has |f(q)| = 1
    m, count, _ = radial_power(grid, point)
    edges = bin_edges(m)

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
    spacings up to half the shorter side. A displacement half-way between two rings belongs to the
    outer one, so that with pixels of 2:1 the first ring contains the displacement 0 alone. Returns
    the mean distance r of each ring [m] and the mean C(r) / C(0) by name of the field (NaN for a
    constant field), all of shape (rings,). Fields that are not periodic have the mean over the
    pairs of points of the grid at each displacement.
    """
    step = max(grid.spacings)
    cell = grid if periodic else grid.doubled()
    distance = distances(cell.whole_shape, (spacing / step for spacing in cell.spacings))
    rings = int(0.5 * min(grid.sides) / step + ROUNDING) + 1
    ring = (distance + 0.5 + ROUNDING).astype(np.int64).ravel()  # half rounds up
    count = np.bincount(ring)

    def mean(values: Field) -> Field:
        return np.bincount(ring, values.ravel())[:rings] / count[:rings]

    def correlated(field: Field) -> Field:
        return correlation(grid, field) if periodic else autocorrelation(np.ma.asarray(field))

    means = {name: mean(correlated(values)) for name, values in fields.items()}
    return mean(distance) * step, means


def correlation(grid: Grid, field: Field) -> Field:
    """C(r) / C(0) at every displacement r of the grid, shape `grid.shape`; NaN if f is constant.

    This is the transform of |f(q)|^2 without q = 0, by the Wiener-Khinchin theorem.
    """
    modes = grid.forward_into_work(field)
    for rows in row_blocks(modes):
        modes[rows] *= modes[rows].conj()
    modes.flat[0] = 0.0
    products = grid.field_of_work()
    is_constant = np.ptp(field) == 0  # but for rounding its variance is zero
    return np.divide(products, np.nan if is_constant else products.flat[0], out=products)
