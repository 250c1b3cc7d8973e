"""The studies behind the figures: their configs, changed keys, and keys of a quick run."""

import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.analysis.compare import Comparison, compare
from gfmd_cli.study.reading import open_study, read_rows

CONFIGS = Path(__file__).parents[2] / "configs" / "paper"


@dataclass(frozen=True)
class Study:
    """A config with overridden keys."""

    config: str
    settings: tuple[str, ...] = ()
    quick: tuple[str, ...] = ()
    """Further keys that a quick run overrides."""


SEEDS = {2: 192, 4: 64, 8: 24, 16: 8}
"""Surfaces in cells of so many roll-off wavelengths."""


def _cell(ratio: int) -> Study:
    """The large-cell check in a cell of `ratio` roll-off wavelengths."""
    settings = (
        f"surface.rolloff={1 / ratio}",
        f"surface.cutoff={1 / (32 * ratio)}",
        f"surface.seed={list(range(SEEDS[ratio]))}",
        f"grid.points={64 * ratio}",
    )
    few = f"surface.seed={list(range(8))}"
    return Study("large_cell", settings, ("load.p_star=[0.001, 0.1]", few))


SMALL = "grid.points=512"
COARSE = "grid.points=256"
TWO = "surface.seed=[0, 1]"
FEW = "load.p_star={from=0.01, to=3.2, per_decade=2}"
MANY = f"surface.seed={list(range(32))}"
"""For studies with statements that were open with eight surfaces, and those compared with them."""
EDGES = ("surface.rolloff=0.25", "surface.cutoff=0.1", MANY)
"""Of `edges`: four roll-off wavelengths in the cell, 102 points per lambda_s on the finest grid."""
STUDIES = {
    "fig01": Study("fig01", quick=("grid.points=1024",)),
    "fig02": Study("fig02", quick=(SMALL,)),
    "kappa": Study("kappa", quick=("solver.tolerance=1e-8",)),
    "fig04": Study("fig04", quick=(SMALL,)),
    "fig05": Study("fig05", quick=("grid.points=1024",)),
    "fig06": Study("fig06", (MANY,), quick=(TWO, COARSE, FEW)),
    "light": Study(
        "light", quick=(TWO, "grid.points=[128,256,512]", "load.p_star=[0.04, 0.08, 0.16, 0.5]")
    ),
    "fig07": Study("fig07", quick=(TWO, "grid.points=[256,512]")),
    "edges": Study("../stress-distribution", EDGES, quick=(TWO, "grid.points=[128,256,512]")),
    "fig13": Study("fig13", quick=(TWO, "grid.points=[256,512,1024]")),
    "fig09b": Study("fig09b", (MANY,), quick=(TWO, COARSE)),
    "small_pressure": Study(
        "small_pressure", quick=(TWO, "load.p_star={from=1e-5, to=0.1, per_decade=1}")
    ),
    "fig10": Study("fig10", (MANY,), quick=(TWO, COARSE, FEW)),
    "fig10b": Study("fig10b", (MANY,), quick=(TWO, COARSE)),
    "cut_off": Study("cut_off", (MANY,), quick=(TWO, COARSE, FEW)),
    "spacing": Study("spacing", quick=(TWO,)),
    "fig11": Study("fig11", (MANY,), quick=(TWO, FEW)),
    "fig12": Study("fig12", quick=("load.p_star={from=1e-6, to=1.0, per_decade=1}",)),
    "weights": Study("weights", quick=(TWO,)),
    "plate_map": Study("plate_map", quick=(SMALL,)),
    **{f"large_cell_{ratio}": _cell(ratio) for ratio in SEEDS},
}
LARGE = ("large_cell_8", "large_cell_16")  # not in a quick run


@dataclass
class StoredStudies:
    """The studies that have been run; each is read at its first use."""

    folder: Path
    _rows: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    _comparisons: dict[str, Comparison] = field(default_factory=dict)

    def path(self, name: str) -> Path:
        """The study file."""
        return self.folder / f"{name}.h5"

    def has(self, name: str) -> bool:
        """Whether the study was run."""
        return self.path(name).exists()

    def rows(self, name: str, **values: Any) -> list[dict[str, Any]]:
        """The solved rows of a study with these values in these columns."""
        if name not in self._rows:
            rows = read_rows(self.path(name))
            self._rows[name] = [row for row in rows if row["status"] != "missing"]
        return [
            row
            for row in self._rows[name]
            if all(row[key] == value for key, value in values.items())
        ]

    def comparison(self, name: str) -> Comparison:
        """The study compared with Persson theory."""
        if name not in self._comparisons:
            self._comparisons[name] = compare(self.path(name))
        return self._comparisons[name]

    def section(self, name: str, row: dict[str, Any]) -> dict[str, np.ndarray]:
        """Height, displacement and stress along the diagonal."""
        return self._arrays(name, "cross_sections", row)

    def fields(self, name: str, row: dict[str, Any]) -> dict[str, np.ndarray]:
        """The stored fields [y, x]."""
        return self._arrays(name, "fields", row)

    def spectra(self, name: str, row: dict[str, Any]) -> dict[str, np.ndarray]:
        """Power spectra by shell."""
        return self._arrays(name, "spectra", row)

    def _arrays(self, name: str, group: str, row: dict[str, Any]) -> dict[str, np.ndarray]:
        with open_study(self.path(name)) as study:
            return study.arrays(group, row["task"])


def run(name: str, folder: Path, quick: bool, jobs: int | None = None) -> None:
    """Run the missing tasks of one study by the command line."""
    study = STUDIES[name]
    settings = {word.partition("=")[0]: word for word in study.settings}
    if quick:
        settings |= {word.partition("=")[0]: word for word in study.quick}
    command = [sys.executable, "-P", "-m", "gfmd_cli", "run", CONFIGS / f"{study.config}.toml"]
    command += ["-o", folder / f"{name}.h5", "-q"]
    command += ["-j", jobs] if jobs else []
    command += [word for setting in settings.values() for word in ("--set", setting)]
    done = subprocess.run([str(word) for word in command], check=False)
    if done.returncode not in (0, 1):  # 1: some contact has not converged, which its row says
        raise SystemExit(done.returncode)


def needs(*names: str) -> Any:
    """Mark a figure with the studies that it needs."""

    def mark(draw: Any) -> Any:
        draw.needs = names
        return draw

    return mark
