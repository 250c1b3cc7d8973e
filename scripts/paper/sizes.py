"""Fig. 12 and Sect. 5.2.2: the size of the cell."""

from pathlib import Path

import numpy as np

from gfmd_cli.analysis.compare import Curve, einstein_prediction
from gfmd_cli.analysis.curve_styles import MARKERS, CurveStyle, colours
from gfmd_cli.analysis.figures import LABELS, P_STAR
from gfmd_cli.analysis.plotting import ColumnFigure
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.physics.surfaces import sample
from paper.claims import Finding, Value
from paper.drawing import STYLES, dense, draw_points, finish, label
from paper.ensembles import Mean, groups
from paper.studies import SEEDS, StoredStudies, needs

GIVEN = {2: 6.0, 8: 8.0}  # height difference of the paper by L / lambda_r, in h_std
SHIFTED = 1.3  # p of n = 1/2 in the figure, so that the symbols of n = 1 are seen
PARTED = 0.05  # relative difference from the closed form that counts


@needs("fig12")
def fig12(studies: StoredStudies, folder: Path) -> list[Finding]:
    """The Einstein foundation in two cells."""
    plot, xs, ys, ends = ColumnFigure(P_STAR, LABELS["u_g"]), [], [], {}
    ensembles = sorted(groups(studies, "fig12"), key=lambda group: -group.first.rows[0]["rolloff"])
    for group, colour, marker in zip(ensembles, colours(3), "so", strict=False):
        row = group.first.rows[0]
        name = f"L/λᵣ = {1 / row['rolloff']:g}"
        p, u = group.p, group.column("u_g")
        draw_points(plot, CurveStyle(colour, marker, name), p, u.value, u.error)
        ends[name] = _mean([_parts(curve) for curve in group.curves])
        xs, ys = [*xs, p], [*ys, u.value]
    line = np.geomspace(min(map(np.min, xs)), max(map(np.max, xs)), 300)
    theory, exact = group.first.predict(line).u_g, einstein_prediction(line).u_g
    plot.line("exact, Gaussian", line, exact, color="black", ls=(0, (4, 2)), lw=0.9)
    plot.theory([(STYLES[1.0], line, theory)])
    finish(plot, folder, "fig12", "log", "linear", np.concatenate(xs), np.concatenate(ys))
    off = {at: float(np.interp(-at, -exact, theory) / at - 1) for at in (2.0, 2.5, 3.5)}
    spans = {ratio: _spans(ratio) for ratio in GIVEN}
    return [
        Finding(
            "span",
            {
                "number of the paper less the mean, in standard deviations of seeds": {
                    f"L/λᵣ = {ratio}": Value((says - spans[ratio][0]) / spans[ratio][1])
                    for ratio, says in GIVEN.items()
                }
            },
            "; ".join(
                f"{mean:.2f}, standard deviation {deviation:.2f} (L/λᵣ = {ratio}, {count} seeds)"
                for ratio, (mean, deviation, count) in spans.items()
            ),
        ),
        Finding(
            "size_effect",
            {"gap at which they differ by 5 %, over Δh/2": ends},
            f"Each surface with its own Δh. Study `fig12`, {len(ensembles[0].curves)} seeds in each cell.",
        ),
        Finding(
            "einstein",
            {
                f"error of the theoretical u_g at u_g/h_std = {at:g}": Value(off[at])
                for at in (2.0, 3.5)
            },
            f"{100 * off[2.5]:+.1f} % at 2.5.",
        ),
    ]


def _parts(curve: Curve) -> float:
    """Least gap at which a solution and the closed form differ, over half the span of the heights."""
    p, u, row = curve.column("p_star"), curve.column("u_g"), curve.rows[0]
    off = (np.abs(u / einstein_prediction(p).u_g - 1) > PARTED) & (u > 1)
    height = sample(_surface(row["rolloff"], row["cutoff"], row["seed"]), row["points"])[1]
    return float(u[off].min() * row["h_std"] / (np.ptp(height) / 2)) if off.any() else np.nan


def _mean(each: list[float]) -> Value:
    """Mean and standard error."""
    mean = Mean(np.array(each))
    return Value(float(mean.value), float(mean.error))


def _surface(rolloff: float, cutoff: float, seed: int) -> SelfAffine:
    """The default surface with other wavelengths, in units of the cell."""
    return SelfAffine(hurst=0.8, rolloff=rolloff, cutoff=cutoff, spectrum="rolloff", seed=seed)


def _spans(ratio: int) -> tuple[float, float, int]:
    """Highest minus lowest point in h_std: mean and standard deviation over seeds, their number."""
    count = 20 if ratio < 4 else 5
    heights = [
        sample(_surface(1 / ratio, 0.01 / ratio, seed), 256 * ratio)[1] for seed in range(count)
    ]
    spans = [float(np.ptp(height) / height.std()) for height in heights]
    return float(np.mean(spans)), float(np.std(spans, ddof=1)), count


@needs("large_cell_2", "large_cell_4")
def large_cell(studies: StoredStudies, folder: Path) -> list[Finding]:
    """u_g over p* in cells of several sizes, mean over seeds."""
    plot, xs, ys, lines = ColumnFigure(P_STAR, LABELS["u_g"]), [], [], []
    ratios = [ratio for ratio in SEEDS if studies.has(f"large_cell_{ratio}")]
    ensembles = {
        (group.n, ratio): group
        for ratio in ratios
        for group in groups(studies, f"large_cell_{ratio}")
    }
    means: dict[tuple[float, int], Mean] = {}
    tones = colours(len(ratios))
    for n, filled in ((0.5, True), (1.0, False)):
        for ratio, colour, marker in zip(ratios, tones, MARKERS, strict=False):
            p = ensembles[n, ratio].p
            mean = means[n, ratio] = ensembles[n, ratio].column("u_g")
            style = CurveStyle(colour, marker, f"{label(n)}, L/λᵣ = {ratio}")
            shown = p * (SHIFTED if filled else 1.0)
            draw_points(plot, style, shown, mean.value, mean.error)
            if filled:
                plot.axes.lines[-2].set_markerfacecolor(colour)
                plot.legend[style.label].set_markerfacecolor(colour)
            xs, ys = [*xs, shown], [*ys, mean.value]
        curve = ensembles[n, 2].first
        lines.append((STYLES[n], dense(curve), curve.predict(dense(curve)).u_g))
    plot.theory(lines)
    finish(plot, folder, "large_cell", "log", "linear", np.concatenate(xs), np.concatenate(ys))
    changes, cases = {}, []
    for (n, ratio), mean in means.items():
        first = means[n, 2]
        cases.append(f"{mean.value[0]:.3f} ± {mean.error[0]:.3f} ({label(n)}, L/λᵣ = {ratio})")
        if ratio > 2:
            change = np.abs(mean.value - first.value)
            at = int(change.argmax())
            difference = Value(change[at], float(np.hypot(mean.error[at], first.error[at])))
            changes[f"{label(n)}, L/λᵣ = {ratio}"] = difference
    names = ", ".join(f"`large_cell_{ratio}`" for ratio in ratios)
    quantity = "largest change of u_g against L = 2 λᵣ, in h_std (a symbol of Fig. 9a: 0.1)"
    return [
        Finding(
            "large_cell",
            {quantity: changes},
            f"Studies {names}. u_g/h_std at p* = {p[0]:g}: {', '.join(cases)}.",
        )
    ]


FIGURES = (fig12, large_cell)
