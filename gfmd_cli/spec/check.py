"""From plain tables to a Spec, or to one message that says what is wrong and where."""

import os
import re
from collections.abc import Iterable, Sequence
from datetime import date, time
from difflib import get_close_matches
from itertools import product
from math import prod
from pathlib import Path
from typing import Any, get_args

from pydantic import TypeAdapter, ValidationError

from gfmd_cli.errors import InputError
from gfmd_cli.spec import models
from gfmd_cli.spec_table import SpecTable
from gfmd_cli.units import left_out

MAX_SHOWN = 200  # characters of what was given, in a message
MAX_PROBLEMS = 20  # of a spec that a message lists
MAX_SWEEP = 100_000  # combinations of one table

NUMBER = re.compile(r"\s*[+-]?\d[\d_]*\.?\d*([eE][+-]?\d+)?\s*")
WORDS = {
    "string_pattern_mismatch": "must begin with a letter or a digit and contain only letters, "
    "digits, '.', '_' and '-', at most 100 of them",
    "path_type": "must be the name of a file",
    "model_type": "must be a table",
    "bool_type": "must be true or false",
    "too_short": "must have {min_length} or more values",
    "too_long": "must have at most {max_length} values",
}
"""What is allowed, by the type of pydantic's error, where its message is not plain."""
ESCAPED = re.compile(r"[\0\b\t\n\f\r]")
"""Characters that TOML writes with a backslash, and that are rare in a path, or not allowed."""
BACKSLASH = (
    "a backslash begins an escape such as \\n; write paths in single quotes or with forward slashes"
)
OTHER_NAMES = {
    **dict.fromkeys(("rms", "h_rms", "rms_height", "sq"), "h_std"),
    **dict.fromkeys(("side", "size"), "length"),
}
"""Keys by other usual names, in small letters."""
LONG_NUMBER = re.compile(r"\d{20,}|0\.0{15,}\d+")
"""A limit that pydantic prints with all its zeros."""
MODELS: dict[str, Any] = {
    name: next(iter(get_args(field.annotation)), field.annotation)  # of a list, or `| None`
    for name, field in models.Spec.model_fields.items()
    if name not in ("source", "places")
}
"""The class of each table, or the union of the classes of its kinds, as `Spec` declares them."""
ADAPTERS: dict[str, TypeAdapter[Any]] = {name: TypeAdapter(MODELS[name]) for name in MODELS}
DEFAULT_KINDS = {"solver": "auto"}
"""Kinds of the tables whose `kind` may be left out."""
REQUIRED = ("surface", "elastomer", "grid", "load")


def kinds_of(table: str) -> dict[str, type[SpecTable]]:
    """The classes of a table by their `kind`; empty for a table without kinds."""
    union = next(iter(get_args(MODELS.get(table))), None)
    return {choice.model_fields["kind"].default: choice for choice in get_args(union)}


Places = tuple[int | None, ...]
"""Where an entry stands in each group of paired lists; None where it has no list of the group."""
PlacedTable = tuple[SpecTable, Places]
"""An entry and where it stands."""


class Check:
    """The check of the tables of one spec, which collects all that is wrong.

    Each problem has its place: the line in `text`, or the --set that gave the key. Paths are
    relative to `folder`.
    """

    def __init__(
        self, name: str, text: str = "", overrides: Sequence[str] = (), folder: Path = Path()
    ) -> None:
        self.name, self.folder = name, folder
        self.problems: list[str] = []
        self.given_at = {
            override.partition("=")[0].strip(): f"--set {override}" for override in overrides
        }
        table = ""
        for number, line in enumerate(text.splitlines(), 1):
            place = f"{name}:{number}"
            if header := re.match(r"\s*\[+\s*([\w.\-]+)\s*\]+", line):
                table = header[1]
                self.given_at.setdefault(table, place)
            elif key := re.match(r"\s*([\w.\-]+)\s*=", line):
                self.given_at.setdefault(f"{table}.{key[1]}" if table else key[1], place)
        for address, place in list(self.given_at.items()):  # of a table that the text does not have
            self.given_at.setdefault(address.partition(".")[0], place)

    def where(self, key: str) -> str:
        """The place of a key, or of the table around it."""
        plain = re.sub(r"\[\d+\]", "", key)
        while plain and plain not in self.given_at:
            plain = plain.rpartition(".")[0]
        return self.given_at.get(plain, self.name)

    def add(self, key: str, text: str) -> None:
        """Note what is wrong with a key."""
        self.problems.append(f"{self.where(key)}: {key}: {text}")

    def refuse(self) -> None:
        """Raise InputError with all that is wrong, if anything is."""
        if self.problems:
            lines = list(dict.fromkeys(self.problems))
            more = left_out(len(lines), MAX_PROBLEMS)
            raise InputError("\n".join([*lines[:MAX_PROBLEMS], *more]))

    def spec(self, data: dict[str, Any]) -> models.Spec:
        """The spec of these tables. Raises InputError."""
        for name in map(str, data):  # tables from Python may have other keys
            if name not in MODELS:
                self.problems.append(f"{self.where(name)}: {_unknown(name, MODELS, 'table')}")
        sweeps = self._sweeps(data)
        tables: dict[str, Any] = {"sweep": sweeps, "places": {}, "source": self.name}
        for name in filter(lambda name: name != "sweep", MODELS):
            if name in REQUIRED and name not in data:
                self.problems.append(f"{self.name}: table [{name}] is missing")
                continue
            entries = self.entries(name, data.get(name, {}), _keys_of(name, sweeps))
            choices = [choice for choice, _ in entries]
            tables[name] = choices if name in models.SWEPT else next(iter(choices), None)
            tables["places"][name] = [places for _, places in entries]
        if load := tables.get("load"):
            groups = _keys_of("load", sweeps)
            places = [_places_of({load.key: i}, groups) for i in range(len(load.listed()))]
            tables["places"]["load"] = places
        if "accuracy" not in data:
            tables["accuracy"] = None
        self._compare(tables)
        self.refuse()
        return models.Spec(**tables)

    def entries(self, name: str, given: Any, paired: Sequence[list[str]] = ()) -> list[PlacedTable]:
        """The distinct choices of one table, with their places in the paired lists."""
        entries: list[PlacedTable] = []
        for table in _alternatives(given) if name in models.REPEATED else [given]:
            if isinstance(table, dict):
                entries += self._build(name, table, paired)
            else:
                self.add(name, f"must be a table, got {_shown(table)}")
        return list(dict.fromkeys(entries)) if name in models.SWEPT else entries

    def _build(
        self, name: str, table: dict[str, Any], paired: Sequence[list[str]]
    ) -> list[PlacedTable]:
        """The choices of one table, every combination of its lists."""
        axes = _axes(table, paired) if name in models.SWEPT else []
        for key in (key for keys in axes for key in keys if not table[key]):
            self.add(f"{name}.{key}", "must have 1 or more values, got []")
        count = prod(len(table[keys[0]]) for keys in axes)
        if count > MAX_SWEEP:
            self.add(name, f"its lists have {count} combinations; at most {MAX_SWEEP} are allowed")
            return []
        built: list[PlacedTable] = []
        for indices in product(*(range(len(table[keys[0]])) for keys in axes)):
            places = {key: i for keys, i in zip(axes, indices, strict=True) for key in keys}
            values = table | {key: table[key][i] for key, i in places.items()}
            path = values.get("path")
            if isinstance(path, str):
                if ESCAPED.search(path) and not os.path.exists(self.folder / path):
                    self.add(f"{name}.path", f"no such file {shortened(repr(path))}: {BACKSLASH}")
                    continue
                values = values | {"path": os.path.realpath(self.folder / path)}
            if name in DEFAULT_KINDS:
                values = {"kind": DEFAULT_KINDS[name]} | values
            try:
                built.append((ADAPTERS[name].validate_python(values), _places_of(places, paired)))
            except ValidationError as error:
                for detail in error.errors(include_url=False):
                    self.add(*_problem(name, places, detail))
        return built

    def _sweeps(self, data: dict[str, Any]) -> list[models.SweepTable]:
        """The valid groups of paired lists."""
        sweeps: list[models.SweepTable] = []
        for sweep, _ in self.entries("sweep", data["sweep"]) if "sweep" in data else []:
            assert isinstance(sweep, models.SweepTable)
            problems = _problems_of(sweep, data)
            for text in problems:
                self.add("sweep.paired", text)
            sweeps += [] if problems else [sweep]
        return sweeps

    def _compare(self, tables: dict[str, Any]) -> None:
        """Note contradictions between tables that are valid by themselves."""
        accuracy, load = tables["accuracy"], tables.get("load")
        auto = [grid for grid in tables.get("grid", []) if grid.points == "auto"]
        if auto and accuracy is None:
            self.add(
                "grid.points",
                '"auto" needs a table [accuracy] with the accuracy to reach, such as '
                "mean_gap = 0.01",
            )
        if any(grid.points_y is not None for grid in auto):
            self.add(
                "grid.points_y",
                'with grid.points = "auto" the points along y follow from the sides; give '
                "surface.length_y",
            )
        if auto and load is not None and models.LOADS[load.key].searched:
            self.add(
                "grid.points",
                f'"auto" needs load.p_star or load.pressure; load.{load.key} is searched on '
                "a given grid",
            )
        given = [grid.points for grid in tables.get("grid", [])]
        if accuracy is not None and given and not auto and min(given) > accuracy.max_points:
            self.add(
                "accuracy.max_points",
                f"{accuracy.max_points} given, but grid.points = {min(given)}: it has "
                'an effect only with grid.points = "auto"; leave it out, or make it as large',
            )
        if accuracy is not None and not accuracy.tolerances():
            self.add("accuracy", "give mean_gap, contact_area or stress_deviation")


def _axes(table: dict[str, Any], paired: Sequence[list[str]]) -> list[list[str]]:
    """The keys of a table that have a list, those of paired lists together."""
    swept = [key for key, value in table.items() if isinstance(value, list)]
    groups = [[key for key in swept if key in group] for group in paired]
    single = [[key] for key in swept if not any(key in group for group in groups)]
    return [*filter(None, groups), *single]


def _alternatives(given: Any) -> list[Any]:
    """The tables of a name that may be repeated."""
    return given if isinstance(given, list) and given else [given]


def _keys_of(table: str, sweeps: list[models.SweepTable]) -> list[list[str]]:
    """The keys of one table in each group of paired lists."""
    addresses = [[key.partition(".") for key in sweep.paired] for sweep in sweeps]
    return [[key for name, _, key in group if name == table] for group in addresses]


def _places_of(where: dict[str, int], groups: Sequence[list[str]]) -> Places:
    """The places of an entry, from the place of each key in its list."""
    return tuple(next((where[key] for key in group if key in where), None) for group in groups)


def _problems_of(sweep: models.SweepTable, data: dict[str, Any]) -> list[str]:
    """What is wrong with one group of paired lists."""
    lengths: dict[str, list[int]] = {}
    for address in sweep.paired:
        table, _, key = address.partition(".")
        values = [a.get(key) for a in _alternatives(data.get(table, {})) if isinstance(a, dict)]
        lengths[address] = [len(value) for value in values if isinstance(value, list)]
    problems = [f"{address} has no list" for address, counts in lengths.items() if not counts]
    if len(lengths) < len(sweep.paired):
        problems.append("a key is named twice")
    if len({length for counts in lengths.values() for length in counts}) > 1:
        lists = [f"{address} has {' and '.join(map(str, n))}" for address, n in lengths.items()]
        problems.append(f"all lists must have the same length; {', '.join(lists)}")
    return problems


def _problem(name: str, places: dict[str, int], detail: Any) -> tuple[str, str]:
    """The key, and what was given and what is allowed."""
    kinds, loc = kinds_of(name), list(detail["loc"])
    if detail["type"].startswith("union_tag") and kinds and not loc:
        if detail["type"] == "union_tag_not_found":
            return f"{name}.kind", f"is missing (known: {', '.join(kinds)})"
        return f"{name}.kind", _unknown(str(detail["ctx"]["tag"]), kinds, "kind")
    model = kinds[loc.pop(0)] if kinds else MODELS[name]
    path = [part for part in loc if part not in models.SHAPES]
    key = name
    for part in path:
        key += f"[{part}]" if isinstance(part, int) else f".{part}"
        key += f"[{places[part]}]" if part in places else ""
    if detail["type"] == "extra_forbidden":
        within = models.GeometricSequence if len(path) > 1 else model
        known = [field.alias or field_name for field_name, field in within.model_fields.items()]
        text = _unknown(str(path[-1]), known, "key")
        owners = [kind for kind, other in kinds.items() if path[-1] in other.model_fields]
        return key, text + (f"; kind {' or '.join(owners)} has it" if owners else "")
    return key, _refusal(detail)


def _refusal(detail: Any) -> str:
    """What is allowed and what was given, of a value that pydantic refuses."""
    error, given, message = detail["type"], detail["input"], detail["msg"]
    if error == "missing":
        return "is missing"
    message = message.removeprefix("Value error, ").replace("Input should", "must")
    message = message[:1].lower() + message[1:]
    if error.startswith(("greater_than", "less_than")):
        message = LONG_NUMBER.sub(lambda number: f"{float(number[0]):g}", message)
    if error in WORDS:
        message = WORDS[error].format(**detail.get("ctx", {}))
    if error == "value_error" and isinstance(given, dict):  # of a whole table
        return str(message)
    text = f"{message}, got {_shown(given)}"
    if isinstance(given, str) and NUMBER.fullmatch(given):
        text += ": write a number as TOML has it, such as 1.0 or 10, without quotation marks"
    return text


def _unknown(given: str, known: Iterable[str], what: str) -> str:
    """Message for a name that is not known, with the nearest known one.

    Names that contain the given one, or are part of it, come first: `points` for `points_x`.
    """
    meant = OTHER_NAMES.get(given.lower(), given[:MAX_SHOWN])
    related = [
        name
        for name in known
        if min(len(name), len(meant)) > 2 and (name in meant or meant in name)
    ]
    matches = get_close_matches(meant, related or known, 1, 0.0 if related else 0.6)
    hint = f" - did you mean {matches[0]!r}?" if matches else ""
    return f"unknown {what} {shortened(given)!r}{hint} (known: {', '.join(known)})"


def _shown(given: Any) -> str:
    """A value in a message; truth values and dates as TOML has them."""
    if isinstance(given, bool):
        return str(given).lower()
    return str(given) if isinstance(given, date | time) else shortened(repr(given))


def shortened(text: str, limit: int = MAX_SHOWN) -> str:
    """A text short enough for a message."""
    return text if len(text) <= limit else text[:limit] + "..."
