"""Power spectra and autocorrelations of fields, averaged over directions.

Spectra are binned as those of surfaces are in Persson theory, Mueser, "Elastic contacts of randomly
rough surfaces across the spatial dimensions", Sect. 4.1.1: exact shells at long waves, then
logarithmic bins; here over all waves of the grid, as displacement and stress have waves that the
surface lacks. By Parseval's theorem the shells of a field sum up to its variance.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gfmd_cli.physics.contact import radial_power
from gfmd_cli.physics.fields import Field, row_blocks
from gfmd_cli.physics.grid import Grid
from gfmd_cli.physics.persson import bin_edges

EXACT, BINS = 64, 500  # shells of one |q| each, and logarithmic bins beyond


@dataclass(frozen=True)
class Spectra:
    """Power of some fields in the same shells of rising wavenumber, arrays of shape (shells,)."""

    q: Field
    """Mean wavenumber of the waves of the shell [1/m]."""
    waves: Field
    """Number of waves q in the shell."""
    power: dict[str, Field]
    """Sum of |f(q)|^2 over the shell by the name of the field, in its units squared."""


def spectra(grid: Grid, fields: Mapping[str, Field]) -> Spectra:
    """Sum |f(q)|^2 over shells of all waves of the grid but q = 0."""
    point = np.zeros(grid.shape)
    point.flat[0] = grid.size  # every wave of a single point has |f(q)| = 1
    m, count, _ = radial_power(grid, point)
    edges = bin_edges(m.copy(), EXACT, BINS)

    def binned(at: Field, values: Field) -> Field:
        return np.asarray(np.bincount(np.searchsorted(edges, at), values, edges.size + 1), float)

    waves = binned(m, count)
    held = waves > 0
    powers = {name: binned(*radial_power(grid, f)[:2])[held] for name, f in fields.items()}
    q = binned(m, m * count)[held] / waves[held] * (2 * np.pi / grid.length)
    return Spectra(q, waves[held], powers)


def autocorrelations(grid: Grid, fields: Mapping[str, Field]) -> tuple[Field, dict[str, Field]]:
    """Autocorrelation C(r) / C(0), C(r) = <(f(x) - <f>)(f(x + r) - <f>)>, over rings of |r|.

    The rings are one grid spacing wide around 0, 1, ... spacings, up to L / 2. Returns the mean
    distance r in each [m] and the means of C(r) / C(0) by the name of the field (NaN for a field
    that is constant), all of shape (points / 2 + 1,).
    """
    distance = _distance(grid)
    ring = np.rint(distance).astype(np.int64).ravel()
    count = np.bincount(ring)

    def mean(values: Field) -> Field:
        return np.asarray((np.bincount(ring, values.ravel()) / count)[: grid.points // 2 + 1])

    means = {name: mean(correlation(grid, values)) for name, values in fields.items()}
    return mean(distance) * (grid.length / grid.points), means


def correlation(grid: Grid, field: Field) -> Field:
    """C(r) / C(0) at every displacement r of the grid, shape `grid.shape`.

    The transform of |f(q)|^2 (Wiener-Khinchin theorem), without q = 0, which is the mean.
    """
    modes = grid.forward_into_work(field)
    for rows in row_blocks(modes):
        modes[rows] *= modes[rows].conj()
    modes.flat[0] = 0.0
    found = grid.empty()
    grid.backward_into(found)
    variance = float(found.flat[0])
    return np.divide(found, variance if variance > 0 else np.nan, out=found)


def _distance(grid: Grid) -> Field:
    """Distance of every point from the first one, the shortest way round [grid spacings]."""
    along = np.minimum(np.arange(grid.points), grid.points - np.arange(grid.points))
    if grid.dimension == 1:
        return along.astype(np.float64)
    return np.asarray(np.hypot(along[:, None], along))
