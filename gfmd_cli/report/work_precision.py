"""Section: speed against error, of the bench that goes with the study."""

from gfmd_cli.bench.figure import bench_figures
from gfmd_cli.bench.table import bench_table
from gfmd_cli.report.data import ReportData
from gfmd_cli.report.section import Section
from gfmd_cli.report.svg import drawing

MAX_FIGURES = 6
LABEL = "Relative error of the mean gap over transforms, and over seconds, for each solver"
CAPTION = (
    "Error of the mean gap over the transforms and the processor time that a solver took. Thick: "
    "the largest error from there on; thin: the error itself; crosses: not converged."
)


def work_precision(data: ReportData) -> Section | None:
    """Work-precision diagrams and their table."""
    if not data.traces:
        return None
    figures = list(bench_figures(data.traces).values())
    drawings = [
        drawing(figure, f"speed-{place}", LABEL, CAPTION, scrolls=True)
        for place, figure in enumerate(figures[:MAX_FIGURES])
    ]
    left_out = len(figures) > MAX_FIGURES
    return Section(
        "Speed against error",
        notes=[f"{MAX_FIGURES} of {len(figures)} scenes are shown."] if left_out else [],
        drawings=drawings,
        tables={"Table behind the figures": bench_table(data.traces)},
        template="work_precision.html",
    )
