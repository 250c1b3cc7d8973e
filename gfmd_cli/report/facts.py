"""Sections without figures: what failed, how two studies differ, where a study comes from."""

import json

from gfmd_cli.analysis.diff import NOTHING, diff, diff_lists, diff_table
from gfmd_cli.analysis.table import Group, Table, TableColumn
from gfmd_cli.analysis.tables import P_STAR, RESIDUAL, STATUS
from gfmd_cli.report.data import ReportData
from gfmd_cli.report.section import Section
from gfmd_cli.units import count

MAX_ROWS = 100  # contacts that the table of failures lists
MACHINE = {
    "node": "Node",
    "system": "System",
    "processor": "Processor",
    "cores": "Cores",
    "python": "Python",
    "slurm_job": "Slurm job",
    "plans": "FFT plans",
}


def failures(data: ReportData) -> Section:
    """Contacts that are not converged or missing."""
    failed, missing = data.failed, data.missing
    tasks = ", ".join(missing[:MAX_ROWS]) + (", ..." if len(missing) > MAX_ROWS else "")
    left_out = len(failed) > MAX_ROWS
    return Section(
        "What failed or is missing",
        notes=[f"The first {MAX_ROWS} of {len(failed)} are listed."] if left_out else [],
        tables=[Table(UNCONVERGED_CAPTION, UNCONVERGED, [Group("", failed[:MAX_ROWS])])],
        template="failures.html",
        content={"count": count(len(missing), "contact"), "tasks": tasks} if missing else None,
    )


UNCONVERGED_CAPTION = (
    "Contacts that ended above the requested tolerance. Their values are kept; figures show "
    "them as crosses."
)
UNCONVERGED = (
    TableColumn("task", "task", "d"),
    TableColumn("elastomer", "elastomer"),
    TableColumn("surface", "surface"),
    P_STAR,
    STATUS,
    RESIDUAL,
    TableColumn("tolerance", "tolerance", ".1e"),
    TableColumn("steps", "steps", "d"),
    TableColumn("reason", lambda row: row["status"].explain(row)),
)


def difference(one: ReportData, other: ReportData) -> Section:
    """What `gfmd diff` writes: pairs of contacts, rows of one study only, keys that differ."""
    differences = diff(one.comparison.path, other.comparison.path)
    notes = [] if differences.pairs else [f"{NOTHING.capitalize()}."]
    lists = diff_lists(differences)
    tables = [diff_table(differences)]
    return Section("Difference", notes, tables, template="difference.html", content=lists)


def provenance(data: ReportData) -> Section:
    """Spec, versions, machine, date, commit."""
    attributes, machine = data.attributes, data.json("machine")
    software = [attributes.get(name, "") for name in ("software", "software_version")]
    facts = [
        ("Study", data.name),
        ("Written", attributes.get("date", "")),
        ("Software", " ".join(software).strip()),
        ("Git commit", attributes.get("git_commit", "")),
        *((title, str(machine.get(key, ""))) for key, title in MACHINE.items()),
        *data.json("packages").items(),
    ]
    content = {
        "spec_text": attributes.get("spec_text", ""),
        "resolved": json.dumps(data.json("spec"), indent=1),
        "facts": facts,
    }
    return Section("Provenance", template="provenance.html", content=content)
