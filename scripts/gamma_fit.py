"""The weight gamma of Persson theory, from simulated mean gaps, and what it predicts elsewhere.

Reads the studies `gamma` and `slab` of scripts/theory_studies.py, prints the tables of
docs/energy_weights.md, and draws its figure. Constants are fitted to the training seeds, and errors
are those on the test seeds.

python scripts/gamma_fit.py --folder results/theory --figure docs/figures/gamma
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path

import numpy as np
from markdown_tables import print_table
from scipy.optimize import curve_fit, minimize_scalar
from theory_studies import EXPONENTS, HURST, LIGHT, SPECTRA, TEST, TRAINING, run_with_studies

from gfmd_cli.analysis.compare import compare, einstein_prediction
from gfmd_cli.analysis.curve_styles import MARKERS, CurveStyle, colours
from gfmd_cli.analysis.plotting import ColumnFigure, styled
from gfmd_cli.physics.elastomers import Slab
from gfmd_cli.physics.persson import Persson, Shells, gamma_n

P_STAR = np.array(LIGHT)
SEEDS = [*TRAINING, *TEST]
FITTED, HELD_OUT = slice(0, len(TRAINING)), slice(len(TRAINING), None)  # of SEEDS
GRID, FINER = 512, 1024
GAMMA = (0.2900, 0.7950, 0.2219)
"""What `fit` finds for all spectra: the curve "fitted" of docs/energy_weights.md."""
Gamma = Callable[[np.ndarray], np.ndarray]
Key = tuple[str, float, float]
"""Name of the spectrum, Hurst exponent, n."""


def smooth(n: np.ndarray, a: float, b: float, c: float) -> np.ndarray:
    return np.asarray(a * np.exp(-np.asarray(n) / b) + c)


def mean_gap(shells: Shells, gamma: np.ndarray | float, p_star: np.ndarray) -> np.ndarray:
    """u_g / h_std of the theory."""
    theory = Persson(replace(shells, gamma=np.broadcast_to(gamma, shells.q.shape)))
    return np.asarray(theory.mean_gap(p_star * theory.delta_sigma) / np.sqrt(shells.height.sum()))


@dataclass
class Surface:
    """One spectrum and one n, with the mean gaps of all seeds and grids."""

    shells: Shells
    ends: tuple[np.ndarray, np.ndarray]
    """u_g / h_std of the theory for gamma = 1 and 0, at P_STAR; u_g is linear in gamma."""
    grids: dict[tuple[int, int], np.ndarray] = field(default_factory=dict)
    """ln u_g / h_std at P_STAR, by seed and points a side."""

    @property
    def refinement(self) -> np.ndarray:
        """ln u_g in the continuum - ln u_g on GRID, at P_STAR.

        The change of ln u_g between the two finest grids and a third of it, as for an error of
        second order in the spacing; mean of the seeds that were solved on both.
        """
        seeds = [seed for seed, points in self.grids if points == FINER]
        steps = [self.grids[seed, FINER] - self.grids[seed, GRID] for seed in seeds]
        return np.asarray(4 / 3 * np.mean(steps, axis=0))

    @property
    def log_gap(self) -> np.ndarray:
        """ln u_g / h_std in the continuum: seeds, pressures."""
        return np.array([self.grids[seed, GRID] for seed in SEEDS]) + self.refinement

    def theory(self, gamma: float) -> np.ndarray:
        return np.asarray(np.log(gamma * self.ends[0] + (1 - gamma) * self.ends[1]))

    def best(self) -> np.ndarray:
        """The gamma of least rms error of ln u_g, for every seed."""
        return np.array([self._best(one) for one in self.log_gap])

    def _best(self, log_gap: np.ndarray) -> float:
        return least(lambda gamma: self.theory(gamma) - log_gap)

    def errors(self, gamma: float) -> np.ndarray:
        """ln u_g of the theory - ln u_g on the test seeds: seeds, pressures."""
        return self.theory(gamma) - self.log_gap[HELD_OUT]


def least(errors: Callable[[float], np.ndarray]) -> float:
    """The gamma of the least sum of squares."""
    squares = lambda gamma: float(np.sum(errors(gamma) ** 2))  # noqa: E731
    minimum = minimize_scalar(squares, bounds=(0.0, 1.0), method="bounded", options={"xatol": 1e-5})
    return float(minimum.x)


def spectrum_of(row: dict) -> str:
    kind = row["spectrum"], row["rolloff"]
    return next(
        name for name, (spectrum, rolloff) in SPECTRA.items() if kind == (spectrum, rolloff)
    )


def read(path: Path) -> dict[Key, Surface]:
    surfaces: dict[Key, Surface] = {}
    for curve in compare(path).curves:
        row = curve.rows[0]
        key = spectrum_of(row), row["hurst"], row["n"]
        if key not in surfaces:
            shells = curve.persson.shells
            ends = mean_gap(shells, 1.0, P_STAR), mean_gap(shells, 0.0, P_STAR)
            surfaces[key] = Surface(shells, ends)
        surfaces[key].grids[row["seed"], row["points"]] = np.log(curve.column("u_g"))
    return surfaces


def spread(values: np.ndarray | list[float]) -> tuple[float, float]:
    """Mean and its standard error over seeds."""
    return float(np.mean(values)), float(np.std(values, ddof=1) / np.sqrt(len(values)))


def rms(values: np.ndarray | list[np.ndarray]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def exact_springs(shells: Shells) -> float:
    """The best gamma of n = 0 against its closed form, Eqs. (34)-(38): no seed, no finite size."""
    springs = replace(shells, energy=shells.height, variance=shells.height)
    one, none = mean_gap(springs, 1.0, P_STAR), mean_gap(springs, 0.0, P_STAR)
    exact = einstein_prediction(P_STAR).u_g
    return least(lambda gamma: np.log((gamma * one + (1 - gamma) * none) / exact))


def fit(surfaces: dict[Key, Surface], springs: list[float], without: str = "") -> np.ndarray:
    """a, b, c of `smooth`, from the training seeds of all spectra except `without`.

    Least squares of the mean over the surfaces, weighted with the scatter between them.
    """
    mean, scatter = [np.mean(springs)], [np.std(springs, ddof=1)]
    for n in EXPONENTS:
        usable = [
            surfaces[name, hurst, n].best()[FITTED].mean()
            for name, hurst in product(SPECTRA, HURST)
            if name != without
        ]
        mean.append(np.mean(usable))
        scatter.append(np.std(usable, ddof=1))
    n = np.array([0, *EXPONENTS])
    return np.asarray(curve_fit(smooth, n, mean, [0.4, 1.5, 0.1], scatter, absolute_sigma=True)[0])


def print_grids(surfaces: dict[Key, Surface]) -> None:
    """ln u_g on each grid minus that on GRID, for the seed that has most grids."""
    rows = []
    for (name, hurst, n), surface in surfaces.items():
        seed = TRAINING[0]
        points = sorted(held for one, held in surface.grids if one == seed and held != GRID)
        steps = [surface.grids[seed, one] - surface.grids[seed, GRID] for one in points]
        cells = ["/".join(f"{100 * step[i]:.1f}" for step in steps) for i in range(P_STAR.size)]
        last = [f"{100 * x:.2f}" for x in surface.refinement]
        rows.append([f"{name}, H = {hurst}", f"{n:g}", "/".join(map(str, points)), *cells, *last])
    heads = ["surface", "n", "grids", *(f"p* = {p:g}" for p in P_STAR)]
    heads += [f"used, {p:g}" for p in P_STAR]
    print_table("ln u_g - ln u_g on 512^2, in per cent", heads, rows)


def print_best(surfaces: dict[Key, Surface]) -> None:
    rows, scores = [], []
    for name, hurst in product(SPECTRA, HURST):
        cells = []
        for n in EXPONENTS:
            best = surfaces[name, hurst, n].best()
            training, test = spread(best[FITTED]), spread(best[HELD_OUT])
            scores.append((training[0] - test[0]) / np.hypot(training[1], test[1]))
            cells.append("; ".join(f"{m:.3f} ± {e:.3f}" for m, e in (training, test)))
        rows.append([f"{name}, H = {hurst}", *cells])
    heads = ["surface", *(f"n = {n:g}" for n in EXPONENTS)]
    print_table("Best gamma of the training seeds; of the test seeds", heads, rows)
    largest = np.max(np.abs(scores))
    print(f"\ntraining - test, in standard errors: rms {rms(scores):.2f}, largest {largest:.2f}")


def print_differences(surfaces: dict[Key, Surface]) -> None:
    """Differences between surfaces that share their random phases, over all seeds."""
    first, *others = SPECTRA
    pairs = [((name, HURST[0]), (name, HURST[-1])) for name in SPECTRA]
    pairs += [((name, hurst), (first, hurst)) for name, hurst in product(others, HURST)]
    rows = []
    for one, other in pairs:
        cells = []
        for n in EXPONENTS:
            mean, error = spread(surfaces[*one, n].best() - surfaces[*other, n].best())
            cells.append(f"{mean:+.4f} ± {error:.4f} ({mean / error:+.0f})")
        rows.append([f"{one[0]}, H = {one[1]}, less {other[0]}, H = {other[1]}", *cells])
    heads = ["surfaces", *(f"n = {n:g}" for n in EXPONENTS)]
    print_table("Difference of gamma (in standard errors)", heads, rows)


def print_errors(surfaces: dict[Key, Surface], fits: dict[str, np.ndarray]) -> None:
    """Errors of ln u_g on the test seeds: of every seed, and of the mean over the seeds."""

    def gammas(key: Key) -> list[float]:
        name, _, n = key
        own = surfaces[key].best()[FITTED].mean()
        return [float(gamma_n(n)), float(smooth(n, *fits[""])), float(smooth(n, *fits[name])), own]

    def cells(keys: list[Key]) -> list[str]:
        words = []
        for chosen in range(4):
            errors = [surfaces[key].errors(gammas(key)[chosen]) for key in keys]
            of_mean = rms([one.mean(axis=0) for one in errors])
            words.append(f"{100 * rms(errors):.1f} / {100 * of_mean:.1f}")
        scatter = rms([one - one.mean(axis=0) for one in errors])
        of_mean = scatter / np.sqrt(len(TEST) - 1)
        return [*words, f"{100 * scatter:.1f} / {100 * of_mean:.1f}"]

    heads = ["Eq. (39)", "smooth", "smooth, other spectra", "same spectrum", "scatter of seeds"]
    by_n = [[f"{n:g}", *cells([key for key in surfaces if key[2] == n])] for n in EXPONENTS]
    title = "Error of ln u_g on the test seeds, in per cent: of a seed / of the mean over the seeds"
    print_table(title, ["n", *heads], [*by_n, ["all", *cells(list(surfaces))]])
    rows = [
        [f"{name}, H = {hurst}", *cells([key for key in surfaces if key[:2] == (name, hurst)])]
        for name, hurst in product(SPECTRA, HURST)
    ]
    print_table(title, ["surface", *heads], rows)


def print_slabs(path: Path, fitted: np.ndarray) -> None:
    """Errors of ln u_g of slabs, on test seeds, with gamma of Eq. (42) or at the local exponent."""
    errors: dict[str, list[np.ndarray]] = {"Eq. (42)": [], "Eq. (39)": [], "smooth": []}
    for curve in compare(path).curves:
        row, shells = curve.rows[0], curve.persson.shells
        pressure = curve.column("p_star") * row["delta_sigma"]  # that of the half-space
        local = Slab(thickness=row["thickness"]).local_exponent(shells.q, row["length"])
        gammas = shells.gamma, gamma_n(local), smooth(local, *fitted)
        for name, gamma in zip(errors, gammas, strict=True):
            theory = mean_gap(shells, gamma, pressure / curve.persson.delta_sigma)
            errors[name].append(np.log(theory / curve.column("u_g_continuum")))
    print("\nslabs, rms error of ln u_g on test seeds, in per cent")
    for name, held in errors.items():
        print(f"{name}: {100 * rms(held):.1f}")


def draw(surfaces: dict[Key, Surface], fitted: np.ndarray, path: Path) -> None:
    """Best gamma over n: symbols all seeds with two standard errors; lines the two functions."""
    n = np.linspace(0, 4, 200)
    with styled():
        plot = ColumnFigure(r"exponent  $n$", r"weight  $\gamma$ of the elastic energy")
        for place, (name, hurst) in enumerate(product(SPECTRA, (HURST[0], HURST[-1]))):
            style = CurveStyle(colours(6)[place], MARKERS[place], f"{name}, H = {hurst}")
            x = np.array(EXPONENTS) + 0.04 * (place - 2.5)
            y, error = np.transpose(
                [spread(surfaces[name, hurst, one].best()) for one in EXPONENTS]
            )
            bars = {"fmt": "none", "ecolor": style.colour, "elinewidth": 0.7, "capsize": 1.5}
            plot.axes.errorbar(x, y, 2 * error, **bars)
            plot.points(style, x, y)
        plot.line("Eq. (39)", n, gamma_n(n), color="0.4", ls=(0, (4, 2)), lw=0.9)
        plot.line("fitted", n, smooth(n, *fitted), color="black", lw=1.1)
        plot.axes.set(xlim=(-0.2, 4.2), ylim=(0, None))
        files = plot.write(path)
    files[0].unlink()  # docs show the PNG


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--folder", type=Path, default=Path("results/theory"))
    parser.add_argument("--figure", type=Path, default=Path("docs/figures/gamma"))
    arguments = parser.parse_args()
    surfaces = read(arguments.folder / "gamma.h5")
    chosen = [surfaces[name, hurst, EXPONENTS[0]] for name, hurst in product(SPECTRA, HURST)]
    springs = [exact_springs(surface.shells) for surface in chosen]
    print("gamma of n = 0 from the closed form:", *(f"{gamma:.4f}" for gamma in springs))
    fits = {name: fit(surfaces, springs, name) for name in ("", *SPECTRA)}
    for name, constants in fits.items():
        print(f"a, b, c without {name or 'nothing'}:", *(f"{x:.4f}" for x in constants))
    print_grids(surfaces)
    print_best(surfaces)
    print_differences(surfaces)
    print_errors(surfaces, fits)
    print_slabs(arguments.folder / "slab.h5", fits[""])
    draw(surfaces, fits[""], arguments.figure)


if __name__ == "__main__":
    run_with_studies(main, "python scripts/theory_studies.py")
