"""What changed between two specs."""

import json
from typing import Any

from gfmd_cli.spec.check import shortened
from gfmd_cli.units import DIGITS

MAX_VALUE = 80  # characters of a value; a choice


def differences(old: Any, new: Any, where: str = "") -> list[str]:
    """What changed between two pieces of plain data, a line for each key."""
    if isinstance(old, dict) and isinstance(new, dict):
        lines = []
        for key in [*old, *(key for key in new if key not in old)]:
            inner = f"{where}.{key}" if where else str(key)
            lines += differences(old.get(key), new.get(key), inner)
        return lines
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        return [
            line
            for i, (a, b) in enumerate(zip(old, new, strict=True))
            for line in differences(a, b, f"{where}[{i}]" if len(old) > 1 else where)
        ]
    if all(_is_sweep(value) for value in (old, new)) and (
        lines := differences(_swept(old), _swept(new), where)
    ):
        return lines  # else the combinations differ
    texts = [_text(value) for value in (old, new)]
    if len(set(texts)) == 1:
        texts = [json.dumps(value) for value in (old, new)]
    shown = (shortened(text, MAX_VALUE) for text in texts)
    return [] if old == new else [f"{where}: {' -> '.join(shown)}"]


def _text(value: Any) -> str:
    """A value as JSON, but numbers as in labels: 7e+10 instead of 70000000000.0."""
    if isinstance(value, float):
        text, short = f"{value:.{DIGITS}g}", f"{value:g}"
        return short if float(short) == float(text) else text
    if isinstance(value, list):
        return f"[{', '.join(map(_text, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{json.dumps(key)}: {_text(v)}' for key, v in value.items())}}}"
    return json.dumps(value)


def _is_sweep(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(v, dict) for v in value)


def _swept(tables: list[dict[str, Any]]) -> dict[str, Any]:
    """Values that each key of a sweep takes, one by itself."""
    keys = dict.fromkeys(key for table in tables for key in table)
    values = {key: [t[key] for t in tables if key in t] for key in keys}
    distinct = {key: [v for i, v in enumerate(vs) if v not in vs[:i]] for key, vs in values.items()}
    return {key: vs[0] if len(vs) == 1 else vs for key, vs in distinct.items()}
