"""What a task has solved before its present grid; a checkpoint stores it beside the state."""

from dataclasses import dataclass, field
from typing import Annotated

from pydantic import ConfigDict, Strict, with_config
from pydantic import Field as Key

from gfmd_cli.physics.indenters import MAX_POINTS

PointCount = Annotated[int, Strict(), Key(ge=1, le=MAX_POINTS)]
"""Number of points along an axis."""
_Finite = Annotated[float, Key(allow_inf_nan=False)]


@dataclass(frozen=True)
class SolvedGrid:
    """Results on one grid, in units that all grids share."""

    points: PointCount
    a_r: float
    sigma_p: float
    """[Pa]."""
    u_g: float
    """[m]."""
    perimeter: float
    cost: float
    """Transforms times grid points."""
    border: float | None = None
    """Share of the border in contact, with a free boundary."""


@dataclass(frozen=True)
class Trial:
    """One solve of a load search."""

    points: PointCount
    pressure: Annotated[_Finite, Key(gt=0)]
    """[Pa]."""
    value: _Finite
    """Contact area, mean gap or displacement [m] of the solution.

    A mean gap is negative where the elastomer enters missing heights deeper than those filled in.
    """
    cost: float
    """Transforms times grid points."""
    observables: dict[str, _Finite] = field(default_factory=dict)
    """a_r, sigma_p [Pa] and u_g [m]; that of the load is `value`. None without convergence."""
    is_neighbour: bool = False
    """Whether the trial is not one of the search, but gives the slopes at its root."""
    is_touching: bool = False
    """Whether points of the grid are in contact, where the continuum value of the area may be 0."""


@with_config(ConfigDict(strict=True, extra="forbid"))
@dataclass
class TaskHistory:
    """Results of the grids and of the trials that have ended."""

    grids: list[SolvedGrid] = field(default_factory=list)
    trials: list[Trial] = field(default_factory=list)
