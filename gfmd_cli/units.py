"""Numbers as people read them: with the prefixes of SI units, times, and counts."""

import math

PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}
PREFIXED = ("m", "Pa", "N/m")
"""Units that take a prefix."""
DIGITS = 12  # of a number in a label, so that different parameters have different labels
LARGEST_RMS_HEIGHT = 1e-2
"""Largest rms height of a rough solid [m]; larger ones are in reduced units. A choice."""
SCALE_RANGE = 1e-100, 1e100
"""Allowed lengths [m] and stresses [Pa]: sums of squares over a spectrum are normal numbers."""
LENGTH_RANGE = 1e-30, 1e30
"""Allowed sides of a cell [m]: fourth powers of wavenumbers are normal numbers. A choice."""
DURATIONS = (("d", 86400), ("h", 3600), ("min", 60), ("s", 1))


def scaled(largest: float, unit: str) -> tuple[float, str]:
    """A divisor for values up to `largest`, and the unit with its SI prefix."""
    if not (math.isfinite(largest) and largest > 0):
        return 1.0, unit
    power = 3 * math.floor(math.log10(1.1 * min(largest, 1e300)) / 3)
    power = min(max(power, min(PREFIXES)), max(PREFIXES))
    return 10.0**power, PREFIXES[power] + unit


def labelled(value: float, unit: str) -> str:
    """A number in a label with its unit, if that takes a prefix: "2 GPa"; else as "2e9"."""
    if unit not in PREFIXED:
        return f"{value:.{DIGITS}g}"
    divisor, prefixed = scaled(abs(value), unit)
    return f"{value / divisor:.{DIGITS}g} {prefixed}"


def duration(seconds: float) -> str:
    """A time in the largest unit of which it has two or more, such as "90 s" or "3 h"."""
    unit, size = next(
        ((unit, size) for unit, size in DURATIONS if seconds >= 2 * size), DURATIONS[-1]
    )
    return f"{seconds / size:.0f} {unit}"


def percent(fraction: float) -> str:
    """A fraction in percent: "100%" only if it is 1 or more, "0%" only if it is 0 or less."""
    if 0.995 <= fraction < 1:
        return "over 99%"
    return "under 1%" if 0 < fraction < 0.005 else f"{fraction:.0%}"


def left_out(length: int, limit: int, what: str = "") -> list[str]:
    """A line on how many things a list of at most `limit` leaves out, if any."""
    more = count(length - limit, f"more {what}") if what else f"{length - limit} more"
    return [f"and {more}"] if length > limit else []


def count(number: int, what: str) -> str:
    """A number of things, in the singular or the plural."""
    return f"1 {what}" if number == 1 else f"{number} {what}s"
