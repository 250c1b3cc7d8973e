"""The page: one HTML file that needs nothing else."""

from importlib.resources import files
from pathlib import Path

from gfmd_cli.analysis.report.contents import Contents, Section, SectionOf, read_contents
from gfmd_cli.analysis.report.further import further
from gfmd_cli.analysis.report.maps import maps
from gfmd_cli.analysis.report.markup import Html, join, tag
from gfmd_cli.analysis.report.origin import origin
from gfmd_cli.analysis.report.overview import failures, key_numbers, sentence, verdict
from gfmd_cli.analysis.report.quantities import contact_area, continuum, mean_gap, stress_deviation
from gfmd_cli.analysis.report.speed import speed
from gfmd_cli.analysis.report.stress import stress_distribution
from gfmd_cli.analysis.report.surface import surface_spectrum
from gfmd_cli.analysis.report.theme import variables
from gfmd_cli.analysis.sheet import styled

SECTIONS: tuple[SectionOf, ...] = (
    failures,
    contact_area,
    mean_gap,
    stress_deviation,
    stress_distribution,
    continuum,
    further,
    maps,
    surface_spectrum,
    speed,
    origin,
)
"""In the order of the page. A new section is one function here."""
POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
"""Nothing is fetched and no script runs, whatever a study holds."""


def report(study: Path, bench: Path | None = None) -> str:
    """The page of a study, the same text each time. Raises InputError, StudyError."""
    contents = read_contents(study, bench)
    with styled():
        made = [section(contents) for section in SECTIONS]
    return _document(contents, [section for section in made if section is not None])


def _document(contents: Contents, sections: list[Section]) -> str:
    body = join(
        tag("a", "Skip to the results", href="#results", class_="skip"),
        tag("header", tag("h1", contents.name), sentence(contents), verdict(contents)),
        _contents(sections),
        tag(
            "main",
            tag("h2", "Key numbers", class_="unseen"),
            key_numbers(contents),
            *(_section(section) for section in sections),
            id="results",
            tabindex=-1,
        ),
        tag("footer", tag("p", FOOT)),
    )
    sheet = files(__package__).joinpath("style.css").read_text("utf-8")
    head = join(
        Html('<meta charset="utf-8">'),
        tag("title", f"{contents.name}: elastic contact"),
        Html('<meta name="viewport" content="width=device-width, initial-scale=1">'),
        Html(f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'),
        tag("style", Html(variables(body) + sheet)),
    )
    return f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head>\n<body>{body}</body></html>\n'


FOOT = "Made by gfmd report. Elastic contact without adhesion, friction or plasticity."


def _contents(sections: list[Section]) -> Html:
    links = (tag("li", tag("a", s.title, href=f"#{s.anchor}")) for s in sections)
    return tag("nav", tag("ul", *links), aria_label="Contents")


def _section(section: Section) -> Html:
    heading = tag("h2", section.title, id=f"{section.anchor}-title")
    labelled = {"id": section.anchor, "aria_labelledby": f"{section.anchor}-title"}
    return Html(tag("section", heading, section.body, **labelled) + "\n")
