"""The contact of a map with an elastomer that extends beyond the map, unloaded there.

Only the points of the map can touch. The elastomer has no borders, so that its displacement is a
convolution of the stress with the compliance kernel, u = C sigma + c, where c is the level of the
undeformed surface. The stress is constant on each pixel. The contact minimises

    <sigma C sigma> / 2 - <sigma h>  over  sigma >= 0  with  <sigma> = p,

where means are taken over the map. At the solution, g = C sigma + c - h >= 0 and sigma g = 0.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from math import inf, prod, sqrt
from typing import Any, ClassVar

import numpy as np
from scipy.fft import dctn

from gfmd_cli.grid.arrays import Field, Mask, SingleField
from gfmd_cli.grid.convolution import PaddedTransform
from gfmd_cli.grid.distributed import create_grid
from gfmd_cli.grid.fft_grid import Grid, Shape
from gfmd_cli.grid.ranks import Ranks
from gfmd_cli.maps.map_preparation import mirror
from gfmd_cli.physics import kernels
from gfmd_cli.physics.contact import Contact, Scene
from gfmd_cli.physics.indenters import RigidSurface
from gfmd_cli.physics.linear_elastomer import LinearElastomer
from gfmd_cli.physics.scenes import build_scene, reduce_scene, touchable
from gfmd_cli.physics.surfaces import sample


@dataclass(frozen=True)
class FreeCompliance:
    """Compliance of an elastomer without borders on a grid, in reduced units."""

    elastomer: LinearElastomer
    grid: Grid
    unit: float
    """Delta_sigma / h_std [Pa/m]."""

    @cached_property
    def _convolution(self) -> tuple[PaddedTransform, Field]:
        """The transform of twice the points, and the symbol of the compliance C."""
        grid = self.grid
        kernel = self.elastomer.free_compliance(grid.whole_shape, grid.spacings, grid.own)
        transform = grid.padded_transform()
        return transform, transform.symbol_of(kernel * self.unit)

    @cached_property
    def _convolution_of_moves(self) -> tuple[PaddedTransform, SingleField]:
        """The same in single precision, in the same memory."""
        transform, symbol = self._convolution
        return transform.in_single(), symbol.astype(np.float32)

    @cached_property
    def rms_symbol(self) -> float:
        """Rms of the symbol of C over all q except 0, where an error only shifts the whole surface.

        White noise in the coefficients of a stress becomes noise of the displacement that is larger
        by this factor.
        """
        transform, symbol = self._convolution
        return sqrt(self.grid.total(transform.mean_square(symbol)))

    def displacement(self, stress: Field, out: Field) -> Field:
        """C sigma, written to `out`: one pair of transforms of twice the points a side."""
        transform, symbol = self._convolution
        return transform.apply(symbol, stress, out)

    def displacement_by_move(self, move: SingleField, out: SingleField) -> None:
        """C times a move of the stress in single precision, written to `out`."""
        transform, symbol = self._convolution_of_moves
        transform.apply(symbol, move, out)

    @property
    def smallest_compliance(self) -> float:
        """Lower limit of the eigenvalues of C; useful only if positive.

        The smallest eigenvalue of the circulant matrix of the kernel reflected about the borders of
        its array, of which C is a principal submatrix: a discrete cosine transform of type I. Every
        process computes all of it.
        """
        shape, spacings = self.grid.whole_shape, self.grid.spacings
        kernel = self.elastomer.free_compliance(shape, spacings) * self.unit
        return float(dctn(kernel, type=1).min())

    @property
    def transforms(self) -> float:
        """Cost of `displacement`, in transforms of the size of the map, by number of points."""
        return 2.0 * prod(self._convolution[0].padded) / self.grid.size


@dataclass(frozen=True)
class FreeContact(Contact):
    """Contact problem of a map on an elastomer without borders, at one pressure.

    `stiffness` is empty: the elastomer is described by `compliance`.
    """

    boundary: ClassVar[str] = "free"
    compliance: FreeCompliance = field(kw_only=True)

    @property
    def exponents(self) -> tuple[float, float]:
        """The exponent of a power law as both limits; infinite limits for any other k(q)."""
        n = self.compliance.elastomer.exponent
        return (-inf, inf) if n is None else (n, n)

    def stress_rounding(self, dtype: "np.dtype[Any]") -> float:
        """Estimated rms error of the gap by rounding, divided by the rms displacement."""
        return 0.5 * float(np.finfo(dtype).eps)

    def recompute(self, u: Field, sigma: Field) -> float:
        """Compute u from sigma, u = h in contact and above it elsewhere; return the residual."""
        gap = self.compliance.displacement(sigma, out=self.grid.empty())
        gap -= self.height
        return self.balance(sigma, gap, u)

    def balance(self, sigma: Field, gap: Field, u: Field, sums: Field | None = None) -> float:
        """Subtract the mean gap in contact from the gap, and set u; return the residual.

        `sums`, if they are known, are those of the kernel `gap_in_contact`.
        """
        rows, as_rows = self.grid.rows, self.grid.as_rows
        fields = as_rows(sigma), as_rows(gap)
        if sums is None:
            sums = rows.sums(2, kernels.gap_in_contact, *fields)
        total, count = sums.tolist()
        level = total / count if count else 0.0
        indenter = as_rows(self.height), as_rows(self.obstacle)
        (squares,) = rows.sums(1, kernels.set_level, *indenter, *fields, level, as_rows(u))
        return self.as_residual(squares)

    def reference_level(self, u: Field, sigma: Field) -> float:
        """Level c of the undeformed surface: <sigma u> = <sigma C sigma> + c p."""
        response = self.compliance.displacement(sigma, out=self.grid.empty())
        np.subtract(u, response, out=response)
        work, load = self.grid.total(np.array([np.vdot(sigma, response), sigma.sum()]))
        return float(work / load)

    def mirrored(self) -> Contact:
        """The periodic contact of the map mirrored to twice its sides, whose Delta_sigma is 1.

        Its stress K h is that of full contact, which is not defined for a map with borders.
        """
        grid = self.grid.doubled()
        elastomer, unit = self.compliance.elastomer, self.compliance.unit
        k = elastomer.stiffness(grid.wavenumber(), grid.length) / unit
        mask = None if self.may_touch is None else mirror(self.may_touch)
        return Contact(grid, mirror(self.height), k, self.pressure, mask)

    def coarsen(self, shape: Shape, *, is_sampled: bool = False) -> "FreeContact":
        """The same contact on larger pixels, with the means of the heights over them."""
        grid = self.grid.coarser(shape)
        return replace(
            self,
            grid=grid,
            height=self.grid.average(self.height, grid),
            may_touch=self._coarse_mask(grid),
            compliance=replace(self.compliance, grid=grid),
        )


def build_free_scene(
    surface: RigidSurface,
    elastomer: LinearElastomer,
    points: int,
    threads: int = 1,
    ranks: Ranks | None = None,
    *,
    points_y: int = 0,
) -> Scene:
    """As `build_scene`, for a free boundary.

    A map that is not periodic has a step at its border. Delta_sigma and the spectrum are therefore
    those of the map mirrored to twice its sides, which is continuous: for a half-space, Delta_sigma
    is E*/2 times the rms gradient of the map.

    Raises InputError as `build_scene`, and where the elastomer has no compliance that decays.
    """
    grid = create_grid(replace(surface.grid(points, points_y), threads=threads), ranks)
    height, void = _heights(surface, grid, ranks)
    scene = reduce_scene(grid, height, elastomer, is_mirrored=True)
    compliance = FreeCompliance(elastomer, grid, scene.delta_sigma / scene.h_std)
    return replace(
        scene,
        stiffness=np.empty(0),
        may_touch=touchable(void, grid),
        contact_type=partial(FreeContact, compliance=compliance),
    )


def _heights(surface: RigidSurface, grid: Grid, ranks: Ranks | None) -> tuple[Field, Mask | None]:
    """Heights [m] of a map on a grid, and the points that never touch.

    A measured map is mirrored before it is interpolated, so that no height on a finer grid lies
    between those of opposite borders.
    """
    own_points = (surface.smallest_grid_y(), surface.smallest_grid())
    mirrored = surface.mirrored()
    if mirrored is None or own_points == (grid.points_y, grid.points):
        _, height = sample(surface, grid.points, grid.points_y, ranks, is_temporary=True)
        return height, surface.void(grid)
    shape = 2 * grid.points, 2 * grid.points_y
    doubled, heights = sample(mirrored, *shape, ranks, is_temporary=True)
    void = mirrored.void(doubled)
    own_void = None if void is None else _on_map(doubled, void, grid)
    return _on_map(doubled, heights, grid), own_void


def _on_map(doubled: Grid, values: Any, grid: Grid) -> Any:
    """The values at the points of the map itself, on twice its grid."""
    part = doubled.as_rows(values)[:, : grid.points]
    return np.ascontiguousarray(doubled.gather_rows(part, grid.row_span)).reshape(grid.shape)


SCENES: dict[str, Callable[..., Scene]] = {"periodic": build_scene, "free": build_free_scene}
"""How a scene is built, by `grid.boundary`."""
