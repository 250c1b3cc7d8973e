"""JSON Schema of the run spec, for editors."""

from typing import Any

from gfmd_cli.physics.choice import Choice
from gfmd_cli.study.parse import MODELS, REQUIRED
from gfmd_cli.study.spec import SWEPT


def spec_schema() -> dict[str, Any]:
    """The schema of a spec as it is written: with a list wherever a sweep may stand."""
    shared: dict[str, Any] = {}
    tables: dict[str, Any] = {}
    for name, model in MODELS.items():
        kinds = list(model.values()) if isinstance(model, dict) else [model]
        forms = [_table(kind, name in SWEPT, isinstance(model, dict), shared) for kind in kinds]
        table = forms[0] if len(forms) == 1 else {"oneOf": forms}
        if name in SWEPT:
            table = {"anyOf": [table, {"type": "array", "items": table, "minItems": 1}]}
        tables[name] = table
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "gfmd run spec",
        "type": "object",
        "properties": tables,
        "required": list(REQUIRED),
        "additionalProperties": False,
        "$defs": shared,
    }


def _table(
    model: type[Choice], swept: bool, needs_kind: bool, shared: dict[str, Any]
) -> dict[str, Any]:
    """The schema of one table; what it refers to goes to `shared`."""
    schema = model.model_json_schema()
    shared.update(schema.pop("$defs", {}))
    if swept:
        for name, key in schema["properties"].items():
            if name != "kind" or not needs_kind:
                schema["properties"][name] = _one_or_many(key)
    if needs_kind:
        schema["required"] = ["kind", *schema.get("required", [])]
    return schema


def _one_or_many(key: dict[str, Any]) -> dict[str, Any]:
    told: dict[str, Any] = {
        name: key[name] for name in ("description", "default", "title") if name in key
    }
    value = {name: part for name, part in key.items() if name not in told}
    return {"anyOf": [value, {"type": "array", "items": value, "minItems": 1}], **told}
