"""From TOML text to a Spec, or to one message that says what is wrong and where."""

import re
import tomllib
from difflib import get_close_matches
from math import prod
from pathlib import Path
from typing import Any, get_args

from pydantic import ValidationError

from gfmd_cli.errors import InputError
from gfmd_cli.physics.choice import Choice
from gfmd_cli.physics.elastomer import Elastomer
from gfmd_cli.physics.surface import FileSurface, Surface
from gfmd_cli.solvers.cascade import SolverChoice
from gfmd_cli.study.spec import (
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
    expand,
)

MAX_BYTES = 256 * 1024  # of a spec; a few kB are usual
MAX_DEPTH = 16  # of tables and lists
MAX_DOTS = 2000  # in a line; of a dotted key tomllib takes memory with their square
MAX_SHOWN = 200  # characters of what was given, in a message
MAX_PROBLEMS = 20  # of a spec that are told
MAX_SWEEP = 100_000  # combinations of one table


def _kinds(union: Any) -> dict[str, type[Choice]]:
    """The classes of a discriminated union by their `kind`."""
    return {model.model_fields["kind"].default: model for model in get_args(get_args(union)[0])}


MODELS: dict[str, type[Choice] | dict[str, type[Choice]]] = {
    "study": StudyTable,
    "surface": _kinds(Surface),
    "elastomer": _kinds(Elastomer),
    "grid": GridTable,
    "load": LoadTable,
    "solver": SolverChoice,
    "output": OutputTable,
    "accuracy": AccuracyTable,
}
REQUIRED = ("surface", "elastomer", "grid", "load")


def read_spec(path: Path, overrides: tuple[str, ...] = ()) -> tuple[Spec, str]:
    """Read and check a run spec.

    Parameters
    ----------
    path : the TOML file
    overrides : "key.name=value", the value in TOML or a bare word

    Returns the spec and the text of the file. Raises InputError with all that is wrong.
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    if len(raw) > MAX_BYTES:
        raise InputError(f"{path}: {len(raw)} bytes; a run spec has at most {MAX_BYTES}")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text (byte {error.start})") from error
    data = _toml(text, str(path))
    origin: dict[str, str] = {}
    for override in overrides:
        _override(data, override, origin)
    return build_spec(data, path.parent, _Where(str(path), text, origin)), text


def read_tables(data: dict[str, Any]) -> Spec:
    """Check the tables of a run spec; paths are relative to the working directory.

    Raises InputError with all that is wrong.
    """
    if _is_deep(data):
        raise InputError(f"spec: nested deeper than {MAX_DEPTH}")
    return build_spec(data, Path(), _Where("spec", "", {}))


def read_scan(path: Path, overrides: tuple[str, ...] = ()) -> FileSurface:
    """A height map as a surface, "surface.key=value" each. Raises InputError."""
    data: dict[str, Any] = {"surface": {"kind": "file", "path": str(path)}}
    origin: dict[str, str] = {}
    for override in overrides:
        _override(data, override, origin)
    problems: list[str] = []
    built = _build("surface", data["surface"], Path(), _Where(str(path), "", origin), problems)
    if set(data) != {"surface"} or (not problems and len(built) != 1):
        problems.append(f"{path}: --set takes surface.key=value with one value, for a height map")
    if problems:
        raise InputError("\n".join(problems))
    (surface,) = built
    if not isinstance(surface, FileSurface):
        raise InputError(f"{path}: surface.kind is that of a file")
    return surface.model_copy(update={"path": path})  # as it was given, for messages


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


def _override(data: dict[str, Any], override: str, origin: dict[str, str]) -> None:
    """Set one key from "key.name=value"."""
    key, equals, value = override.partition("=")
    parts = key.strip().split(".")
    if not equals or not all(re.fullmatch(r"[\w\-]+", part) for part in parts):
        raise InputError(f"--set {override}: write key.name=value, such as load.p_star=0.1")
    if len(parts) > MAX_DEPTH:
        raise InputError(f"--set {_cut(key)}: nested deeper than {MAX_DEPTH}")
    try:
        parsed = _toml(f"value = {value.strip()}", f"--set {key}")["value"]
    except InputError:
        if not re.fullmatch(r"[\w./~+\-]+", value.strip()):
            raise InputError(f"--set {override}: {value!r} is no TOML value") from None
        parsed = value.strip()  # a bare word is a string
    table = data
    for part in parts[:-1]:
        inner = table.setdefault(part, {})
        if not isinstance(inner, dict):
            raise InputError(f"--set {override}: {part!r} is no table")
        table = inner
    if parts[0] == "load" and len(parts) == 2 and parts[1] in LOADS:
        for other in set(LOADS) & set(table):  # one way to say it takes the place of another
            del table[other]
    table[parts[-1]] = parsed
    origin[key.strip()] = f"--set {override}"


def build_spec(data: dict[str, Any], folder: Path, where: _Where) -> Spec:
    """Check plain data against the models; paths are relative to `folder`."""
    problems = [
        f"{where(name)}: {_unknown(name, list(MODELS), 'table')}"
        for name in data
        if name not in MODELS
    ]
    tables: dict[str, Any] = {}
    for name in MODELS:
        if name in REQUIRED and name not in data:
            problems.append(f"{where.name}: table [{name}] is missing")
            continue
        given = data.get(name, {})
        alternatives = given if name in SWEPT and isinstance(given, list) and given else [given]
        built: list[Choice] = []
        for table in alternatives:
            if isinstance(table, dict):
                built += _build(name, table, folder, where, problems)
            else:
                problems.append(f"{where(name)}: {name}: must be a table, got {_cut(repr(table))}")
        distinct = list(dict.fromkeys(built)) if name in SWEPT else built
        tables[name] = distinct if name in SWEPT else next(iter(distinct), None)
    if "accuracy" not in data:
        tables["accuracy"] = None
    problems += _discord(tables, where)
    if problems:
        told = list(dict.fromkeys(problems))
        more = [f"and {len(told) - MAX_PROBLEMS} more"] if len(told) > MAX_PROBLEMS else []
        raise InputError("\n".join([*told[:MAX_PROBLEMS], *more]))
    return Spec(**tables)


def _discord(tables: dict[str, Any], where: _Where) -> list[str]:
    """What is wrong with tables that are each right by itself."""
    problems = []
    accuracy, load = tables["accuracy"], tables.get("load")
    auto = any(grid.points == "auto" for grid in tables.get("grid", []))
    if auto and accuracy is None:
        problems.append(
            f'{where("grid.points")}: grid.points: "auto" takes a table [accuracy] that says '
            "what is good enough, such as mean_gap = 0.01"
        )
    if auto and load is not None and load.quantity in SOUGHT:
        problems.append(
            f'{where("grid.points")}: grid.points: "auto" takes load.p_star or load.pressure; '
            f"load.{load.quantity} is that of a given grid"
        )
    if accuracy is not None and not accuracy.asked():
        problems.append(
            f"{where('accuracy')}: accuracy: give mean_gap, contact_area or stress_deviation"
        )
    return problems


def _build(
    name: str, table: dict[str, Any], folder: Path, where: _Where, problems: list[str]
) -> list[Choice]:
    """The choices of one table; what is wrong with it goes to `problems`."""
    lists = [v for v in table.values() if isinstance(v, list)] if name in SWEPT else []
    if not 0 < prod(map(len, lists)) <= MAX_SWEEP:
        problems.append(
            f"{where(name)}: {name}: its lists have {prod(map(len, lists))} combinations; "
            f"1 to {MAX_SWEEP} are allowed"
        )
        return []
    built = []
    for values, places in expand(table) if name in SWEPT else [(table, {})]:
        model = MODELS[name]
        if isinstance(model, dict):
            kind = values.get("kind")
            if not isinstance(kind, str) or kind not in model:
                problems.append(
                    f"{where(f'{name}.kind')}: {name}.kind: "
                    + ("is missing" if kind is None else _unknown(str(kind), list(model), "kind"))
                    + (f" (known: {', '.join(model)})" if kind is None else "")
                )
                continue
            model = model[kind]
        if isinstance(values.get("path"), str):
            values = values | {"path": str((folder / values["path"]).resolve())}
        try:
            built.append(model.model_validate(values))
        except ValidationError as error:
            details = error.errors(include_url=False)
            problems.extend(_problem(name, model, places, detail, where) for detail in details)
    return built


def _problem(
    name: str, model: type[Choice], places: dict[str, int], detail: Any, where: _Where
) -> str:
    """One line: place, key, what was given, what is allowed."""
    path = [part for part in detail["loc"] if part not in SHAPES]
    key = name
    for part in path:
        key += f"[{part}]" if isinstance(part, int) else f".{part}"
        key += f"[{places[part]}]" if part in places else ""
    if detail["type"] == "extra_forbidden":
        within = Ladder if len(path) > 1 else model
        known = [field.alias or field_name for field_name, field in within.model_fields.items()]
        text = _unknown(str(path[-1]), known, "key")
    elif detail["type"] == "missing":
        text = "is missing"
    else:
        message = detail["msg"].removeprefix("Value error, ")
        message = message[:1].lower() + message[1:]
        given = detail["input"]
        text = message if isinstance(given, dict) else f"{message}, got {_cut(repr(given))}"
    return f"{where(key)}: {key}: {text}"


def _unknown(given: str, known: list[str], what: str) -> str:
    """Message for a name that is not known, with the nearest known one."""
    near = get_close_matches(given[:MAX_SHOWN], known, 1, 0.5)
    hint = f" - did you mean {near[0]!r}?" if near else ""
    return f"unknown {what} {_cut(given)!r}{hint} (known: {', '.join(known)})"
