"""Contact area, stress deviation and mean gap over pressure, each beside theory."""

import math
from collections.abc import Sequence

from gfmd_cli.analysis.compare import Curve, Row
from gfmd_cli.analysis.ensemble import ensembles
from gfmd_cli.analysis.report.contents import Contents, Section
from gfmd_cli.analysis.report.figure import figure
from gfmd_cli.analysis.report.markup import NONE, Group, Html, details, join, table, tag
from gfmd_cli.analysis.report.units import (
    AREA,
    DELTA_SIGMA,
    DEVIATION,
    GAP,
    H_STD,
    P_STAR,
    PRESSURE,
    with_error,
)
from gfmd_cli.analysis.tables import continuum_cell
from gfmd_cli.analysis.true_contact import VARIANTS, true_contact_areas
from gfmd_cli.physics.observables import QUANTITIES

DRAWN = (
    " Symbols: simulation, in the continuum with its error where that is known, else on the grid "
    "(bars: estimated distance to the continuum; crosses: not converged). Lines: Persson theory of "
    "the same spectrum."
)
THEORY, RATIO = "Persson", "ratio"


def contact_area(contents: Contents) -> Section | None:
    """Relative contact area."""
    drawn = [
        _drawn(contents, "contact_area", "Relative contact area over reduced pressure"),
        _drawn(contents, "contact_area_ratio", "Contact area over that of Persson theory"),
    ]
    header = [P_STAR, PRESSURE, AREA, THEORY, RATIO, "status"]
    groups = [
        Group(
            title,
            [
                [
                    row["p_star"],
                    row["pressure"],
                    with_error(value, error),
                    float(theory),
                    _ratio(value, theory),
                    row["status"],
                ]
                for row, theory, value, error in zip(
                    curve.rows, curve.prediction.a_r, *curve.best("a_r"), strict=True
                )
            ],
        )
        for title, curve in contents.curves
    ]
    caption = join("Relative contact area ", AREA, " and Persson theory; ratio: simulation / it.")
    return _section("Contact area", drawn, [*_table(caption, header, groups), *_true(contents)])


def stress_deviation(contents: Contents) -> Section | None:
    """Standard deviation of the stress."""
    name = "stress_deviation"
    drawn = [_drawn(contents, name, "Standard deviation of the stress over reduced pressure")]
    reduced = join(DEVIATION, " / ", DELTA_SIGMA)
    physical = join(DEVIATION, " [Pa]")
    header = [P_STAR, PRESSURE, reduced, physical, THEORY, join(THEORY, " [Pa]"), RATIO, "status"]
    groups = [
        Group(title, _reduced_and_not(curve, "sigma_p", curve.rows[0]["delta_sigma"]))
        for title, curve in contents.curves
    ]
    caption = join("Standard deviation ", DEVIATION, " of the stress over the whole interface.")
    return _section("Stress deviation", drawn, _table(caption, header, groups))


def mean_gap(contents: Contents) -> Section | None:
    """Mean gap."""
    drawn = [
        _drawn(contents, "mean_gap_log", "Mean gap over the logarithm of the reduced pressure"),
        _drawn(contents, "mean_gap_tail", "Logarithm of the mean gap over the reduced pressure"),
    ]
    reduced, physical = join(GAP, " / ", H_STD), join(GAP, " [m]")
    header = [P_STAR, PRESSURE, reduced, physical, THEORY, join(THEORY, " [m]"), RATIO, "status"]
    groups = [
        Group(title, _reduced_and_not(curve, "u_g", curve.rows[0]["h_std"]))
        for title, curve in contents.curves
    ]
    caption = join("Mean gap ", GAP, " between the surfaces, over the whole interface.")
    return _section("Mean gap", drawn, _table(caption, header, groups))


def continuum(contents: Contents) -> Section | None:
    """Continuum values with error bars, and means over seeds."""
    told = [part for part in (_values(contents), _seeds(contents)) if part is not None]
    return Section("Error bars", join(*told)) if told else None


SCALARS = (AREA, join(DEVIATION, " / ", DELTA_SIGMA), join(GAP, " / ", H_STD))


def _values(contents: Contents) -> Html | None:
    groups = [
        Group(title, [[row["p_star"], row["points"], *_continuum(row)] for row in curve.rows])
        for title, curve in contents.curves
        if _has_continuum(curve)
    ]
    caption = "Continuum values with their estimated errors, or why there is none."
    return table(caption, [P_STAR, "points", *SCALARS], groups) if groups else None


def _seeds(contents: Contents) -> Html | None:
    spreads: dict[str, list[list[object]]] = {}
    for found in ensembles(contents.comparison):
        told = [found.spread(name) for name in QUANTITIES]
        cells = [with_error(spread.mean, spread.half_width) for spread in told]
        title = f"{found.title}: {len(found.rows)} seeds"
        spreads.setdefault(title, []).append([found.rows[0]["p_star"], *cells])
    groups = [Group(title, rows) for title, rows in spreads.items()]
    caption = "Means over seeds, ± half the width of the 95 % confidence interval (Student)."
    return table(caption, [P_STAR, *SCALARS], groups) if groups else None


def _continuum(row: Row) -> list[str]:
    return [continuum_cell(row, name).replace("+-", "±") for name in QUANTITIES]


def _has_continuum(curve: Curve) -> bool:
    return any(row.get(f"{name}_verdict") for row in curve.rows for name in QUANTITIES)


def _drawn(contents: Contents, name: str, what: str) -> Html | None:
    sheet = contents.sheets.get(name)
    if sheet is None:
        return None
    label = f"{what}: {', '.join(sheet.legend)}"
    return figure(sheet, name, label, f"{what}.{DRAWN}")


def _section(title: str, drawn: list[Html | None], below: list[Html]) -> Section:
    return Section(title, join(tag("div", *drawn, class_="figures"), *below))


def _table(caption: Html, header: Sequence[object], groups: list[Group]) -> list[Html]:
    return [details("Table behind the figures", table(caption, header, groups))]


def _reduced_and_not(curve: Curve, name: str, unit: float) -> list[list[object]]:
    """Rows of a quantity over pressure, in its reduced unit and times that."""
    theory, (values, errors) = getattr(curve.prediction, name), curve.best(name)
    return [
        [
            row["p_star"],
            row["pressure"],
            with_error(values[i], errors[i]),
            float(values[i] * unit),
            float(theory[i]),
            float(theory[i] * unit),
            _ratio(values[i], theory[i]),
            row["status"],
        ]
        for i, row in enumerate(curve.rows)
    ]


def _ratio(value: float, reference: float) -> str:
    ratio = value / reference if reference else math.nan
    return f"{ratio:.3f}" if math.isfinite(ratio) else NONE


def _true(contents: Contents) -> list[Html]:
    """Theory with Delta_sigma over the contact in the place of the whole surface."""
    groups = []
    for title, curve in contents.curves:
        areas = true_contact_areas(curve)
        if areas:
            rows = [
                [
                    row["p_star"],
                    row["a_r"],
                    *(x for n, key in VARIANTS.items() for x in (row[n], float(areas[key][i]))),
                ]
                for i, row in enumerate(curve.rows)
            ]
            groups.append(Group(title, rows))
    if not groups:
        return []
    titles = [join(t, a) for t in VARIANTS for a in (Html(" / Δ<var>σ</var>"), join(": ", AREA))]
    caption = join(DELTA_SIGMA, " taken over the contact, and the contact area of theory with it.")
    told = table(caption, [P_STAR, AREA, *titles], groups)
    return [details("Table: Persson theory with the stress over the true contact", told)]
