"""Sections: the figures of `gfmd analyze` and `gfmd bench`, with the tables behind them.

Contact area, mean gap and stress deviation over the pressure, distribution of the stress, speed
against error; error bars and optional observables, which are tables alone; what has not converged,
how two studies differ, where a study comes from.
"""

import json
from collections import Counter
from dataclasses import replace

from gfmd_cli.analysis import tables
from gfmd_cli.analysis.diff import diff, diff_lists, diff_table, nothing_in_common
from gfmd_cli.analysis.distribution_figure import Density, densities
from gfmd_cli.analysis.figures import PANELS
from gfmd_cli.analysis.table import Group, Table, TableColumn, product, ratio, records_of
from gfmd_cli.analysis.tables import ELASTOMER, P_STAR, RESIDUAL, STATUS, TASK
from gfmd_cli.analysis.wording import shown
from gfmd_cli.bench.results import bench_figures, bench_table
from gfmd_cli.report.data import ReportData, item_title
from gfmd_cli.report.section import Section, drawing, with_curves
from gfmd_cli.units import count

MAX_ROWS = 100  # contacts that the table of contacts that have not converged lists
MACHINE = ("node", "system", "processor", "cores", "python", "slurm_job")
NOT_CONVERGED_CAPTION = (
    "Contacts that missed the requested tolerance, accuracy or load, see the reasons. Their values "
    "are kept; figures show them as ×, ☆ or ✚."
)
NOT_CONVERGED = (
    TASK,
    ELASTOMER,
    TableColumn("surface", "surface"),
    P_STAR,
    STATUS,
    RESIDUAL,
    TableColumn("tolerance", "tolerance", ".1e"),
    TableColumn("steps", "steps", "d"),
    TableColumn("reason", lambda row: row["status"].explain(row)),
)
EXPLANATION = (
    "In this and the next figures over the pressure, symbols are the simulation: in the continuum "
    "with its error where that is known, else on the grid; a mean over seeds is left out where the "
    "continuum value was requested, but that of some seed is unknown. Bars: estimated distance to "
    "the continuum; ×, ☆, ✚: the contact missed the requested tolerance, accuracy or load."
)
LINES = " Lines: Persson theory with the same spectrum."
BEHIND = "Table behind the figures"
TRUE_CONTACT = "Table: rms stress in full contact, taken over the true contact"
DISTRIBUTIONS = {
    "stress_distribution": (
        "Distribution of the stress over logarithmic stress, elastomers side by side",
        "Pr(sigma) of the elastomers at about one pressure, over logarithmic bins. Symbols: "
        "simulation{lines}. Bins with fewer than ten grid points, on average over the seeds, are "
        "left out.",
        "Table: elastomers at about one pressure",
    ),
    "stress_distribution_pressures": (
        "Distribution of the stress over linear stress, at several pressures",
        "Pr(sigma) of one elastomer at several pressures. Thick: simulation{thin}.",
        "Table: one elastomer at several pressures",
    ),
    "stress_distribution_continuum": (
        "Distribution of the stress in the continuum, with error bars and edge laws",
        "Pr(sigma) extrapolated over the grids, with error bars; faint: the grids; dashed: power "
        "law of the stress at the edge of a contact.",
        "Table: power laws",
    ),
}
"""Label, caption and title of the table by the name of the figure; {lines}, {thin}: the theory."""
BINS = (
    TableColumn("sigma / Delta_sigma", "sigma"),
    TableColumn("sigma", product("sigma", "delta_sigma"), unit="Pa"),
    TableColumn("Pr(sigma) Delta_sigma", "density"),
    TableColumn("Pr(sigma)", ratio("density", "delta_sigma"), unit="1/Pa"),
    TableColumn("Persson, Pr(sigma) Delta_sigma", "theory", optional=True),
)
MAX_CONTACTS = 6  # of a bench, each with a figure; a choice
BENCH_LABEL = "Relative error of the mean gap over transforms, and over seconds, for each solver"
BENCH_CAPTION = (
    "Error of the mean gap over the transforms and the processor time that a solver took. Thick: "
    "the largest error from there on; thin: the error itself; crosses: not converged."
)


def contact_area(data: ReportData) -> Section:
    """Relative contact area."""
    caption, lines = "Relative contact area a_r.", ""
    if data.comparison.has_theory:
        caption = "Relative contact area a_r and Persson theory; ratio: simulation / theory."
        lines = LINES + tables.border_note(data.curves)
    section = _over_pressure(data, "Contact area", "a_r", caption)
    more = {TRUE_CONTACT: tables.true_contact_table(data.curves)}
    return replace(section, notes=[EXPLANATION + lines], disclosed={**section.disclosed, **more})


def mean_gap(data: ReportData) -> Section:
    """Mean gap."""
    caption = "Mean gap u_g between the surfaces, over the whole interface."
    return _over_pressure(data, "Mean gap", "u_g", caption)


def stress_deviation(data: ReportData) -> Section:
    """Standard deviation of the stress."""
    caption = "Standard deviation sigma_p of the stress over the whole interface."
    return _over_pressure(data, "Stress deviation", "sigma_p", caption)


def _over_pressure(data: ReportData, title: str, name: str, caption: str) -> Section:
    """The figures of a quantity over the pressure that the study has data for, and its table."""
    drawings = [
        drawing(plot, panel.name, with_curves(panel.meaning, plot), f"{panel.meaning}.")
        for panel in PANELS
        if panel.column == name and (plot := data.figures.get(panel.name))
    ]
    table = tables.over_pressure(tables.BEST_VALUES[name], caption, data.curves)
    return Section(title, drawings=drawings, disclosed={BEHIND: table})


def stress_distribution(data: ReportData) -> Section:
    """Figures of Pr(sigma), the bins behind them, and power laws."""
    lines, thin = "; lines: Persson theory", "; thin: Persson theory"
    of_bins = "Middle of each bin, density and theory."
    if not data.comparison.has_theory:
        lines, thin, of_bins = "", "", "Middle of each bin, and density."
    bins = shown(BINS, data.solved)
    behind = {
        name: Table(of_bins, bins, [_bins(density) for density in contacts])
        for name, contacts in densities(data.items).items()
    }
    behind["stress_distribution_continuum"] = tables.power_laws(data.comparison)
    return Section(
        "Stress distribution",
        drawings=[
            drawing(
                figure, name, with_curves(label, figure), caption.format(lines=lines, thin=thin)
            )
            for name, (label, caption, _) in DISTRIBUTIONS.items()
            if (figure := data.figures.get(name))
        ],
        disclosed={DISTRIBUTIONS[name][2]: table for name, table in behind.items()},
    )


def _bins(density: Density) -> Group:
    sigma, row = density.sigma, density.row
    of_bins = records_of(sigma=sigma, density=density.density, theory=density.theory(sigma))
    records = [{**row, **record} for record in of_bins]  # with the scales of the contact
    title, p_star = item_title(density.item, of_seeds=density.seeds > 1), f"{row['p_star']:.4g}"
    mean = f": mean of {density.seeds} seeds" if density.seeds > 1 else ""
    return Group(f"{title}, p* = {p_star}{mean}{density.remark}", records)


def error_bars(data: ReportData) -> Section:
    """Continuum values with error bars, and means over seeds."""
    both = [tables.continuum_table(data.curves), tables.seeds_table(data.comparison)]
    return Section("Error bars", tables=both)


def optional_observables(data: ReportData) -> Section:
    """The observables that keys of [output] have turned on."""
    return Section("Optional observables", tables=[tables.observables_table(data.curves)])


def work_precision(data: ReportData) -> Section:
    """Work-precision diagrams of the bench that goes with the study, and their table."""
    title = "Speed against error"
    if not data.traces:
        return Section(title)
    figures = list(bench_figures(data.traces).values())
    left_out = len(figures) > MAX_CONTACTS
    return Section(
        title,
        notes=[f"{MAX_CONTACTS} of {len(figures)} contacts are shown."] if left_out else [],
        drawings=[
            drawing(figure, f"speed-{place}", BENCH_LABEL, BENCH_CAPTION)
            for place, figure in enumerate(figures[:MAX_CONTACTS])
        ],
        disclosed={BEHIND: bench_table(data.traces)},
        template="work_precision.html",
    )


def not_converged(data: ReportData) -> Section:
    """Contacts that are not converged or missing."""
    not_converged, missing = data.not_converged, data.comparison.missing
    tasks = ", ".join(map(str, missing[:MAX_ROWS])) + (", ..." if len(missing) > MAX_ROWS else "")
    left_out = len(not_converged) > MAX_ROWS
    return Section(
        "Not converged or missing",
        notes=[f"The first {MAX_ROWS} of {len(not_converged)} are listed."] if left_out else [],
        tables=[Table(NOT_CONVERGED_CAPTION, NOT_CONVERGED, [Group("", not_converged[:MAX_ROWS])])],
        template="not_converged.html",
        content={"count": count(len(missing), "contact"), "tasks": tasks} if missing else None,
    )


def difference(one: ReportData, other: ReportData) -> Section:
    """What `gfmd diff` writes: pairs of contacts, rows of one study only, keys that differ."""
    differences = diff(one.comparison.path, other.comparison.path)
    nothing = nothing_in_common(differences)
    notes = [] if differences.pairs else [f"{nothing[:1].upper()}{nothing[1:]}."]
    lists = diff_lists(differences)
    tables = [diff_table(differences)]
    return Section("Difference", notes, tables, template="difference.html", content=lists)


def provenance(data: ReportData) -> Section:
    """Spec, versions, machine, date, commit; these are of the last call that added results."""
    attributes, machine = data.comparison.attributes, data.json("machine")
    software = [attributes.get(name, "") for name in ("software", "software_version")]
    facts = [
        ("Study", data.name),
        ("Written", attributes.get("date", "")),
        ("Software", " ".join(software).strip()),
        ("Git commit", attributes.get("git_commit", "")),
        *((key.replace("_", " ").capitalize(), str(machine.get(key, ""))) for key in MACHINE),
        ("FFT plans", str(machine.get("plans", ""))),
        *data.json("packages").items(),
    ]
    by_version = Counter(row["gfmd_version"] or "unknown" for row in data.solved)
    if len(by_version) > 1:
        each = "; ".join(f"{name}: {n}" for name, n in sorted(by_version.items()))
        facts.insert(3, ("Contacts by version that solved them", each))
    content = {
        "spec_text": attributes.get("spec_text", ""),
        "resolved": json.dumps(data.json("spec"), indent=1),
        "facts": facts,
    }
    return Section("Provenance", template="provenance.html", content=content)
