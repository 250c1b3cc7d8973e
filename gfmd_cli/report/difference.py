"""Section: two studies side by side."""

from gfmd_cli.analysis.diff import diff
from gfmd_cli.analysis.diff_table import NOTHING, diff_lists, diff_table
from gfmd_cli.report.data import ReportData
from gfmd_cli.report.section import Section


def difference(one: ReportData, other: ReportData) -> Section:
    """What `gfmd diff` writes: pairs of contacts, rows of one study only, keys that differ."""
    found = diff(one.comparison.path, other.comparison.path)
    table = diff_table(found)
    content = {"table": table if table.records else None, "lists": diff_lists(found)}
    notes = [] if table.records else [f"{NOTHING.capitalize()}."]
    return Section("Difference", notes=notes, template="difference.html", content=content)
