"""Pr(sigma) beside theory, on the grids and in the continuum."""

from typing import Any

from gfmd_cli.analysis.distribution_tables import distribution_records
from gfmd_cli.analysis.figures import Density, densities
from gfmd_cli.analysis.report.contents import Contents, Section, title_of
from gfmd_cli.analysis.report.figure import figure
from gfmd_cli.analysis.report.markup import NONE, Group, Html, details, join, table, tag
from gfmd_cli.analysis.report.units import AREA, DELTA_SIGMA, P_STAR, with_error

PR = Html("Pr(<var>σ</var>)")
SIGMA = Html("<var>σ</var>")
CAPTIONS = {
    "stress_distribution": (
        "Distribution of the stress over logarithmic stress, bodies side by side",
        " of the bodies at about one pressure, over logarithmic bins. Symbols: simulation; lines: "
        "Persson theory. Bins with fewer than ten grid points are left out.",
    ),
    "stress_distribution_pressures": (
        "Distribution of the stress over linear stress, at several pressures",
        " of one body at several pressures. Thick: simulation; thin: Persson theory.",
    ),
    "stress_distribution_continuum": (
        "Distribution of the stress in the continuum, with error bars and edge laws",
        " extrapolated over the grids, with error bars; faint: the grids; dashed: power law of the "
        "stress at the edge of a contact.",
    ),
}


def stress_distribution(contents: Contents) -> Section | None:
    """Figures of Pr(sigma), the bins behind them, and power laws."""
    drawn = [
        figure(contents.sheets[name], name, label, join(PR, caption))
        for name, (label, caption) in CAPTIONS.items()
        if name in contents.sheets
    ]
    if not drawn:
        return None
    below = [
        details(summary, _bins(shown))
        for summary, shown in zip(TABLES, densities(contents.items).values(), strict=True)
        if shown
    ]
    return Section(
        "Stress distribution",
        join(tag("div", *drawn, class_="figures"), *below, _power_laws(contents)),
    )


TABLES = ("Table: bodies at about one pressure", "Table: one body at several pressures")


def _bins(shown: list[Density]) -> Html:
    header = [
        join(SIGMA, " / ", DELTA_SIGMA),
        join(SIGMA, " [Pa]"),
        join(PR, " ", DELTA_SIGMA),
        join(PR, " [1/Pa]"),
        join("Persson, ", PR, " ", DELTA_SIGMA),
    ]
    groups = []
    for found in shown:
        unit = float(found.row["delta_sigma"])
        theory = found.theory(found.sigma)
        title = f"{title_of(found.item)}, p* = {found.row['p_star']:.4g}"
        columns = zip(found.sigma.tolist(), found.density.tolist(), theory.tolist(), strict=True)
        groups.append(Group(title, [[s, s * unit, d, d / unit, t] for s, d, t in columns]))
    return table("Middle of each bin, density and theory.", header, groups)


def _power_laws(contents: Contents) -> Html | None:
    """Exponents at small and large stress, where two grids gave a continuum."""
    reach = join(SIGMA, " / ", DELTA_SIGMA, " from")
    header = [P_STAR, AREA, "stress", reach, "to", "exponent", "at the edge", "theory"]
    groups: dict[str, list[list[object]]] = {}
    for record in distribution_records(contents.comparison):
        rows = groups.setdefault(f"{record['elastomer']} on {record['surface']}", [])
        at = [record["p_star"], record["a_r"]]
        rows += [[*at, name, *_law(law)] for name, law in record["fits"].items()]
    told = [Group(title, rows) for title, rows in groups.items() if rows]
    if not told:
        return None
    caption = join("Power laws of ", PR, " in the continuum; theory: the edge of a contact.")
    return details("Table: power laws", table(caption, header, told))


def _law(law: dict[str, Any]) -> list[object]:
    limit, theory = law["edge_exponent"], law["edge_exponent_theory"]
    return [
        law["sigma_from"],
        law["sigma_to"],
        with_error(law["exponent"], law["exponent_error"]),
        NONE if limit is None else with_error(limit, law["edge_exponent_error"]),
        NONE if theory is None else theory,
    ]
