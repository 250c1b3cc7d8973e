"""What a page is made from: a study beside theory, and a bench where one is given."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from gfmd_cli.analysis.compare import Comparison, Curve, Row, compare
from gfmd_cli.analysis.figures import Item, items_of, sheets
from gfmd_cli.analysis.report.markup import Html
from gfmd_cli.analysis.sheet import Sheet
from gfmd_cli.study.layout import MISSING
from gfmd_cli.study.reading import open_study, read_rows
from gfmd_cli.study.traces import Trace, read_bench


@dataclass(frozen=True)
class Section:
    """A part of the page under a heading."""

    title: str
    body: Html

    @property
    def anchor(self) -> str:
        """Its place in the page."""
        return self.title.lower().replace(" ", "-")


@dataclass(frozen=True)
class Contents:
    """All that a section may tell of."""

    comparison: Comparison
    rows: list[Row]
    """One a task, missing ones too."""
    attributes: dict[str, str]
    """Of the study file."""
    traces: list[Trace]
    """Of the bench; none where no bench is given."""

    @cached_property
    def sheets(self) -> dict[str, Sheet]:
        """The figures of the study by name."""
        return sheets(self.comparison, self.items)

    @cached_property
    def items(self) -> list[Item]:
        """The curves as figures have them."""
        return items_of(self.comparison)

    @property
    def curves(self) -> list[tuple[str, Curve]]:
        """The curves, each with its name in figures and in full."""
        return [(title_of(item), item.curve) for item in self.items]

    @property
    def solved(self) -> list[Row]:
        """The rows that hold a result."""
        return [row for row in self.rows if row["status"] != MISSING]

    @property
    def name(self) -> str:
        """Of the study."""
        return self.attributes.get("title", "study")

    def data(self, attribute: str) -> dict[str, Any]:
        """An attribute that holds JSON; empty where it holds none."""
        try:
            told = json.loads(self.attributes.get(attribute, ""))
        except (ValueError, RecursionError):
            return {}
        return told if isinstance(told, dict) else {}


SectionOf = Callable[[Contents], Section | None]
"""Makes a section, or none where the study has nothing for it."""


def read_contents(study: Path, bench: Path | None) -> Contents:
    """Read a study, and a bench. Raises InputError, StudyError."""
    comparison = compare(study)
    with open_study(study) as file:
        attributes = {name: str(value) for name, value in file.attrs.items()}
    traces = [] if bench is None else read_bench(bench)
    return Contents(comparison, read_rows(study), attributes, traces)


def title_of(item: Item) -> str:
    """A curve by its name in figures and in full."""
    curve, short = item.curve, item.look.label.replace(r"\$", "$")
    whole = f"{curve.elastomer} on {curve.surface}"
    sizes = sorted({int(row["points"]) for row in curve.rows})
    grid = str(sizes[0]) if len(sizes) == 1 else f"{sizes[0]} to {sizes[-1]}"
    told = whole if short == curve.elastomer else f"{short}: {whole}"
    return f"{told}, {grid} points a side"
