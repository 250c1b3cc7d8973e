"""Every figure of the paper from a shipped config, and every statement beside what is found.

    python scripts/paper_figures.py -o results/paper            # two hours on one core
    python scripts/paper_figures.py -o results/paper --quick    # minutes, small grids

Studies are resumed where they were stopped. Figures are written as PDF and PNG, the statements as
a page of Markdown: docs/paper.md with `--page`.
"""

import argparse
import time
from pathlib import Path

from paper import beyond, gaps, hertz, light, page, rough, sizes, stress, weights
from paper.claims import Finding
from paper.studies import LARGE, STUDIES, StoredStudies, run

from gfmd_cli.analysis.plotting import styled

MODULES = (hertz, rough, light, stress, gaps, sizes, weights, beyond)
FIGURES = [draw for module in MODULES for draw in module.FIGURES]
"""Functions that draw a figure and measure the statements that it shows."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=Path("results/paper"))
    parser.add_argument("--quick", action="store_true", help="small grids, minutes")
    parser.add_argument("--only", nargs="*", metavar="STUDY", help="run these studies only")
    parser.add_argument("-j", "--jobs", type=int, help="worker processes, as in gfmd run")
    parser.add_argument("--no-run", action="store_true", help="draw what is there")
    parser.add_argument("--page", type=Path, help="where the page goes, by default with the rest")
    arguments = parser.parse_args()
    figures = arguments.output / "figures"
    figures.mkdir(parents=True, exist_ok=True)
    names = arguments.only or [name for name in STUDIES if not (arguments.quick and name in LARGE)]
    for name in () if arguments.no_run else names:
        begun = time.perf_counter()
        run(name, arguments.output, arguments.quick, arguments.jobs)
        print(f"{name}: {time.perf_counter() - begun:.0f} s", flush=True)
    studies = StoredStudies(arguments.output)
    findings: list[Finding] = []
    with styled():
        for draw in FIGURES:
            if all(studies.has(name) for name in draw.needs):
                findings += draw(studies, figures)
    findings.sort(key=lambda finding: list(page.STATEMENTS).index(finding.key))
    page.write(findings, studies, figures, arguments.page or arguments.output / "paper.md")
    print(page.count(findings))


if __name__ == "__main__":
    main()
