"""Proven bounds of the distance between an approximate and the exact solution on a grid.

The exact solution on the grid is u*, sigma*. For any stress s >= 0 with <s> = p, the energy of a
periodic contact lies between -E(s), with

    E(s) = <(s - p) K^-1 (s - p)> / 2 - <s h>,

and J(u) = <u K u> / 2 + p <u> of any u >= h. With s the compressive part of sigma = K u + p, scaled
to the mean p, and e = sigma - s, the duality gap is

    eta = J(u) + E(s) = <s g> + <e K^-1 e> / 2,

free of cancellation. J is quadratic with the operator K, so <(u - u*) K (u - u*)> <= 2 eta, from
which <(sigma - sigma*)^2> <= 2 eta k_max. The contact pressure is sigma at the points in contact
and zero elsewhere; the rms of the difference is added. The minimum of J is a concave function of p
with slope <u*>, and s p'/p is admissible at any other pressure p'; the best p' gives

    | <u*> - (<s h> - B) / p | <= sqrt(2 eta B) / p,   B = <(s - p) K^-1 (s - p)>.

With a free boundary the contact minimises E(s) = <s C s> / 2 - <s h> over stresses s >= 0 with the
mean p, where means are over the map. Let s* be the solution, d = s - s*, and
g = C s - h - min(C s - h), the gap at the level of first touch. E is quadratic with
the gradient C s - h, and <d> = 0, so

    E(s) - E(s*) = <g d> - <d C d> / 2 <= <s g> = eta,      <d C d> <= <g d> <= eta,

because <d C d> / 2 <= E(s) - E(s*) at a minimum. C is a principal submatrix of the circulant matrix
of the kernel reflected about the borders of its array, so that its eigenvalues are not below the
smallest of that matrix, C_min, and <d^2> <= eta / C_min. The gap of the solution is C s* + c* - h
with

    | <C s> - <C s*> | <= sqrt(<1 C 1> eta)

by the inequality of Cauchy and Schwarz. The minimum of E is a convex function of p with slope -c*,
and s p'/p is admissible at any other pressure p'; the best p' gives, with A = <s C s>,

    | c* - (<s h> - A) / p | <= sqrt(2 A eta) / p.
"""

from dataclasses import dataclass
from functools import singledispatch
from math import nan, sqrt

import numpy as np

from gfmd_cli.grid.arrays import Field, row_blocks
from gfmd_cli.physics.contact import UNCERTAINTY_FACTOR, Contact
from gfmd_cli.physics.free_contact import FreeContact
from gfmd_cli.physics.observables import Observables, contact_pressure

ALGEBRAIC = 2.0
"""Largest measured error of u_g or sigma_p, x, on its grid, over the natural residual times the
largest of x, sqrt(x) and sqrt(f) / 2, with the fraction f of points that are not in contact or
uncertain, which matters next to full contact: n = 0.5 to 4, slabs, p* = 0.003 to 3."""


@dataclass(frozen=True)
class ErrorBounds:
    """Bounds of the errors of an approximate solution on its grid, in reduced units."""

    duality_gap: float
    """Duality gap eta [h_std Delta_sigma]."""
    u_g: float
    """Upper bound of the error of the mean gap [h_std]."""
    sigma_p: float
    """Upper bound of the error of the deviation of the contact pressure [Delta_sigma]."""
    a_r: float
    """Fraction of the points whose contact state is uncertain: an estimate, not a bound."""

    def estimated_error(self, name: str, observables: Observables, residual: float) -> float:
        """Estimated error of an observable on its grid, from stopping at a natural residual.

        See `ALGEBRAIC`. That of a_r is the uncertain fraction.
        """
        if name == "a_r":
            return self.a_r
        value = abs(float(getattr(observables, name)))  # u_g may be < 0 where voids are filled in
        open_fraction = max(1.0 - observables.a_r, 0.0) + self.a_r
        return ALGEBRAIC * residual * max(value, sqrt(value), 0.5 * sqrt(open_fraction))


@singledispatch
def error_bounds(contact: Contact, u: Field, sigma: Field) -> ErrorBounds:
    """Bound the errors of a solution: of a periodic contact, u >= h with sigma = K u + p.

    `u` and `sigma` are in reduced units, of shape `grid.shape`. The cost is one transform.
    """
    grid, p = contact.grid, contact.pressure
    obstacle = contact.obstacle

    def compressive(rows: slice) -> Field:
        return contact.clear_untouchable(np.maximum(sigma[rows], 0.0), rows)

    loaded = grid.total(sum(float(compressive(rows).sum()) for rows in row_blocks(u)))
    scale = p * grid.size / loaded
    stress_difference = grid.padded[..., : grid.points]
    sums = np.zeros(7)
    for rows in row_blocks(u):
        v, h = u[rows], contact.height[rows]
        s = scale * compressive(rows)
        e = sigma[rows] - s
        stress_difference[rows] = e
        g = v - h
        violation = np.minimum(v - obstacle[rows], sigma[rows])
        left_out = sigma[rows] - contact_pressure(obstacle[rows], v, sigma[rows])
        terms = (s * g, s * h, v * (sigma[rows] - p), v * e, violation**2, v, left_out**2)
        sums += [float(term.sum()) for term in terms]
    s_gap, s_height, twice_energy, u_e, violated, mean, omitted = grid.total(sums) / grid.size
    remainder = _compliance(contact)
    duality_gap = max(s_gap + 0.5 * remainder, 0.0)
    reaction = max(twice_energy - 2 * u_e + remainder, 0.0)  # B, as s - p = K u - e
    centre = (s_height - reaction) / p
    return ErrorBounds(
        duality_gap=duality_gap,
        u_g=abs(mean - centre) + _level_bound(duality_gap, reaction, p),
        sigma_p=sqrt(2 * duality_gap * contact.largest_stiffness) + sqrt(omitted),
        a_r=_uncertain_fraction(contact, u, sigma, violated),
    )


@error_bounds.register
def _of_free_contact(contact: FreeContact, u: Field, sigma: Field) -> ErrorBounds:
    """Bound the errors of a displacement u and a stress sigma of a contact with a free boundary.

    The cost is three transforms of twice the points a side. The bound of sigma_p is NaN where no
    positive lower limit of the compliance is known.
    """
    grid, p, h, compliance = contact.grid, contact.pressure, contact.height, contact.compliance
    mean = grid.mean
    s = contact.clear_untouchable(np.maximum(sigma, 0.0))
    s *= p / mean(s)
    gap = compliance.displacement(s, out=grid.empty())
    energy, lifted, deflection = mean(s * gap), mean(s * h), mean(gap)
    gap -= h
    touchable = gap if contact.may_touch is None else gap[contact.may_touch]
    lowest = grid.min(float(touchable.min(initial=np.inf)))
    duality_gap = mean(s * (gap - lowest))
    centre = deflection + (lifted - energy) / p - mean(h)
    gap -= mean(gap[s > 0])  # that of u is exactly zero in contact, and nowhere negative
    violation = contact.clear_untouchable(np.minimum(gap, s))
    limit = UNCERTAINTY_FACTOR * sqrt(mean(violation**2))
    uncertain = contact.clear_untouchable(np.where(s > 0, s, gap) < limit)
    mean_compliance = mean(compliance.displacement(np.ones_like(s), out=gap))
    smallest = compliance.smallest_compliance
    omitted = sqrt(mean((contact_pressure(contact.obstacle, u, sigma) - s) ** 2))
    return ErrorBounds(
        duality_gap=duality_gap,
        u_g=abs(mean(u - h) - centre)
        + sqrt(mean_compliance * duality_gap)
        + _level_bound(duality_gap, energy, p),
        sigma_p=sqrt(duality_gap / smallest) + omitted if smallest > 0 else nan,
        a_r=mean(uncertain),
    )


def full_contact_errors(
    contact: Contact, sigma: Field, bend: float, stiffness: float, sigma_p: float
) -> dict[str, float]:
    """Errors in full contact, where the stress can be tensile between the points of the grid.

    Around a minimum of a Gaussian stress the curvature along an axis is on average p <q_i^2>, so
    that between points of spacings d_i the stress is lower by up to m = p sum <q_i^2> d_i^2 / 8.
    Points with sigma < m may lose contact. The errors are their fraction, their mean deficit
    m - sigma over the stiffness of the shortest wave, and the change of the variance, as the change
    of sigma_p.

    Parameters
    ----------
    bend : sum of <q_i^2> d_i^2 over the axes, the means weighted with the variance of the stress
    stiffness : k(q) of the shortest wave along an axis, in reduced units
    """
    grid = contact.grid
    margin = contact.pressure * bend / 8
    sums = np.zeros(3)
    for rows in row_blocks(sigma):
        deficit = np.maximum(margin - sigma[rows], 0.0)
        sums += [np.count_nonzero(deficit), deficit.sum(), np.square(deficit).sum()]
    fraction, mean, square = grid.total(sums) / grid.size
    of_deviation = 0.5 * square / sigma_p if square > 0 else 0.0  # both vanish on a thin slab
    errors = {"a_r": fraction, "sigma_p": of_deviation, "u_g": mean / stiffness}
    return {name: float(error) for name, error in errors.items()}


def _level_bound(duality_gap: float, reaction: float, p: float) -> float:
    """(r B / 2 + eta / r) / p at r = |p' - p| / p = sqrt(2 eta / B), where it is sqrt(2 eta B) / p.

    With r at most 1, as p' >= 0. With a free boundary A takes the place of B.
    """
    r = min(sqrt(2 * duality_gap / reaction), 1.0) if reaction > 0 else 1.0
    return (0.5 * r * reaction + (duality_gap / r if r > 0 else 0.0)) / p


def _uncertain_fraction(contact: Contact, u: Field, sigma: Field, violated: float) -> float:
    """Fraction of the points with a gap and a stress below the error of both.

    The error is `UNCERTAINTY_FACTOR` times the rms of min(g, sigma); `violated` is the mean of
    min(g, sigma)^2. Points with such a gap count at any compressive stress: they should touch, but
    do not.
    """
    error, count = UNCERTAINTY_FACTOR * sqrt(violated), 0
    for rows in row_blocks(u):
        gap, stress = u[rows] - contact.obstacle[rows], sigma[rows]
        uncertain = (gap < error) & (stress > -error) & ((gap > 0) | (stress < error))
        count += int(np.count_nonzero(uncertain))
    return contact.grid.total(count) / contact.grid.size


def _compliance(contact: Contact) -> float:
    """<e K^-1 e> of the field in `padded`, which has no mean."""
    grid, k = contact.grid, contact.stiffness
    grid.transform()
    total, count = 0.0, grid.multiplicity()
    for rows in row_blocks(grid.work):
        stiffness = k[rows].copy()
        stiffness[stiffness == 0.0] = np.inf  # q = 0
        weight = count if grid.dimension == 2 else count[rows]
        total += float(np.sum(weight * np.abs(grid.work[rows]) ** 2 / stiffness))
    return grid.total(total) / float(grid.size) ** 2
