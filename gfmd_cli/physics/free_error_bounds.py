"""Proven bounds of the errors on a grid with a free boundary: the dual form of `error_bounds`.

The contact minimises E(s) = <s C s> / 2 - <s h> over stresses s >= 0 with the mean p, where means
are over the map. Let s* be the solution, d = s - s*, and g = C s - h - min(C s - h), the gap at the
level at which the bodies just touch. E is quadratic with the gradient C s - h, and <d> = 0, so

    E(s) - E(s*) = <g d> - <d C d> / 2 <= <s g> = G,      <d C d> <= <g d> <= G,

because <d C d> / 2 <= E(s) - E(s*) at a minimum. C is a principal submatrix of the circulant matrix
of the kernel reflected about the borders of its array, so that its eigenvalues are not below the
smallest of that matrix, l, and <d^2> <= G / l. The gap of the solution is C s* + c* - h with

    | <C s> - <C s*> | <= sqrt(<1 C 1> G)

by the inequality of Cauchy and Schwarz. The minimum E(p) is convex in p with slope -c*, and s q / p
is admissible at any other pressure q; the best q gives, with A = <s C s>,

    | c* - (<s h> - A) / p | <= sqrt(2 A G) / p.
"""

from collections.abc import Callable
from math import nan, sqrt

import numpy as np

from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.error_bounds import Certificate, certify, uncertain_share
from gfmd_cli.physics.free_contact import FreeContact
from gfmd_cli.physics.observables import contact_pressure


def certify_free(contact: FreeContact, u: Field, sigma: Field) -> Certificate:
    """Bound the errors of a displacement u and a stress sigma of a contact with a free boundary.

    The cost is three transforms of twice the points a side. The bound of sigma_p is NaN where no
    positive lower limit of the compliance is known.
    """
    grid, p, h, free = contact.grid, contact.pressure, contact.height, contact.free

    def mean(values: Field) -> float:
        return grid.total(float(values.sum())) / grid.size

    s = contact.clear_untouchable(np.maximum(sigma, 0.0))
    s *= p / mean(s)
    gap = free.displacement(s, out=grid.empty())
    energy, lifted, deflection = mean(s * gap), mean(s * h), mean(gap)
    gap -= h
    touchable = gap if contact.may_touch is None else gap[contact.may_touch]
    lowest = -grid.max(-float(touchable.min(initial=np.inf)))
    duality_gap = mean(s * (gap - lowest))
    centre = deflection + (lifted - energy) / p - mean(h)
    share = min(sqrt(2 * duality_gap / energy), 1.0) if energy > 0 else 1.0
    spread = duality_gap / share if share > 0 else 0.0
    mean_compliance = mean(free.displacement(np.ones_like(s), out=gap))
    smallest = free.smallest_compliance
    omitted = sqrt(mean((contact_pressure(contact.obstacle, u, sigma) - s) ** 2))
    violation = np.minimum(u - contact.obstacle, sigma)
    return Certificate(
        gap=duality_gap,
        u_g=abs(mean(u - h) - centre)
        + sqrt(mean_compliance * duality_gap)
        + (0.5 * share * energy + spread) / p,
        sigma_p=sqrt(duality_gap / smallest) + omitted if smallest > 0 else nan,
        a_r=uncertain_share(contact, u, sigma, mean(violation**2)),
    )


CERTIFY: dict[str, Callable[..., Certificate]] = {"periodic": certify, "free": certify_free}
"""How a solution is certified, by the boundary of the contact."""
