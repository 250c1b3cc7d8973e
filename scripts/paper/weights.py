"""Eq. (30) and Sects. 6 and 7: the energy of each wave, and Delta_sigma over the contact."""

from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import erf

from gfmd_cli.analysis.compare import VARIANTS
from gfmd_cli.analysis.plotting import ColumnFigure
from gfmd_cli.physics.persson import gamma_n
from paper.claims import Finding, Value
from paper.drawing import STYLES, column, draw_points, finish, label
from paper.ensembles import Mean, estimate, groups
from paper.studies import StoredStudies, needs

SHOWN = 0.1  # p* of the figure and of the comparison
EXPONENTS = (0.5, 1.0, 2.0)
LONGEST, SHORTEST = (0.9, 2.0), (32.0, 64.1)  # q L / 2 pi of the octaves; lambda_s = L / 64


@needs("weights")
def weights(studies: StoredStudies, folder: Path) -> list[Finding]:
    """W over q beside Eq. (30), mean over the seeds."""
    plot = ColumnFigure(r"wave number  $qL\,/\,2\pi$", r"weight  $W$")
    octaves: dict[tuple[float, float], dict[str, Value]] = {LONGEST: {}, SHORTEST: {}}
    for n in EXPONENTS:
        curves = [curve for curve in studies.comparison("weights").curves if curve.n == n]
        pairs = [_weights(studies, curve) for curve in curves]
        q, energy, theory = pairs[0][0], pairs[0][2], pairs[0][3]
        exponents = np.array([pair[1] for pair in pairs])
        style = STYLES[n]
        bins = np.digitize(q, np.geomspace(0.9, 65, 14))
        parts = [(bins == b, energy[bins == b]) for b in np.unique(bins)]
        at = [np.average(q[part], weights=weight) for part, weight in parts]
        mean = Mean(
            np.transpose([np.average(exponents[:, part], axis=1, weights=w) for part, w in parts])
        )
        draw_points(plot, style, at, mean.value, mean.error)
        plot.axes.plot(q, theory, color=style.colour)
        for octave, cases in octaves.items():
            inside = (q >= octave[0]) & (q < octave[1])
            whole = energy[inside] @ theory[inside]
            ratio = Mean(exponents[:, inside] @ energy[inside] / whole)
            cases[label(n)] = Value(float(ratio.value), float(ratio.error))
    plot.legend["Eq. (30)"] = plot.axes.lines[-1]
    finish(plot, folder, "weights", "log", "log", [1, 64], [0.01, 1])
    return [
        Finding(
            "weight",
            {
                "measured W over Eq. (30), longest octave of waves": octaves[LONGEST],
                "measured W over Eq. (30), shortest octave of waves": octaves[SHORTEST],
            },
            f"p* = {SHOWN:g}. Study `weights`. W = |u(q)|²/|h(q)|² weighted with k C. The errors of the "
            "energy cancel in u_g ([measured](energy_weights.md#the-weight-w-measured)).",
        ),
        Finding("exact_order", {}, "The program solves hard-wall contact only."),
        *_sampling(studies),
    ]


def _weights(studies: StoredStudies, curve: Any) -> tuple[np.ndarray, ...]:
    """Shells q L / 2 pi, W, k C and W of Eq. (30) at the pressure of the figure."""
    row = next(row for row in curve.rows if abs(row["p_star"] - SHOWN) < 1e-6)
    spectra = studies.spectra("weights", row)
    full = spectra["height"] > 1e-12 * spectra["height"].max()
    q = spectra["q"][full]
    ratio = spectra["u"][full] / spectra["height"][full]
    energy = q**curve.n * spectra["height"][full]
    variance = np.cumsum(q ** (2 * curve.n) * spectra["height"][full])
    variance -= 0.5 * np.diff(variance, prepend=0.0)
    area = erf(SHOWN * np.sqrt(variance[-1]) / np.sqrt(2 * variance))
    gamma = float(gamma_n(curve.n))
    return q * row["length"] / (2 * np.pi), ratio, energy, area * (gamma + (1 - gamma) * area**2)


def _sampling(studies: StoredStudies) -> list[Finding]:
    """Delta_sigma over the contact: how it depends on n, and the area that it predicts."""
    rows = [row for row in studies.rows("weights") if abs(row["p_star"] - SHOWN) < 1e-6]

    def mean(name: str, n: float) -> Mean:
        return Mean(column([row for row in rows if row["n"] == n], name))

    def ratio(name: str) -> Value:
        return estimate(lambda large, small: large / small, mean(name, 2.0), mean(name, 0.5))

    light = {}
    for group in groups(studies, "weights"):
        if group.n > 1:
            continue
        key = VARIANTS["deviation_bearing"]
        predicted = Mean(np.array([[curve.records[0][key]] for curve in group.curves]))
        light[label(group.n)] = estimate(
            lambda theory, a: theory[0] / a[0], predicted, group.continuum("a_r").only([0])
        )
    areas = ", ".join(f"{mean('a_r_continuum', n).value:.3f}" for n in (0.5, 2.0))
    return [
        Finding(
            "sampling",
            {
                "rms of K h shifted by a quarter wave (Eq. 22), n = 2 over n = 1/2": ratio(
                    "quadrature_c"
                ),
                "standard deviation of K h, n = 2 over n = 1/2": ratio("deviation_c"),
            },
            f"Over the true contact at p* = {SHOWN:g}, in Δσ; a_r = {areas}. Both readings of Eq. (20) have "
            "the mean square Δσ² over the whole surface ([theory](true_contact.md)).",
        ),
        Finding(
            "percentile",
            {"predicted over computed a_r at p* = 0.01": light},
            "a_r in the continuum. Study `weights`.",
        ),
    ]


FIGURES = (weights,)
