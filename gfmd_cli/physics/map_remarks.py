"""Warnings about probable mistakes in the use of a measured map."""

import numpy as np

from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.map_preparation import border_step

STEEP = 3.0  # rms gradient; a choice: surfaces of machined or worn solids have less
SMOOTH = 1e-6  # rms gradient; a choice: polished mirrors have about that
CLIFF = 5.0  # ratio of the step across the border to that inside; a choice: 1 if periodic
FILLED = 0.05  # share of filled heights; a choice, as for the frame of the window


def map_remarks(
    heights: Field, sides: tuple[float, ...], *, unsized: bool, repeated: bool, filled: float
) -> list[str]:
    """Warnings about a missing side, filled heights, an unusual gradient and a step at the border.

    Parameters
    ----------
    heights : the prepared heights [m]
    sides : sides of their cell [m]
    unsized : whether neither the spec nor the file gives the side
    repeated : whether the map is taken as periodic
    filled : share of the heights that are missing and were filled in
    """
    remarks = []
    if unsized:
        remarks.append("the file does not state its side; L = 1 m is assumed: set surface.length")
    if filled > FILLED:
        remarks.append(
            f"{filled:.0%} of the heights are missing and were filled in: contact there was not "
            'measured; set surface.region, or surface.missing = "void" where nothing can touch'
        )
    points_per_metre = (n / side for n, side in zip(heights.shape, sides, strict=True))
    slopes = (np.diff(heights, axis=i) * each for i, each in enumerate(points_per_metre))
    gradient = np.sqrt(sum(float(np.mean(slope**2)) for slope in slopes))
    if gradient > STEEP or 0 < gradient < SMOOTH:
        remarks.append(
            f"rms gradient {gradient:.3g}: check that heights and side are in metres; "
            "surface.scale is the factor from the heights of the file to metres, "
            "surface.length the side"
        )
    cliff = border_step(heights) if repeated else 1.0
    if cliff > CLIFF:
        remarks.append(
            f"the height step across the border is {cliff:.3g} times that inside the map: if the "
            "map is not periodic, set surface.periodic = false"
        )
    return remarks
