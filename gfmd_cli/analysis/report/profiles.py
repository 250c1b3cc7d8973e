"""Cross-sections: heights of the indenter and of the body above it, and the stress."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from gfmd_cli.analysis.compare import Row
from gfmd_cli.analysis.report.units import largest, scaled
from gfmd_cli.analysis.sheet import HEIGHT, WIDTH, Page
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.surface import dimension_of
from gfmd_cli.study.reading import fields_of

LINES = {
    "height": ("indenter h", {"color": "black", "lw": 1.2}),
    "u": ("surface of the body u", {"color": "#0077bb", "lw": 0.9}),
}
STRESS = "#cc3311"


@dataclass(frozen=True)
class Profile:
    """Values along a line through the cell."""

    values: dict[str, Field]
    """Of u and height [m], sigma [Pa]; not all need be there."""
    position: Field
    """[m]"""
    along: str
    pressure: float
    """Nominal, [Pa]: stresses far below are rounding."""


def read_profile(file: Any, row: Row) -> Profile | None:
    """The cross-section of a contact; a line scene may have stored it as its fields."""
    line = not plane(row)
    values = fields_of(file, f"cross_sections/{row['task']}")
    if line and not values:
        values = fields_of(file, f"fields/{row['task']}")
    if not values:
        return None
    size = next(iter(values.values())).size
    step = float(row["length"]) / size * (1.0 if line else np.sqrt(2))
    return Profile(
        values, np.arange(size) * step, "the cell" if line else "the diagonal", row["pressure"]
    )


def plane(row: Row) -> bool:
    """Whether a contact has maps, or is a line scene."""
    return dimension_of(str(row["surface"]).partition(" ")[0]) == 2


def profile_sheet(profile: Profile) -> Page:
    """Heights above, stress below, over one position."""
    page = Page(WIDTH, 1.5 * HEIGHT)
    divisor, unit = scaled(float(profile.position[-1]), "m")
    x = profile.position / divisor
    upper, lower = page.figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    _draw_heights(page, upper, x, profile)
    _draw_stress(lower, x, profile)
    lower.set(xlabel=f"position along {profile.along} ({unit})", xlim=(x[0], x[-1]))
    return page


def _draw_heights(page: Page, axes: Any, x: Field, profile: Profile) -> None:
    heights = {name: profile.values[name] for name in LINES if name in profile.values}
    most = max((largest(np.abs(y)) for y in heights.values()), default=0.0)
    divisor, unit = scaled(most, "m")
    for name, y in heights.items():
        label, style = LINES[name]
        page.legend[label] = axes.plot(x, y / divisor, **style)[0]  # of either sign
    axes.set_ylabel(f"height ({unit})")


def _draw_stress(axes: Any, x: Field, profile: Profile) -> None:
    if "sigma" not in profile.values:
        return
    sigma = profile.values["sigma"]
    top = max(largest(sigma), profile.pressure)
    divisor, unit = scaled(top, "Pa")
    axes.plot(x, sigma / divisor, color=STRESS, lw=0.9)
    axes.set_ylabel(rf"$\sigma$ ({unit})")
    axes.set_ylim(-0.05 * top / divisor, 1.1 * top / divisor)
