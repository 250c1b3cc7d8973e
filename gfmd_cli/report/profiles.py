"""Cross-sections: heights of indenter and elastomer, and the stress.

Their axes, and those of maps, are in SI units where these mean something, else reduced.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from gfmd_cli.analysis.plotting import HEIGHT, WIDTH, LegendFigure
from gfmd_cli.analysis.wording import in_si, largest
from gfmd_cli.grid.arrays import Field
from gfmd_cli.study.column import Row
from gfmd_cli.study.reading import StudyFile
from gfmd_cli.units import scaled

LINES = {
    "height": ("indenter h", {"color": "black", "lw": 1.2}),
    "u": ("elastomer u", {"color": "#0077bb", "lw": 0.9}),
}
STRESS = "#cc3311"
ROWS = 256  # of fields, or of pixels of a map, that are in memory at a time


class Scale(NamedTuple):
    """Units of a quantity on axes."""

    si: str
    column: str
    """Column of a row that holds the reduced unit."""
    symbol: str

    def axis(self, row: Row, largest_value: float, label: str) -> tuple[float, str]:
        """A divisor for values up to `largest_value`, and the label with its unit."""
        if in_si(row):
            divisor, unit = scaled(largest_value, self.si)
            return divisor, f"{label} ({unit})"
        return float(row[self.column]), f"{label} / {self.symbol}"


LENGTH_SCALE = Scale("m", "length", "L")
HEIGHT_SCALE = Scale("m", "h_std", r"$h_\mathrm{std}$")
STRESS_SCALE = Scale("Pa", "delta_sigma", r"$\Delta\sigma$")


@dataclass(frozen=True)
class Profile:
    """Values along a line through the cell."""

    values: dict[str, Field]
    """Stored ones of u [m], height [m] and sigma [Pa], each of shape (points,)."""
    position: Field
    """Distance along the line [m], shape (points,)."""
    along: str
    """Name of the line."""
    row: Row
    """The contact; stresses far below its nominal pressure are rounding."""
    place: str = ""
    """Where the line lies in the cell, in words."""


def read_profile(study: StudyFile, row: Row) -> Profile | None:
    """The cross-section of a contact; a line contact may have stored it as its fields.

    Where the fields of a cell are stored, the row of the grid that carries most load; the diagonal,
    which can miss all contacts, only where that alone is stored.
    """
    line = not plane(row)
    if not line and (profile := _most_loaded(study, row)):
        return profile
    values = study.arrays("cross_sections", row["task"])
    if line and not values:
        values = study.arrays("fields", row["task"])
    if not values:
        return None
    size = next(iter(values.values())).size
    length = float(row["length"])
    step = (length if line else float(np.hypot(length, row["length_y"]))) / size
    position = (np.arange(size) + size * row["x_first"]) * step
    return Profile(values, position, "the cell" if line else "the diagonal", row)


def _most_loaded(study: StudyFile, row: Row) -> Profile | None:
    """The row of the grid that carries most load; None where not all fields are stored."""
    loads, values = np.empty(0), {}
    for block in study.blocks("fields", row["task"], ROWS, (*LINES, "sigma")):
        if len(block) <= len(LINES):
            return None
        of_block = np.nan_to_num(np.maximum(block["sigma"], 0.0)).sum(axis=1)
        if of_block.max() > loads.max(initial=-1.0):
            values = {name: data[np.argmax(of_block)].copy() for name, data in block.items()}
        loads = np.append(loads, of_block)
    if not values:
        return None
    y, size = int(np.argmax(loads)), values["sigma"].size
    position = (np.arange(size) / size + row["x_first"]) * float(row["length"])
    place = f" through the row that carries most load (y = {y / loads.size:.2f} of the side)"
    return Profile(values, position, "x", row, place)


def plane(row: Row) -> bool:
    """Whether a contact has maps; a line contact has none."""
    return int(row["dimension"]) == 2


def profile_figure(profile: Profile) -> LegendFigure:
    """Heights above, stress below, over one position."""
    plot = LegendFigure(WIDTH, 1.5 * HEIGHT)
    length = float(np.ptp(profile.position))
    divisor, label = LENGTH_SCALE.axis(profile.row, length, f"position along {profile.along}")
    x = profile.position / divisor
    upper, lower = plot.figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    _draw_heights(plot, upper, x, profile)
    _draw_stress(lower, x, profile)
    lower.set(xlabel=label, xlim=(x[0], x[-1]))
    return plot


def _draw_heights(plot: LegendFigure, axes: Any, x: Field, profile: Profile) -> None:
    heights = {name: profile.values[name] for name in LINES if name in profile.values}
    highest = max((largest(np.abs(y)) for y in heights.values()), default=0.0)
    divisor, axis = HEIGHT_SCALE.axis(profile.row, highest, "height")
    for name, y in heights.items():
        label, style = LINES[name]
        plot.legend[label] = axes.plot(x, y / divisor, **style)[0]  # of either sign
    axes.set_ylabel(axis)


def _draw_stress(axes: Any, x: Field, profile: Profile) -> None:
    if "sigma" not in profile.values:
        return
    sigma = profile.values["sigma"]
    top = max(largest(sigma), profile.row["pressure"])
    divisor, label = STRESS_SCALE.axis(profile.row, top, r"$\sigma$")
    axes.plot(x, sigma / divisor, color=STRESS, lw=0.9)
    axes.set_ylabel(label)
    axes.set_ylim(-0.05 * top / divisor, 1.1 * top / divisor)
