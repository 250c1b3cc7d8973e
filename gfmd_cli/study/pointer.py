"""The pointer of a checkpoint: what it says of the saved states, as a typed model.

Others may be able to write to the folder of unfinished work, so that nothing in a pointer is
trusted.
"""

import json
from dataclasses import fields
from math import prod
from os import SEEK_END
from pathlib import Path
from typing import Annotated, Literal, Self, get_type_hints

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, Strict, model_validator

from gfmd_cli.files.atomic import write_whole
from gfmd_cli.files.checksums import check_seal, sealed
from gfmd_cli.files.regular import open_regular
from gfmd_cli.grid import arrays
from gfmd_cli.solvers.loop import State
from gfmd_cli.study.history import PointCount, TaskHistory

LAYOUT = 7
"""Raised whenever a state of the old layout must not be resumed."""
MAX_BYTES = 2**24
"""Size of a pointer: 100 bytes for each of at most 65536 processes, and the history."""
MAX_PARTS = 65536
PRECISIONS = {arrays.Field: "<f8", arrays.SingleField: "<f4"}
"""Types of the values of an array, by its annotation in the class of a state."""
Whole = Annotated[int, Field(ge=0, lt=2**53)]
Count = Annotated[int, Field(ge=1, lt=2**53)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z_]\w{0,60}$")]


class _Checked(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid")


class Part(_Checked):
    """The rows that one process wrote."""

    file: Annotated[str, Field(pattern=r"^[ab][0-9]{0,6}$")]
    first: Whole
    rows: Count
    crc: Annotated[int, Field(ge=0, lt=2**32)]
    bytes: Count


class Scalars(_Checked):
    """The attributes of a state that are not arrays; those of all solvers are named here."""

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, bool | Whole | float]

    step: Whole
    residual: float


class Slot(_Checked):
    """One saved state."""

    name: Literal["a", "b"]
    parts: Annotated[list[Part], Field(min_length=1, max_length=MAX_PARTS)]
    shape: Annotated[tuple[PointCount, ...], Strict(False), Field(min_length=1, max_length=2)]
    """Points along y and x of the whole grid."""
    fields: Annotated[dict[Name, str], Field(min_length=1, max_length=64)]
    state: Scalars
    history: TaskHistory

    @model_validator(mode="after")
    def _check_parts(self) -> Self:
        """Parts are the rows of the grid in order."""
        first = 0
        for part in self.parts:
            if part.first != first or not part.file.startswith(self.name):
                raise ValueError("parts that do not make up a grid")
            first += part.rows
        if first != self.shape[0]:
            raise ValueError("rows are missing")
        return self

    def holds(self, state_type: type[State], shape: tuple[int, ...]) -> bool:
        """Whether the slot has exactly the attributes of such a state on a grid of this shape."""
        hints = get_type_hints(state_type)
        kinds = {field.name: hints[field.name] for field in fields(state_type)}
        precisions = {n: PRECISIONS[kind] for n, kind in kinds.items() if kind in PRECISIONS}
        scalars = self.state.model_dump()
        if self.fields != precisions or scalars.keys() != kinds.keys() - precisions.keys():
            return False
        row = prod(shape[1:]) * sum(np.dtype(kind).itemsize for kind in precisions.values())
        return all(part.bytes == part.rows * row for part in self.parts) and all(
            type(value) is kinds[name] or (kinds[name] is float and type(value) is int)
            for name, value in scalars.items()
        )


class _Pointer(_Checked):
    layout: Annotated[int, Field(ge=LAYOUT, le=LAYOUT)]
    slots: Annotated[list[Slot], Field(min_length=1, max_length=2)]


def write_pointer(path: Path, slots: list[Slot]) -> None:
    """Write a pointer to these slots, the newer one first. Raises SpaceError."""
    content = {"layout": LAYOUT, "slots": [slot.model_dump() for slot in slots]}
    write_whole(path, sealed(json.dumps(content).encode()))


def read_pointer(path: Path) -> list[Slot]:
    """The slots of a pointer; none where it is missing, damaged or of another layout."""
    try:
        with open_regular(path) as file:
            if file.seek(0, SEEK_END) > MAX_BYTES:
                return []
            file.seek(0)
            return _Pointer.model_validate_json(file.read(check_seal(file))).slots
    except (OSError, ValueError):
        return []
