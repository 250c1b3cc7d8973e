"""What is measured on a solved contact, in reduced units."""

from dataclasses import dataclass

import numpy as np

from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.fields import Field, Mask, row_blocks
from gfmd_cli.physics.grid import Grid


def contact_points(contact: Contact, u: Field, sigma: Field) -> Mask:
    """Points that carry load: on the indenter and pressed against it."""
    points: Mask = u == contact.height
    points &= sigma > 0
    return points


def switches(grid: Grid, mask: Mask) -> int:
    """Changes between contact and non-contact of neighbours along all axes, periodic."""
    count = 0
    for axis in range(mask.ndim):
        lines = np.moveaxis(mask, axis, 0)
        below = grid.below(lines) if axis == 0 else lines[0]
        count += int(np.count_nonzero(lines[1:] != lines[:-1]))
        count += int(np.count_nonzero(lines[-1] != below))
    return int(grid.total(count))


QUANTITIES = ("a_r", "sigma_p", "u_g")
"""The observables that errors are told of, by name."""


@dataclass(frozen=True)
class Observables:
    """Scalars of one contact."""

    a_r: float
    """Relative contact area: share of the grid points that carry load."""
    sigma_p: float
    """Standard deviation of the stress over the whole interface [Delta_sigma]."""
    u_g: float
    """Mean gap [h_std]."""
    perimeter: float
    """Contact line per area times L: spacing times the switches along rows and columns / L; for
    a line scene the number of contact edges."""
    energy: float
    """Elastic energy per area v = <u K u> / 2 [h_std Delta_sigma]."""
    work: float
    """<sigma h> - p <u> [h_std Delta_sigma], equal to 2 v at the solution."""


def observe(contact: Contact, u: Field, sigma: Field) -> Observables:
    """Measure the scalars on a displacement and its stress sigma = K u + p."""
    grid, touching = contact.grid, contact_points(contact, u, sigma)
    sums = np.zeros(5)
    for rows in row_blocks(u):
        v, h = u[rows], contact.height[rows]
        elastic = sigma[rows] - contact.pressure
        terms = (v - h, elastic * elastic, v * elastic, sigma[rows] * h, v)
        sums += [float(term.sum()) for term in terms]
    gap, variance, twice_energy, lifted, mean = grid.total(sums) / grid.size
    return Observables(
        a_r=int(grid.total(np.count_nonzero(touching))) / grid.size,
        sigma_p=float(np.sqrt(variance)),
        u_g=float(gap),
        perimeter=switches(grid, touching) / grid.points ** (grid.dimension - 1),
        energy=0.5 * float(twice_energy),
        work=float(lifted - contact.pressure * mean),
    )


@dataclass(frozen=True)
class Distribution:
    """Pr(x) of x >= 0 in its unit: zero weight + sum of density times width + beyond = 1.

    In logarithmic bins the share `below` them adds to that.
    """

    linear: Field
    """Density in the linear bins."""
    logarithmic: Field
    """Density in the logarithmic bins."""
    zero: float
    """Weight of the delta function at zero."""
    beyond: float
    """Share of points above the last linear bin."""
    below: float
    """Share of points above zero and below the first logarithmic bin."""


def linear_edges() -> Field:
    """Edges of the linear bins of stresses [Delta_sigma] and gaps [h_std].

    Of width 0.05 up to 10, where a Gauss tail has ended.
    """
    return np.linspace(0.0, 10.0, 201)


def logarithmic_edges() -> Field:
    """Edges of the logarithmic bins [Delta_sigma, h_std]: ten a decade from 1e-6 to 1e4."""
    return np.logspace(-6.0, 4.0, 101)


def logarithmic_middles() -> Field:
    """Geometric middles of the logarithmic bins."""
    return geometric_middles(logarithmic_edges())


def geometric_middles(edges: Field) -> Field:
    """Geometric middles of bins, one fewer than edges."""
    return np.asarray(np.sqrt(edges[1:] * edges[:-1]))


def stress_distribution(contact: Contact, u: Field, sigma: Field) -> Distribution:
    """Histogram of the stress over the points that carry load, as densities over sigma."""
    return _distribution(contact.grid, sigma[contact_points(contact, u, sigma)])


def gap_distribution(contact: Contact, u: Field) -> Distribution:
    """Histogram of the gap over the points off the indenter, as densities over g."""
    gap = u - contact.height
    return _distribution(contact.grid, gap[gap > 0])


def _distribution(grid: Grid, positive: Field) -> Distribution:
    """Densities over the values of the points where they are positive; elsewhere they are zero."""
    size, count = grid.size, int(grid.total(positive.size))
    linear, logarithmic = (
        grid.total(np.histogram(positive, edges())[0])
        for edges in (linear_edges, logarithmic_edges)
    )
    below = grid.total(np.count_nonzero(positive < logarithmic_edges()[0]))
    return Distribution(
        linear=linear / (size * np.diff(linear_edges())),
        logarithmic=logarithmic / (size * np.diff(logarithmic_edges())),
        zero=1.0 - count / size,
        beyond=float(count - linear.sum()) / size,
        below=int(below) / size,
    )
