"""Base of the tables of the run spec: the fields of a class are the keys of its table."""

import re
from collections.abc import Collection
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, Strict

from gfmd_cli.units import LENGTH_RANGE, labelled

UNIT = re.compile(r" \[(.*?)\]")
"""Unit of a number in the docstring of its key."""
Positive = Annotated[float, Field(gt=0)]
Scale = Annotated[float, Field(ge=LENGTH_RANGE[0], le=LENGTH_RANGE[1])]
"""A length [m], or a factor of lengths."""
Seed = Annotated[int, Field(ge=0, lt=2**63)]
FilePath = Annotated[Path, Strict(False)]


class SpecTable(BaseModel):
    """A table of the run spec, which refuses unknown keys, NaN and infinities."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        strict=True,
        allow_inf_nan=False,
        use_attribute_docstrings=True,
    )

    def parameters(self) -> dict[str, Any]:
        """Value of every key, including defaults."""
        return dict(self)

    @property
    def file(self) -> Path | None:
        """The file that the table names; None without one."""
        return dict(self).get("path")

    @property
    def label(self) -> str:
        """The kind and every key that the spec gives, including those with the default value."""
        return self.label_without(())

    def label_without(self, left_out: Collection[str]) -> str:
        """The label without some of the keys."""
        return " ".join(self.words({"kind", *self.model_fields_set}.difference(left_out)))

    def words(self, keys: Collection[str]) -> list[str]:
        """Each of these keys as "key=value", `kind` as its value alone."""
        return [
            as_text(value) if key == "kind" else f"{key}={as_text(value, self.unit_of(key))}"
            for key, value in self
            if key in keys and value is not None
        ]

    @classmethod
    def unit_of(cls, key: str) -> str:
        """The unit that the docstring of a key gives, "" without one."""
        unit = UNIT.search(cls.model_fields[key].description or "")
        return unit[1] if unit else ""


def as_text(value: object, unit: str = "") -> str:
    """Text of a value in a label: the name of a file, a number with its unit."""
    if isinstance(value, Path):
        return value.name
    return labelled(value, unit) if isinstance(value, float) else str(value)
