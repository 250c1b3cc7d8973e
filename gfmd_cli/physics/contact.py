"""The contact problem, in reduced units.

Minimise sum_q k(q) |u(q)|^2 / 2 + p <u> over u >= h. At the solution sigma = K u + p >= 0,
g = u - h >= 0 and sigma g = 0 everywhere; K is diagonal in q with symbol k(q), k(0) = 0.

Heights, displacements and gaps are in units of h_std, stresses in Delta_sigma, so that the solvers
see one scale, whatever the units of a scene; the stiffness is then in Delta_sigma / h_std.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.physics.elastomer import Elastomer, Slab
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.grid import Grid, Operator
from gfmd_cli.physics.persson import Shells, shells
from gfmd_cli.physics.surface import Surface, sample


@dataclass(frozen=True)
class Contact:
    """One pressure on one scene."""

    grid: Grid
    height: Field
    """Indenter h, shape `grid.shape`, zero mean."""
    stiffness: Field
    """k(q), shape `grid.spectral_shape`, zero at q = 0."""
    pressure: float
    """Nominal pressure p* = p / Delta_sigma."""

    @cached_property
    def elasticity(self) -> Operator:
        """The map K."""
        return self.grid.operator(self.stiffness)

    def stress(self, u: Field, out: Field) -> Field:
        """sigma = K u + p. Written to `out`, which is returned."""
        self.elasticity(u, out)
        out += self.pressure
        return out

    def residual(self, u: Field, sigma: Field) -> float:
        """Natural residual: rms of min(g, sigma), divided by min(p*, 1).

        Zero exactly at the solution. The one score by which all solvers are judged.
        """
        total = 0.0
        for rows in _row_blocks(u):
            violation = np.minimum(u[rows] - self.height[rows], sigma[rows]).ravel()
            total += float(violation @ violation)
        return float(np.sqrt(total / u.size)) / min(self.pressure, 1.0)

    def coarsen(self, points: int) -> "Contact":
        """The same contact, low-passed to a coarser grid."""
        grid = replace(self.grid, points=points)
        half = points // 2
        k = self.stiffness[..., : half + 1]
        if self.grid.dimension == 2:
            k = np.concatenate([k[:half], k[-half:]])
        return Contact(grid, self.grid.resample(self.height, grid), k, self.pressure)


def _row_blocks(field: Field) -> list[slice]:
    """Slices of about 2^15 points: they and their temporaries stay in the cache."""
    step = max(1, 2**15 * len(field) // field.size)
    return [slice(start, start + step) for start in range(0, len(field), step)]


@dataclass(frozen=True)
class Scene:
    """A surface and an elastomer on a grid: what all pressures share."""

    grid: Grid
    height: Field
    """(h - <h>) / h_std."""
    stiffness: Field
    """k h_std / Delta_sigma, shape `grid.spectral_shape`."""
    mean_height: float
    """<h> [m]."""
    h_std: float
    """Root-mean-square height [m]."""
    delta_sigma: float
    """Unit of pressure [Pa]: the rms stress in full contact (of the half-space, for a slab)."""
    surface: Surface
    elastomer: Elastomer

    def contact(self, p_star: float) -> Contact:
        """The contact at reduced pressure p*."""
        return Contact(self.grid, self.height, self.stiffness, p_star)

    def shells(self) -> Shells:
        """The spectrum of the resolved surface with its stiffness, in physical units."""
        grid = self.grid
        q = grid.wavenumber()
        power = np.abs(grid.forward(self.height)) ** 2 * grid.multiplicity() * self.h_std**2
        k, gamma = self.elastomer.stiffness(q, grid.length), self.elastomer.gamma(q, grid.length)
        keep = (q > 0) & (power > _FLAT * power.max())
        return shells(q[keep], power[keep], k[keep], gamma[keep])


_FLAT = 1e-28  # |h(q)|^2 of a mode that only rounding has excited, relative to the largest


def build_scene(surface: Surface, elastomer: Elastomer, points: int, threads: int = 1) -> Scene:
    """Sample the surface and reduce heights and stiffness to the scales of the resolved surface.

    Raises InputError where the grid does not resolve the surface, the surface is flat, or the
    numbers overflow.
    """
    grid, height = sample(surface, points)
    grid = replace(grid, threads=threads)
    mean = float(height.mean())
    height -= mean
    h_std = float(np.sqrt(np.mean(np.square(height / np.abs(height).max())))) * float(
        np.abs(height).max()
    )  # squares of metres of 1e-200 would vanish
    height /= h_std
    q = grid.wavenumber()
    with np.errstate(over="ignore"):  # refused below
        stiffness = elastomer.stiffness(q, grid.length)
    largest = float(stiffness.max())
    if not (np.isfinite(largest) and largest > 0):
        raise InputError(f"elastomer: stiffness {largest} at the shortest wave is out of range")
    stiffness /= largest
    unit = elastomer.half_space(q) / largest if isinstance(elastomer, Slab) else stiffness
    power = np.abs(grid.forward(height)) ** 2 * grid.multiplicity()
    reduced = float(np.sqrt(np.sum(power * unit**2)))  # Delta_sigma / (largest h_std), Eq. (23)
    stiffness /= reduced
    return Scene(
        grid, height, stiffness, mean, h_std, reduced * largest * h_std, surface, elastomer
    )
