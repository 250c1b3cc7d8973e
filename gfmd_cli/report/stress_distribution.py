"""Section: Pr(sigma) compared with theory, on the grids and in the continuum."""

from gfmd_cli.analysis.distribution_tables import power_laws
from gfmd_cli.analysis.figures import Density, densities
from gfmd_cli.analysis.table import Column, Group, Table, product, ratio
from gfmd_cli.report.data import ReportData, item_title
from gfmd_cli.report.section import Section
from gfmd_cli.report.svg import drawing

FIGURES = {
    "stress_distribution": (
        "Distribution of the stress over logarithmic stress, bodies side by side",
        "Pr(sigma) of the bodies at about one pressure, over logarithmic bins. Symbols: "
        "simulation{lines}. Bins with fewer than ten grid points are left out.",
    ),
    "stress_distribution_pressures": (
        "Distribution of the stress over linear stress, at several pressures",
        "Pr(sigma) of one body at several pressures. Thick: simulation{thin}.",
    ),
    "stress_distribution_continuum": (
        "Distribution of the stress in the continuum, with error bars and edge laws",
        "Pr(sigma) extrapolated over the grids, with error bars; faint: the grids; dashed: power "
        "law of the stress at the edge of a contact.",
    ),
}
"""Label and caption by the name of the figure; {lines}, {thin}: what says which is theory."""
SUMMARIES = {
    "stress_distribution": "Table: bodies at about one pressure",
    "stress_distribution_pressures": "Table: one body at several pressures",
}
BINS = (
    Column("sigma / Delta_sigma", "sigma"),
    Column("sigma", product("sigma", "delta_sigma"), unit="Pa"),
    Column("Pr(sigma) Delta_sigma", "density"),
    Column("Pr(sigma)", ratio("density", "delta_sigma"), unit="1/Pa"),
    Column("Persson, Pr(sigma) Delta_sigma", "theory", optional=True),
)


def stress_distribution(data: ReportData) -> Section | None:
    """Figures of Pr(sigma), the bins behind them, and power laws."""
    shown = {name: texts for name, texts in FIGURES.items() if name in data.figures}
    if not shown:
        return None
    bins = data.shown(BINS)
    tables = {
        SUMMARIES[name]: Table(
            "Middle of each bin, density and theory.", bins, list(map(_bins, held))
        )
        for name, held in densities(data.items).items()
        if held
    }
    laws = power_laws(data.comparison)
    if laws.records:
        tables["Table: power laws"] = laws
    lines, thin = ("; lines: Persson theory", "; thin: Persson theory")
    if not data.comparison.has_theory:
        lines, thin = "", ""
    drawings = [
        drawing(data.figures[name], name, label, caption.format(lines=lines, thin=thin))
        for name, (label, caption) in shown.items()
    ]
    return Section("Stress distribution", drawings=drawings, tables=tables)


def _bins(found: Density) -> Group:
    columns = zip(found.sigma, found.density, found.theory(found.sigma), strict=True)
    unit = float(found.row["delta_sigma"])
    records = [
        {"sigma": float(s), "density": float(d), "theory": float(t), "delta_sigma": unit}
        for s, d, t in columns
    ]
    return Group(f"{item_title(found.item)}, p* = {found.row['p_star']:.4g}", records)
