"""The tables of a study: their columns, and the records that fill them."""

from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import Any

from gfmd_cli.analysis.compare import (
    VARIANTS,
    Comparison,
    Curve,
    in_continuum,
    of_study,
    with_solvers,
)
from gfmd_cli.analysis.distribution import StressDistribution, distributions
from gfmd_cli.analysis.edge_law import fit_power_law
from gfmd_cli.analysis.ensemble import ensembles
from gfmd_cli.analysis.table import (
    Group,
    Record,
    Table,
    TableColumn,
    Value,
    groups_of,
    known,
    product,
    ratio,
    value_in,
)
from gfmd_cli.analysis.wording import SPACE, contact_title, grid_size, in_si, shown
from gfmd_cli.grid.arrays import Field
from gfmd_cli.physics.observables import MAIN_OBSERVABLES
from gfmd_cli.study.observables import OPTIONAL_OBSERVABLES, OptionalObservable
from gfmd_cli.study.plausibility import SEPARATOR
from gfmd_cli.units import count

TitledCurves = list[tuple[str, Curve]]
"""Curves with the titles that tables give them."""
TASK = TableColumn("task", "task", "d")
ELASTOMER = TableColumn("elastomer", "elastomer")
P_STAR = TableColumn("p*", "p_star", ".4g")
PRESSURE = TableColumn("p", "pressure", ".4g", "Pa")
AREA = TableColumn("a_r", "a_r")
POINTS = TableColumn("points", "points", "d")
STATUS = TableColumn("status", "status")
SCALES = (("Delta_sigma", "delta_sigma", "Pa"), ("h_std", "h_std", "m"), ("L", "length", "m"))
"""Symbol, column and SI unit of the scales of a contact."""
RESIDUAL = TableColumn("residual", "residual", ".1e")
ON_GRID = " (grid)"
"""What follows a value on the grid whose continuum value was requested, but is unknown."""
THEORIES = {"persson": "Persson", "einstein": "closed form"}
"""Headings of predictions, by the suffix of their keys."""


def _beside_theory(name: str, theory: str = "persson", *, best: bool = False) -> list[TableColumn]:
    """A quantity on the grid, or its best value in SI units too, with prediction and ratio."""
    (symbol, unit_column, si_unit), heading = MAIN_OBSERVABLES[name], THEORIES[theory]
    value, predicted = f"{name}_best" if best else name, f"{name}_{theory}"
    columns = [TableColumn(heading, predicted, optional=True)]
    if best and unit_column:
        columns.insert(0, TableColumn(name, product(value, unit_column), unit=si_unit))
        columns.append(
            TableColumn(heading, product(predicted, unit_column), unit=si_unit, optional=True)
        )
    return [
        best_value(name, symbol) if best else TableColumn(name, name),
        *columns,
        TableColumn("ratio", ratio(value, predicted), optional=True),
    ]


def best_value(name: str, heading: str, number_format: str = TableColumn.format) -> TableColumn:
    """The value of a quantity in the continuum with its error; that of the grid says so."""
    return TableColumn(
        heading,
        f"{name}_best",
        number_format,
        error=f"{name}_best_error",
        remark=lambda record: ON_GRID if record.get(f"{name}_verdict") else "",
    )


def _continuum(name: str) -> TableColumn:
    return TableColumn(
        MAIN_OBSERVABLES[name].heading,
        lambda record: record[f"{name}_continuum"] if in_continuum(record, name) else None,
        error=f"{name}_continuum_error",
        otherwise=f"{name}_verdict",
    )


COMPARISON = (
    P_STAR,
    PRESSURE,
    *(column for name in MAIN_OBSERVABLES for column in _beside_theory(name)),
    TableColumn("p ratio", ratio("p_star_persson_at_u_g", "p_star"), optional=True),
    STATUS,
)
EINSTEIN = (
    P_STAR,
    PRESSURE,
    *(c for name in MAIN_OBSERVABLES for c in _beside_theory(name, "einstein")),
)
ON_GRIDS = "Values on the grid, not extrapolated."
EINSTEIN_CAPTION = f"Comparison with the closed form for n = 0 and Gaussian heights. {ON_GRIDS}"
CONTINUUM = (
    replace(P_STAR, error="p_star_error"),
    PRESSURE,
    POINTS,
    *map(_continuum, MAIN_OBSERVABLES),
)
SEEDS = (
    replace(P_STAR, error="p_star_confidence"),
    PRESSURE,
    *(
        TableColumn(observable.heading, f"{name}_mean", error=f"{name}_confidence")
        for name, observable in MAIN_OBSERVABLES.items()
    ),
    TableColumn("not converged", "not_converged", optional=True),
)
BEST_VALUES = {
    name: (P_STAR, PRESSURE, *_beside_theory(name, best=True), STATUS) for name in MAIN_OBSERVABLES
}
"""Columns by quantity: with continuum values where they are known, else with values on the grid."""
TRUE_CONTACT = (
    P_STAR,
    PRESSURE,
    AREA,
    TableColumn("whole surface\na_r", "a_r_persson", optional=True),
    TableColumn("\nratio", ratio("a_r", "a_r_persson"), optional=True),
    *(
        column
        for name, area in VARIANTS.items()
        for column in (
            TableColumn(f"{name}\n/ Delta_sigma", name),
            TableColumn("\na_r", area, optional=True),
            TableColumn("\nratio", ratio("a_r", area), optional=True),
        )
    ),
)
POWER_LAWS = (
    P_STAR,
    AREA,
    TableColumn("grids", "grids"),
    TableColumn("seeds", "seeds", "d"),
    TableColumn("stress", "law"),
    TableColumn("sigma / Delta_sigma\nfrom", "lowest", ".3g"),
    TableColumn("\nto", "highest", ".3g"),
    TableColumn("exponent", "exponent", error="error"),
    TableColumn("at the edge", "limit", error="limit_error"),
    TableColumn("theory", "theory", ".3g"),
    TableColumn("prefactor", "prefactor", ".3g"),
)
POWER_LAWS_CAPTION = (
    "Power laws of Pr(sigma) in the continuum. exponent: fit between the two stresses; at the "
    "edge: fit with the first correction to the power law; theory: exponent at the edge of a "
    f"contact, n{SPACE}/{SPACE}(2{SPACE}-{SPACE}n). a_r: on the finest grid, mean over the seeds."
)


def _columns_of(observable: OptionalObservable) -> list[TableColumn]:
    """An observable in reduced and in SI units; the columns that no task has are left out."""
    heading, name, unit = observable.heading, observable.column.name, observable.unit
    if unit is not None and observable.line_unit is not None:
        return [
            replace(column, value=_of_dimension(dimension, column.value))
            for dimension, of_it in ((2, unit), (1, observable.line_unit))
            for column in _columns_of(observable._replace(unit=of_it, line_unit=None))
        ]
    if observable.is_flag:
        return [TableColumn(heading, lambda r: {0: False, 1: True}.get(r[name]), optional=True)]
    number_format = "d" if observable.column.kind is int else TableColumn.format
    if unit is None:
        return [TableColumn(heading, name, number_format, optional=True)]
    return [
        TableColumn(f"{heading}\n/ {unit.symbol}", name, number_format, optional=True),
        TableColumn(
            f"{heading}\n", lambda r: r[name] * unit.value(r), unit=unit.si_unit, optional=True
        ),
    ]


def _of_dimension(dimension: int, value: Value) -> Callable[[Record], Any]:
    """A value of the contacts of one dimension; None of the others."""
    return lambda record: value_in(record, value) if record["dimension"] == dimension else None


IN_TABLE = tuple(observable for observable in OPTIONAL_OBSERVABLES if observable.heading)
"""The observables that [output] turns on, without those that have a table of their own."""
OPTIONAL_COLUMNS = (
    P_STAR,
    PRESSURE,
    AREA,
    *(c for each in IN_TABLE for c in _columns_of(each)),
)


def warnings_in(rows: Sequence[Record]) -> list[str]:
    """The warnings of some contacts, each once, with the number of contacts that have it."""
    counts = Counter(line for row in rows for line in row["warnings"].split(SEPARATOR) if line)
    return [f"{line} ({n} of {count(len(rows), 'contact')})" for line, n in counts.items()]


def study_tables(comparison: Comparison) -> list[Table]:
    """The tables of `gfmd analyze`, without those that have no record."""
    firsts = [curve.rows[0] for curve in comparison.curves]
    titles = with_solvers(map(curve_title, comparison.curves), firsts)
    curves = list(zip(titles, comparison.curves, strict=True))
    tables = [
        comparison_table(curves),
        over_pressure(EINSTEIN, EINSTEIN_CAPTION, curves, ["a_r_einstein"]),
        continuum_table(curves),
        seeds_table(comparison),
        true_contact_table(curves),
        observables_table(curves),
        power_laws(comparison),
    ]
    return [table for table in tables if table.records]


def comparison_table(curves: TitledCurves) -> Table:
    """Simulation beside Persson theory, with the values on the grid."""
    groups = [Group(title, curve.records, _scales(curve)) for title, curve in curves]
    caption = ON_GRIDS
    if any(curve.has_theory for _, curve in curves):
        source = curves[0][1].persson.mean_gap_source
        of_gap = f", mean gap by {source}" if source else ""
        caption = (
            f"Comparison with Persson theory{of_gap}. The theory assumes Gaussian heights."
            f"{border_note(curves)} {ON_GRIDS} p ratio: pressure at which the "
            "theory gives the simulated mean gap / simulated pressure."
        )
    rows = [record for group in groups for record in group.records]
    return Table(caption, shown(COMPARISON, rows), groups)


def border_note(curves: TitledCurves) -> str:
    """A sentence on what the theory leaves out of contacts with a free boundary; else ""."""
    if all(row["boundary"] != "free" for _, curve in curves for row in curve.rows):
        return ""
    return " It is that of a periodic surface, without the borders of a free boundary."


def over_pressure(
    columns: Sequence[TableColumn], caption: str, curves: TitledCurves, keys: Collection[str] = ()
) -> Table:
    """Columns of the records of the curves; with `keys`, of those that have a value of one."""
    groups = [
        Group(title, curve.records) for title, curve in curves if not keys or curve.stores(keys)
    ]
    rows = [record for group in groups for record in group.records]
    return Table(caption, shown(columns, rows), groups)


def continuum_table(curves: TitledCurves) -> Table:
    """Continuum values with their errors, or the reason why there is none."""
    caption = "Continuum values with their estimated errors, or the reason why there is none."
    return over_pressure(
        CONTINUUM, caption, curves, [f"{name}_verdict" for name in MAIN_OBSERVABLES]
    )


def true_contact_table(curves: TitledCurves) -> Table:
    """Delta_sigma over the contact, and Persson theory with it where that applies."""
    caption = "Delta_sigma over the contact instead of over the whole surface."
    if any(curve.has_theory for _, curve in curves):
        caption = f"Persson theory with {caption}"
    return over_pressure(TRUE_CONTACT, f"{caption} {ON_GRIDS}", curves, VARIANTS)


def observables_table(curves: TitledCurves) -> Table:
    """The observables that keys of [output] have turned on, with their meaning."""
    columns = [observable.column for observable in IN_TABLE]
    table = over_pressure(OPTIONAL_COLUMNS, "", curves, [column.name for column in columns])
    meanings = [
        column.meaning[:1].upper() + column.meaning[1:]
        for column in columns
        if any(known(record[column.name]) for record in table.records)
    ]
    return replace(table, caption=f"Observables: {'. '.join(meanings)}. {ON_GRIDS}")


def seeds_table(comparison: Comparison) -> Table:
    """Means over seeds."""
    means = ensembles(comparison)
    titles = with_solvers((each.title for each in means), [each.rows[0] for each in means])
    groups = groups_of(
        (
            f"{title}: mean of {len(ensemble.rows)} seeds",
            {
                **ensemble.rows[0],
                "p_star": ensemble.mean_load("p_star"),
                "pressure": ensemble.mean_load("pressure"),
                "not_converged": ensemble.not_converged,
                **ensemble.means(),
            },
        )
        for title, ensemble in zip(titles, means, strict=True)
    )
    caption = (
        "Means over seeds, +- half the width of the 95 % confidence interval (Student's t). "
        "With [accuracy] the values are those in the continuum, and the interval includes their "
        "mean error; otherwise they are those on the grid."
    )
    records = [record for group in groups for record in group.records]
    if not all(known(record[f"{name}_mean"]) for record in records for name in MAIN_OBSERVABLES):
        caption += " A mean is left out where the continuum value of some seed is unknown."
    return Table(caption, shown(SEEDS, records), groups)


def power_laws(comparison: Comparison) -> Table:
    """The power laws of Pr(sigma), a record each; without one where no contact has two grids."""
    stresses = distributions(comparison)
    titles = with_solvers((each.title for each in stresses), [each.finest for each in stresses])
    titled = [
        (title, record)
        for title, stress in zip(titles, stresses, strict=True)
        for record in _law_records(stress)
    ]
    return Table(POWER_LAWS_CAPTION, POWER_LAWS, groups_of(titled))


def _law_records(stress: StressDistribution) -> list[Record]:
    record = {
        "p_star": stress.finest["p_star"],
        "a_r": stress.a_r,
        "grids": f"{stress.points[0]} to {stress.points[-1]}",
        "seeds": len(stress.seeds),
    }
    fits = (fit_power_law(stress, law) for law in ("small", "large"))
    laws = [vars(fit) for fit in fits if fit is not None]
    return [record | law for law in laws or [{"law": "too few bins are resolved"}]]


def curve_title(curve: Curve, *, of_seeds: bool = False) -> str:
    """Elastomer, surface and grid in words; `of_seeds`: the surface without its seed."""
    text = f"{contact_title(curve.rows[0], of_seeds=of_seeds)}, {grid_size(curve.rows)}"
    return of_study(curve.study, text)


def _ends(values: Field) -> str:
    """The smallest and the largest value: those of a map may depend on the grid."""
    return " to ".join(dict.fromkeys(f"{end:.6g}" for end in (values.min(), values.max())))


def _scales(curve: Curve) -> list[str]:
    units = [unit if any(in_si(row, unit) for row in curve.rows) else "" for *_, unit in SCALES]
    scales = ", ".join(
        f"{symbol} = {_ends(curve.column(name))} {unit}".rstrip()
        for (symbol, name, _), unit in zip(SCALES, units, strict=True)
    )
    warnings = [f"warning: {line}" for line in warnings_in(curve.rows)]
    scales += "" if any(units) else " (reduced units)"
    return [scales, *filter(None, [curve.rows[0].get("preparation")]), *warnings]
