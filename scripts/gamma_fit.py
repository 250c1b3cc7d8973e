"""gamma of Persson theory fitted to simulated mean gaps, and what the fit is worth elsewhere.

Reads the studies of scripts/theory_studies.py, prints the tables of docs/theory.md, and draws
its figure. The fit sees the study `training` only.

python scripts/gamma_fit.py --folder results/theory --figure docs/figures/gamma
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.optimize import curve_fit, minimize_scalar
from theory_studies import STUDIES, TRAINING

from gfmd_cli.analysis.compare import Curve, compare, einstein_prediction
from gfmd_cli.analysis.curve_styles import MARKERS, CurveStyle, colours
from gfmd_cli.analysis.plotting import ColumnFigure, styled
from gfmd_cli.physics.elastomers import Slab
from gfmd_cli.physics.persson import Persson, gamma_n

Gamma = Callable[[np.ndarray], np.ndarray]
PAPER = "Eqs. (39), (42)"
FORMS: dict[str, tuple[Callable, list[float]]] = {
    "a exp(-n/b) + c": (lambda n, a, b, c: a * np.exp(-n / b) + c, [0.5, 2.0, 0.0]),
    "a (1 - n/4)^b": (lambda n, a, b: a * np.clip(1 - n / 4, 0, 1) ** b, [0.5, 1.2]),
    "a exp(-n/b)": (lambda n, a, b: a * np.exp(-n / b), [0.5, 2.0]),
    "a / [1 + (n/b)^2]": (lambda n, a, b: a / (1 + (n / b) ** 2), [0.5, 2.0]),
}
"""Forms of gamma(n) with where their fit begins."""
LABELS = {"hurst-0.3": "H = 0.3", "other-seeds": "other seeds", "narrow": "few waves"}
LIGHT = 1.0  # p*: below, errors are those of ln u_g, from here on those of ln p
TABLE = np.array([0.003, 0.01, 0.03, 0.1, 0.3, *np.geomspace(1.0, 5.0, 33)])
"""Reduced pressures that theory is tabulated at: below LIGHT those of the studies."""
ENDS: dict[tuple[str, str], tuple[np.ndarray, np.ndarray]] = {}


@dataclass(frozen=True)
class Case:
    """The pressures of one surface and body, with u_g of the continuum where it is known."""

    curve: Curve

    @cached_property
    def p_star(self) -> np.ndarray:
        return self.curve.column("p_star")

    @cached_property
    def u_g(self) -> np.ndarray:
        """In units of h_std."""
        best = self.curve.column("u_g_continuum")
        return np.where(np.isfinite(best), best, self.curve.column("u_g"))

    @cached_property
    def exponents(self) -> np.ndarray:
        """d ln k / d ln q at every shell."""
        q, row = self.curve.persson.shells.q, self.curve.rows[0]
        if np.isfinite(self.curve.n):
            return np.full(q.size, self.curve.n)
        return Slab(thickness=row["thickness"]).local_exponent(q, row["length"])

    @property
    def ends(self) -> tuple[np.ndarray, np.ndarray]:
        """u_g over TABLE for gamma = 1 and 0; u_g is linear in a gamma that is one for all q.

        Surfaces that differ in their seed have one spectrum.
        """
        row = self.curve.rows[0]
        key = (row["ensemble"], row["elastomer"])
        if key not in ENDS:
            ENDS[key] = self.gap(lambda n: np.ones(n.size)), self.gap(lambda n: np.zeros(n.size))
        return ENDS[key]

    def gap(self, gamma: Gamma | None) -> np.ndarray:
        """u_g of theory over TABLE [h_std]; gamma None: as the paper has it, Eqs. (39), (42)."""
        row, shells = self.curve.rows[0], self.curve.persson.shells
        if gamma is not None:
            shells = replace(shells, gamma=gamma(self.exponents))
        return Persson(shells).mean_gap(TABLE * row["delta_sigma"]) / row["h_std"]

    def theory(self, gamma: Gamma | None) -> np.ndarray:
        """u_g of theory over TABLE, the fast way where there is one."""
        if not np.isfinite(self.curve.n):
            return self.gap(gamma)
        weight = float((gamma or gamma_n)(self.exponents[:1])[0])
        return weight * self.ends[0] + (1 - weight) * self.ends[1]

    def errors(self, gamma: Gamma | None) -> np.ndarray:
        """ln(u_g of theory / u_g) over p* < LIGHT."""
        kept = (self.p_star < LIGHT) & (self.u_g > 0)
        gap = np.interp(np.log(self.p_star[kept]), np.log(TABLE), np.log(self.theory(gamma)))
        return gap - np.log(self.u_g[kept])

    def pressure_errors(self, gamma: Gamma | None) -> np.ndarray:
        """ln(p of theory / p) at equal u_g over p* >= LIGHT."""
        kept = (self.p_star >= LIGHT) & (self.u_g > 1e-9)
        p = np.interp(-np.log(self.u_g[kept]), -np.log(self.theory(gamma)), np.log(TABLE))
        return p - np.log(self.p_star[kept])

    def best(self) -> float:
        """The gamma of least rms error, one for all q."""
        found = minimize_scalar(
            lambda g: np.sum(self.errors(lambda n: np.full(n.size, g)) ** 2),
            bounds=(0.0, 1.0),
            method="bounded",
            options={"xatol": 1e-4},
        )
        return float(found.x)


def cases(folder: Path, name: str) -> list[Case]:
    """Of one study; none where it has not been run."""
    path = folder / f"{name}.h5"
    return [Case(curve) for curve in compare(path).curves] if path.exists() else []


def fit(best: dict[float, tuple[float, float]], form: Callable, start: list[float]) -> np.ndarray:
    """The parameters of least squares over the best gammas, weighted with their errors."""
    mean, error = np.array(list(best.values())).T
    return curve_fit(form, np.array(list(best)), mean, start, error, absolute_sigma=True)[0]


def exact_springs(case: Case) -> tuple[float, float]:
    """The best gamma of n = 0 against its closed form, Eqs. (34)-(38): no seed, no finite size.

    The error is what other spectra differ by, 0.506 to 0.515.
    """
    p_star = TABLE[TABLE < LIGHT]
    exact, (one, zero) = einstein_prediction(p_star).u_g, (end[: p_star.size] for end in case.ends)
    error = lambda g: np.sum(np.log((g * one + (1 - g) * zero) / exact) ** 2)  # noqa: E731
    return float(minimize_scalar(error, bounds=(0, 1), method="bounded").x), 0.005


def rms(parts: list[np.ndarray]) -> float:
    values = np.concatenate(parts)
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(values**2))) if values.size else float("nan")


def spread(values: list[float]) -> tuple[float, float]:
    """Mean and its standard error over seeds."""
    error = np.std(values, ddof=1) / np.sqrt(len(values)) if len(values) > 1 else np.nan
    return float(np.mean(values)), float(error)


def best_gammas(found: list[Case]) -> dict[float, tuple[float, float]]:
    """By exponent: best gamma, mean and standard error over seeds."""
    by_n: dict[float, list[float]] = {}
    for case in found:
        if np.isfinite(case.curve.n):
            by_n.setdefault(case.curve.n, []).append(case.best())
    return {n: spread(values) for n, values in sorted(by_n.items())}


def print_best(best: dict[str, dict[float, tuple[float, float]]], smooth: Gamma) -> None:
    exponents = sorted({n for values in best.values() for n in values})
    print("\nBest gamma +- standard error over seeds")
    print("| study | " + " | ".join(f"n = {n:g}" for n in exponents) + " |")
    print("| --- |" + " --- |" * len(exponents))
    for name, values in best.items():
        cells = [
            f"{values[n][0]:.3f} ± {values[n][1]:.3f}" if n in values else "" for n in exponents
        ]
        print(f"| {name} | " + " | ".join(cells) + " |")
    for name, gamma in (("Eq. (39)", gamma_n), ("gamma(n) fitted", smooth)):
        told = [f"{float(gamma(np.array([n]))[0]):.3f}" for n in exponents]
        print(f"| {name} | " + " | ".join(told) + " |")


def print_rms(studies: dict[str, list[Case]], gammas: dict[str, Gamma | None]) -> None:
    print("\nRms of ln u_g over p* < 1 / rms of ln p at equal u_g over p* >= 1, in per cent")
    print("| study | curves | " + " | ".join(gammas) + " |")
    print("| --- | --- |" + " --- |" * len(gammas))
    for name, held in studies.items():
        cells = []
        for gamma in gammas.values():
            light = rms([case.errors(gamma) for case in held])
            heavy = rms([case.pressure_errors(gamma) for case in held])
            cells.append(f"{100 * light:.1f} / {100 * heavy:.1f}")
        print(f"| {name} | {len(held)} | " + " | ".join(cells) + " |", flush=True)


def print_by_exponent(found: list[Case], gammas: dict[str, Gamma | None], title: str) -> None:
    """Rms of ln u_g exponent by exponent (or thickness by thickness)."""
    groups: dict[str, list[Case]] = {}
    for case in sorted(found, key=lambda c: (np.nan_to_num(c.curve.n), c.curve.elastomer)):
        groups.setdefault(case.curve.elastomer, []).append(case)
    print(f"\n{title}: rms of ln u_g over p* < 1, in per cent")
    print("| body | " + " | ".join(gammas) + " |\n| --- |" + " --- |" * len(gammas))
    for body, held in groups.items():
        told = [f"{100 * rms([case.errors(g) for case in held]):.1f}" for g in gammas.values()]
        print(f"| {body} | " + " | ".join(told) + " |", flush=True)


def draw(best: dict[str, dict[float, tuple[float, float]]], smooth: Gamma, path: Path) -> None:
    """Best gamma over n: symbols the fits with their error bars, lines the two functions."""
    n = np.linspace(0, 4, 200)
    with styled():
        plot = ColumnFigure(r"exponent  $n$", r"weight  $\gamma$ of the elastic energy")
        shown = {name: values for name, values in best.items() if values}
        for place, (name, values) in enumerate(shown.items()):
            style = CurveStyle(colours(len(shown))[place], MARKERS[place], LABELS.get(name, name))
            x = np.array(list(values)) + 0.03 * (place - len(shown) / 2)
            y, error = np.array(list(values.values())).T
            bars = {"fmt": "none", "ecolor": style.colour, "elinewidth": 0.7, "capsize": 1.5}
            plot.axes.errorbar(x, y, 2 * error, **bars)
            plot.points(style, x, y, np.full(x.size, True))
        plot.line(plot.axes, "Eq. (39)", n, gamma_n(n), color="0.4", ls=(0, (4, 2)), lw=0.9)
        plot.line(plot.axes, "fitted here", n, smooth(n), color="black", lw=1.1)
        plot.axes.set(xlim=(-0.2, 4.2), ylim=(0, None))
        files = plot.write(path)
    files[0].unlink()  # docs show the PNG


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--folder", type=Path, default=Path("results/theory"))
    parser.add_argument("--figure", type=Path, default=Path("docs/figures/gamma"))
    given = parser.parse_args()
    names = [name for name in STUDIES if name != "true-contact"]  # the training surfaces again
    studies = {name: found for name in names if (found := cases(given.folder, name))}
    best = {name: best_gammas(found) for name, found in studies.items() if name != "slab"}
    gammas: dict[str, Gamma | None] = {PAPER: None, "Eq. (39) at local n": gamma_n}
    springs = exact_springs(next(case for case in studies[TRAINING] if case.curve.n == 0))
    print(f"gamma at n = 0 from the closed form: {springs[0]:.4f}")
    for name, (form, start) in FORMS.items():
        x = fit(best[TRAINING] | {0.0: springs}, form, start)
        print(f"gamma = {name}: " + ", ".join(f"{value:.4f}" for value in x), flush=True)
        gammas[name] = lambda n, form=form, x=x: form(n, *x)
    chosen = gammas[next(iter(FORMS))]
    assert chosen is not None
    print_best(best, chosen)
    print_rms(studies, gammas)
    for name, found in studies.items():
        print_by_exponent(found, gammas, name)
    draw(best, chosen, given.figure)


if __name__ == "__main__":
    main()
