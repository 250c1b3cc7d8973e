"""The studies behind the figures: which config, what is changed, how small for a quick look."""

import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from gfmd_cli.analysis.compare import Comparison, compare
from gfmd_cli.study.reading import open_study, read_rows

CONFIGS = Path(__file__).parents[2] / "configs" / "paper"


@dataclass(frozen=True)
class Study:
    """A config with what is set from outside."""

    config: str
    settings: tuple[str, ...] = ()
    quick: tuple[str, ...] = ()
    """What a quick look changes besides."""


def _cell(ratio: int) -> Study:
    """The large-cell check in a cell of `ratio` roll-off wavelengths."""
    settings = [f"surface.rolloff={1 / ratio}", f"surface.cutoff={1 / (128 * ratio)}"]
    settings += [f"grid.points={256 * ratio}"]
    if ratio > 4:
        settings.append("surface.seed=[0]")
    if ratio > 16:
        settings.append("load.p_star=[0.01, 0.1]")
    return Study("large_cell", tuple(settings), ("surface.seed=[0,1]", "load.p_star=[0.01,0.1]"))


SMALL, NO_BARS = "grid.points=512", "grid.points=[512,1024]"
FEW = "load.p_star={from=0.01, to=3.0, per_decade=2}"
STUDIES = {
    "fig01": Study("fig01"),
    "fig02": Study("fig02", quick=(SMALL,)),
    "kappa": Study("kappa", quick=("grid.points=[128,256,512]",)),
    "fig04": Study("fig04", quick=(SMALL,)),
    "fig05": Study("fig05", quick=("grid.points=1024",)),
    "fig06": Study("fig06", quick=(SMALL, FEW)),
    "fig07": Study("fig07", quick=("grid.points=[512,1024]",)),
    "edges": Study("../stress-distribution", quick=("grid.points=[128,256,512]",)),
    "fig08": Study("fig08", quick=(NO_BARS, "load.p_star=[0.01, 0.03, 0.1, 1.0]")),
    "spacing": Study("spacing"),
    "fig10": Study("fig10", quick=(SMALL, FEW)),
    "fig11": Study("fig11", quick=(FEW,)),
    "fig12": Study("fig12"),
    "fig13": Study("fig13", quick=("grid.points=[512,1024,2048]",)),
    "plate": Study("plate", quick=(NO_BARS, FEW)),
    "plate_map": Study("plate_map", quick=(SMALL,)),
    **{f"large_cell_{ratio}": _cell(ratio) for ratio in (2, 4, 8, 16, 32)},
}
LARGE = ("large_cell_8", "large_cell_16", "large_cell_32")  # left out of a quick look


@dataclass
class Held:
    """The studies that have been run, read when asked for."""

    folder: Path
    quick: bool
    _rows: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    _comparisons: dict[str, Comparison] = field(default_factory=dict)

    def path(self, name: str) -> Path:
        """The study file."""
        return self.folder / f"{name}.h5"

    def has(self, name: str) -> bool:
        """Whether it was run."""
        return self.path(name).exists()

    def rows(self, name: str, **wanted: Any) -> list[dict[str, Any]]:
        """The solved rows of a study whose columns are as wanted."""
        if name not in self._rows:
            found = read_rows(self.path(name))
            self._rows[name] = [row for row in found if row["status"] != "missing"]
        return [
            row
            for row in self._rows[name]
            if all(row[key] == value for key, value in wanted.items())
        ]

    def comparison(self, name: str) -> Comparison:
        """The study beside Persson theory."""
        if name not in self._comparisons:
            self._comparisons[name] = compare(self.path(name))
        return self._comparisons[name]

    def section(self, name: str, row: dict[str, Any]) -> dict[str, np.ndarray]:
        """Height, displacement and stress along the diagonal, and the position `s` [m]."""
        return self._group(name, f"cross_sections/{row['task']}")

    def fields(self, name: str, row: dict[str, Any]) -> dict[str, np.ndarray]:
        """The stored fields [y, x]."""
        return self._group(name, f"fields/{row['task']}")

    def _group(self, name: str, place: str) -> dict[str, np.ndarray]:
        with open_study(self.path(name)) as file:
            group = file[place]
            return {key: data[()] for key, data in group.items() if isinstance(data, h5py.Dataset)}


def run(name: str, folder: Path, quick: bool) -> None:
    """Run one study, or what is missing of it, as a user would."""
    study = STUDIES[name]
    settings = (*study.settings, *(study.quick if quick else ()))
    command = [sys.executable, "-m", "gfmd_cli", "run", CONFIGS / f"{study.config}.toml"]
    command += ["-o", folder / f"{name}.h5", "-q"]
    command += [word for setting in settings for word in ("--set", setting)]
    ended = subprocess.run([str(word) for word in command], check=False)
    if ended.returncode not in (0, 1):  # 1: some contact missed its tolerance, which its row says
        raise SystemExit(ended.returncode)


def needs(*names: str) -> Any:
    """Marks a figure with the studies that it is drawn from."""

    def mark(draw: Any) -> Any:
        draw.needs = names
        return draw

    return mark
