"""Speed against error, of the bench that goes with the study."""

from gfmd_cli.analysis.benchmark import LEVELS, bench_cells, footnotes
from gfmd_cli.analysis.report.contents import Contents, Section
from gfmd_cli.analysis.report.figure import figure
from gfmd_cli.analysis.report.markup import Group, details, join, number, table, tag
from gfmd_cli.analysis.report.units import AREA, DEVIATION, GAP
from gfmd_cli.analysis.work_precision import pages

SHOWN = 6  # figures


def speed(contents: Contents) -> Section | None:
    """Work-precision diagrams and their table."""
    traces = contents.traces
    if not traces:
        return None
    drawn = pages(traces)
    label = "Relative error of the mean gap over transforms, and over seconds, for each solver"
    caption = (
        "Error of the mean gap over the transforms and the processor time that a solver took. "
        "Thick: what is reached for good; thin: the error itself; crosses: not converged."
    )
    figures = [
        figure(page, f"speed-{place}", label, caption, scrolls=True)
        for place, page in enumerate(list(drawn.values())[:SHOWN])
    ]
    many = len(drawn) > SHOWN
    note = tag("p", f"{SHOWN} of {len(drawn)} scenes are shown.") if many else None
    header, rows = bench_cells(traces)
    told = table(
        join(*(f"{line} " for line in footnotes(traces))),
        [*header[:4], *_titles(), *header[4 + len(_titles()) :]],
        [Group("", [list(row) for row in rows])],
    )
    body = join(note, *figures, details("Table behind the figures", told))
    return Section("Speed against error", tag("div", body, class_="wide"))


def _titles() -> list[object]:
    """Of the columns that the plain table puts under common heads."""
    levels = [number(level) for level in LEVELS]
    return [
        *(f"transforms to {level}" for level in levels),
        *(f"seconds to {level}" for level in levels),
        *(join("error of ", symbol) for symbol in (AREA, DEVIATION, GAP)),
    ]
