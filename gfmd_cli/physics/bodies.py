"""Rigid bodies and ridges of simple shape, one in the middle of each periodic cell.

Each class is one `kind` of the run spec's [surface]; equation numbers are those of Mueser, "Elastic
contacts of randomly rough surfaces across the spatial dimensions".
"""

from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field as Key
from pydantic import model_validator

from gfmd_cli.physics.choice import Choice, Positive
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.grid import Grid

SMALLEST_GRID = 8  # points per side; below it no contact is resolved


class Indenter(Choice):
    """A rigid surface that any grid can sample."""

    dimension: ClassVar[int] = 2

    def heights(self, points: int) -> Field:
        """Heights [m] on the grid [y, x]; of a line scene, on [x]."""
        return self.on(Grid(points, self.dimension))

    def on(self, grid: Grid) -> Field:
        """Heights [m] at the points of a grid that this process holds."""
        raise NotImplementedError

    def preparation(self) -> str:
        """What was read from a file and what was done to it, for people."""
        return ""


class _Body(Indenter):
    """A single body in the middle of the cell, repeated periodically."""

    length: Positive = 1.0
    """Side of the cell L [m]."""

    def smallest_grid(self) -> int:
        """Any grid: the body is what the grid makes of it."""
        return SMALLEST_GRID

    def _along(self, grid: Grid) -> Field:
        """Distance from the middle of the cell along one side [m]."""
        return (np.arange(grid.points) / grid.points - 0.5) * self.length

    def _radius(self, grid: Grid) -> Field:
        """Distance from the middle of the cell [m]."""
        along = self._along(grid)
        return np.hypot(along[grid.own, None], along)


class Parabola(_Body):
    """Paraboloid h = -r^2 / 2R. Paper Eq. (4)."""

    kind: Literal["parabola"] = "parabola"
    radius: Positive = 1.0
    """Radius of curvature R [m]."""

    def on(self, grid: Grid) -> Field:
        """Heights [m] at the points of a grid that this process holds."""
        return -(self._radius(grid) ** 2) / (2 * self.radius)


class PowerLawBody(_Body):
    """Body of revolution h = -r^m / (m R^(m-1)). Paper Sect. 3.3."""

    kind: Literal["power-law"] = "power-law"
    exponent: Annotated[float, Key(gt=0, le=100)] = 2.0
    """Exponent m."""
    radius: Positive = 1.0
    """Length R [m]; the radius of curvature for m = 2."""

    def on(self, grid: Grid) -> Field:
        """Heights [m] at the points of a grid that this process holds."""
        return -self.radius * (self._radius(grid) / self.radius) ** self.exponent / self.exponent


class Cone(_Body):
    """Cone h = -slope r."""

    kind: Literal["cone"] = "cone"
    slope: Positive = 1.0
    """Slope of the flank."""

    def on(self, grid: Grid) -> Field:
        """Heights [m] at the points of a grid that this process holds."""
        return -self.slope * self._radius(grid)


class Punch(_Body):
    """Flat cylindrical punch: h = 0 for r <= radius, -depth beyond."""

    kind: Literal["punch"] = "punch"
    radius: Positive = 0.25
    """Radius of the face [m]."""
    depth: Positive = 1.0
    """How far the surface lies back around the face [m]; deep enough, it is never touched."""

    @model_validator(mode="after")
    def _has_a_rim(self) -> Self:
        if self.radius >= self.length / 2:
            raise ValueError(f"radius = {self.radius:g} leaves no rim in a cell of {self.length:g}")
        return self

    def on(self, grid: Grid) -> Field:
        """Heights [m] at the points of a grid that this process holds."""
        face = self._radius(grid) <= self.radius * (1 + 1e-12)  # points on the rim belong to it
        return np.where(face, 0.0, -self.depth)


class Ridge(_Body):
    """Acute ridge h = -slope |x|, a line scene. Paper Fig. 1 (ridges side by side, one a cell)."""

    dimension: ClassVar[int] = 1
    kind: Literal["ridge"] = "ridge"
    slope: Positive = 1.0
    """Slope of the flanks."""
    width: Annotated[float, Key(gt=0, le=1)] = 1.0
    """Width at the foot as a share of the cell; the rest is flat."""

    def on(self, grid: Grid) -> Field:
        """Heights [m] at the points of a grid that this process holds."""
        across = np.abs(np.arange(grid.points) / grid.points - 0.5)
        return -self.slope * self.length * np.minimum(across, 0.5 * self.width)


class LineParabola(_Body):
    """Parabolic cylinder h = -x^2 / 2R, a line scene. Paper Eq. (4) in one dimension."""

    dimension: ClassVar[int] = 1
    kind: Literal["line-parabola"] = "line-parabola"
    radius: Positive = 1.0
    """Radius of curvature R [m]."""

    def on(self, grid: Grid) -> Field:
        """Heights [m] at the points of a grid that this process holds."""
        return -(self._along(grid) ** 2) / (2 * self.radius)


class Wave(_Body):
    """Cosine wave h = amplitude cos(2 pi x / L), a line scene (Westergaard's problem)."""

    dimension: ClassVar[int] = 1
    kind: Literal["wave"] = "wave"
    amplitude: Positive = 1.0
    """Amplitude [m]."""

    def on(self, grid: Grid) -> Field:
        """Heights [m] at the points of a grid that this process holds."""
        return self.amplitude * np.cos(2 * np.pi * (np.arange(grid.points) / grid.points - 0.5))
