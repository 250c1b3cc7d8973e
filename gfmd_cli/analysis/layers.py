"""What a figure shows, as data: points, lines and bands, for a page that draws them anew."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gfmd_cli.grid.arrays import Field


@dataclass(frozen=True)
class Layer:
    """Points, a line or a band of a figure."""

    kind: Literal["points", "line", "band"]
    names: tuple[str, ...]
    """Entries of the legend that the layer belongs to, that of its curve first."""
    x: Field
    y: Field
    """Of a band its lower end."""
    colour: str
    """As #rrggbb."""
    marker: str = ""
    """Of points, as matplotlib names it."""
    width: float = 0.9
    """Of a line [points]."""
    dashed: bool = False
    error: Field | None = None
    """Error bars of points, shape (points,), or (2, points) for down and up; NaN: none."""
    high: Field | None = None
    """Upper end of a band."""
    details: Sequence[str] = ()
    """What else is known of each point, a text of some lines."""

    def errors(self) -> tuple[Field, Field] | None:
        """Lengths of the error bars down and up; None without any."""
        if self.error is None or not np.any(np.isfinite(self.error)):
            return None
        down, up = np.broadcast_to(self.error, (2, self.x.size))
        return down, up
