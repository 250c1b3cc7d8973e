"""From TOML text to a Spec, or to one message that says what is wrong and where."""

import os
import re
import tomllib
from collections.abc import Sequence
from difflib import get_close_matches
from math import prod
from pathlib import Path
from typing import Any, get_args

from pydantic import TypeAdapter, ValidationError

from gfmd_cli.choice import Choice
from gfmd_cli.errors import InputError
from gfmd_cli.files.hdf5 import MAGIC
from gfmd_cli.files.regular import open_regular
from gfmd_cli.physics.array_files import map_names
from gfmd_cli.physics.elastomers import Elastomer, LinearElastomer
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.physics.surfaces import Surface
from gfmd_cli.solvers.auto import AnySolver
from gfmd_cli.spec.models import (
    LOADS,
    SHAPES,
    SOUGHT,
    SWEPT,
    AccuracyTable,
    GridTable,
    Ladder,
    LoadTable,
    OutputTable,
    Spec,
    StudyTable,
    SweepTable,
    axes_of,
    expand,
)
from gfmd_cli.spec.pairing import Places, alternatives, keys_of, places_of, problems_of

MAX_BYTES = 256 * 1024  # of a spec; a few kB are usual
MAX_DEPTH = 16  # of tables and lists
MAX_DOTS = 2000  # in a line; of a dotted key tomllib takes memory with their square
MAX_SHOWN = 200  # characters of what was given, in a message
MAX_PROBLEMS = 20  # of a spec that a message lists
MAX_SWEEP = 100_000  # combinations of one table

NUMBER = re.compile(r"\s*[+-]?\d[\d_]*\.?\d*([eE][+-]?\d+)?\s*")
WORDS = {
    "string_pattern_mismatch": "must begin with a letter or a digit and contain only letters, "
    "digits, '.', '_' and '-', at most 100 of them"
}
"""What is allowed, by the type of pydantic's error, where its message is a regular expression."""
MODELS: dict[str, Any] = {
    "study": StudyTable,
    "surface": Surface,
    "elastomer": Elastomer,
    "grid": GridTable,
    "load": LoadTable,
    "solver": AnySolver,
    "output": OutputTable,
    "accuracy": AccuracyTable,
    "sweep": SweepTable,
}
"""The class of each table, or the union of the classes of its kinds."""
ADAPTERS: dict[str, TypeAdapter[Any]] = {name: TypeAdapter(MODELS[name]) for name in MODELS}
DEFAULT_KINDS = {"solver": "auto"}
"""Of the tables whose `kind` may be left out."""
REQUIRED = ("surface", "elastomer", "grid", "load")


def kinds_of(table: str) -> dict[str, type[Choice]]:
    """The classes of a table by their `kind`; empty for a table without kinds."""
    model = MODELS[table]
    if isinstance(model, type):
        return {}
    return {choice.model_fields["kind"].default: choice for choice in get_args(get_args(model)[0])}


def read_spec(path: Path, overrides: tuple[str, ...] = ()) -> tuple[Spec, str]:
    """Read and check a run spec.

    Parameters
    ----------
    path : the TOML file
    overrides : "key.name=value", the value in TOML or a bare word

    Returns the spec and the text of the file. Raises InputError with all that is wrong.
    """
    try:
        with open_regular(path, follow=True) as file:
            raw = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    if raw.startswith(MAGIC):
        raise InputError(
            f"{path}: an HDF5 file such as a study, where a run spec (TOML) is expected; "
            f"`gfmd analyze {path}` shows the results of a study"
        )
    if len(raw) > MAX_BYTES:
        raise InputError(f"{path}: too long; a run spec has at most {MAX_BYTES} bytes")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text (byte {error.start})") from error
    return read_text(text, path, overrides), text


def read_tables(data: dict[str, Any]) -> Spec:
    """Check the tables of a run spec; paths are relative to the working directory.

    Raises InputError with all that is wrong.
    """
    if _is_deep(data):
        raise InputError(f"spec: nested deeper than {MAX_DEPTH}")
    return build_spec(data, Path(), _Where("spec", "", {}))


def read_scan(path: Path, overrides: tuple[str, ...] = ()) -> FileSurface:
    """A height map as a surface, "surface.key=value" each; the first one of several in a file.

    Raises InputError.
    """
    data: dict[str, Any] = {"surface": {"kind": "file", "path": str(path)}}
    surface = _only_choice("surface", data, path, overrides)
    if set(data) != {"surface"}:
        raise InputError(f"{path}: --set takes surface.key=value with one value, for a height map")
    if not isinstance(surface, FileSurface):
        raise InputError(f'{path}: surface.kind must be "file" for a height map')
    names = map_names(path) if surface.dataset is None else []
    first = {"dataset": names[0]} if len(names) > 1 else {}
    return surface.model_copy(update={"path": path, **first})  # the path as given, for messages


def read_elastomer(default: dict[str, Any], overrides: tuple[str, ...]) -> LinearElastomer:
    """The elastomer of a spec that is to be written, "elastomer.key=value" each.

    A kind replaces the default. Raises InputError.
    """
    other = any(override.partition("=")[0].strip() == "elastomer.kind" for override in overrides)
    data: dict[str, Any] = {"elastomer": {} if other else dict(default)}
    elastomer = _only_choice("elastomer", data, Path("spec"), overrides)
    assert isinstance(elastomer, LinearElastomer)
    return elastomer


def _only_choice(name: str, data: dict[str, Any], path: Path, overrides: tuple[str, ...]) -> Choice:
    """The one choice of a table, with overrides applied to `data`; the first of a sweep."""
    for override in overrides:
        set_override(data, override)
    problems: list[str] = []
    where = _Where(str(path), "", _given_by(overrides))
    built = _build(name, data[name], Path(), where, problems)
    if name == "surface" and not problems and len(built) != 1:
        problems.append(f"{path}: --set takes surface.key=value with one value, for a height map")
    if problems:
        raise InputError("\n".join(problems))
    return built[0][0]


def read_text(text: str, path: Path, overrides: tuple[str, ...]) -> Spec:
    """The spec of a text, for the file `path`, with overrides. Raises InputError for any other."""
    data = _toml(text, str(path))
    for override in overrides:
        set_override(data, override)
    return build_spec(data, path.parent, _Where(str(path), text, _given_by(overrides)))


class _Where:
    """Names the place of a key: file and line, or the --set that gave it."""

    def __init__(self, name: str, text: str, overridden: dict[str, str]) -> None:
        self.name, self.overridden = name, overridden
        self.lines: dict[str, int] = {}
        table = ""
        for number, line in enumerate(text.splitlines(), 1):
            if header := re.match(r"\s*\[+\s*([\w.\-]+)\s*\]+", line):
                table = header[1]
                self.lines.setdefault(table, number)
            elif key := re.match(r"\s*([\w.\-]+)\s*=", line):
                self.lines.setdefault(f"{table}.{key[1]}" if table else key[1], number)

    def __call__(self, key: str) -> str:
        plain = re.sub(r"\[\d+\]", "", key)
        while plain:
            if plain in self.overridden:
                return self.overridden[plain]
            if plain in self.lines:
                return f"{self.name}:{self.lines[plain]}"
            plain = plain.rpartition(".")[0]
        return self.name


def _toml(text: str, name: str) -> dict[str, Any]:
    """Parse TOML that is neither deep nor long. Raises InputError."""
    if len(text) > MAX_BYTES:
        raise InputError(f"{name}: {len(text)} characters; at most {MAX_BYTES}")
    for number, line in enumerate(text.splitlines(), 1):
        if line.count(".") > MAX_DOTS:
            raise InputError(
                f"{name}:{number}: {line.count('.')} dots in a line; at most {MAX_DOTS}: break it"
            )
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise InputError(f"{name}: nested deeper than {MAX_DEPTH}") from None
    except ValueError as error:  # TOMLDecodeError is one
        raise InputError(f"{name}: TOML syntax: {_cut(str(error))}") from error
    if _is_deep(data):
        raise InputError(f"{name}: nested deeper than {MAX_DEPTH}")
    return data


def _is_deep(data: Any) -> bool:
    """Whether tables and lists lie more than MAX_DEPTH within each other."""
    level = [data]
    for _ in range(MAX_DEPTH):
        level = [
            inner
            for outer in level
            for inner in (outer.values() if isinstance(outer, dict) else outer)
            if isinstance(inner, dict | list)
        ]
    return bool(level)


def _cut(text: str) -> str:
    """A text short enough for a message."""
    return text if len(text) <= MAX_SHOWN else text[:MAX_SHOWN] + "..."


def split_override(override: str) -> tuple[list[str], Any]:
    """The parts of the key and the value of "key.name=value". Raises InputError."""
    key, equals, value = override.partition("=")
    parts = key.strip().split(".")
    if not equals or not all(re.fullmatch(r"[\w\-]+", part) for part in parts):
        raise InputError(f"--set {override}: write key.name=value, such as load.p_star=0.1")
    if len(parts) > MAX_DEPTH:
        raise InputError(f"--set {_cut(key)}: nested deeper than {MAX_DEPTH}")
    try:
        return parts, _toml(f"value = {value.strip()}", f"--set {key}")["value"]
    except InputError:
        if not re.fullmatch(r"[\w./~+\-]+", value.strip()):
            raise InputError(f"--set {override}: {value!r} is not a TOML value") from None
        return parts, value.strip()  # a bare word is a string


def set_override(data: dict[str, Any], override: str) -> None:
    """Set one key of the tables of a spec from "key.name=value". Raises InputError."""
    parts, parsed = split_override(override)
    table = data
    for part in parts[:-1]:
        inner = table.setdefault(part, {})
        if not isinstance(inner, dict):
            raise InputError(f"--set {override}: {part!r} is not a table")
        table = inner
    if parts[0] == "load" and len(parts) == 2 and parts[1] in LOADS:
        for other in set(LOADS) & set(table):  # one way to say it takes the place of another
            del table[other]
    table[parts[-1]] = parsed


def _given_by(overrides: tuple[str, ...]) -> dict[str, str]:
    """The --set that gave each key."""
    return {override.partition("=")[0].strip(): f"--set {override}" for override in overrides}


def build_spec(data: dict[str, Any], folder: Path, where: _Where) -> Spec:
    """Check plain data against the models; paths are relative to `folder`."""
    problems = [
        f"{where(name)}: {_unknown(name, list(MODELS), 'table')}"
        for name in map(str, data)  # tables from Python may have other keys
        if name not in MODELS
    ]
    sweeps = _sweeps(data, folder, where, problems)
    tables: dict[str, Any] = {"sweep": sweeps, "places": {}, "source": where.name}
    for name in [name for name in MODELS if name != "sweep"]:
        if name in REQUIRED and name not in data:
            problems.append(f"{where.name}: table [{name}] is missing")
            continue
        given = data.get(name, {})
        paired = keys_of(name, sweeps)
        built: list[tuple[Choice, Places]] = []
        for table in alternatives(given) if name in SWEPT else [given]:
            if isinstance(table, dict):
                built += _build(name, table, folder, where, problems, paired)
            else:
                problems.append(f"{where(name)}: {name}: must be a table, got {_cut(repr(table))}")
        distinct = dict.fromkeys(built) if name in SWEPT else built
        choices = [choice for choice, _ in distinct]
        tables[name] = choices if name in SWEPT else next(iter(choices), None)
        if sweeps and name in SWEPT:
            tables["places"][name] = [places for _, places in distinct]
    if sweeps and tables.get("load") is not None:
        tables["places"]["load"] = _places_of_loads(tables["load"], sweeps)
    if "accuracy" not in data:
        tables["accuracy"] = None
    problems += _discord(tables, where)
    if problems:
        lines = list(dict.fromkeys(problems))
        more = [f"and {len(lines) - MAX_PROBLEMS} more"] if len(lines) > MAX_PROBLEMS else []
        raise InputError("\n".join([*lines[:MAX_PROBLEMS], *more]))
    return Spec(**tables)


def _sweeps(
    data: dict[str, Any], folder: Path, where: _Where, problems: list[str]
) -> list[SweepTable]:
    """The groups of paired lists; what is wrong with them goes to `problems`."""
    sweeps: list[SweepTable] = []
    for table in alternatives(data["sweep"]) if "sweep" in data else []:
        if not isinstance(table, dict):
            problems.append(f"{where('sweep')}: sweep: must be a table, got {_cut(repr(table))}")
            continue
        for sweep, _ in _build("sweep", table, folder, where, problems):
            assert isinstance(sweep, SweepTable)
            wrong = problems_of(sweep, data)
            problems += [f"{where('sweep.paired')}: sweep.paired: {text}" for text in wrong]
            sweeps += [] if wrong else [sweep]
    return sweeps


def _places_of_loads(load: LoadTable, sweeps: list[SweepTable]) -> list[Places]:
    """Where each load stands in the paired lists."""
    groups = keys_of("load", sweeps)
    return [places_of({load.quantity: i}, groups) for i in range(len(load.listed()))]


def _discord(tables: dict[str, Any], where: _Where) -> list[str]:
    """What is wrong with tables that are each right by itself."""
    problems = []
    accuracy, load = tables["accuracy"], tables.get("load")
    auto = any(grid.points == "auto" for grid in tables.get("grid", []))
    if auto and accuracy is None:
        problems.append(
            f'{where("grid.points")}: grid.points: "auto" needs a table [accuracy] with '
            "the accuracy to reach, such as mean_gap = 0.01"
        )
    if any(grid.points == "auto" and grid.points_y is not None for grid in tables.get("grid", [])):
        problems.append(
            f'{where("grid.points_y")}: grid.points_y: with grid.points = "auto" the points along '
            "y follow from the sides; give surface.length_y"
        )
    if auto and load is not None and load.quantity in SOUGHT:
        problems.append(
            f'{where("grid.points")}: grid.points: "auto" needs load.p_star or load.pressure; '
            f"load.{load.quantity} is searched on a given grid"
        )
    if accuracy is not None and not accuracy.asked():
        problems.append(
            f"{where('accuracy')}: accuracy: give mean_gap, contact_area or stress_deviation"
        )
    return problems


def _build(
    name: str,
    table: dict[str, Any],
    folder: Path,
    where: _Where,
    problems: list[str],
    paired: Sequence[list[str]] = (),
) -> list[tuple[Choice, Places]]:
    """The choices of one table with their places in the paired lists.

    What is wrong with the table goes to `problems`.
    """
    axes = axes_of(table, paired) if name in SWEPT else []
    count = prod(len(table[keys[0]]) for keys in axes)
    if not 0 < count <= MAX_SWEEP:
        problems.append(
            f"{where(name)}: {name}: its lists have {count} combinations; "
            f"1 to {MAX_SWEEP} are allowed"
        )
        return []
    built = []
    for values, places in expand(table, paired) if name in SWEPT else [(table, {})]:
        if isinstance(values.get("path"), str):
            values = values | {"path": os.path.realpath(folder / values["path"])}
        if name in DEFAULT_KINDS:
            values = {"kind": DEFAULT_KINDS[name]} | values
        try:
            built.append((ADAPTERS[name].validate_python(values), places_of(places, [*paired])))
        except ValidationError as error:
            details = error.errors(include_url=False)
            problems.extend(_problem(name, places, detail, where) for detail in details)
    return built


def _problem(name: str, places: dict[str, int], detail: Any, where: _Where) -> str:
    """One line: place, key, what was given, what is allowed."""
    kinds, loc = kinds_of(name), list(detail["loc"])
    if detail["type"].startswith("union_tag") and kinds and not loc:
        return f"{where(f'{name}.kind')}: {name}.kind: {_kind_problem(detail, list(kinds))}"
    model = kinds[loc.pop(0)] if kinds else MODELS[name]
    path = [part for part in loc if part not in SHAPES]
    key = name
    for part in path:
        key += f"[{part}]" if isinstance(part, int) else f".{part}"
        key += f"[{places[part]}]" if part in places else ""
    if detail["type"] == "extra_forbidden":
        within = Ladder if len(path) > 1 else model
        known = [field.alias or field_name for field_name, field in within.model_fields.items()]
        text = _unknown(str(path[-1]), known, "key")
        owners = [kind for kind, other in kinds.items() if path[-1] in other.model_fields]
        text += f"; kind {' or '.join(owners)} has it" if owners else ""
    elif detail["type"] == "missing":
        text = "is missing"
    else:
        message = detail["msg"].removeprefix("Value error, ")
        message = message[:1].lower() + message[1:]
        given = detail["input"]
        message = WORDS.get(detail["type"], message)
        text = message if isinstance(given, dict) else f"{message}, got {_cut(repr(given))}"
        if isinstance(given, str) and NUMBER.fullmatch(given):
            text += ": write the number without quotation marks"
    return f"{where(key)}: {key}: {text}"


def _kind_problem(detail: Any, kinds: list[str]) -> str:
    """What is wrong with the kind of a table, and the kinds that are allowed."""
    if detail["type"] == "union_tag_not_found":
        return f"is missing (known: {', '.join(kinds)})"
    return _unknown(str(detail["ctx"]["tag"]), kinds, "kind")


def _unknown(given: str, known: list[str], what: str) -> str:
    """Message for a name that is not known, with the nearest known one."""
    near = get_close_matches(given[:MAX_SHOWN], known, 1, 0.5)
    hint = f" - did you mean {near[0]!r}?" if near else ""
    return f"unknown {what} {_cut(given)!r}{hint} (known: {', '.join(known)})"
