"""From a file or text in TOML, with the keys of the command line, to a Spec."""

import os
import re
import tomllib
from pathlib import Path
from typing import Any

from gfmd_cli.errors import InputError, typed
from gfmd_cli.files.hdf5 import MAGIC
from gfmd_cli.files.regular import open_regular
from gfmd_cli.physics.file_surface import FileSurface
from gfmd_cli.spec.check import BACKSLASH, Check, shortened
from gfmd_cli.spec.models import LOADS, Spec

MAX_BYTES = 256 * 1024  # of a spec; a few kB are usual
MAX_DEPTH = 16  # of tables and lists
MAX_DOTS = 2000  # in a line; of a dotted key tomllib takes memory with their square
SYNTAX = {
    r"\r": "its lines end in a carriage return alone; save the spec with line feeds",
    r"^.*(overwrite|twice)": "this key or table was given before; keep one of them",
    r'^(Unescaped|Invalid hex|Illegal|Unterminated).*\n.*"[^"]*\\': BACKSLASH,
    r"=\s*[+-]?\d+,\d": "write numbers with a decimal point, such as 0.1",
    r"^Invalid value\n.*=[\s\[]*[A-Za-z]": 'write words in quotation marks, such as "auto", '
    "and true and false in small letters",
}
"""What to write instead, by patterns of the message of tomllib and the line after it."""


def read_spec(path: Path, overrides: tuple[str, ...] = ()) -> tuple[Spec, str]:
    """Read and check a run spec.

    Parameters
    ----------
    path : the TOML file
    overrides : "key.name=value", the value in TOML or a bare word

    Returns the spec and the text of the file. Raises InputError with all that is wrong.
    """
    check_distinct(overrides)
    try:
        with open_regular(path, follow=True) as file:
            raw = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    if raw.startswith(MAGIC):
        raise InputError(
            f"{path}: an HDF5 file such as a study, where a run spec (TOML) is expected; "
            f"`gfmd analyze {typed(path)}` shows the results of a study"
        )
    if len(raw) > MAX_BYTES:
        raise InputError(
            f"{path}: too long; a run spec has at most {MAX_BYTES} bytes; for a scan, "
            f"`gfmd init SPEC --from {typed(path)}` writes a spec"
        )
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: not UTF-8 text (byte {error.start}), where a run spec (TOML) is expected: "
            "save a spec as UTF-8 in the editor; for a scan, "
            f"`gfmd init SPEC --from {typed(path)}` writes a spec"
        ) from error
    data = _toml(text, str(path))
    for override in overrides:
        set_override(data, override)
    return Check(str(path), text, overrides, path.parent).spec(data), text


def read_tables(data: dict[str, Any]) -> Spec:
    """Check the tables of a run spec; paths are relative to the working directory.

    Raises InputError with all that is wrong.
    """
    if _is_deep(data):
        raise InputError(f"spec: nested deeper than {MAX_DEPTH}")
    return Check("spec").spec(data)


def read_scan(path: Path, overrides: tuple[str, ...]) -> FileSurface:
    """The surface of a height map, with overrides "surface.key=value". Raises InputError."""
    data: dict[str, Any] = {"surface": {"kind": "file", "path": str(path)}}
    for override in overrides:
        set_override(data, override)
    check = Check(str(path), overrides=overrides)
    surfaces = [surface for surface, _ in check.entries("surface", data["surface"])]
    check.refuse()
    if set(data) != {"surface"} or len(surfaces) != 1:
        raise InputError(
            f"{path}: for a scan, --set takes only keys of the table surface, with one value each"
        )
    surface = surfaces[0]
    if not isinstance(surface, FileSurface):
        raise InputError(f'{path}: surface.kind must be "file" for a height map')
    if str(surface.path) != os.path.realpath(path):
        raise InputError(f"--set surface.path: the command names the scan, {path}; leave it out")
    return surface.model_copy(update={"path": path})  # the path as given, for messages


def _toml(text: str, name: str) -> dict[str, Any]:
    """Parse TOML. Raises InputError, also for deep tables and lines of many dots."""
    for number, line in enumerate(text.splitlines(), 1):
        if line.count(".") > MAX_DOTS:
            raise InputError(
                f"{name}:{number}: {line.count('.')} dots in a line, at most {MAX_DOTS} are read: "
                "spread a long list over several lines, or use {from, to, per_decade}"
            )
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise InputError(f"{name}: nested deeper than {MAX_DEPTH}") from None
    except ValueError as error:  # TOMLDecodeError is one
        raise InputError(_syntax_error(text, name, str(error))) from error
    if _is_deep(data):
        raise InputError(f"{name}: nested deeper than {MAX_DEPTH}")
    return data


def _syntax_error(text: str, name: str, message: str) -> str:
    """The message of tomllib with the line that it names, and what to write instead."""
    reason, _, place = message.rpartition(" (at line ")
    if not reason:
        return f"{name}: TOML syntax: {shortened(message)}"
    number = int(place.partition(",")[0])
    line = text.split("\n")[number - 1].strip()
    remedies = (SYNTAX[form] for form in SYNTAX if re.search(form, f"{reason}\n{line}"))
    shown = shortened(line.partition("\r")[0])
    return f"{name}:{number}: {shown}: TOML syntax: {next(remedies, reason)}"


def _is_deep(data: Any, depth: int = MAX_DEPTH) -> bool:
    """Whether tables and lists lie more than `depth` within each other."""
    if not isinstance(data, dict | list):
        return False
    inner = data.values() if isinstance(data, dict) else data
    return depth == 0 or any(_is_deep(each, depth - 1) for each in inner)


def check_distinct(overrides: tuple[str, ...]) -> None:
    """Raise InputError for two overrides of one key, and for two loads."""
    given: dict[str, str] = {}
    for override in overrides:
        key = override.partition("=")[0].strip()
        key = "load" if key.removeprefix("load.") in LOADS else key
        if (earlier := given.setdefault(key, override)) != override:
            raise InputError(
                f"--set {override}: takes the place of --set {earlier}; give one of them"
            )


def split_override(override: str) -> tuple[list[str], Any]:
    """The parts of the key and the value of "key.name=value". Raises InputError."""
    key, equals, value = override.partition("=")
    parts = key.strip().split(".")
    if not equals or not all(re.fullmatch(r"[\w\-]+", part) for part in parts):
        raise InputError(f"--set {override}: write key.name=value, such as load.p_star=0.1")
    if len(parts) > MAX_DEPTH:
        raise InputError(f"--set {shortened(key)}: nested deeper than {MAX_DEPTH}")
    try:
        (parsed,) = _toml(f"value = {value.strip()}", f"--set {key}").values()
        return parts, parsed
    except (InputError, ValueError):  # ValueError: further lines set further keys
        if not re.fullmatch(r"[\w./~+\-]+", value.strip()):
            raise InputError(
                f"--set {override}: {value!r} is not a TOML value, such as 0.1, [0.1, 0.2] or true"
            ) from None
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
    if parts[0] == "load" and len(parts) > 1 and parts[1] in LOADS:
        for other in set(LOADS) & set(data["load"]) - {parts[1]}:  # one takes the place of another
            del data["load"][other]
    table[parts[-1]] = parsed
