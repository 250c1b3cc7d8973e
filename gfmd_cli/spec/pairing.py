"""Paired lists of a run spec: table [sweep], checked against the lists that it names."""

from typing import Any

from gfmd_cli.spec.models import SweepTable

Places = tuple[int | None, ...]
"""Where an entry stands in each group of paired lists; None where it has no list of the group."""


def alternatives(given: Any) -> list[Any]:
    """The tables of a name that may be repeated."""
    return given if isinstance(given, list) and given else [given]


def keys_of(table: str, sweeps: list[SweepTable]) -> list[list[str]]:
    """The keys of one table in each group of paired lists."""
    addresses = [[key.partition(".") for key in sweep.paired] for sweep in sweeps]
    return [[key for name, _, key in group if name == table] for group in addresses]


def places_of(where: dict[str, int], groups: list[list[str]]) -> Places:
    """The places of an entry, from the place of each key in its list."""
    return tuple(next((where[key] for key in group if key in where), None) for group in groups)


def problems_of(sweep: SweepTable, data: dict[str, Any]) -> list[str]:
    """What is wrong with one group of paired lists."""
    lengths: dict[str, list[int]] = {}
    for address in sweep.paired:
        table, _, key = address.partition(".")
        values = [a.get(key) for a in alternatives(data.get(table, {})) if isinstance(a, dict)]
        lengths[address] = [len(value) for value in values if isinstance(value, list)]
    problems = [f"{address} has no list" for address, found in lengths.items() if not found]
    if len(lengths) < len(sweep.paired):
        problems.append("a key is named twice")
    if len({length for found in lengths.values() for length in found}) > 1:
        told = [f"{address} has {' and '.join(map(str, n))}" for address, n in lengths.items()]
        problems.append(f"all lists must have the same length; {', '.join(told)}")
    return problems
