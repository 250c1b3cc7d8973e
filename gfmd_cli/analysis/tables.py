"""The tables of a study: their columns, and the records that fill them."""

from collections import Counter
from collections.abc import Callable, Sequence

from gfmd_cli.analysis.compare import Comparison, Curve, in_continuum, of_study
from gfmd_cli.analysis.distribution_tables import power_laws
from gfmd_cli.analysis.ensemble import ensembles
from gfmd_cli.analysis.grid_size import grid_size
from gfmd_cli.analysis.records import VARIANTS, means_of, records_of, true_contact_areas
from gfmd_cli.analysis.table import Column, Group, Record, Table, groups_of, known, product, ratio
from gfmd_cli.analysis.units import in_si, shown
from gfmd_cli.physics.observables import QUANTITIES
from gfmd_cli.study.observables import OBSERVABLES, Observable
from gfmd_cli.study.plausibility import SEPARATOR

TitledCurves = list[tuple[str, Curve]]
"""Curves with the titles that tables give them."""
P_STAR = Column("p*", "p_star", ".4g")
PRESSURE = Column("p", "pressure", ".4g", "Pa")
AREA = Column("a_r", "a_r")
POINTS = Column("points", "points", "d")
STATUS = Column("status", "status")
SCALES = (("Delta_sigma", "delta_sigma", "Pa"), ("h_std", "h_std", "m"), ("L", "length", "m"))
"""Symbol, column and SI unit of the scales of a contact."""
RESIDUAL = Column("residual", "residual", ".1e")
REDUCED = {"a_r": "a_r", "sigma_p": "sigma_p / Delta_sigma", "u_g": "u_g / h_std"}
"""Headings of the three quantities in reduced units."""
BEST = {name: Column(heading, f"{name}_best", error=f"{name}_best_error")
        for name, heading in REDUCED.items()}  # fmt: skip
"""Continuum values where they are known, else values on the grid."""


def _beside_theory(name: str, theory: str) -> tuple[Column, Column, Column]:
    """A quantity on the grid, its prediction, and their ratio."""
    predicted = f"{name}_{theory}"
    heading = "closed form" if theory == "einstein" else "Persson"
    return (
        Column(name, name),
        Column(heading, predicted, optional=True),
        Column("ratio", ratio(name, predicted), ".3f", optional=True),
    )


COMPARISON = (
    P_STAR,
    *(column for name in QUANTITIES for column in _beside_theory(name, "persson")),
    Column("p ratio", ratio("p_star_persson_at_u_g", "p_star"), ".3f", optional=True),
    STATUS,
)
EINSTEIN = (
    P_STAR,
    *(column for name in QUANTITIES for column in _beside_theory(name, "einstein")),
)
CONTINUUM = (
    P_STAR,
    POINTS,
    *(
        Column(heading, f"{name}_shown", error=f"{name}_continuum_error",
               otherwise=f"{name}_verdict")
        for name, heading in REDUCED.items()
    ),
)  # fmt: skip
SEEDS = (
    P_STAR,
    *(
        Column(heading, f"{name}_mean", error=f"{name}_confidence")
        for name, heading in REDUCED.items()
    ),
)
CONTACT_AREA = (
    P_STAR,
    PRESSURE,
    BEST["a_r"],
    Column("Persson", "a_r_persson", optional=True),
    Column("ratio", ratio("a_r_best", "a_r_persson"), ".3f", optional=True),
    STATUS,
)


def _with_units(name: str, unit: str, unit_name: str) -> tuple[Column, ...]:
    """A quantity beside theory, in reduced and in physical units."""
    return (
        P_STAR,
        PRESSURE,
        BEST[name],
        Column(name, product(f"{name}_best", unit), unit=unit_name),
        Column("Persson", f"{name}_persson", optional=True),
        Column("Persson", product(f"{name}_persson", unit), unit=unit_name, optional=True),
        Column("ratio", ratio(f"{name}_best", f"{name}_persson"), ".3f", optional=True),
        STATUS,
    )


STRESS_DEVIATION = _with_units("sigma_p", "delta_sigma", "Pa")
MEAN_GAP = _with_units("u_g", "h_std", "m")
TRUE_CONTACT = (
    P_STAR,
    AREA,
    Column("whole surface\na_r", "a_r_persson"),
    Column("\nratio", ratio("a_r", "a_r_persson"), ".3f"),
    *(
        column
        for name, area in VARIANTS.items()
        for column in (
            Column(f"{name}\n/ Delta_sigma", name),
            Column("\na_r", area),
            Column("\nratio", ratio("a_r", area), ".3f"),
        )
    ),
)


def _columns_of(observable: Observable) -> list[Column]:
    """An observable in reduced and in SI units; the columns that no task has are left out."""
    heading, name, unit = observable.heading, observable.column.name, observable.unit
    if observable.is_flag:
        return [Column(heading, _flag(name), optional=True)]
    number_format = "d" if observable.column.kind is int else Column.format
    if unit is None:
        return [Column(heading, name, number_format, optional=True)]
    return [
        Column(f"{heading}\n/ {unit.symbol}", name, number_format, optional=True),
        Column(f"{heading}\n", lambda r: r[name] * unit.value(r), unit=unit.si, optional=True),
    ]


def _flag(name: str) -> Callable[[Record], bool | None]:
    return lambda record: bool(record[name]) if known(record[name]) else None


IN_TABLE = tuple(observable for observable in OBSERVABLES if observable.heading)
"""The observables that the table of optional observables shows."""
OPTIONAL_OBSERVABLES = (P_STAR, AREA, *(c for each in IN_TABLE for c in _columns_of(each)))


def warnings_in(rows: Sequence[Record]) -> list[str]:
    """The warnings of some contacts, each once, with the number of contacts that have it."""
    counts = Counter(line for row in rows for line in row["warnings"].split(SEPARATOR) if line)
    return [f"{line} ({n} of {len(rows)} contacts)" for line, n in counts.items()]


def study_tables(comparison: Comparison) -> list[Table]:
    """The tables of `gfmd analyze`, without those that have no record."""
    curves = [(curve_title(curve), curve) for curve in comparison.curves]
    tables = [
        comparison_table(curves),
        einstein_table(curves),
        continuum_table(curves),
        seeds_table(comparison),
        true_contact_table(curves),
        observables_table(curves),
        power_laws(comparison),
    ]
    return [table for table in tables if table.records]


def comparison_table(curves: TitledCurves) -> Table:
    """Simulation beside Persson theory, with the values on the grid."""
    groups = [Group(title, records_of(curve), _scales(curve)) for title, curve in curves]
    caption = "Values on the grid, not extrapolated."
    if any(curve.has_theory for _, curve in curves):
        source = curves[0][1].persson.mean_gap_source
        of_gap = f", mean gap by {source}" if source else ""
        caption = (
            f"Comparison with Persson theory{of_gap}. Values on the grid, not extrapolated. p "
            "ratio: pressure at which the theory gives the simulated mean gap / simulated pressure."
        )
    return Table(caption, COMPARISON, groups)


def over_pressure(columns: Sequence[Column], caption: str, curves: TitledCurves) -> Table:
    """Columns of the records of some curves, curve by curve."""
    rows = [row for _, curve in curves for row in curve.rows]
    groups = [Group(title, records_of(curve)) for title, curve in curves]
    return Table(caption, shown(columns, rows), groups)


def einstein_table(curves: TitledCurves) -> Table:
    """Springs (n = 0) beside the closed form."""
    springs = [(title, curve) for title, curve in curves if curve.n == 0 and curve.has_theory]
    return over_pressure(
        EINSTEIN, "Comparison with the closed form for n = 0 and Gaussian heights.", springs
    )


def continuum_table(curves: TitledCurves) -> Table:
    """Continuum values with their errors, or the reason why there is none."""
    groups = []
    for title, curve in curves:
        records = records_of(curve)
        if any(record.get(f"{name}_verdict") for record in records for name in QUANTITIES):
            for record in records:
                shown = [name for name in QUANTITIES if in_continuum(record, name)]
                record |= {f"{name}_shown": record[f"{name}_continuum"] for name in shown}
            groups.append(Group(title, records))
    caption = "Continuum values with their estimated errors, or the reason why there is none."
    return Table(caption, CONTINUUM, groups)


def seeds_table(comparison: Comparison) -> Table:
    """Means over seeds."""
    groups = groups_of(
        (
            f"{ensemble.title}: mean of {len(ensemble.rows)} seeds",
            {"p_star": ensemble.rows[0]["p_star"], **means_of(ensemble)},
        )
        for ensemble in ensembles(comparison)
    )
    caption = "Means over seeds, +- half the width of the 95 % confidence interval (Student's t)."
    return Table(caption, SEEDS, groups)


def true_contact_table(curves: TitledCurves) -> Table:
    """Persson theory with Delta_sigma over the contact."""
    stored = [pair for pair in curves if true_contact_areas(pair[1])]
    caption = "Persson theory with Delta_sigma over the contact instead of over the whole surface."
    return over_pressure(TRUE_CONTACT, caption, stored)


def observables_table(curves: TitledCurves) -> Table:
    """The observables that keys of [output] have turned on, with their meaning."""
    columns = [observable.column for observable in IN_TABLE]
    stored = [
        (title, curve)
        for title, curve in curves
        if any(known(row[column.name]) for column in columns for row in curve.rows)
    ]
    meanings = [
        column.meaning[:1].upper() + column.meaning[1:]
        for column in columns
        if any(known(row[column.name]) for _, curve in stored for row in curve.rows)
    ]
    return over_pressure(OPTIONAL_OBSERVABLES, f"Observables: {'. '.join(meanings)}.", stored)


def curve_title(curve: Curve) -> str:
    """Elastomer, surface and grid in words."""
    text = f"{curve.elastomer} on {curve.surface}, {grid_size(curve.rows)}"
    return of_study(curve.study, text)


def _scales(curve: Curve) -> list[str]:
    row = curve.rows[0]
    physical = in_si(row)
    scales = ", ".join(
        f"{symbol} = {row[name]:.6g}{f' {unit}' if physical else ''}"
        for symbol, name, unit in SCALES
    )
    warnings = [f"warning: {line}" for line in warnings_in(curve.rows)]
    scales += "" if physical else " (reduced units)"
    return [scales, *filter(None, [row.get("preparation")]), *warnings]
