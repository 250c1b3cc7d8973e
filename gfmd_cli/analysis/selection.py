"""Groups of contacts, and the choice of those that figures and maps show."""

from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import TypeVar

import numpy as np

TYPICAL_AREA = 0.1  # relative contact area of the paper's Fig. 7
NEAR = 1.5  # pressures that differ by a smaller factor are shown side by side

T = TypeVar("T")
K = TypeVar("K", bound=Hashable)


def grouped(values: Iterable[T], key: Callable[[T], K]) -> dict[K, list[T]]:
    """The values by their keys, in the order in which these occur."""
    groups: dict[K, list[T]] = {}
    for value in values:
        groups.setdefault(key(value), []).append(value)
    return groups


def evenly(values: Sequence[T], max_count: int) -> list[T]:
    """At most `max_count` values at equal distances, the first and the last among them."""
    places = np.linspace(0, len(values) - 1, min(max_count, len(values))).round().astype(int)
    return [values[place] for place in np.unique(places)]


def at_one_pressure(
    groups: Sequence[Sequence[T]], load: Callable[[T], tuple[float, float]]
) -> list[T]:
    """One contact of each group at about one pressure, of the groups that have it.

    The pressure is that of most groups; among several, that at which the contact areas are nearest
    to TYPICAL_AREA. `load` gives p* and a_r of a contact.
    """

    def near(p_star: float) -> list[T]:
        nearest = [
            min(group, key=lambda contact: abs(np.log(load(contact)[0] / p_star)))
            for group in groups
        ]
        return [contact for contact in nearest if 1 / NEAR < load(contact)[0] / p_star < NEAR]

    def rank(p_star: float) -> tuple[int, float]:
        areas = np.array([load(contact)[1] for contact in near(p_star)])
        return -areas.size, float(np.sum(np.abs(np.log(areas / TYPICAL_AREA))))

    pressures = sorted({load(contact)[0] for group in groups for contact in group})
    return near(min(pressures, key=rank)) if pressures else []


def pressure_label(pressures: Sequence[float]) -> str:
    """The reduced pressure, or its range, for the label of an axis."""
    low, high = min(pressures), max(pressures)
    between = f"{low:.3g}" if high < 1.001 * low else rf"{low:.3g}\;\mathrm{{to}}\;{high:.3g}"
    return f"$p^* = {between}$"
