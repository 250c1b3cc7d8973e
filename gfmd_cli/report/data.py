"""The data of a page: a study compared with theory, and a bench where one is given."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from gfmd_cli.analysis.compare import Comparison, compare
from gfmd_cli.analysis.curve_styles import StyledCurve, with_styles, without_escapes
from gfmd_cli.analysis.figures import study_figures
from gfmd_cli.analysis.plotting import ColumnFigure
from gfmd_cli.analysis.tables import TitledCurves, curve_title
from gfmd_cli.analysis.wording import in_si
from gfmd_cli.bench.file import Trace
from gfmd_cli.study.column import Row
from gfmd_cli.study.reading import solved_rows, tell_files_apart


@dataclass(frozen=True)
class ReportData:
    """What the sections are made from."""

    comparison: Comparison
    traces: list[Trace] = field(default_factory=list)
    """Traces of the bench; none where no bench is given."""
    letter: str = ""
    """A or B, of two studies side by side."""

    @cached_property
    def figures(self) -> dict[str, ColumnFigure]:
        """The figures of the study by name."""
        return study_figures(self.comparison, self.items)

    @cached_property
    def items(self) -> list[StyledCurve]:
        """The curves in the order and style of the figures."""
        return with_styles(self.comparison)

    @property
    def curves(self) -> TitledCurves:
        """The curves by their names in figures and in full."""
        return [(item_title(item), item.curve) for item in self.items]

    @property
    def solved(self) -> list[Row]:
        """The rows that hold a result."""
        return solved_rows(self.comparison.rows)

    @property
    def not_converged(self) -> list[Row]:
        """The rows whose contact is solved, but missed its tolerance, accuracy or load."""
        return [row for row in self.solved if not row["status"].is_converged]

    @property
    def name(self) -> str:
        """Name of the study; of two studies, which may share it, that of the file."""
        study = self.comparison
        return study.path.name if self.letter else study.attributes.get("title", "study")

    @property
    def title(self) -> str:
        """Name of the study, with its letter where there are two."""
        return f"{self.letter}: {self.name}" if self.letter else self.name

    @property
    def prefix(self) -> str:
        """Prefix of the names of figures that each of two studies has."""
        return f"{self.letter}-" if self.letter else ""

    def in_si(self, unit: str) -> bool:
        """Whether values in this unit mean something in some contact."""
        return any(in_si(row, unit) for row in self.solved)

    def json(self, attribute: str) -> dict[str, Any]:
        """An attribute that holds JSON; empty where it holds none."""
        try:
            data = json.loads(self.comparison.attributes.get(attribute, ""))
        except (ValueError, RecursionError):
            return {}
        return data if isinstance(data, dict) else {}


def read_report_data(study: Path, letter: str) -> ReportData:
    """Read a study; `letter` as in `ReportData`. Raises InputError, StudyError."""
    comparison = compare(study)
    curves = [replace(curve, study=letter) for curve in comparison.curves]
    return ReportData(replace(comparison, curves=curves), letter=letter)


def merged(studies: Sequence[ReportData], traces: list[Trace]) -> ReportData:
    """The curves and rows of one study or of two together, and the traces of a bench."""
    comparisons = [data.comparison for data in studies]
    curves = [curve for each in comparisons for curve in each.curves]
    rows = [row for each in comparisons for row in each.rows]
    tell_files_apart(rows)
    return ReportData(replace(comparisons[0], curves=curves, rows=rows), traces)


def item_title(item: StyledCurve, *, of_seeds: bool = False) -> str:
    """A curve by its name in figures and in full; `of_seeds`: the surface without its seed."""
    short = without_escapes(item.style.label)
    full = curve_title(item.curve, of_seeds=of_seeds)
    return full if short == item.curve.elastomer else f"{short}: {full}"
