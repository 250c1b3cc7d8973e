"""Figs. 4 to 6: cross-sections, one asperity, and the contact area over pressure."""

from pathlib import Path

import numpy as np

from gfmd_cli.analysis.figures import P_STAR
from gfmd_cli.analysis.plotting import ColumnFigure
from gfmd_cli.physics import einstein_solid
from paper.claims import Finding, Value
from paper.drawing import STYLES, dense, draw_limits, finish, label
from paper.ensembles import estimate, groups, power
from paper.studies import StoredStudies, needs

LIGHT = 0.035  # p* up to which a contact is called light
HEAVY = 0.999  # p* from which it is called heavy
WINDOW = 1.0  # half-width of the asperity of Fig. 5 along the diagonal, in lambda_s
SHIFT = 100.0  # lines of `ColumnFigure` are drawn where they are positive; heights are not


@needs("fig04")
def fig04(studies: StoredStudies, folder: Path) -> list[Finding]:
    """Displacement along the diagonal at 10 % contact."""
    plot = ColumnFigure(
        r"position along the diagonal  $r\,/\,L$", r"height  $h,\,u\;/\,h_\mathrm{std}$"
    )
    rows = sorted(studies.rows("fig04"), key=lambda row: row["n"])
    longest, pieces, y = {}, {}, []
    for row in rows:
        section, unit = studies.section("fig04", row), row["h_std"]
        h, u = section["height"] / unit, section["u"] / unit
        x = (np.arange(h.size) / h.size - 0.5) * np.sqrt(2)
        if row is rows[0]:
            plot.line("indenter", x, h + SHIFT, color="black", lw=0.6)
            plot.axes.lines[-1].set_ydata(h)
        style = STYLES[row["n"]]
        plot.line(style.label, x, u + SHIFT, color=style.colour, lw=0.9)
        plot.axes.lines[-1].set_ydata(u)
        touching = contact_points(section)
        starts = np.flatnonzero(touching & ~np.roll(touching, 1))
        pieces[row["n"]] = starts.size
        longest[row["n"]] = _longest_free(touching) / h.size * np.sqrt(2)
        y += [h, u]
    finish(plot, folder, "fig04", "ratio", "ratio", [-0.65, 0.65], np.concatenate(y))
    cases = ", ".join(f"{pieces[n]} ({longest[n]:.2f} L) at {label(n)}" for n in pieces)
    area = ", ".join(
        f"{Value(row['a_r_continuum'], row['a_r_continuum_error'])} at {label(row['n'])}"
        for row in rows
    )
    return [
        Finding(
            "spread",
            {
                "longest stretch of the diagonal without contact in L, n = 0": Value(longest[0.0]),
                "the same stretch for n ≥ 2": {label(n): Value(longest[n]) for n in (2.0, 3.0)},
                "contacts along the diagonal, n = 3 over n = 0": Value(
                    pieces[3.0] / max(1, pieces[0.0])
                ),
            },
            f"Contacts (longest stretch): {cases}. a_r in the continuum: {area}. One realisation.",
        )
    ]


def _longest_free(touching: np.ndarray) -> int:
    """Points of the longest run without contact, around the periodic border."""
    places = np.flatnonzero(touching)
    if not places.size:
        return int(touching.size)
    return int(np.diff(np.append(places, places[0] + touching.size)).max())


def _mean_around(values: np.ndarray, at: int, half: int) -> float:
    """Mean over so many points to either side."""
    return float(np.mean(values.take(at + np.arange(-half, half + 1), mode="wrap")))


def _highest(height: np.ndarray, half: int) -> int:
    """The place where the mean height over so many points to either side is the largest."""
    return int(np.argmax([_mean_around(height, at, half) for at in range(height.size)]))


@needs("fig05")
def fig05(studies: StoredStudies, folder: Path) -> list[Finding]:
    """Stress along the diagonal at its highest asperity: where the mean height is the largest."""
    rows = {row["n"]: row for row in studies.rows("fig05")}
    sections = {n: studies.section("fig05", row) for n, row in rows.items()}
    height = sections[0.5]["height"]
    half = round(WINDOW * rows[0.5]["cutoff"] * height.size / np.sqrt(2))
    summits = {wide: _highest(height, wide * half) for wide in (1, 2)}  # in lambda_s
    drawn = summits[1] + np.arange(-3 * half, 3 * half + 1)
    x = np.arange(-3 * half, 3 * half + 1) / half * WINDOW
    plot, highest, shares = (
        ColumnFigure(
            r"distance from the summit  $r\,/\,\lambda_s$", r"stress  $\sigma\,/\,\Delta\sigma$"
        ),
        0.0,
        {},
    )
    for n, section in sections.items():
        touching = contact_points(section)
        sigma = np.where(touching, section["sigma"], 0.0).take(drawn, mode="wrap")
        sigma = sigma / rows[n]["delta_sigma"] / (2 if n == 3 else 1)
        shares[n] = {
            f"within {'' if wide == 1 else f'{wide} '}λₛ": Value(
                _mean_around(touching, at, wide * half)
            )
            for wide, at in summits.items()
        }
        style = STYLES[n]
        name = style.label + (" (half the stress)" if n == 3 else "")
        plot.axes.plot(x, sigma, color=style.colour, lw=0.5, zorder=2)
        shown = slice(None, None, max(1, half // 12))
        plot.points(type(style)(style.colour, style.marker, name), x[shown], sigma[shown])
        highest = max(highest, float(sigma.max()))
    finish(plot, folder, "fig05", "ratio", "linear", x, [0, highest])
    others = ", ".join(
        f"{' and '.join(f'{100 * value.value:.0f} %' for value in shares[n].values())} at {label(n)}"
        for n in (1.0, 2.0)
    )
    return [
        Finding(
            "asperity",
            {f"share in contact at {label(n)}": shares[n] for n in (0.5, 3.0)},
            "Within this distance of the place of the diagonal with the largest mean height over it, a "
            f"choice that no solution enters; {others}. {rows[0.5]['points']}² points, 10 % contact on the "
            "grid.",
        )
    ]


@needs("fig06", "fig09b")
def fig06(studies: StoredStudies, folder: Path) -> list[Finding]:
    """Contact area over pressure, and its ratio to theory, in the continuum."""
    area = ColumnFigure(P_STAR, r"relative contact area  $a_r$")
    xs, ys, slopes = [], [], {}
    for group in groups(studies, "fig06"):
        p, a, style = group.p, group.continuum("a_r"), STYLES[group.n]
        known = draw_limits(area, style, p, a.value, a.error)
        light = known & (p <= LIGHT)
        if light.sum() > 1 and 0.5 <= group.n <= 2:
            slopes[style.label] = power(p[light], a.only(light))
        xs, ys = [*xs, p], [*ys, a.value[known]]
    line = dense(group.first)
    area.theory([(STYLES[1.0], line, group.first.predict(line).a_r)])
    finish(area, folder, "fig06a", "log", "log", np.concatenate(xs), np.concatenate(ys))
    ratio = ColumnFigure(P_STAR, r"$a_r\,/\,a_r$(Persson)")
    xs, ys, heavy, gaussian = [], [], {}, ""
    for group in groups(studies, "fig09b"):
        p, style = group.p, STYLES[group.n]
        a = group.continuum("a_r").over(group.theory.a_r)
        known = draw_limits(ratio, style, p, a.value, a.error)
        high = known & (p >= HEAVY)
        if np.any(high) and group.n <= 3:
            heavy[style.label] = estimate(lambda a: np.abs(a - 1).max(), a.only(high))
        if group.n == 0:
            theory, at = group.theory.a_r[p >= HEAVY], p[p >= HEAVY]
            exact = einstein_solid.contact_area(einstein_solid.non_contact_height(at))
            ratios = (1 - theory) / (1 - exact)
            gaussian = (
                f" Gaussian heights have {np.abs(exact / theory - 1).max():.3f} at n = 0 (Eqs. 36, "
                f"38); 1 - a_r itself is {ratios.min():.1f} to {ratios.max():.1f} times too large "
                f"there for p* = {at.min():g} to {at.max():g}."
            )
        xs, ys = [*xs, p], [*ys, a.value[known]]
    ratio.axes.axhline(1.0, color="black", lw=0.9)
    finish(ratio, folder, "fig06b", "linear", "ratio", np.concatenate(xs), np.concatenate(ys))
    return [
        Finding(
            "linear",
            {f"d ln a_r/d ln p* for p* ≤ {LIGHT:g}": slopes},
            "Continuum values of `fig06`.",
        ),
        Finding(
            "full_contact",
            {"largest error of a_r for p* ≥ 1 (reasonable: 20 %, as in Sect. 1)": heavy},
            f"Continuum values of `fig09b`.{gaussian}",
        ),
    ]


def contact_points(section: dict[str, np.ndarray]) -> np.ndarray:
    """Points of a cross-section that carry load."""
    return (section["u"] == section["height"]) & (section["sigma"] > 0)


FIGURES = (fig04, fig05, fig06)
