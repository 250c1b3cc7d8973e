"""Rigid surfaces: the interface of all surfaces, and single indenters of simple shape.

Each class of a single indenter is one `kind` of [surface] in the run spec. The indenter is in the
middle of the periodic cell. Equation numbers are those of Mueser, "Elastic contacts of randomly
rough surfaces across the spatial dimensions".
"""

from math import ceil
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field as Key
from pydantic import model_validator

from gfmd_cli.errors import InputError
from gfmd_cli.files.file_cache import file_cache
from gfmd_cli.grid.arrays import Field, Mask, MaskedField
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.maps.pictures import Picture
from gfmd_cli.physics.highest_point import highest_point, highest_point_of_mirrored
from gfmd_cli.spec_table import Positive, Scale, SpecTable

SMALLEST_GRID = 8  # points along an axis; a choice: smaller grids resolve no contact
MAX_POINTS = 2**17  # along an axis; upper limit, guards against typing errors
MAX_ASPECT_RATIO = 1e9  # of the sides; a choice: no grid has so many points
SLOPE_STEP = 1e-3  # of a distance from the middle, over which a slope is taken
POINTS_ROUNDING = 1e-9  # of a number of points that follows from a ratio of sides
UNCOUNTABLE = 1e15  # points along an axis; what would need more, or infinitely many, counts as this


def whole_points(number: float) -> int:
    """The smallest whole number of points that is at least `number`, up to rounding."""
    return ceil(min(number, UNCOUNTABLE) - POINTS_ROUNDING)


class RigidSurface(SpecTable):
    """Interface of all surfaces; the defaults are those of a single indenter.

    A subclass implements `smallest_grid` and `heights_on`, has the fields `length` and, unless it
    is a line, `length_y`, or overrides `sides`, and overrides the defaults that do not hold for it.
    """

    dimension: ClassVar[int] = 2
    """Dimension of the surface: 1 for a line contact, h(x), 2 for h(x, y)."""
    rough: ClassVar[bool] = False
    """Whether the surface is random or measured; error bars then use its spectrum."""
    x_first: ClassVar[float] = 0.0
    """Position of the first grid point along each axis, over the side of the cell."""
    is_map: ClassVar[bool] = False
    """Whether the surface is a map, whose points are those of the smallest grid."""
    band_limited: ClassVar[bool] = False
    """Whether the smallest grid resolves all waves, so that all grids have one Delta_sigma."""
    stepped: ClassVar[bool] = False
    """Whether the surface has vertical steps, at which the stress of any contact is singular."""
    tip_exponent: ClassVar[float] = 2.0
    """Exponent m of the heights -r^m next to the tip of a single indenter; below 2 it is sharp."""
    has_borders: ClassVar[bool] = False
    """Whether the surface ends at its borders, and the spec does not make it periodic."""
    copies: ClassVar[int] = 1
    """Copies of the surface along each side of its cell."""
    size_hint: ClassVar[str] = "the side along y is surface.length_y"
    """What to check where the smallest grid has too many points, for messages."""
    kind: str

    def smallest_grid(self) -> int:
        """Smallest number of points along x that resolves the surface."""
        raise NotImplementedError

    def smallest_grid_y(self) -> int:
        """Smallest number of points along y, by default at the same spacing; 1 for a line."""
        if self.dimension == 1:
            return 1
        length_y, length = self._checked_sides()
        return max(SMALLEST_GRID, whole_points(self.smallest_grid() * length_y / length))

    def _checked_sides(self) -> tuple[float, ...]:
        """The sides. Raises InputError where one is very much longer than the other."""
        length_y, length = self.sides
        if not 1 / MAX_ASPECT_RATIO <= length_y / length <= MAX_ASPECT_RATIO:
            raise InputError(
                f"surface.length_y = {length_y:g} m is out of range: the side along x has "
                f"{length:g} m"
            )
        return length_y, length

    def points_y(self, points: int) -> int:
        """Points along y where a spec gives none: the even number nearest to square pixels."""
        if self.dimension == 1:
            return 1
        length_y, length = self._checked_sides()
        return points if length_y == length else 2 * round(points * length_y / length / 2)

    def on_cell(self, points: int, points_y: int) -> Self:
        """The surface on the cell that it has on a grid of so many points.

        Where the spec does not give the side along y, it is the points along y times the spacing
        along x. Raises InputError where one side is very much longer than the other.
        """
        if self.dimension == 1:
            return self
        _, length = self._checked_sides()
        if points_y == points or dict(self).get("length_y") is not None:
            return self
        return self.model_copy(update={"length_y": length * points_y / points})

    def heights_on(self, grid: Grid) -> Field:
        """Heights h [m] at the points of a grid that this process holds, shape `grid.shape`."""
        raise NotImplementedError

    def heights(self, points: int, points_y: int = 0) -> Field:
        """Heights h [m] on a grid of so many points, indexed [y, x], for a line contact [x].

        Raises InputError where the grid does not resolve the surface.
        """
        grid = self.grid(points, points_y)
        self.check_resolved(points, grid.points_y)
        return self.heights_on(grid)

    def check_resolved(self, points: int, points_y: int) -> None:
        """Raise InputError where a grid of so many points along x and y is too coarse."""
        along_x = ("points", "x", points, self.smallest_grid())
        along_y = ("points_y", "y", points_y, self.smallest_grid_y())
        for key, axis, count, least in (along_x, along_y):
            if count < least:
                raise InputError(
                    f"grid.{key}: {count // self.copies} points along {axis} do not resolve "
                    f"the surface ({self.smallest_grid_reason()}); "
                    f"{self.remedy(least // self.copies)}"
                )

    def remedy(self, needed: int) -> str:
        """What to do where the surface needs so many points along an axis, or more."""
        if needed <= MAX_POINTS:
            return f"use {needed} or more"
        return (
            f"it takes {float(needed):.12g}, but at most {MAX_POINTS} are allowed; "
            f"check: {self.size_hint}"
        )

    def grid(self, points: int, points_y: int = 0) -> Grid:
        """The grid of so many points on the cell; by default with `points_y(points)` along y."""
        length_y = self.sides[0]
        points_y = points_y or self.points_y(points)
        return Grid(points, self.dimension, self.sides[-1], points_y=points_y, length_y=length_y)

    @property
    def sides(self) -> tuple[float, ...]:
        """Sides of the periodic cell [m], along y and x; of a line, its length."""
        fields = dict(self)
        length = float(fields["length"])
        return (length,) if self.dimension == 1 else (fields.get("length_y") or length, length)

    def within(self, boundary: str) -> Self:
        """The surface with the treatment of its edges that goes with a boundary by default."""
        return self

    def smallest_grid_reason(self) -> str:
        """Reason for the smallest grid, as text for messages."""
        return f"kind {self.kind!r}"

    def slope_at(self, r: float) -> float:
        """Slope |dh/dr| of a single indenter at a distance r > 0 from its middle; else 0."""
        return 0.0

    def preparation(self, boundary: str = "") -> str:
        """Description of how a map was read and prepared for a boundary; "" for other surfaces."""
        return ""

    def measured_map(self) -> tuple[MaskedField, tuple[float, ...]] | None:
        """Levelled heights [m] as measured, and their spacing [m]; None where nothing was."""
        return None

    def changed(self, grid: Grid, *, is_periodic: bool = True) -> dict[str, Mask]:
        """Points of a grid that can touch, but whose heights are not those measured, by reason.

        "edge": a window has changed them; "filled": they were filled in. `is_periodic`: whether the
        boundary of the contact is.
        """
        return {}

    def mirrored(self) -> "RigidSurface | None":
        """A map that is not periodic, mirrored to twice its sides; None for other surfaces."""
        return None

    @file_cache(maxsize=16)
    def peak(self) -> float | None:
        """Height of the highest point [m], between grid points too; None where it is unknown."""
        if not self.band_limited:
            return None
        find = highest_point_of_mirrored if self.is_mirrored else highest_point
        return find(self.resolved_heights())

    @property
    def is_mirrored(self) -> bool:
        """Whether `resolved_heights` are mirrored at their borders, and then repeated."""
        return False

    def resolved_heights(self) -> Field:
        """Heights [m] of a band-limited surface, with more than two points per wave."""
        points_y = self.smallest_grid_y() + 2 if self.dimension == 2 else 1
        return self.heights(self.smallest_grid() + 2, points_y)

    def tapered_map(self) -> "RigidSurface | None":
        """A map that is not periodic, tapered for its spectrum; None for other surfaces."""
        return None

    def period_limit(self) -> float:
        """Shortest wavelength that a map resolves [m]; 0 where the spec does not say it."""
        return 0.0

    def void(self, grid: Grid) -> Mask | None:
        """Points of a grid that never touch, as their height is unknown; None where all can."""
        return None

    def pictures(self) -> dict[str, Picture]:
        """Pictures of a map as it was "measured" and as it was "prepared"; none of others."""
        return {}

    def warnings(self, boundary: str = "periodic") -> list[str]:
        """Warnings about values that are probably mistakes of the user, for `grid.boundary`."""
        return []


class SingleIndenter(RigidSurface):
    """A single indenter in the middle of the cell, repeated periodically; x counts from there."""

    x_first: ClassVar[float] = -0.5
    length: Scale = 1.0
    """Side of the cell along x, L [m]."""

    def smallest_grid(self) -> int:
        """Smallest number of points along x; any grid resolves most of them."""
        return SMALLEST_GRID

    def smallest_grid_y(self) -> int:
        """Smallest number of points along y."""
        return SMALLEST_GRID if self.dimension == 2 else 1

    def heights_on(self, grid: Grid) -> Field:
        """Heights [m] at the points of a grid that this process holds."""
        x = (np.arange(grid.points) / grid.points + self.x_first) * self.length
        if self.dimension == 1:
            return self._profile(np.abs(x))
        y = (np.arange(grid.points_y) / grid.points_y + self.x_first) * grid.length_y
        return self._profile(np.hypot(y[grid.own, None], x))

    def peak(self) -> float:
        """Height of the crest [m]."""
        return float(self._profile(np.zeros(1))[0])

    def slope_at(self, r: float) -> float:
        """Slope |dh/dr| at a distance r > 0 from the middle of the cell [m], by differences."""
        inner, outer = self._profile(r * np.array([1 - SLOPE_STEP, 1 + SLOPE_STEP])).tolist()
        return float(abs(outer - inner) / (2 * SLOPE_STEP * r))

    def _profile(self, r: Field) -> Field:
        """Heights [m] at distances r >= 0 from the middle of the cell [m]."""
        raise NotImplementedError


class RoundIndenter(SingleIndenter):
    """A single indenter of revolution in the middle of the cell, h(r)."""

    length_y: Scale | None = None
    """Side of the cell along y [m]; by default the points along y times the spacing along x."""


class LineIndenter(SingleIndenter):
    """A single indenter of a line contact, h(|x|)."""

    dimension: ClassVar[int] = 1


class Parabola(RoundIndenter):
    """Paraboloid h = -r^2 / 2R. Paper Eq. (4)."""

    kind: Literal["parabola"] = "parabola"
    radius: Positive = 1.0
    """Radius of curvature R [m]."""

    def _profile(self, r: Field) -> Field:
        return -(r**2) / (2 * self.radius)


class PowerLawIndenter(RoundIndenter):
    """Indenter of revolution h = -r^m / (m R^(m-1)). Paper Sect. 3.3."""

    kind: Literal["power-law"] = "power-law"
    exponent: Annotated[float, Key(gt=0, le=100)] = 2.0
    """Exponent m."""
    radius: Positive = 1.0
    """Length R [m]; the radius of curvature for m = 2."""

    @property
    def tip_exponent(self) -> float:  # type: ignore[override]
        """The exponent m, at the tip as elsewhere."""
        return self.exponent

    def _profile(self, r: Field) -> Field:
        return -self.radius * (r / self.radius) ** self.exponent / self.exponent


class Cone(RoundIndenter):
    """Cone h = -slope r."""

    tip_exponent: ClassVar[float] = 1.0
    kind: Literal["cone"] = "cone"
    slope: Positive = 1.0
    """Slope of the flanks, the tangent of their angle to the plane."""

    def _profile(self, r: Field) -> Field:
        return -self.slope * r


class Punch(RoundIndenter):
    """Flat cylindrical punch: h = 0 for r <= radius, -depth beyond."""

    stepped: ClassVar[bool] = True
    size_hint: ClassVar[str] = "surface.radius and surface.length have one unit"
    kind: Literal["punch"] = "punch"
    radius: Positive = 0.25
    """Radius of the face [m], a grid spacing or more."""
    depth: Positive | None = None
    """Depth of the surface around the face [m]; a large value keeps it out of contact. By default
    the side of the cell along x."""

    @model_validator(mode="after")
    def _has_rim(self) -> Self:
        self._check_rim()
        return self

    def _check_rim(self) -> None:
        side = min(self.sides)
        if self.radius >= side / 2:
            raise ValueError(
                f"radius = {self.radius:g} leaves no rim in a cell of {side:g}: "
                f"less than {side / 2:g} is allowed"
            )

    def on_cell(self, points: int, points_y: int) -> Self:
        """See `RigidSurface.on_cell`. Raises InputError where the radius leaves no rim."""
        surface = super().on_cell(points, points_y)
        try:
            surface._check_rim()
        except ValueError as error:
            raise InputError(f"grid.points_y: with {points_y} points, surface.{error}") from error
        return surface

    def smallest_grid(self) -> int:
        """Smallest number of points along x: the radius is a spacing or more."""
        return max(SMALLEST_GRID, whole_points(self.length / self.radius))

    def smallest_grid_y(self) -> int:
        """Smallest number of points along y, likewise."""
        return max(SMALLEST_GRID, whole_points(self.sides[0] / self.radius))

    def smallest_grid_reason(self) -> str:
        """Reason for the smallest grid: the radius."""
        return f"kind {self.kind!r}, radius = {self.radius:g}: a spacing or more"

    def _profile(self, r: Field) -> Field:
        rim = self.radius * (1 + 1e-12)  # points on the rim belong to the face, up to rounding
        return np.where(r <= rim, 0.0, -(self.depth or self.length))

    def parameters(self) -> dict[str, Any]:
        """Value of every key, with the default of the depth as it is applied."""
        return super().parameters() | {"depth": self.depth or self.length}


class Ridge(LineIndenter):
    """Acute ridge h = -slope |x|, a line contact; x = 0 at the crest, in the middle of the cell.

    Paper Fig. 1 (periodic ridges, one per cell).
    """

    tip_exponent: ClassVar[float] = 1.0
    size_hint: ClassVar[str] = "surface.width is relative to surface.length"
    kind: Literal["ridge"] = "ridge"
    slope: Positive = 1.0
    """Slope of the flanks, the tangent of their angle to the plane."""
    width: Annotated[float, Key(gt=0, le=1)] = 1.0
    """Width of the ridge at its foot / L, at least two grid spacings; the rest is flat."""

    def smallest_grid(self) -> int:
        """Smallest number of points: the foot is a spacing or more away from the crest."""
        return max(SMALLEST_GRID, whole_points(2 / self.width))

    def smallest_grid_reason(self) -> str:
        """Reason for the smallest grid: the width."""
        return f"kind {self.kind!r}, width = {self.width:g}: two spacings or more"

    def _profile(self, r: Field) -> Field:
        return -self.slope * np.minimum(r, 0.5 * self.width * self.length)


class LineParabola(LineIndenter):
    """Parabolic cylinder h = -x^2 / 2R, a line contact. Paper Eq. (4) in one dimension.

    x = 0 at the crest, in the middle of the cell.
    """

    kind: Literal["line-parabola"] = "line-parabola"
    radius: Positive = 1.0
    """Radius of curvature R [m]."""

    def _profile(self, r: Field) -> Field:
        return -(r**2) / (2 * self.radius)


class Wave(LineIndenter):
    """Cosine wave h = amplitude cos(2 pi x / L), a line contact (Westergaard's problem).

    x = 0 at the crest, in the middle of the cell.
    """

    band_limited: ClassVar[bool] = True
    kind: Literal["wave"] = "wave"
    amplitude: Positive = 1.0
    """Amplitude [m]."""

    def _profile(self, r: Field) -> Field:
        return self.amplitude * np.cos(2 * np.pi * r / self.length)


Indenter = Parabola | PowerLawIndenter | Cone | Punch | Ridge | LineParabola | Wave
"""The single indenters."""
