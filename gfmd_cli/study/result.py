"""The result of one task, in memory."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from gfmd_cli.grid.arrays import Field
from gfmd_cli.maps.pictures import Picture
from gfmd_cli.physics.persson import Shells
from gfmd_cli.physics.surface_spectrum import Spectrum
from gfmd_cli.status import Status


class Outcome(NamedTuple):
    """What a study or a record holds of a task."""

    status: Status
    stored: frozenset[str]
    """What [output] stored of it (`OutputTable.names`)."""


class Entry(NamedTuple):
    """A task of a study without its arrays."""

    task_id: str
    scene_id: str
    """Tasks of one scene share surface, elastomer and grid."""
    stored: frozenset[str]
    """Output that is stored, as in `Outcome`; nothing of a task that is not solved yet."""
    row: Mapping[str, Any]
    """Columns and histograms by name."""


@dataclass(frozen=True)
class TaskResult:
    """All that a study stores of one task."""

    entry: Entry
    shells: Shells
    arrays: Mapping[str, Mapping[str, Field]] = field(default_factory=dict)
    """Arrays by group (`TASK_GROUPS`) and name."""
    pictures: Mapping[str, Picture] = field(default_factory=dict)
    """Pictures of a measured surface, as "measured" and as "prepared"."""
    map_spectrum: Spectrum | None = None
    """Spectrum of a map with borders, None of any other surface."""
