"""How far an approximate solution is from the exact one on the same grid: proven bounds.

For any stress s >= 0 with <s> = p, the energy of the contact lies between the dual value

    D(s) = <s h> - <(s - p) K^-1 (s - p)> / 2

and J(u) = <u K u> / 2 + p <u> of any u >= h. With s the compressive part of sigma = K u + p, scaled
to the mean p, and e = sigma - s, the duality gap is

    G = J(u) - D(s) = <s g> + <e K^-1 e> / 2,

free of cancellation. J is as curved as K, so <(u - u*) K (u - u*)> <= 2 G, from which
<(sigma - sigma*)^2> <= 2 G k_max. The least energy E(p) is concave in p with slope <u*>, and
s q / p serves at any other pressure q; the best q gives

    | <u*> - (<s h> - B) / p | <= sqrt(2 G B) / p,   B = <(s - p) K^-1 (s - p)>.
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np

from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.fields import Field, row_blocks

DOUBT = 1.0
"""Points whose stress and gap both lie below this many rms violations may be on either side."""


@dataclass(frozen=True)
class Certificate:
    """Distances to the exact solution on the grid, in reduced units."""

    gap: float
    """Duality gap G [h_std Delta_sigma]."""
    u_g: float
    """Upper bound of the error of the mean gap [h_std]."""
    sigma_p: float
    """Upper bound of the error of the standard deviation of the stress [Delta_sigma]."""
    a_r: float
    """Share of the points that may be in contact or not: an estimate, no bound."""


def certify(contact: Contact, u: Field, sigma: Field) -> Certificate:
    """Bound the errors of a displacement u >= h with its stress sigma = K u + p.

    Costs one transform.
    """
    grid, p = contact.grid, contact.pressure
    loaded = grid.total(sum(float(np.maximum(sigma[r], 0.0).sum()) for r in row_blocks(u)))
    scale = p * grid.size / loaded
    rest = grid.padded[..., : grid.points]
    sums = np.zeros(6)
    for rows in row_blocks(u):
        v, h = u[rows], contact.height[rows]
        s = scale * np.maximum(sigma[rows], 0.0)
        e = sigma[rows] - s
        rest[rows] = e
        g = v - h
        violation = np.minimum(g, sigma[rows])
        terms = (s * g, s * h, v * (sigma[rows] - p), v * e, violation * violation, v)
        sums += [float(term.sum()) for term in terms]
    product, lifted, twice_energy, mixed, violated, mean = grid.total(sums) / grid.size
    remainder = _compliance(contact)
    duality_gap = max(product + 0.5 * remainder, 0.0)
    reaction = max(twice_energy - 2 * mixed + remainder, 0.0)  # B, as s - p = K u - e
    centre = (lifted - reaction) / p
    share = min(sqrt(2 * duality_gap / reaction), 1.0) if reaction > 0 else 1.0
    spread = duality_gap / share if share > 0 else 0.0
    doubt = DOUBT * sqrt(violated)
    doubtful = sum(
        int(np.count_nonzero(np.maximum(u[r] - contact.height[r], np.abs(sigma[r])) < doubt))
        for r in row_blocks(u)
    )
    return Certificate(
        gap=duality_gap,
        u_g=abs(mean - centre) + (0.5 * share * reaction + spread) / p,
        sigma_p=sqrt(2 * duality_gap * grid.most(float(contact.stiffness.max()))),
        a_r=grid.total(doubtful) / grid.size,
    )


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
