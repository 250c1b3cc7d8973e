"""A study beside Persson theory."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np

from gfmd_cli.analysis.selection import grouped
from gfmd_cli.analysis.table import known
from gfmd_cli.errors import InputError, typed
from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics import einstein_solid
from gfmd_cli.physics.gap_theories import CoarseGrained, FittedWeight
from gfmd_cli.physics.observables import MAIN_OBSERVABLES
from gfmd_cli.physics.persson import Persson, Shells
from gfmd_cli.physics.surface_spectrum import Spectrum
from gfmd_cli.physics.true_contact import contact_area
from gfmd_cli.study.column import Row
from gfmd_cli.study.columns import PARAMETERS
from gfmd_cli.study.reading import open_study, solved_rows

Theory = Literal["paper", "fitted", "coarse-grained"]
"""Theory of the mean gap: Eq. (30) with gamma of Eqs. (39) and (42), the weight that is fitted in
docs/energy_weights.md, or coarse-graining without any constant."""
VARIANTS = {
    name: f"a_r_persson_{name}" for name in ("deviation_bearing", "deviation_c", "quadrature_c")
}
"""Columns that hold Delta_sigma over the contact; for each, the key of the contact area that
Persson theory gives with it."""


def in_continuum(row: Mapping[str, Any], name: str) -> bool:
    """Whether a quantity has a value in the continuum, with its error."""
    values = (row.get(f"{name}_continuum", np.nan), row.get(f"{name}_continuum_error", np.nan))
    return bool(np.all(np.isfinite(values)))


def best_of_all(rows: Sequence[Row], name: str) -> list[tuple[float, float]]:
    """A quantity of rows that are averaged, with its error: of the continuum where that is known.

    NaN where it is known of some rows only; of the grid where no row was to have a continuum value.
    Of a single row: of the continuum where that is known, else of the grid.
    """
    are_known = all(in_continuum(row, name) for row in rows)
    if len(rows) > 1 and not are_known and any(row.get(f"{name}_verdict") for row in rows):
        return [(np.nan, np.nan)] * len(rows)
    value = f"{name}_continuum" if are_known else name
    return [(float(row[value]), float(row[f"{value}_error"])) for row in rows]


def with_best(row: Row) -> Row:
    """A row with the best value of each quantity, as `NAME_best`, and `NAME_best_error`."""
    pairs = {name: best_of_all([row], name)[0] for name in MAIN_OBSERVABLES}
    values = {f"{name}_best": value for name, (value, _) in pairs.items()}
    return row | values | {f"{name}_best_error": error for name, (_, error) in pairs.items()}


def of_study(study: str, text: str) -> str:
    """A text with the name of its study, where two are shown side by side."""
    return f"{study}: {text}" if study else text


@dataclass(frozen=True)
class Prediction:
    """What a theory says at some pressures, in reduced units."""

    a_r: Field
    sigma_p: Field
    u_g: Field


@dataclass(frozen=True)
class Curve:
    """All pressures of one surface, elastomer, grid and solver, with theory of the spectrum."""

    rows: list[Row]
    """Rows of the study, pressure rising."""
    persson: Persson
    map_spectrum: Spectrum | None = None
    """Spectrum of a map with borders, None of any other surface."""
    study: str = ""
    """Name of the study where several are shown side by side."""
    spectrum_row: Row | None = None
    """A row on the grid of which the study stores the spectrum; for a map, h_std and Delta_sigma
    depend on this grid. By default the first row."""

    @property
    def elastomer(self) -> str:
        """Label of the elastomer."""
        return str(self.rows[0]["elastomer"])

    @property
    def surface(self) -> str:
        """Label of the surface."""
        return str(self.rows[0]["surface"])

    @property
    def points(self) -> int:
        """Grid points along x."""
        return int(self.rows[0]["points"])

    @property
    def n(self) -> float:
        """Exponent of the stiffness, NaN where it is no single power."""
        return float(self.rows[0]["n"])

    def column(self, name: str) -> Field:
        """A column of the study over the pressures."""
        return np.array([row[name] for row in self.rows], dtype=np.float64)

    @property
    def units(self) -> tuple[float, float]:
        """Delta_sigma [Pa] and h_std [m] of the spectrum."""
        row = self.row_of_spectrum
        return row["delta_sigma"], row["h_std"]

    @property
    def row_of_spectrum(self) -> Row:
        """A row on the grid of the spectrum."""
        return self.spectrum_row or self.rows[0]

    @property
    def has_theory(self) -> bool:
        """Whether Persson theory applies: it describes rough surfaces, not single indenters."""
        return bool(self.rows[0]["rough"])

    def predict(self, p_star: Field) -> Prediction:
        """Persson theory at reduced pressures, NaN where it does not apply.

        Paper Eqs. (25), (26), (28).
        """
        if not self.has_theory:
            return Prediction(*(np.full(np.shape(p_star), np.nan) for _ in range(3)))
        unit, height = self.units
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
        if not self.has_theory:
            return np.full(np.shape(sigma), np.nan)
        unit, _ = self.units
        return unit * self.persson.stress_density(sigma * unit, p_star * unit)

    def pressure_at_gap(self, u_g: Field) -> Field:
        """Reduced pressure of this mean gap in Persson theory; NaN below 1e-6 and above 20."""
        if not self.has_theory:
            return np.full(np.shape(u_g), np.nan)
        unit, height = self.units
        return self.persson.pressure_at_gap(np.asarray(u_g) * height) / unit

    @cached_property
    def records(self) -> list[Row]:
        """The rows with best values and with theory at each pressure, NaN where it is unknown."""
        p_star = self.column("p_star")
        columns = {f"{name}_persson": getattr(self.prediction, name) for name in MAIN_OBSERVABLES}
        columns["p_star_persson_at_u_g"] = self.pressure_at_gap(self.column("u_g"))
        for name, key in VARIANTS.items():
            deviation = self.column(name) if self.has_theory else np.full_like(p_star, np.nan)
            columns[key] = contact_area(deviation, p_star)
        if self.n == 0 and self.has_theory:
            exact = einstein_prediction(p_star)
            columns |= {f"{name}_einstein": getattr(exact, name) for name in MAIN_OBSERVABLES}
        return [
            with_best(row) | {name: float(values[i]) for name, values in columns.items()}
            for i, row in enumerate(self.rows)
        ]

    def stores(self, keys: Iterable[str]) -> bool:
        """Whether some record has a value of one of these keys."""
        return any(
            known(record.get(key)) and record[key] != "" for record in self.records for key in keys
        )


@dataclass(frozen=True)
class Comparison:
    """A study, curve by curve."""

    path: Path
    curves: list[Curve]
    rows: list[Row]
    """One for each task, missing ones too."""
    attributes: dict[str, str]
    """Attributes of the study file."""

    @property
    def missing(self) -> list[int]:
        """Tasks without a result: not run yet, or failed."""
        return [row["task"] for row in self.rows if not row["status"].is_solved]

    @property
    def has_theory(self) -> bool:
        """Whether Persson theory applies to any curve."""
        return any(curve.has_theory for curve in self.curves)

    @property
    def records(self) -> list[Row]:
        """The records of all curves."""
        return [record for curve in self.curves for record in curve.records]

    def __str__(self) -> str:
        """The tables of `gfmd analyze`."""
        return "\n\n\n".join(table.as_text() for table in self._tables())

    def _repr_html_(self) -> str:
        """The same as HTML, for notebooks."""
        return "".join(table.as_html() for table in self._tables())

    def _tables(self) -> list[Any]:
        from gfmd_cli.analysis.tables import study_tables  # which needs this module

        return study_tables(self)


def compare(path: Path, theory: Theory = "paper") -> Comparison:
    """Set a study beside Persson theory.

    Raises InputError where there is no such study or it holds no result, StudyError where it
    is unreadable.
    """
    with open_study(path) as study:
        solved = solved_rows(study.rows)
        if not solved:
            raise InputError(
                f"{path}: contains no result yet; `gfmd status {typed(path)}` shows its tasks"
            )
        by_scene = grouped(solved, lambda row: row["scene"])
        groups = grouped(solved, lambda row: (row["scene"], *solver_of(row)))
        curves = []
        for (scene, *_), group in groups.items():
            ordered = sorted(group, key=lambda row: row["p_star"])
            spectrum = study.shells(scene)
            persson = theory_of(theory, spectrum, float(group[0]["n"]))
            finest = max(by_scene[scene], key=lambda row: row["points"])
            curves.append(Curve(ordered, persson, study.map_spectrum(scene), spectrum_row=finest))
        return Comparison(path, curves, study.rows, study.attributes)


def solver_of(row: Row) -> tuple[str, ...]:
    """All parameters of the solver of a row, as words: a blank cell, NaN, would differ from NaN."""
    return tuple(each.word(row) for each in PARAMETERS if each.table == "solver")


def with_solvers(titles: Iterable[str], rows: Sequence[Row]) -> list[str]:
    """Titles of contacts, followed by the keys of [solver] in which the contacts differ.

    A key that only some kinds of solvers have is named only if its values differ.
    """
    columns = zip(*map(solver_of, rows), strict=True)
    differing = [column for column in columns if len(set(column) - {""}) > 1]
    return [
        ", ".join(filter(None, (title, *(column[i] for column in differing))))
        for i, title in enumerate(titles)
    ]


def load_of(row: Row) -> tuple[str, str]:
    """The prescribed load of a row, equal where loads differ by rounding alone."""
    return row["load"], f"{row['load_value']:.12g}"


def theory_of(theory: Theory, spectrum: Shells, n: float) -> Persson:
    """A theory of a spectrum and the exponent n of k(q); where n is NaN, the local exponent.

    That needs two shells: the fitted mean gap of a single wave is NaN where n is.
    """
    if theory == "coarse-grained":
        return CoarseGrained(spectrum)
    if theory == "fitted":
        exponents = spectrum.exponents() if np.isnan(n) else np.full(spectrum.q.size, n)
        return FittedWeight(spectrum, exponents)
    return Persson(spectrum)


def einstein_prediction(p_star: Field) -> Prediction:
    """The Einstein solid (n = 0) under Gaussian heights, in closed form. Paper Eqs. (34)-(38)."""
    height = einstein_solid.non_contact_height(p_star)
    return Prediction(
        a_r=einstein_solid.contact_area(height),
        sigma_p=einstein_solid.stress_deviation(height),
        u_g=einstein_solid.mean_gap(height),
    )
