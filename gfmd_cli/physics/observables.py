"""Observables of a solved contact, in reduced units."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gfmd_cli.grid.arrays import Field, Mask, row_blocks
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.indenters import RigidSurface

LINEAR_EDGES = np.linspace(0.0, 10.0, 201)
"""Edges of the linear bins of stresses [Delta_sigma] and gaps [h_std]: at the end a Gaussian of
unit width is below 1e-21."""
LOGARITHMIC_EDGES = np.logspace(-6.0, 4.0, 101)
"""Edges of the logarithmic bins [Delta_sigma, h_std]: ten per decade from 1e-6 to 1e4."""


def contact_points(height: Field, u: Field, sigma: Field) -> Mask:
    """Mask of the points in contact, where u = h and sigma > 0.

    `height` and `u` are in the same unit. `Contact.obstacle` as the height leaves out points that
    never touch. The stress alone does not suffice, because it is rounded.
    """
    points: Mask = u == height
    points &= sigma > 0
    return points


def contact_pressure(height: Field, u: Field, sigma: Field) -> Field:
    """The stress at the points in contact, and exactly zero at all others."""
    return np.where(contact_points(height, u, sigma), sigma, 0.0)


def contact_line(grid: Grid, mask: Mask, *, periodic: bool = True) -> float:
    """Contact line per area times the side along x; of a line contact, the number of edges."""
    counts = np.zeros(mask.ndim)
    next_row = grid.row_span[1] % grid.points_y
    for axis in range(mask.ndim):
        lines = np.moveaxis(mask, axis, 0)
        counts[axis] += np.count_nonzero(lines[1:] != lines[:-1])
        following = grid.gather_rows(mask, (next_row, next_row + 1)) if axis == 0 else lines[:1]
        continues = axis == 0 and grid.row_span[1] < grid.points_y
        if periodic or continues:
            counts[axis] += np.count_nonzero(lines[-1:] != following)
    # side that two points share over the area of the cell, times L
    edges = np.divide(grid.whole_shape, grid.size) * np.divide(grid.length, grid.sides)
    return float(grid.total(counts) @ edges)


def estimated_patches(perimeter: float, a_r: float, area: float) -> float:
    """Number of circles with this relative contact area and perimeter, as in `Observables`.

    The area of the cell is in units of L^2. A circle of radius r has 8 r switches along rows and
    columns, in units of the spacing.
    """
    return np.pi * area * perimeter**2 / (64 * a_r) if a_r > 0 else 0.0


def border_contact(grid: Grid, mask: Mask) -> float:
    """Fraction of the outermost points of a map that a mask contains."""
    first, last = grid.row_span
    inner_rows = slice(int(first == 0), len(mask) - int(last == grid.points_y))
    inside = mask[(inner_rows, slice(1, -1))[: mask.ndim]]
    counts = [np.count_nonzero(mask) - np.count_nonzero(inside), mask.size - inside.size]
    touching, outermost = grid.total(np.array(counts))
    return float(touching / outermost)


class MainObservable(NamedTuple):
    """An observable that has error estimates."""

    heading: str
    """Symbol in tables, over the reduced unit."""
    unit_column: str = ""
    """Column of the reduced unit in a study; empty for a pure number."""
    si_unit: str = ""
    """SI unit."""


MAIN_OBSERVABLES = {
    "a_r": MainObservable("a_r"),
    "sigma_p": MainObservable("sigma_p / Delta_sigma", "delta_sigma", "Pa"),
    "u_g": MainObservable("u_g / h_std", "h_std", "m"),
}
"""The observables that have error estimates, by their names."""


@dataclass(frozen=True)
class Observables:
    """Scalars of one contact."""

    a_r: float
    """Relative contact area: fraction of the grid points that carry load."""
    sigma_p: float
    """Standard deviation of the contact pressure over the whole interface [Delta_sigma]."""
    u_g: float
    """Mean gap [h_std]; where heights are unknown, with those that are filled in."""
    perimeter: float
    """Contact line per area times L, from the switches between neighbours, each as long as the
    side that two points share; for a line contact the number of contact edges."""
    energy: float
    """Elastic energy per area [h_std Delta_sigma]: v = <u K u> / 2; for a free boundary
    <sigma C sigma> / 2."""
    work: float
    """<sigma h> - p <u> [h_std Delta_sigma], equal to 2 v at the solution; for a free boundary the
    level c of the undeformed surface takes the place of <u>."""


def observe(contact: Contact, u: Field, sigma: Field) -> Observables:
    """Measure the scalars of a displacement and its stress [reduced units], shape `grid.shape`."""
    grid, touching = contact.grid, contact_points(contact.obstacle, u, sigma)
    sums = np.zeros(6)
    for rows in row_blocks(u):
        v, h = u[rows], contact.height[rows]
        elastic = sigma[rows] - contact.pressure  # first, as sigma - p cancels at large p
        deviation = np.where(touching[rows], elastic, -contact.pressure)
        terms = (v - h, deviation, deviation * deviation, v * elastic, sigma[rows] * h, v)
        sums += [float(term.sum()) for term in terms]
    gap, offset, square, twice_energy, lifted, mean = grid.total(sums) / grid.size
    level = contact.reference_level(u, sigma)
    twice_energy += contact.pressure * (mean - level)
    return Observables(
        a_r=int(grid.total(np.count_nonzero(touching))) / grid.size,
        sigma_p=float(np.sqrt(max(square - offset * offset, 0.0))),
        u_g=float(gap),
        perimeter=contact_line(grid, touching, periodic=contact.is_periodic),
        energy=0.5 * float(twice_energy),
        work=float(lifted - contact.pressure * level),
    )


def changed_fractions(
    surface: RigidSurface, contact: Contact, u: Field, sigma: Field
) -> dict[str, float]:
    """Fractions of the contact area and of the load where the heights are not those measured.

    Columns `edge_contact` and `edge_load` of the tapered zone, `filled_contact` and `filled_load`
    of heights that were filled in; none where the surface has no such points.
    """
    grid = contact.grid
    zones = surface.changed(grid, is_periodic=contact.is_periodic)
    fractions: dict[str, float] = {}
    load = contact_pressure(contact.obstacle, u, sigma) if zones else sigma
    for name, zone in zones.items():
        sums = [[np.count_nonzero(part), part.sum()] for part in (load[zone], load)]
        inside, whole = grid.total(np.array(sums))
        shares = np.divide(inside, whole, out=np.full(2, np.nan), where=whole > 0).tolist()
        fractions |= {f"{name}_contact": shares[0], f"{name}_load": shares[1]}
    return fractions


@dataclass(frozen=True)
class Histogram:
    """Distribution Pr(x) of x >= 0: zero + sum of density times width + beyond = 1.

    For the logarithmic bins the sum includes the fraction `below` them.
    """

    linear: Field
    """Density in the linear bins."""
    logarithmic: Field
    """Density in the logarithmic bins."""
    zero: float
    """Weight of the delta function at zero."""
    beyond: float
    """Fraction of points above the last linear bin."""
    below: float
    """Fraction of points above zero and below the first logarithmic bin."""


def geometric_middles(edges: Field) -> Field:
    """Geometric means of neighbouring edges, shape (edges - 1,)."""
    return np.sqrt(edges[1:] * edges[:-1])


def stress_histogram(contact: Contact, u: Field, sigma: Field) -> Histogram:
    """Histogram of the stress at the points in contact; zero elsewhere."""
    return _histogram(contact.grid, sigma[contact_points(contact.obstacle, u, sigma)], u.size)


def gap_histogram(contact: Contact, u: Field) -> Histogram:
    """Histogram of the gap where the height is known."""
    gap = u - contact.height
    if contact.may_touch is not None:
        gap = gap[contact.may_touch]
    return _histogram(contact.grid, gap[gap > 0], gap.size)


def _histogram(grid: Grid, positive: Field, points: int) -> Histogram:
    """Histogram of a field with these positive values among so many points, zero at the others."""
    size, count = int(grid.total(points)), int(grid.total(positive.size))
    linear, logarithmic = (
        grid.total(np.histogram(positive, edges)[0]) for edges in (LINEAR_EDGES, LOGARITHMIC_EDGES)
    )
    below = grid.total(np.count_nonzero(positive < LOGARITHMIC_EDGES[0]))
    return Histogram(
        linear=linear / (size * np.diff(LINEAR_EDGES)),
        logarithmic=logarithmic / (size * np.diff(LOGARITHMIC_EDGES)),
        zero=1.0 - count / size,
        beyond=float(count - linear.sum()) / size,
        below=int(below) / size,
    )
