"""Section: measured surfaces, as they were measured and as they were solved."""

from gfmd_cli.analysis.compare import Row
from gfmd_cli.analysis.surface_figure import height_figure
from gfmd_cli.physics.pictures import Picture
from gfmd_cli.report.data import ReportData
from gfmd_cli.report.section import Drawing, Section
from gfmd_cli.report.svg import drawing
from gfmd_cli.study.reading import open_study

MAX_SURFACES = 4  # that are shown; a choice
MISSING = " Grey: missing heights."


def measured_surface(data: ReportData) -> Section | None:
    """Pictures of the measured surfaces; none of a study that has no such surface."""
    surfaces = {str(row["surface"]): row for row in reversed(data.solved)}
    shown: list[Row] = []
    drawings: list[Drawing] = []
    with open_study(data.comparison.path) as study:
        for row in reversed(surfaces.values()):
            pictures = study.pictures(row["scene"])
            if pictures and len(shown) < MAX_SURFACES:
                shown.append(row)
                drawings += _drawings(row, pictures, f"{data.prefix}{len(shown)}")
    if not shown:
        return None
    notes = [str(row["preparation"]) for row in shown]
    return Section("Measured surface", notes=notes, drawings=drawings)


def _drawings(row: Row, pictures: dict[str, Picture], place: str) -> list[Drawing]:
    """The pictures of one surface."""
    captions = {
        "measured": "Heights as measured, relative to their mean.",
        "prepared": "Heights as prepared for the contact, relative to their mean.",
    }
    return [
        drawing(
            height_figure(picture),
            f"heights-{name}-{place}",
            f"Map of {captions[name].lower()} {row['surface']}",
            captions[name] + (MISSING if _has_holes(picture) else ""),
        )
        for name, picture in pictures.items()
    ]


def _has_holes(picture: Picture) -> bool:
    return bool((picture.heights != picture.heights).any())
