"""Symbols as they are set, and values in SI units."""

import math
from collections.abc import Iterable

import numpy as np

from gfmd_cli.analysis.report.markup import Html, number
from gfmd_cli.analysis.tables import plus_minus
from gfmd_cli.physics.fields import Field

P_STAR = Html("<var>p</var>*")
PRESSURE = Html("<var>p</var> [Pa]")
AREA = Html("<var>a</var><sub>r</sub>")
DELTA_SIGMA = Html("Δ<var>σ</var>")
DEVIATION = Html("<var>σ</var><sub>p</sub>")
GAP = Html("<var>u</var><sub>g</sub>")
H_STD = Html("<var>h</var><sub>std</sub>")
PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}
SPACE = "\u00a0"
"""No line breaks here."""
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def largest(values: Field) -> float:
    """The largest finite value, at least zero."""
    return float(np.max(values, initial=0.0, where=np.isfinite(values)))


def scaled(most: float, unit: str) -> tuple[float, str]:
    """What to divide by so that a largest value reads well, and the unit then."""
    if not (math.isfinite(most) and most > 0):
        return 1.0, unit
    power = 3 * math.floor(math.log10(1.1 * most) / 3)
    power = min(max(power, min(PREFIXES)), max(PREFIXES))
    return 10.0**power, PREFIXES[power] + unit


def quantity(value: float, unit: str) -> str:
    """A value with its unit."""
    divisor, prefixed = scaled(abs(value), unit)
    return f"{pretty(value / divisor)}{SPACE}{prefixed}"


def pretty(value: float) -> str:
    """Three digits, as they are printed."""
    mantissa, _, power = number(value, 3).partition("e")
    if not power:
        return mantissa
    return f"{mantissa}{SPACE}×{SPACE}10{str(int(power)).translate(RAISED)}"


def with_error(value: float, error: float) -> object:
    """A value with its error, where that is known."""
    known = math.isfinite(value) and math.isfinite(error)
    return plus_minus(value, abs(error)).replace("+-", "±") if known else float(value)


def span(values: Iterable[float], unit: str = "") -> str:
    """From the least to the largest of the finite values."""
    known = [value for value in values if math.isfinite(value)]
    if not known:
        return "unknown"
    low, high = (quantity(end, unit) if unit else pretty(end) for end in (min(known), max(known)))
    if low == high:
        return low
    bare, _, low_unit = low.rpartition(SPACE)
    return f"{bare if unit and high.endswith(SPACE + low_unit) else low} to {high}"


def count(number_of: int, what: str) -> str:
    """So many things."""
    if number_of == 1:
        return f"1 {what}"
    return f"{number_of} {what[:-1] + 'ies' if what.endswith('dy') else what + 's'}"


def told(words: list[str]) -> str:
    """Words as a sentence lists them."""
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " and " + words[-1]
