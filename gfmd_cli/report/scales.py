"""Axes of maps and cross-sections: in SI units where those mean something, else reduced."""

from typing import NamedTuple

from gfmd_cli.analysis.compare import Row
from gfmd_cli.analysis.units import in_si
from gfmd_cli.units import scaled


class Scale(NamedTuple):
    """Units of a quantity."""

    si: str
    column: str
    """Column of a row that holds the reduced unit."""
    symbol: str

    def axis(self, row: Row, most: float, label: str) -> tuple[float, str]:
        """A divisor for values up to `most`, and the label with the unit that this gives."""
        if in_si(row):
            divisor, unit = scaled(most, self.si)
            return divisor, f"{label} ({unit})"
        return float(row[self.column]), f"{label} / {self.symbol}"


LENGTH_SCALE = Scale("m", "length", "L")
HEIGHT_SCALE = Scale("m", "h_std", r"$h_\mathrm{std}$")
STRESS_SCALE = Scale("Pa", "delta_sigma", r"$\Delta\sigma$")
