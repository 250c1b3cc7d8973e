"""Delta_sigma over the true contact instead of the whole surface, for Persson theory.

Mueser, "Elastic contacts of randomly rough surfaces across the spatial dimensions", Eq. (20) and
Sects. 4.1.2, 6, 7: a_r = erf(p / sqrt(2) Delta_sigma_c) (Sect. 6 prints no sqrt(2)). Two fields
have the rms value Delta_sigma over the whole surface, but different values over the contact:

- sigma_h = K h, the stress of full contact without p. Contact is more likely at its maxima, so its
  mean over the contact is not zero, and its standard deviation is used.
- Its quadrature i (q / |q|) sigma_h(q), a vector along q: Eq. (22) with its factor i. Each wave is
  shifted by a quarter of a wavelength. For n = 1 it is k_1 grad h, as in Eq. (20).
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import erf, erfinv

from gfmd_cli.grid.arrays import Field, Mask, row_blocks
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.contact import Contact

HEIGHT_BINS = 1 << 14  # of height, of width 1e-3 h_std or less for heights within +-8 h_std
BIN_ROUNDING = 1e-6
"""Of a bin, by which equal heights may differ by rounding, so that one bin has them all; a choice.
At a depth of all bins, rounding is 1e-12 of them."""
MIN_POINTS = 10  # for a standard deviation; a choice
ROUNDING = 1e-10  # Delta_sigma; a smaller deviation of sigma_h is rounding


@dataclass(frozen=True)
class ContactStress:
    """Moments of the stress of full contact over the true contact [Delta_sigma]."""

    deviation: float
    """Standard deviation of sigma_h = K h; NaN with fewer than `MIN_POINTS` points in contact."""
    quadrature: float
    """Root mean square of its quadrature; NaN without contact."""


def contact_stress(contact: Contact, touching: Mask, copies: int = 1) -> ContactStress:
    """Compute both moments over the points in contact.

    Parameters
    ----------
    touching : points in contact, shape `grid.shape`
    copies : of each point of the map in a mirrored contact; for `MIN_POINTS` they count once
    """
    if not np.any(touching):
        return ContactStress(np.nan, np.nan)
    grid, square = contact.grid, 0.0
    field = contact.apply_stiffness(contact.height, grid.empty())
    known = np.count_nonzero(touching) >= MIN_POINTS * copies
    deviation = float(field[touching].std()) if known else np.nan
    for axis in range(grid.dimension):  # the components of the quadrature
        modes = grid.forward_into_work(contact.height)
        for rows in row_blocks(modes):
            modes[rows] *= 1j / grid.size * contact.stiffness[rows] * direction(grid, axis, rows)
        field = grid.field_of_work()
        square += float(np.sum(field[touching] ** 2))
    return ContactStress(deviation, float(np.sqrt(square / np.count_nonzero(touching))))


def direction(grid: Grid, axis: int, rows: slice) -> Field:
    """Component of q / |q| along an axis for rows of `grid.spectral_shape`; zero at q = 0.

    Also zero where the component is the highest wavenumber of the grid, which has no sign.
    """
    x = np.arange(*grid.span)
    y = np.fft.fftfreq(grid.points_y, 1 / grid.points_y)[rows, None]
    wave = x[rows] if grid.dimension == 1 else (y, x)[axis]
    points, side = grid.whole_shape[axis], grid.sides[axis]
    q = grid.wavenumber(rows)
    component = np.where(2 * np.abs(wave) < points, wave * (2 * np.pi / side), 0.0)
    return np.divide(component, q, out=np.zeros_like(q), where=q > 0)


@dataclass(frozen=True)
class Bearing:
    """Standard deviation of sigma_h over the highest points, as a function of their fraction."""

    area: Field
    """Fraction of the points that are above a height, increasing."""
    deviation: Field
    """Standard deviation of sigma_h over these points [Delta_sigma]."""

    def delta_sigma_c(self, p_star: Field | float) -> Field:
        """Delta_sigma_c [Delta_sigma] that is consistent with its contact area. Paper Sect. 7.

        The pressure for a fraction a is p = sqrt(2) Delta_sigma_c(a) erfinv(a). Where p(a) does not
        increase, the smallest fraction is used; beyond its ends, Delta_sigma_c is constant. NaN if
        p(a) increases nowhere.
        """
        p = np.sqrt(2) * self.deviation * erfinv(self.area)
        rises = p > np.maximum.accumulate(np.append(0.0, p))[:-1]
        if not rises.any():
            return np.full(np.shape(p_star), np.nan)
        return np.interp(np.log(p_star), np.log(p[rises]), self.deviation[rises])


def contact_area(delta_sigma_c: Field | float, p_star: Field | float) -> Field:
    """Relative contact area erf(p / sqrt(2) Delta_sigma_c).

    Paper Sect. 6 (printed without sqrt(2)); both arguments in units of Delta_sigma.
    """
    with np.errstate(divide="ignore"):
        return erf(np.divide(p_star, np.sqrt(2) * np.asarray(delta_sigma_c)))


def bearing(contact: Contact) -> Bearing:
    """Compute the bearing of an indenter from its points, sorted by height in fine bins.

    Fractions over which sigma_h is constant, as under a flat punch on springs, are left out.
    """
    height = contact.height
    stress = contact.apply_stiffness(contact.height, contact.grid.empty())
    stress -= stress.flat[height.argmax()]  # so that a flat top has no stress
    low, high = float(height.min()), float(height.max())
    sums = np.zeros((3, HEIGHT_BINS))
    for rows in row_blocks(height):
        depth = (high - height[rows]) * ((HEIGHT_BINS - 1) / (high - low)) + BIN_ROUNDING
        bin_number, values = depth.astype(np.int64).ravel(), stress[rows].ravel()
        for total, weight in zip(sums, (np.ones_like(values), values, values**2), strict=True):
            total += np.bincount(bin_number, weight, minlength=HEIGHT_BINS)
    count, total, square = np.cumsum(sums, axis=1)
    usable = (count >= MIN_POINTS) & (count < height.size) & (sums[0] > 0)
    mean = total[usable] / count[usable]
    variance = np.maximum(square[usable] / count[usable] - mean**2, 0.0)
    known = variance > ROUNDING**2
    return Bearing((count[usable] / height.size)[known], np.sqrt(variance[known]))
