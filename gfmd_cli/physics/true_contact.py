"""Delta_sigma taken over the contact, in the place of the whole surface, in Persson theory.

Mueser, "Elastic contacts of randomly rough surfaces across the spatial dimensions", Eq. (20) and
Sects. 4.1.2, 6, 7: a_r = erf(p / sqrt(2) Delta_sigma_c) (Sect. 6 prints no sqrt(2)). Two fields
have Delta_sigma as their rms over the whole surface, and part ways over the contact:

- s = K h, the stress of full contact without p. Contact prefers its peaks, so that its mean over
  the contact is no fluctuation: it is the standard deviation that counts.
- w, the waves of s a quarter of their length on, along q: Eq. (22) with the factor i that it
  prints. For n = 1, w = k_1 grad h, which is Eq. (20) to the letter.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import erf, erfinv

from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.fields import Field, Mask, row_blocks
from gfmd_cli.physics.grid import ALL, Grid

BINS = 1 << 14  # of height: 1e-3 h_std and less
FEW = 10  # points; fewer have no standard deviation worth the name


@dataclass(frozen=True)
class ContactStress:
    """What the stress of full contact is like over the true contact [Delta_sigma]."""

    deviation: float
    """Standard deviation of s = K h; NaN without contact."""
    quadrature: float
    """Root mean square of w; NaN without contact."""


def contact_stress(contact: Contact, touching: Mask) -> ContactStress:
    """Take both measures over the points of contact, shape of the grid."""
    if not np.any(touching):
        return ContactStress(np.nan, np.nan)
    field = contact.grid.empty()
    contact.elasticity(contact.height, field)
    deviation = float(field[touching].std())
    square = sum(float(np.sum(w[touching] ** 2)) for w in _quadratures(contact, field))
    return ContactStress(deviation, float(np.sqrt(square / np.count_nonzero(touching))))


def _quadratures(contact: Contact, out: Field) -> Iterator[Field]:
    """The components of w, one after another, each written to `out`."""
    grid = contact.grid
    for axis in range(grid.dimension):
        modes = grid.forward_into_work(contact.height)
        for rows in row_blocks(modes):
            modes[rows] *= 1j / grid.size * contact.stiffness[rows] * direction(grid, axis, rows)
        grid.backward_into(out)
        yield out


def direction(grid: Grid, axis: int, rows: slice = ALL) -> Field:
    """Component of q / |q| along an axis for rows of `grid.spectral_shape`; zero at q = 0.

    Zero also where the component is that of the highest wave of the grid, whose sign is not known.
    """
    half = grid.points // 2
    along = np.arange(half + 1, dtype=np.float64)
    if grid.dimension == 2:
        across = np.fft.fftfreq(grid.points, 1 / grid.points)[rows, None]
        component = np.broadcast_to((across, along)[axis], (len(across), half + 1))
    else:
        component = along[rows]
    part = np.where(np.abs(component) < half, component, 0.0)
    return np.asarray(part / np.maximum(grid.mode_number(rows), 1.0))


@dataclass(frozen=True)
class Bearing:
    """The deviation of s over the highest points of the indenter, over rising shares of them."""

    area: Field
    """Share of the points that are high enough, rising."""
    deviation: Field
    """Standard deviation of s over them [Delta_sigma]."""

    def delta_sigma_c(self, p_star: Field | float) -> Field:
        """The Delta_sigma_c [Delta_sigma] that goes with its own a_r. Paper Sect. 7.

        A share a carries p = sqrt(2) Delta_sigma_c(a) erfinv(a). Where that is no rising function
        the least share counts; beyond its ends Delta_sigma_c stays what it is there.
        """
        p = np.sqrt(2) * self.deviation * erfinv(self.area)
        rises = p > np.maximum.accumulate(np.append(0.0, p))[:-1]
        return np.asarray(np.interp(np.log(p_star), np.log(p[rises]), self.deviation[rises]))

    def contact_area(self, p_star: Field | float) -> Field:
        """Relative contact area with its own Delta_sigma_c. Paper Sect. 7."""
        return contact_area(self.delta_sigma_c(p_star), p_star)


def contact_area(delta_sigma_c: Field | float, p_star: Field | float) -> Field:
    """Relative contact area erf(p / sqrt(2) Delta_sigma_c).

    Paper Sect. 6 (printed without sqrt(2)); both arguments in units of Delta_sigma.
    """
    with np.errstate(divide="ignore"):
        return np.asarray(erf(np.divide(p_star, np.sqrt(2) * np.asarray(delta_sigma_c))))


def bearing(contact: Contact) -> Bearing:
    """Sort the points of the indenter by height, in fine bins."""
    height = contact.height
    stress = contact.elasticity(contact.height, contact.grid.empty())
    low, high = float(height.min()), float(height.max())
    sums = np.zeros((3, BINS))
    for rows in row_blocks(height):
        depth = (high - height[rows]) * ((BINS - 1) / (high - low))
        where, values = depth.astype(np.int64).ravel(), stress[rows].ravel()
        for total, weight in zip(sums, (np.ones_like(values), values, values**2), strict=True):
            total += np.bincount(where, weight, minlength=BINS)
    count, total, square = np.cumsum(sums, axis=1)
    kept = (count >= FEW) & (count < height.size) & (sums[0] > 0)
    mean = total[kept] / count[kept]
    variance = np.maximum(square[kept] / count[kept] - mean**2, 0.0)
    known = variance > 0
    return Bearing((count[kept] / height.size)[known], np.sqrt(variance[known]))
