"""What was asked for in [output] beside the scalars: patches, leakage, stiffness."""

import math

from gfmd_cli.analysis.compare import Curve, Row
from gfmd_cli.analysis.further import further_records
from gfmd_cli.analysis.report.contents import Contents, Section
from gfmd_cli.analysis.report.markup import Group, table
from gfmd_cli.analysis.report.units import AREA, P_STAR
from gfmd_cli.physics.surface import dimension_of

HEADER = (
    P_STAR,
    AREA,
    "patches",
    "mean patch [m²; of a line m]",
    "largest patch",
    "stiffness −dp/du_g [Pa/m]",
    "the gap leaks along x",
    "along y",
)
CAPTION = (
    "Contact patches (8 neighbours), contact stiffness at this pressure, and whether the gap "
    "(4 neighbours) goes all the way through the periodic cell."
)


def further(contents: Contents) -> Section | None:
    """A table of those columns, in SI units."""
    groups = [
        Group(name, [_cells(row) for row in curve.rows])
        for name, curve in contents.curves
        if _has_some(curve)
    ]
    if not groups:
        return None
    return Section("Patches, stiffness, leakage", table(CAPTION, HEADER, groups))


def _has_some(curve: Curve) -> bool:
    return bool(further_records(curve)[0])


def _cells(row: Row) -> list[object]:
    cell = float(row["length"]) ** dimension_of(str(row["surface"]).partition(" ")[0])
    return [
        float(row["p_star"]),
        float(row["a_r"]),
        str(row["patches"]) if row["patches"] >= 0 else "–",
        row["patch_area_mean"] * cell,
        row["patch_area_largest"] * cell,
        row["stiffness"] * row["delta_sigma"] / row["h_std"],
        *(_answer(row[f"leaks_{axis}"]) for axis in "xy"),
    ]


def _answer(value: float) -> str:
    known = math.isfinite(value) and value >= 0
    return ("yes" if value else "no") if known else "–"
