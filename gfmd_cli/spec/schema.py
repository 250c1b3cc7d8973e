"""JSON Schema of the run spec, for editors."""

import json
from typing import Any

from gfmd_cli.spec.check import DEFAULT_KINDS, MODELS, REQUIRED, kinds_of
from gfmd_cli.spec.models import REPEATED, SWEPT
from gfmd_cli.spec_table import SpecTable

UNKNOWN_KEY = {"not": {"description": "unknown key"}}
"""No value is valid. An editor marks the key, where it marks the whole table for `false`."""


def spec_schema() -> dict[str, Any]:
    """The schema of a spec as it is written: with a list wherever a sweep may stand."""
    shared: dict[str, Any] = {}
    tables: dict[str, Any] = {}
    for name, model in MODELS.items():
        kinds, swept = kinds_of(name), name in SWEPT
        forms = [
            _table(choice, swept, bool(kinds) and kind != DEFAULT_KINDS.get(name), shared)
            for kind, choice in (kinds or {"": model}).items()
        ]
        table = _by_kind(forms, DEFAULT_KINDS.get(name)) if kinds else forms[0]
        if name in REPEATED:
            several = {"items": table, "minItems": 1}
            table = {"if": {"type": "array"}, "then": several, "else": table}
        tables[name] = table
    schema: dict[str, Any] = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "gfmd run spec",
        "type": "object",
        "properties": tables,
        "required": list(REQUIRED),
        "additionalProperties": False,
        "$defs": shared,
    }
    return json.loads(json.dumps(schema), object_hook=_marking_keys)


def _marking_keys(schema: dict[str, Any]) -> dict[str, Any]:
    """The same with UNKNOWN_KEY where additional properties are forbidden."""
    forbids = schema.get("additionalProperties") is False
    return schema | {"additionalProperties": UNKNOWN_KEY} if forbids else schema


def _table(
    model: type[SpecTable], swept: bool, needs_kind: bool, shared: dict[str, Any]
) -> dict[str, Any]:
    """The schema of one table; what it refers to goes to `shared`."""
    schema = model.model_json_schema()
    shared.update(schema.pop("$defs", {}))
    if swept:
        for name in schema["properties"].keys() - {"kind"}:
            schema["properties"][name] = _one_or_many(schema["properties"][name])
    if needs_kind:
        schema["required"] = ["kind", *schema.get("required", [])]
    return schema


def _by_kind(forms: list[dict[str, Any]], default: str | None) -> dict[str, Any]:
    """The schema of a table with kinds: the kind decides which form must hold.

    So a message names the key that is wrong in this form, and not that all forms fail. All keys
    stand beside the conditions, for editors that complete them.
    """
    kinds = [form["properties"]["kind"]["const"] for form in forms]
    rules: list[dict[str, Any]] = []
    for kind, form in zip(kinds, forms, strict=True):
        named = {"properties": {"kind": {"const": kind}}}  # also true without the key
        is_kind = named if kind == default else named | {"required": ["kind"]}
        rules.append({"if": is_kind, "then": form})
    of_list = {"properties": {"kind": {"type": "array"}}, "required": ["kind"]}
    rules.append({"if": of_list, "then": _several_kinds(forms) or False})
    several = {"items": {"enum": kinds}, "minItems": 1}
    of_kind = {"if": {"type": "array"}, "then": several, "else": {"enum": kinds}}
    keys = {name: _annotations(key) for form in forms for name, key in form["properties"].items()}
    return {
        "type": "object",
        "properties": keys | {"kind": of_kind},
        "required": [] if default else ["kind"],
        "allOf": rules,
    }


def _annotations(key: dict[str, Any]) -> dict[str, Any]:
    """What a schema says of a key without restricting it."""
    return {name: key[name] for name in ("description", "default", "title") if name in key}


def _several_kinds(forms: list[dict[str, Any]]) -> dict[str, Any] | None:
    """The schema of a table whose kind is a list, with the keys that all kinds share.

    None where one of the kinds requires a key of its own.
    """
    keys = set.intersection(*(set(form["properties"]) for form in forms))
    if any(set(form.get("required", [])) - keys for form in forms):
        return None
    kinds = [form["properties"]["kind"]["const"] for form in forms]
    properties = {name: key for name, key in forms[0]["properties"].items() if name in keys}
    properties["kind"] = {"type": "array", "items": {"enum": kinds}, "minItems": 1}
    return forms[0] | {
        "title": "Several kinds",
        "description": "One table for each kind.",
        "properties": properties,
        "required": ["kind"],
    }


def _one_or_many(key: dict[str, Any]) -> dict[str, Any]:
    annotations = _annotations(key)
    value = {name: part for name, part in key.items() if name not in annotations}
    return {"anyOf": [value, {"type": "array", "items": value, "minItems": 1}], **annotations}
