"""The preconditioner of a free boundary: the stress of a punch that imposes a displacement.

Stresses on the points O of the contact cause the displacement C_OO s there. The inverse of C_OO
gives the stress that causes a displacement r on O and vanishes on all other points F, where the
surface is free. With the stiffness K, that is K_OO r + K_OF w, where the displacement w of the free
surface follows from K_FF w = -K_FO r (the Schur complement; Saad, Iterative Methods for Sparse
Linear Systems, 2nd ed., section 14.2). Here

- K is that of a periodic cell, enlarged, so that contacts at opposite borders are not neighbours;
- w follows from one step of conjugate gradients from w = 0, or three where k(q) is steep. They are
  preconditioned by the multigrid V-cycle of `pcg`. Without levels for it w = 0.

Each step minimises the energy <r + w, K (r + w)> / 2 along its direction. Twice this energy is the
product of r and the stress, which is therefore positive. With w = 0 it would be too large, as if
the surroundings of the contact could not move, and the solver would take up to nine times as many
steps (docs/solver_measurements.md).
"""

from dataclasses import replace
from math import ceil, isfinite
from typing import Any

import numpy as np

from gfmd_cli.grid.arrays import Field, SingleField
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.grid.plans import fast_length
from gfmd_cli.physics.contact import Contact
from gfmd_cli.physics.free_contact import FreeContact
from gfmd_cli.solvers.contact_state import ContactState
from gfmd_cli.solvers.multigrid import Multigrid, has_coarser_level, largest_growth

# Measured: `scripts/free_preconditioner.py`, tables of docs/solver_measurements.md.
PADDING = 1.25  # of the cell, as a multiple of the map
CYCLES = 1, 3  # steps for the free surface up to MAX_GROWTH, and above
MAX_GROWTH = 2.5  # of k(q) per octave; n = 1.3
UNIT = 16  # the points per side are multiples of it, so that each level has half of the finer one


class StressPreconditioner:
    """An approximate inverse of the compliance restricted to some points of a map."""

    def __init__(self, contact: FreeContact) -> None:
        self.map, self.cell = contact.grid, _enlarged(contact.grid)
        elastomer, unit = contact.compliance.elastomer, contact.compliance.unit
        self.stiffness = elastomer.stiffness(self.cell.wavenumber(), self.map.length) / unit
        padded = self.cell.as_rows(self.cell.padded)
        self.values: SingleField = padded[:, : self.cell.points]
        self.stress = np.zeros(self.values.shape, np.float32)
        self.response = np.zeros_like(self.stress)  # K times the last direction
        self.contact_state = self.cell.rows.empty_with_halo(self.cell.points, dtype=np.int8)
        self.cycles, cost = 0, float(self.cell.pair_cost)
        if has_coarser_level(self.cell):
            periodic = Contact(self.cell, np.empty(0), self.stiffness, contact.pressure)
            self.multigrid = Multigrid(periodic, self.cell)
            self.cycles = CYCLES[largest_growth(periodic) > MAX_GROWTH]
            cost += self.cycles * (self.cell.pair_cost + self.multigrid.transforms)
        self.transforms = cost * self.cell.size / self.map.size
        """Cost of `apply` in transforms of the size of the map."""

    def apply(
        self, displacement: Field, contact_state: ContactState, threshold: int, out: SingleField
    ) -> None:
        """Write the stress of a displacement of the points in contact to `out`, zero elsewhere.

        These are the points whose contact state is at least the threshold. All fields have two
        axes.
        """
        held = contact_state >= threshold
        self._enlarge(np.where(held, displacement, 0.0).astype(np.float32), self.values)
        self._enlarge(contact_state, self.cell.rows.interior(self.contact_state))
        self.cell.filter_padded(self.stiffness)
        self.stress[...] = self.values
        self._relax(threshold)
        own = self.cell.gather_rows(self.stress[:, : self.map.points], self.map.row_span)
        np.multiply(own, held, out=out)

    def _relax(self, threshold: int) -> None:
        """Move the free points by steps of conjugate gradients, and update `stress`."""
        fields = self.stress, self.contact_state, threshold, self.response
        last_curvature = 0.0
        for _ in range(self.cycles):
            descent, coupling = self.multigrid.apply(*fields)
            curvature = self.cell.filter_padded(self.stiffness)
            if last_curvature > 0:
                beta = -coupling / last_curvature
                self.values += np.float32(beta) * self.response
                curvature += beta * coupling
            if not (curvature > 0 and isfinite(curvature)):
                return
            self.stress += np.float32(descent / curvature) * self.values
            if self.cycles > 1:
                self.response[...] = self.values
            last_curvature = curvature

    def _enlarge(self, field: Any, out: Any) -> None:
        """Write a field of the map to the first rows and columns of the cell, zeros elsewhere."""
        first, last = (min(row, self.map.points_y) for row in self.cell.row_span)
        rows = self.map.gather_rows(field, (first, last))
        out[...] = 0
        out[: last - first, : self.map.points] = rows


def _enlarged(grid: Grid) -> Grid:
    """The periodic cell in single precision, of at least `PADDING` times as many pixels a side."""
    shape = [UNIT * fast_length(ceil(PADDING * points / UNIT)) for points in grid.whole_shape]
    sides = [n * spacing for n, spacing in zip(shape, grid.spacings, strict=True)]
    cell = replace(grid, points=shape[-1], length=sides[-1], precision="single")
    return cell if grid.dimension == 1 else replace(cell, points_y=shape[0], length_y=sides[0])
