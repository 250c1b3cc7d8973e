"""The page: one HTML file that needs nothing else."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

from gfmd_cli.analysis.plotting import styled
from gfmd_cli.bench.file import Trace, read_bench
from gfmd_cli.report import sections, summary
from gfmd_cli.report.data import ReportData, merged, read_report_data
from gfmd_cli.report.maps import maps
from gfmd_cli.report.rendering import render
from gfmd_cli.report.section import Section
from gfmd_cli.report.surface import measured_surface, surface_spectrum
from gfmd_cli.report.theme import variables

OWN, SHARED = True, False
SECTIONS: tuple[tuple[Callable[[ReportData], Section], bool], ...] = (
    (sections.not_converged, OWN),
    (measured_surface, OWN),
    (sections.contact_area, SHARED),
    (sections.mean_gap, SHARED),
    (sections.stress_deviation, SHARED),
    (sections.stress_distribution, SHARED),
    (sections.error_bars, SHARED),
    (sections.optional_observables, SHARED),
    (maps, OWN),
    (surface_spectrum, SHARED),
    (sections.work_precision, SHARED),
    (sections.provenance, OWN),
)
"""Sections in their order; of two studies each has its own, or both share it."""


def report(study: Path, bench: Path | None = None, other: Path | None = None) -> str:
    """The page of a study or of two, the same text each time. Raises InputError, StudyError."""
    paths = {"": study} if other is None else {"A": study, "B": other}
    studies = [read_report_data(path, letter) for letter, path in paths.items()]
    traces = [] if bench is None else read_bench(bench)
    name = " and ".join(data.name for data in studies)
    with styled():
        content = list(_sections(studies, traces))
    body = render("body.html", name=name, studies=studies, summary=summary, sections=content)
    return f"{render('page.html', name=name, colours=variables(body), body=body)}\n"


def _sections(studies: list[ReportData], traces: list[Trace]) -> Iterator[Section]:
    """The sections that the studies have data for."""
    if len(studies) == 2:
        yield sections.difference(*studies)
    shared = merged(studies, traces)
    for make, own in SECTIONS:
        for data in studies if own else [shared]:
            section = make(data)
            if not section.is_blank:
                of_one = f" of {data.letter}" if data.letter else ""  # of two studies
                yield replace(section, title=section.title + of_one)
