"""Persson theory with Delta_sigma over the contact: tables and figure of docs/true_contact.md.

Reads the study `true-contact` of scripts/theory_studies.py.

python scripts/true_contact.py --folder results/theory --figure docs/figures/true_contact
"""

import argparse
from pathlib import Path

import numpy as np
from gamma_fit import spread
from markdown_tables import print_head, print_row
from scipy.special import erfinv
from theory_studies import run_with_studies

from gfmd_cli.analysis.compare import VARIANTS, Curve, compare
from gfmd_cli.analysis.curve_styles import MARKERS, CurveStyle, colours
from gfmd_cli.analysis.figures import P_STAR
from gfmd_cli.analysis.plotting import ColumnFigure, styled
from gfmd_cli.analysis.selection import grouped
from gfmd_cli.physics.true_contact import contact_area

PERSSON = "whole"
SHOWN = (0, 0.5, 1, 1.5, 2)
HIGHEST = 1.0  # p*; above, every theory is right


def simulated(curve: Curve) -> np.ndarray:
    """Contact area of the continuum where it is known."""
    best = curve.column("a_r_continuum")
    return np.where(np.isfinite(best), best, curve.column("a_r"))


def measured(curve: Curve, name: str) -> np.ndarray:
    """Delta_sigma_c / Delta_sigma of one kind."""
    return np.ones(len(curve.rows)) if name == PERSSON else curve.column(name)


def needed(curve: Curve) -> np.ndarray:
    """The Delta_sigma_c / Delta_sigma that makes Persson theory exact."""
    with np.errstate(divide="ignore"):
        return curve.column("p_star") / (np.sqrt(2) * erfinv(np.minimum(simulated(curve), 1)))


def over_seeds(columns: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard error, pressure by pressure."""
    return tuple(np.array([spread(list(values)) for values in np.transpose(columns)]).T)


def print_tables(groups: dict[float, list[Curve]]) -> None:
    p_star = next(iter(groups.values()))[0].column("p_star")
    low = p_star <= HIGHEST
    for n, curves in groups.items():
        print(
            f"\nn = {n:g}: Delta_sigma_c / Delta_sigma; a_r of theory / simulated ± standard error"
        )
        names = ["p*", "a_r", "needed", *VARIANTS, PERSSON, *VARIANTS]
        print_head(*names)
        means = [over_seeds([f(c) for c in curves])[0] for f in (simulated, needed)]
        widths = [over_seeds([measured(c, name) for c in curves])[0] for name in VARIANTS]
        ratios = [
            over_seeds([contact_area(measured(c, name), p_star) / simulated(c) for c in curves])
            for name in (PERSSON, *VARIANTS)
        ]
        for i in np.flatnonzero(low):
            cells = [f"{p_star[i]:g}", f"{means[0][i]:.4f}", f"{means[1][i]:.3f}"]
            cells += [f"{width[i]:.3f}" for width in widths]
            cells += [f"{mean[i]:.3f} ± {error[i]:.3f}" for mean, error in ratios]
            print_row(*cells)


def draw(groups: dict[float, list[Curve]], path: Path) -> None:
    """Symbols: what would make Persson theory exact; lines: what the highest points have."""
    shown = {n: groups[n] for n in SHOWN if n in groups}
    with styled():
        plot = ColumnFigure(P_STAR, r"$\Delta\sigma_c\,/\,\Delta\sigma$")
        for place, (n, curves) in enumerate(shown.items()):
            style = CurveStyle(colours(len(shown))[place], MARKERS[place], f"n = {n:g}")
            p_star = curves[0].column("p_star")
            low = p_star <= HIGHEST
            value, error = (part[low] for part in over_seeds([needed(c) for c in curves]))
            bars = {"fmt": "none", "ecolor": style.colour, "elinewidth": 0.7, "capsize": 2}
            plot.axes.errorbar(p_star[low], value, 2 * error, **bars)
            plot.points(style, p_star[low], value)
            line = over_seeds([measured(c, "deviation_bearing") for c in curves])[0][low]
            plot.axes.plot(p_star[low], line, color=style.colour)
        plot.line("highest points", p_star[:0], p_star[:0], color="0.4")
        dashed = {"color": "black", "ls": (0, (4, 2)), "lw": 0.9}
        plot.line("whole surface", p_star[low], np.ones(value.size), **dashed)
        plot.scale("x", "log", p_star[low])
        plot.axes.set(ylim=(0, 1.7))
        files = plot.write(path)
    files[0].unlink()  # docs show the PNG


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--folder", type=Path, default=Path("results/theory"))
    parser.add_argument("--figure", type=Path, default=Path("docs/figures/true_contact"))
    arguments = parser.parse_args()
    curves = compare(arguments.folder / "true-contact.h5").curves
    groups = dict(sorted(grouped(curves, lambda curve: curve.n).items()))
    print_tables(groups)
    draw(groups, arguments.figure)


if __name__ == "__main__":
    run_with_studies(main, "python scripts/theory_studies.py")
