"""Constrained conjugate gradients in the pressure.

Polonsky & Keer, Wear 231, 206 (1999): minimise the complementary energy <s K^-1 s> / 2 - <s h>
over s >= 0 at the mean pressure p. Its gradient is the gap.

For n of about 1 and below. Beyond, contacts that overlap are pressed on without regard to their
neighbours, and each such step starts the conjugation anew. Pairs of transforms at p* = 0.02, 0.1, 1
from a flat body to a residual of 1e-4 (256^2, cutoff 0.02): 57, 128, 294 for n = 1; 301, 819, 4415
for n = 1.5; 2107 and 7011 for n = 2 at the lower two. It fails for n = 3 and 4 (p* = 0.1, residual
above 1 after 20000) and for a slab of t = 0.02 L (p* = 0.02 and 0.3, 128^2, above 0.1 after 4000).
"""

from collections.abc import Iterator
from typing import Literal

import numpy as np

from gfmd_cli.physics.choice import Choice
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.fields import Field, Mask
from gfmd_cli.physics.grid import Grid
from gfmd_cli.solvers.loop import State


class PolonskyKeer(Choice):
    """Constrained conjugate gradients in the pressure at fixed mean pressure."""

    kind: Literal["polonsky-keer"] = "polonsky-keer"

    def begin(self, contact: Contact, u: Field) -> State:
        """Start from the compressive part of the stress that belongs to `u`."""
        sigma = contact.stress(u, out=contact.grid.empty())
        pressure = np.maximum(sigma, 0.0)
        pressure *= contact.pressure / _mean(contact.grid, pressure)
        soften = contact.grid.operator(compliance(contact))
        response = soften(pressure, out=contact.grid.empty())
        fields = {"pressure": pressure, "response": response, "direction": np.zeros_like(u)}
        scalars = {"conjugate": 0.0, "norm": 1.0}
        return State(u, sigma, transforms=4, fields=fields, scalars=scalars)

    def iterate(self, contact: Contact, state: State) -> Iterator[State]:
        """Advance `state` in place: one pair of transforms a step, two where pressures were cut.

        What is yielded needs one more pair, for sigma = K u + p. That pair serves the residual,
        not the method, and is not counted.
        """
        s, w, t = (state.fields[name] for name in ("pressure", "response", "direction"))
        grid, memory = contact.grid, state.scalars
        soften = grid.operator(compliance(contact))
        gap, answer = grid.empty(), grid.empty()
        while True:
            touching: Mask = s > 0
            np.subtract(w, contact.height, out=gap)
            gap -= _mean(grid, gap, touching)  # [1] the gap, on average zero in contact
            _read_off(contact, state, gap, touching)
            yield state
            inside = gap[touching]
            norm = grid.total(float(inside @ inside))  # [2] G
            t *= memory["conjugate"] * norm / memory["norm"]
            t += gap
            t[~touching] = 0.0  # [3] the new direction
            memory["norm"] = max(norm, 1e-300)
            soften(t, out=answer)
            answer -= _mean(grid, answer, touching)  # [4] its displacement
            curvature = grid.total(float(np.vdot(answer, t)))
            descent = grid.total(float(np.vdot(gap, t)))
            length = descent / curvature if curvature > 0 else 0.0  # [5] the step
            s -= length * t
            cut = grid.total(np.count_nonzero(s < 0)) > 0
            np.maximum(s, 0.0, out=s)  # [6] no tension
            overlap = (s == 0) & (gap < 0)
            s[overlap] -= length * gap[overlap]  # [7] pressure where the bodies overlap ...
            anew = grid.total(np.count_nonzero(overlap)) > 0  # ... and a restart
            memory["conjugate"] = 0.0 if anew else 1.0
            scale = contact.pressure / _mean(grid, s)
            s *= scale  # [8] the mean pressure
            state.transforms += 2
            if cut or memory["conjugate"] == 0:
                soften(s, out=w)
                state.transforms += 2
            else:  # the same, w being linear in s; its mean is of no account
                answer *= length
                w -= answer
                w *= scale
            state.step += 1


def _mean(grid: Grid, field: Field, where: Mask | None = None) -> float:
    """Mean of a field, or of some of its points."""
    chosen = field if where is None else field[where]
    total, count = grid.total(np.array([chosen.sum(), chosen.size]))
    return float(total / count)


def compliance(contact: Contact) -> Field:
    """1 / k(q), zero at q = 0."""
    k = contact.stiffness
    out: Field = np.divide(1.0, k, out=np.zeros_like(k), where=k > 0)
    return out


def _read_off(contact: Contact, state: State, gap: Field, touching: Mask) -> None:
    """Displacement: h where there is pressure, elsewhere h + max(gap, 0); its stress, residual."""
    np.maximum(gap, 0.0, out=state.u)
    state.u[touching] = 0.0
    state.u += contact.height
    contact.stress(state.u, out=state.sigma)
    state.residual = contact.residual(state.u, state.sigma)
