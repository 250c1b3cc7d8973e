"""The contact problem, in reduced units.

Minimise sum_q k(q) |u(q)|^2 / 2 + p <u> over u >= h. At the solution sigma = K u + p >= 0,
g = u - h >= 0 and sigma g = 0 everywhere; K is diagonal in q with symbol k(q), k(0) = 0.

Heights, displacements and gaps are in units of h_std, stresses in Delta_sigma, so that the solvers
see one scale, whatever the units of a scene; the stiffness is then in Delta_sigma / h_std.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import sqrt

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.physics import sweeps
from gfmd_cli.physics.elastomer import Elastomer, Slab
from gfmd_cli.physics.fields import BLOCK, Field, row_blocks
from gfmd_cli.physics.grid import Grid, Operator
from gfmd_cli.physics.persson import Shells, shells
from gfmd_cli.physics.ranks import Ranks
from gfmd_cli.physics.surface import Surface, sample

ROUNDING = 1e-28  # |h(q)|^2 of a mode that only rounding has excited, relative to the largest
SCALES = (1e-100, 1e100)  # [m, Pa]: squared, over all of the spectrum, still normal numbers
EXACT_SQUARES = 2**20  # |q|^2 L^2 / 4 pi^2 up to which each has its own shell on any grid
MOST_SQUARES = 28  # bits of that on a grid on which each has
PRESSURES = (1e-30, 1e6)
"""Reduced pressures that are solved. Above 2^17, full contact on every grid, as no peak of a field
is above its rms times the points per side; sigma - p then only loses digits. Below, squares of p*
vanish sooner or later, and rounding of sigma has long been larger than p*."""


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
    def line(self) -> Field:
        """k(q) of the waves along x, from q = 0 on, shape (points/2 + 1,)."""
        return self.grid.line(self.stiffness)

    @cached_property
    def elasticity(self) -> Operator:
        """The map K."""
        return self.grid.operator(self.stiffness)

    def stress(self, u: Field, out: Field) -> Field:
        """sigma = K u + p. Written to `out`, which is returned."""
        self.elasticity(u, out)
        out += self.pressure
        return out

    def settle(self, u: Field) -> Field:
        """Lift `u` above the indenter and lower it until it touches, in place; return it."""
        np.maximum(u, self.height, out=u)
        u += self.grid.most(float(np.max(self.height - u)))
        return np.maximum(u, self.height, out=u)

    def residual(self, u: Field, sigma: Field) -> float:
        """Natural residual: rms of min(g, sigma), divided by min(p*, 1).

        Zero exactly at the solution. The one score by which all solvers are judged.
        """
        bodies = map(self.grid.as_rows, (self.height, u, sigma))
        (total,) = self.grid.rows.sums(1, sweeps.score, *bodies)
        return self.as_residual(total)

    def as_residual(self, violation: float) -> float:
        """Natural residual from the sum of the squares of min(g, sigma)."""
        return sqrt(violation / self.grid.size) / min(self.pressure, 1.0)

    def in_single(self) -> "Contact":
        """The same contact, rounded to single precision."""
        grid = replace(self.grid, precision="single")
        height, stiffness = self.height.astype(grid.real), self.stiffness.astype(grid.real)
        return Contact(grid, height, stiffness, self.pressure)

    def coarsen(self, points: int) -> "Contact":
        """The same contact, low-passed to a coarser grid."""
        grid = self.grid.coarser(points)
        k = self.grid.cut(self.stiffness, grid)
        return Contact(grid, self.grid.resample(self.height, grid), k, self.pressure)


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
    shells: Shells
    """The spectrum of the resolved surface with its stiffness, in physical units."""

    def contact(self, p_star: float) -> Contact:
        """The contact at reduced pressure p*. Raises InputError where that is out of range."""
        low, high = PRESSURES
        if not low <= p_star <= high:
            raise InputError(
                f"load: p* = {p_star:g} is out of range, {low:g} to {high:g}: p* = 1 is "
                f"{self.delta_sigma:.3g} Pa here; are moduli, heights and lengths in Pa and m?"
            )
        return Contact(self.grid, self.height, self.stiffness, p_star)


def build_scene(
    surface: Surface,
    elastomer: Elastomer,
    points: int,
    threads: int = 1,
    ranks: Ranks | None = None,
) -> Scene:
    """Sample the surface and reduce heights and stiffness to the scales of the resolved surface.

    `ranks` are the processes that share large grids.

    Raises InputError where the grid does not resolve the surface, the surface is flat, or a scale
    is out of range.
    """
    grid, height = sample(surface, points, ranks)
    grid = replace(grid, threads=threads)
    mean = grid.total(float(height.sum())) / grid.size
    height -= mean
    largest = grid.most(max(float(height.max()), -float(height.min())))
    height /= largest  # squares of heights of 1e-200 m would vanish
    rms = sqrt(grid.total(float(np.square(height).sum())) / grid.size)
    height /= rms
    stiffness, stiffest = _stiffness(grid, elastomer)
    m, power, modes = radial_power(grid, height)
    q = m * (2 * np.pi / grid.length)
    k = elastomer.stiffness(q, grid.length)
    unit = elastomer.half_space(q) if isinstance(elastomer, Slab) else k
    with np.errstate(over="ignore"):  # refused below
        reduced = float(np.sqrt(np.sum(power * (unit / stiffest) ** 2)))  # Eq. (23)
    h_std = largest * rms
    _check_scales(
        {
            "L": grid.length,
            "h_std": h_std,
            "h_std times the largest k(q)": stiffest * h_std,
            "Delta_sigma": reduced * stiffest * h_std,
        }
    )
    stiffness /= reduced
    return Scene(
        grid=grid,
        height=height,
        stiffness=stiffness,
        mean_height=mean,
        h_std=h_std,
        delta_sigma=reduced * stiffest * h_std,
        shells=shells(q, power * h_std**2, k, elastomer.gamma(q, grid.length), modes),
    )


def _check_scales(scales: dict[str, float]) -> None:
    """Refuse what is too large or too small to compute with; [m] and [Pa]."""
    low, high = SCALES
    for name, scale in scales.items():
        if not low <= scale <= high:
            raise InputError(
                f"surface, elastomer: {name} = {scale:g} is out of range, "
                f"{low:g} to {high:g}: choose other units"
            )


def _stiffness(grid: Grid, elastomer: Elastomer) -> tuple[Field, float]:
    """k(q) over the half-spectrum in units of its largest value, and that value."""
    k = np.empty(grid.spectral_shape)
    with np.errstate(over="ignore"):  # refused below
        for rows in row_blocks(k):
            k[rows] = elastomer.stiffness(grid.wavenumber(rows), grid.length)
    stiffest = grid.most(float(k.max()))
    if not (np.isfinite(stiffest) and stiffest > 0):
        raise InputError(f"elastomer: stiffness {stiffest} at the shortest wave is out of range")
    k /= stiffest
    waves = k.ravel()[1:] if grid.ends[0] else k  # the first is q = 0
    softest = -grid.most(-float(waves.min()))
    if not softest >= SCALES[0]:
        raise InputError(f"elastomer: stiffness falls to {softest:g} of its largest value")
    return k, stiffest


def radial_power(grid: Grid, height: Field) -> tuple[Field, Field, Field]:
    """Sum of |h(q)|^2 over the modes of equal |q|, where it is more than rounding.

    On grids beyond 16384 points a side, large |q| that differ by less than 1e-5 are one.

    Returns |q| L / 2 pi, rising, the sums, and how many modes they are of, each (shells,).
    """
    coefficients = grid.forward_into_work(height)
    half = grid.points // 2
    highest = grid.dimension * half**2
    merged = max(0, highest.bit_length() - MOST_SQUARES)  # 2^merged squares are one
    exact = EXACT_SQUARES if merged else highest + 1
    total, count = np.zeros((2, exact + (max(highest - exact, 0) >> merged) + 1))
    for rows in row_blocks(coefficients, max(coefficients.size // 16, BLOCK)):
        square = np.rint(grid.mode_number(rows) ** 2).astype(np.int64)  # a whole number
        if merged:
            np.copyto(square, exact + (square - exact >> merged), where=square >= exact)
        weight = grid.multiplicity() if grid.dimension == 2 else grid.multiplicity()[rows]
        power = np.abs(coefficients[rows]) ** 2 * weight
        weight = np.broadcast_to(weight, square.shape)
        total += np.bincount(square.ravel(), power.ravel(), minlength=total.size)
        count += np.bincount(square.ravel(), weight.ravel(), minlength=total.size)
    total, count = grid.total(total), grid.total(count)
    total[0] = 0.0
    (square,) = np.nonzero(total > ROUNDING * total.max())
    squares = square.astype(np.float64)
    beyond = squares[square >= exact]
    squares[square >= exact] = exact + (beyond - exact + 0.5) * 2**merged - 0.5  # their middle
    return np.sqrt(squares), total[square] / float(grid.size) ** 2, count[square]
