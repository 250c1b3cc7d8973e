"""The page docs/paper.md: claims, figures, and corrections to the paper."""

from collections.abc import Iterable
from pathlib import Path
from shutil import copyfile
from textwrap import fill
from typing import Any

from gfmd_cli.spec.parse import read_spec
from gfmd_cli.study.tasks import plan
from paper.captions import CAPTIONS
from paper.claims import Finding, Statement, result, verdict
from paper.statements_hertz import HERTZ
from paper.statements_rough import ROUGH
from paper.studies import CONFIGS, STUDIES, StoredStudies

WIDTH = 120  # characters of a line
STATEMENTS: dict[str, Statement] = HERTZ | ROUGH
INTRODUCTION = """\
# The paper, claim by claim

This page checks M. H. Müser, *Elastic contacts of randomly rough surfaces across the spatial dimensions*: each statement
that can be checked, with the result of this program. [Sizes of the studies](#sizes-of-the-studies) has the commands.
"""

READING = """\
- **Criteria.** Each statement has criteria: a quantity and the limits between which the statement holds. They are data, in
  `scripts/paper/statements_hertz.py` and `scripts/paper/statements_rough.py`. The limits come from the paper where it
  gives a number; the others are choices. A criterion holds (✓) or fails (✗) if the value with twice its error lies inside
  or outside of the limits; otherwise it is open (?). A value without an error is exact, or that of the one contact or
  surface named with it.
- **Verdicts.** "agrees": all criteria hold. "disagrees": all fail. "agrees in part": some hold and some fail, whether or
  not others are open. "misprint": the content holds, the printed form does not. "not decided here": otherwise, if a
  criterion is open, or there is none.
- **Errors.** Results on rough surfaces are means over the seeds of the named study, at least eight, apart from the
  cross-sections (Figs. 4 and 5), the map, and the height range of surfaces (statement 45: five). The standard errors
  contain the scatter of the seeds (jackknife) and, for values in the continuum, the error of the grid (half of an error
  bar). Studies have 32 seeds if statements on them were open with eight; verdicts near a limit are therefore weaker than
  two standard errors suggest.
- **Limits.** The random phases of the paper are not known, so single numbers of its one realisation cannot be reproduced.
  Trends, exponents, ratios and exact results can.
"""

SIZES = """\
## Sizes of the studies

Each figure of the paper has a spec in `configs/paper/`. The first command writes this page, the second one a page like it
from smaller studies:

<!-- not run: takes two hours, and minutes -->
```bash
make paper          # about two hours on one core: docs/paper.md
make paper-quick    # small grids, two seeds, minutes: results/paper-quick/paper.md
```

The paper has λᵣ/λₛ = 100 in most studies and grids of up to 16384² points. How the mean gap and the contact area depend
on λᵣ/λₛ from 8 to 128 is [measured](mean_gap.md#trend-with-the-range-of-the-spectrum). A study of another size is run with
other keys, as in `gfmd run configs/paper/fig13.toml -o results/paper/fig13.h5 --set grid.points='[2048, 4096, 8192]'`. Then
`python scripts/paper_figures.py -o results/paper --no-run --page docs/paper.md` writes the page.
"""

THEORY = """\
[Weights of the elastic energy](energy_weights.md) examines whether one smooth $\\gamma(n)$ is sufficient (Eq. 39), and
[Full-contact stress over the contact](true_contact.md) what $\\Delta\\sigma$ over the true contact predicts (Sects. 6, 7).
"""

MISPRINTS = r"""
## Corrections to the paper

The program uses the corrected equations. Each correction was checked by an independent calculation.

| where | printed | should be |
| --- | --- | --- |
| Eqs. 5, 6 | $\sigma = \sigma(0) \sqrt{1 - \rho^2}^{2\mu}$, $\mu = 2 - n$ | $(1 - \rho^2)^{\mu/2}$, which agrees with Hertz at $n = 1$ and with the computed contacts (row 5) |
| Eq. 10b | "for $n < 1/2$" | for $1/2 < n < 2$; $I_n = 2^{1-n} \Gamma(1 - n/2)/\Gamma(n/2)$ holds for $0 < n < 2$ (Abel summation) |
| text to Eq. 14 | $r_2 = \sqrt{e} a_c$, same slope | $r_2 = a_c/\sqrt{e}$, same height |
| Eq. 15 | $u_g^2/R_c$ | $a_c^2/R_c$ |
| text to Eq. 17 | coefficient 3/2 at $n = 1$ | 3/8 for $F R/k_1$, 3/4 for $F R/E^\ast$ |
| Eq. 18 | $a_r = \kappa' p R/(k a^{2-n})$ | $\pi \kappa' p R/(k a^{2-n})$ with the printed $\kappa'$ |
| text to Eq. 21 | $\kappa_{1/2}$ "believed exact" | $\kappa'_n = 2^{1-n} \Gamma(3 - n/2) \Gamma(2 - n/2)/\pi$; the conjecture is 9.6e-5 off |
| Eq. 24 | two equal exponentials; denominator $\Delta\sigma^2$ | the second has $(\sigma + p)^2$; the denominator is $\Delta\sigma$ |
| Eq. 32 | $I$ | $-2 I$ ([formula](theory.md#persson-theory)) |
| Eq. 33, 38 | $\delta(h - h_{nc})$; $p = k_0 u$ | $\delta(u - h_{nc})$; $p = k_0 \langle u \rangle$ |
| Eq. 40 | $\Theta(q_s - 1)$; $L/\lambda_s = 5.12$ | $\Theta(q_s - q)$; $L/\lambda_r = 5.12$ |
| Sect. 2 | $q_s/q_r = 1/100$; $16k = 2^{15}$ | $\lambda_s/\lambda_r = 1/100$; $16k = 2^{14}$ |
| conclusions | $\gamma(q \ll 1/t) = \gamma_1$ | $\gamma_4$, as in Eq. 42 |
| Sect. 6 | $a_r = \mathrm{erf}(p/\Delta\sigma_c)$ | $\mathrm{erf}(p/\sqrt{2} \Delta\sigma_c)$ |
| Fig. 13 | $\lambda_r/\Delta a = 2 \ldots 64$ | $\lambda_s/\Delta a$ |
"""

GALLERY = """\
## Figures

From Fig. 6 on, symbols are means over the seeds, with standard errors except in Fig. 13. In Figs. 9 to 11 and for the
cut-off spectrum they are continuum values, and lines are Persson theory with Eq. 39.
"""


def table(findings: list[Finding]) -> str:
    """The statements as a Markdown table, numbered."""
    lines = [
        "| | where | the paper says | criterion (limits): found here | verdict |",
        "| --- | --- | --- | --- | --- |",
    ]
    for number, finding in enumerate(findings, 1):
        one = STATEMENTS[finding.key]
        shown = f" [Figure](figures/paper/{one.figure}.png)" if one.figure else ""
        cells = (
            str(number),
            one.where,
            one.says,
            result(one, finding) + shown,
            f"**{verdict(one, finding)}**",
        )
        lines.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(lines)


def count(findings: list[Finding]) -> str:
    """Number of statements by verdict, with the rows of those that do not agree."""
    rows: dict[str, list[str]] = {}
    for number, finding in enumerate(findings, 1):
        rows.setdefault(verdict(STATEMENTS[finding.key], finding), []).append(str(number))
    counts = "; ".join(
        f'"{name}" {len(which)}' + (f" ({', '.join(which)})" if name != "agrees" else "")
        for name, which in sorted(rows.items())
    )
    return f"{len(findings)} statements: {counts}"


def _grids(points: Iterable[int]) -> str:
    return ", ".join(map(str, sorted(set(points))))


def planned(name: str) -> tuple[str, int]:
    """The grids and the number of contacts of a study at full size."""
    study = STUDIES[name]
    tasks = plan(read_spec(CONFIGS / f"{study.config}.toml", study.settings)[0])
    return _grids(task.points for task in tasks), len(tasks)


def _wavelengths(rows: list[dict[str, Any]]) -> tuple[str, str]:
    """L / lambda_r and lambda_r / lambda_s of the random surfaces of a study."""
    rough = [row for row in rows if row["rough"]]
    cells = {1 / row["rolloff"] for row in rough}
    ranges = {row["rolloff"] / row["cutoff"] for row in rough}
    long, short = (", ".join(f"{one:.3g}" for one in sorted(each)) for each in (cells, ranges))
    return long, short


def sizes(studies: StoredStudies) -> str:
    """The studies of the page as a Markdown table, beside their full size where one is smaller."""
    heads = ["study", "L/λᵣ", "λᵣ/λₛ", "grids (points per side)", "surfaces", "contacts"]
    heads += ["not converged", "`make paper`"]
    lines = []
    for name in (name for name in STUDIES if studies.has(name)):
        rows = studies.rows(name)
        grids = _grids(row["points"] for row in rows)
        full = planned(name)
        other = "" if full == (grids, len(rows)) else f"{full[0]}; {full[1]} contacts"
        surfaces = len({row["surface"] for row in rows})
        missed = sum(row["status"] != "converged" for row in rows)
        cells = (f"`{name}`", *_wavelengths(rows), grids, surfaces, len(rows), missed, other)
        lines.append([str(cell) for cell in cells])
    width = len(heads) if any(line[-1] for line in lines) else len(heads) - 1
    lines = [heads, ["---"] * len(heads), *lines]
    return "\n".join(f"| {' | '.join(line[:width])} |" for line in lines)


def write(findings: list[Finding], studies: StoredStudies, figures: Path, target: Path) -> None:
    """Write the page, and its figures (PNG) to figures/paper beside it."""
    folder = target.parent / "figures" / "paper"
    folder.mkdir(parents=True, exist_ok=True)
    shown = [name for name in CAPTIONS if (figures / f"{name}.png").exists()]
    for name in shown:
        copyfile(figures / f"{name}.png", folder / f"{name}.png")
    gallery = "\n\n".join(
        f"![{name}](figures/paper/{name}.png)\n\n{fill(f'*{CAPTIONS[name]}*', WIDTH)}"
        for name in shown
    )
    parts = (
        INTRODUCTION,
        fill(f"{count(findings)}.", WIDTH),
        READING,
        table(findings),
        THEORY,
        SIZES,
        sizes(studies),
        MISPRINTS,
        GALLERY,
        gallery,
    )
    target.write_text("\n\n".join(part.strip() for part in parts) + "\n", encoding="utf-8")
