"""The interface of all elastomers: the stiffness k(q), and what follows from it.

k(q) is the stress per displacement at wavenumber q. The elastic energy per area is
sum_q k(q) |u(q)|^2 / 2: Eq. (1) of Mueser, "Elastic contacts of randomly rough surfaces across the
spatial dimensions". Sums exclude q = 0, where k is zero for every elastomer (load control).
"""

from fractions import Fraction
from math import inf
from typing import ClassVar

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.grid.arrays import Field
from gfmd_cli.grid.fft_grid import ALL_ROWS, Shape
from gfmd_cli.physics.compliance_transforms import Compliance
from gfmd_cli.physics.contact import Scene
from gfmd_cli.physics.free_compliance import Pixels, Spacings, power_law
from gfmd_cli.physics.persson import gamma_n
from gfmd_cli.spec_table import SpecTable
from gfmd_cli.units import count

EXPONENT_STEP = 1e-3  # of ln q: the truncation error is of order 1e-7, the rounding error 1e-13


class LinearElastomer(SpecTable):
    """Interface of all elastomers.

    A subclass implements `stiffness`, and overrides the defaults that do not hold for it.
    Wavenumbers q are arrays [1/m]; `length` is the side of the cell L [m], which scales the
    thickness of a slab.
    """

    exponent: ClassVar[float | None] = None
    """Exponent n where the stiffness is a power law k = k_n q^n, else None."""
    uniform_stiffness: ClassVar[float | None] = None
    """Limit of k(q) for q -> 0 [Pa/m], where it is finite and not zero, else None.

    It determines the mean displacement, which the solution under a given load does not need."""
    largest_displacement: ClassVar[float] = inf
    """Displacement from first touch beyond which linear elasticity does not hold [m]."""
    kind: str

    @property
    def short_label(self) -> str:
        """Name in figures: the exponent as "n = 3/2" where there is one, else the label."""
        if self.exponent is None:
            return self.label
        fraction = Fraction(self.exponent).limit_denominator(4)
        return f"n = {fraction}" if fraction == self.exponent else f"n = {self.exponent:g}"

    @property
    def stiffness_given(self) -> bool:
        """Whether the spec gives every key that has a unit; without, k(q) is in arbitrary units."""
        fields = type(self).model_fields
        return all(key in self.model_fields_set for key in fields if self.unit_of(key))

    def label_on(self, length: float) -> str:
        """The label on a cell of this side [m]."""
        return self.label

    def stiffness(self, q: Field, length: float = 1.0) -> Field:
        """k(q) [Pa/m], zero at q = 0."""
        raise NotImplementedError

    def free_compliance(self, shape: Shape, spacings: Spacings, rows: slice = ALL_ROWS) -> Field:
        """Displacements [m/Pa] of an elastomer without borders, due to unit pressure on one pixel.

        `spacings` are the sides of a pixel [m], in the order (y, x). The result of this shape, or
        in two dimensions some of its rows, is indexed by the distance of the two pixels in points.
        See `free_compliance`, for a stiffness that is not a power law `compliance_transforms`.

        Raises InputError where the displacement does not decay with the distance.
        """
        self.check_free_boundary(len(shape))
        pixels = Pixels(shape, spacings, rows)
        if self.exponent is None:
            return self.compliance().displacements(pixels)
        return power_law(self.exponent, pixels) / float(self.stiffness(np.ones(1))[0])

    def compliance(self) -> Compliance:
        """1/k(q) of an elastomer whose displacement decays and whose k(q) is not a power law."""
        raise NotImplementedError

    def warnings(self, scene: Scene, boundary: str, *, is_rough: bool) -> list[str]:
        """Warnings about a scene with this `grid.boundary`; empty by default.

        `is_rough`: whether its rms height is that of a rough surface, not of a single indenter.
        """
        return []

    def decays(self, dimension: int) -> bool:
        """Whether the displacement decays with the distance from the load.

        That of a power law does for n < 2; in one dimension for n <= 1, the logarithm included.
        """
        if self.exponent is None:
            return False
        return self.exponent < 2 if dimension == 2 else self.exponent <= 1

    def check_free_boundary(self, dimension: int) -> None:
        """Raise InputError for an elastomer that a free boundary does not suit."""
        if not self.decays(dimension):
            raise InputError(
                f'grid.boundary: "free" needs an elastomer whose displacement decays with the '
                f"distance from the load; that of {self.label} in "
                f'{count(dimension, "dimension")} does not: use "periodic"'
            )

    def has_level(self, boundary: str, dimension: int) -> bool:
        """Whether displacements count from the level of the undeformed surface.

        With a free boundary that is the level far from all loads, which does not exist under a line
        load on a half-space (n = 1, a logarithm); with a periodic one it exists for an elastomer on
        a base, whose stiffness k(0) is not zero.
        """
        if boundary == "free":
            is_logarithm = dimension == 1 and self.exponent == 1
            return self.decays(dimension) and not is_logarithm
        return self.uniform_stiffness is not None

    def check_displacement_load(self, boundary: str, dimension: int) -> None:
        """Raise InputError where a displacement from first touch is not defined."""
        if not self.has_level(boundary, dimension):
            remedy = "" if boundary == "free" else "a free boundary or "
            raise InputError(
                f'load.displacement: {self.label} with grid.boundary = "{boundary}" in '
                f"{count(dimension, 'dimension')} has no level of the undeformed "
                f"surface to count from; it needs {remedy}an elastomer whose k(0) is not zero "
                "(layer, n = 0): use load.mean_gap"
            )

    def unit_stiffness(self, q: Field, length: float = 1.0) -> Field:
        """k(q) [Pa/m] of the elastomer whose Delta_sigma is the unit of pressure."""
        return self.stiffness(q, length)

    @property
    def modulus(self) -> float:
        """Contact modulus E* [Pa], 0 where the elastomer has none."""
        return float(dict(self).get("E_star", 0.0))

    def local_exponent(self, q: Field, length: float = 1.0, step: float = EXPONENT_STEP) -> Field:
        """n(q) = d ln k / d ln q, by central differences over +-step; zero where k is zero."""
        above, below = (self.stiffness(q * np.exp(shift), length) for shift in (step, -step))
        safe = (above > 0) & (below > 0)
        ratio = np.where(safe, above, 1.0) / np.where(safe, below, 1.0)
        return np.log(ratio) / (2 * step)

    def gamma(self, q: Field, length: float = 1.0) -> Field:
        """Weight of the elastic energy in Persson theory: paper Eq. (39) at the exponent n(q)."""
        if self.exponent is not None:
            return np.full_like(q, gamma_n(self.exponent))
        return gamma_n(np.clip(self.local_exponent(q, length), 0.0, 4.0))
