"""A study beside Persson theory."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from gfmd_cli.errors import InputError
from gfmd_cli.physics import einstein
from gfmd_cli.physics.fields import Field
from gfmd_cli.physics.persson import Persson, Shells, gamma_fitted
from gfmd_cli.study.layout import MISSING
from gfmd_cli.study.reading import read_rows, read_shells

Row = dict[str, Any]
Weights = Literal["paper", "fitted"]
"""gamma of Eq. (30): as the paper has it, Eqs. (39) and (42), or as fitted in docs/theory.md."""


def in_continuum(row: Row, name: str) -> bool:
    """Whether a quantity has a value in the continuum, with its error."""
    told = (row.get(f"{name}_continuum", np.nan), row.get(f"{name}_continuum_error", np.nan))
    return bool(np.all(np.isfinite(told)))


def best(row: Row, name: str) -> tuple[float, float]:
    """A quantity with its error: of the continuum where that is known, else of the grid."""
    value = f"{name}_continuum" if in_continuum(row, name) else name
    return float(row[value]), float(row[f"{value}_error"])


@dataclass(frozen=True)
class Prediction:
    """What a theory says at some pressures, in reduced units."""

    a_r: Field
    sigma_p: Field
    u_g: Field


@dataclass(frozen=True)
class Curve:
    """All pressures of one surface, body, grid and solver, and the theory of the same spectrum."""

    rows: list[Row]
    """Rows of the study, pressure rising."""
    persson: Persson

    @property
    def elastomer(self) -> str:
        """The body, in words."""
        return str(self.rows[0]["elastomer"])

    @property
    def surface(self) -> str:
        """The surface, in words."""
        return str(self.rows[0]["surface"])

    @property
    def points(self) -> int:
        """Grid points per side."""
        return int(self.rows[0]["points"])

    @property
    def n(self) -> float:
        """Exponent of the stiffness, NaN where it is no single power."""
        return float(self.rows[0]["n"])

    def column(self, name: str) -> Field:
        """A column of the study over the pressures."""
        return np.array([row[name] for row in self.rows], dtype=np.float64)

    def best(self, name: str) -> tuple[Field, Field]:
        """A quantity over the pressures with its errors: of the continuum where that is known."""
        values, errors = zip(*(best(row, name) for row in self.rows), strict=True)
        return np.array(values), np.array(errors)

    def predict(self, p_star: Field) -> Prediction:
        """Persson theory at reduced pressures. Paper Eqs. (25), (26), (28)."""
        unit, height = self.rows[0]["delta_sigma"], self.rows[0]["h_std"]
        pressure = np.asarray(p_star) * unit
        return Prediction(
            a_r=self.persson.contact_area(pressure),
            sigma_p=self.persson.stress_deviation(pressure) / unit,
            u_g=self.persson.mean_gap(pressure) / height,
        )

    @cached_property
    def prediction(self) -> Prediction:
        """Persson theory at the pressures of the study."""
        return self.predict(self.column("p_star"))

    def stress_density(self, sigma: Field, p_star: float) -> Field:
        """Pr(sigma) Delta_sigma of Persson theory over sigma / Delta_sigma. Paper Eq. (24)."""
        unit = self.rows[0]["delta_sigma"]
        return np.asarray(unit * self.persson.stress_density(sigma * unit, p_star * unit))

    def pressure_at_gap(self, u_g: Field) -> Field:
        """Reduced pressure at which Persson theory has this mean gap; NaN for no gap."""
        unit, height = self.rows[0]["delta_sigma"], self.rows[0]["h_std"]
        pressure: Field = self.persson.pressure_at_gap(np.asarray(u_g) * height) / unit
        return pressure


@dataclass(frozen=True)
class Comparison:
    """A study, curve by curve."""

    path: Path
    curves: list[Curve]
    missing: int
    """Tasks that the study does not hold yet."""


def compare(path: Path, gamma: Weights = "paper") -> Comparison:
    """Set a study beside Persson theory.

    Raises InputError where there is no such study or it holds no result, StudyError where it
    is unreadable.
    """
    rows = read_rows(path)
    solved = [row for row in rows if row["status"] != MISSING]
    if not solved:
        raise InputError(f"{path}: holds no result yet; run it first")
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in solved:
        groups.setdefault((row["scene"], row["solver"], row["tolerance"]), []).append(row)
    curves = []
    for (scene, *_), group in groups.items():
        spectrum = read_shells(path, scene)
        if gamma == "fitted":
            spectrum = with_fitted_gamma(spectrum, float(group[0]["n"]))
        curves.append(Curve(sorted(group, key=lambda row: row["p_star"]), Persson(spectrum)))
    return Comparison(path, curves, len(rows) - len(solved))


def with_fitted_gamma(spectrum: Shells, n: float) -> Shells:
    """A spectrum with gamma as fitted, at the exponent n or, where n is NaN, the local one."""
    exponents = spectrum.exponents() if np.isnan(n) else np.full(spectrum.q.size, n)
    return replace(spectrum, gamma=gamma_fitted(exponents))


def einstein_prediction(p_star: Field) -> Prediction:
    """The Einstein solid (n = 0) under Gaussian heights, in closed form. Paper Eqs. (34)-(38)."""
    height = einstein.non_contact_height(p_star)
    return Prediction(
        a_r=einstein.contact_area(height),
        sigma_p=einstein.stress_deviation(height),
        u_g=einstein.mean_gap(height),
    )
