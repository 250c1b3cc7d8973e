"""Proven bounds of the distance between an approximate and the exact solution on a grid.

For any stress s >= 0 with <s> = p, the energy of the contact lies between the dual value

    D(s) = <s h> - <(s - p) K^-1 (s - p)> / 2

and J(u) = <u K u> / 2 + p <u> of any u >= h. With s the compressive part of sigma = K u + p, scaled
to the mean p, and e = sigma - s, the duality gap is

    G = J(u) - D(s) = <s g> + <e K^-1 e> / 2,

free of cancellation. J is as curved as K, so <(u - u*) K (u - u*)> <= 2 G, from which
<(sigma - sigma*)^2> <= 2 G k_max. The contact pressure is sigma at the points in contact and zero
elsewhere; the rms of the difference is added. The minimum E(p) of J is concave in p with slope
<u*>, and s q / p is admissible at any other pressure q; the best q gives

    | <u*> - (<s h> - B) / p | <= sqrt(2 G B) / p,   B = <(s - p) K^-1 (s - p)>.
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np

from gfmd_cli.grid.arrays import Field, row_blocks
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.observables import contact_pressure

DOUBT = 1.0
"""Factor of the rms violation below which gap and stress leave the contact state uncertain."""


@dataclass(frozen=True)
class Certificate:
    """Bounds of the errors of an approximate solution on its grid, in reduced units."""

    gap: float
    """Duality gap G [h_std Delta_sigma]."""
    u_g: float
    """Upper bound of the error of the mean gap [h_std]."""
    sigma_p: float
    """Upper bound of the error of the deviation of the contact pressure [Delta_sigma]."""
    a_r: float
    """Share of the points whose contact state is uncertain: an estimate, not a bound."""


def certify(contact: Contact, u: Field, sigma: Field) -> Certificate:
    """Bound the errors of a displacement u >= h with its stress sigma = K u + p.

    The cost is one transform.
    """
    grid, p = contact.grid, contact.pressure
    obstacle = contact.obstacle
    loaded = grid.total(
        sum(
            float(contact.clear_untouchable(np.maximum(sigma[r], 0.0), r).sum())
            for r in row_blocks(u)
        )
    )
    scale = p * grid.size / loaded
    rest = grid.padded[..., : grid.points]
    sums = np.zeros(7)
    for rows in row_blocks(u):
        v, h = u[rows], contact.height[rows]
        s = scale * contact.clear_untouchable(np.maximum(sigma[rows], 0.0), rows)
        e = sigma[rows] - s
        rest[rows] = e
        g = v - h
        violation = np.minimum(v - obstacle[rows], sigma[rows])
        left_out = sigma[rows] - contact_pressure(obstacle[rows], v, sigma[rows])
        terms = (s * g, s * h, v * (sigma[rows] - p), v * e, violation**2, v, left_out**2)
        sums += [float(term.sum()) for term in terms]
    product, lifted, twice_energy, mixed, violated, mean, omitted = grid.total(sums) / grid.size
    remainder = _compliance(contact)
    duality_gap = max(product + 0.5 * remainder, 0.0)
    reaction = max(twice_energy - 2 * mixed + remainder, 0.0)  # B, as s - p = K u - e
    centre = (lifted - reaction) / p
    share = min(sqrt(2 * duality_gap / reaction), 1.0) if reaction > 0 else 1.0
    spread = duality_gap / share if share > 0 else 0.0
    return Certificate(
        gap=duality_gap,
        u_g=abs(mean - centre) + (0.5 * share * reaction + spread) / p,
        sigma_p=sqrt(2 * duality_gap * grid.max(float(contact.stiffness.max()))) + sqrt(omitted),
        a_r=uncertain_share(contact, u, sigma, violated),
    )


def uncertain_share(contact: Contact, u: Field, sigma: Field, violated: float) -> float:
    """Share of the points whose gap and stress are both below the rms violation.

    `violated` is its square, the mean of min(g, sigma)^2.
    """
    doubt, obstacle = DOUBT * sqrt(violated), contact.obstacle
    doubtful = sum(
        int(np.count_nonzero(np.maximum(u[r] - obstacle[r], np.abs(sigma[r])) < doubt))
        for r in row_blocks(u)
    )
    return contact.grid.total(doubtful) / contact.grid.size


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
