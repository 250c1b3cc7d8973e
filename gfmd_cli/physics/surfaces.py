"""The union of all kinds of surface, and their heights on a grid.

Each class is one `kind` of [surface] in the run spec. Heights h increase towards the elastomer.
"""

from dataclasses import replace
from typing import Annotated

import numpy as np
from pydantic import Field as Key

from gfmd_cli.errors import InputError
from gfmd_cli.grid.arrays import Field
from gfmd_cli.grid.distributed import create_grid
from gfmd_cli.grid.fft_grid import Grid
from gfmd_cli.grid.ranks import Ranks
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.indenters import Indenter, RigidSurface
from gfmd_cli.physics.self_affine import SelfAffine

Surface = Annotated[SelfAffine | Indenter | FileSurface, Key(discriminator="kind")]


def sample(
    surface: RigidSurface,
    points: int,
    points_y: int = 0,
    ranks: Ranks | None = None,
    *,
    is_temporary: bool = False,
) -> tuple[Grid, Field]:
    """Make the grid of so many points on the cell of a surface, and the heights [m] on it.

    `ranks` are the processes that share large grids. By default the number of points along y
    makes the pixels square. `is_temporary` is that of the grid.

    Raises InputError where the grid does not resolve the surface, the surface is flat, or its
    heights overflow.
    """
    whole = replace(surface.grid(points, points_y), is_temporary=is_temporary)
    surface.check_resolved(points, whole.points_y)
    grid = create_grid(whole, ranks)
    with np.errstate(over="ignore", invalid="ignore"):  # refused below
        heights = surface.heights_on(grid)
        range_of_heights = grid.max(float(heights.max())) - grid.min(float(heights.min()))
    if not np.isfinite(range_of_heights):
        raise InputError(f"surface: heights overflow (kind {surface.kind!r}); choose other units")
    if range_of_heights == 0:
        raise InputError(f"surface: flat (kind {surface.kind!r}); reduced units need roughness")
    return grid, heights
