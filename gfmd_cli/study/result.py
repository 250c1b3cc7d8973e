"""The result of one task, in memory."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.persson import Shells
from gfmd_cli.physics.pictures import Picture


@dataclass(frozen=True)
class TaskResult:
    """All that a study stores of one task."""

    task_id: str
    scene_id: str
    stored: frozenset[str]
    """What [output] stored of it (`OutputTable.names`)."""
    row: Mapping[str, Any]
    """Columns and histograms by name."""
    shells: Shells
    arrays: Mapping[str, Mapping[str, Field]] = field(default_factory=dict)
    """Arrays by group (`TASK_GROUPS`) and name."""
    pictures: Mapping[str, Picture] = field(default_factory=dict)
    """Pictures of a measured surface, as "measured" and as "prepared"."""
