"""Groups of contacts, and a choice among many."""

from collections.abc import Callable, Hashable, Iterable, Sequence
from typing import TypeVar

import numpy as np

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
