"""The top of the page: what was run, whether it converged, the numbers to take home."""

import math

from gfmd_cli.analysis.compare import Row, best, in_continuum
from gfmd_cli.analysis.ensemble import without_seed
from gfmd_cli.analysis.report.contents import Contents, Section
from gfmd_cli.analysis.report.markup import Group, Html, code, details, join, table, tag
from gfmd_cli.analysis.report.units import (
    AREA,
    DELTA_SIGMA,
    DEVIATION,
    GAP,
    H_STD,
    P_STAR,
    count,
    pretty,
    quantity,
    span,
    told,
)
from gfmd_cli.study.layout import MISSING

CONVERGED = "converged"
NEARLY_FULL = 0.5  # p*; above, the gap falls by decades, and a ratio of gaps tells little
LISTED = 3  # bodies and surfaces that the sentence names
SHOWN = 100  # contacts that the table of failures lists


def sentence(contents: Contents) -> Html:
    """What was run, in one sentence."""
    rows, curves = contents.solved, contents.comparison.curves
    surfaces = list(dict.fromkeys(without_seed(row) for row in rows))
    bodies = list(dict.fromkeys(str(row["elastomer"]) for row in rows))
    seeds = len({row["seed"] for row in rows})
    parts: list[object] = [
        f"{count(len(contents.rows), 'contact')}: {_some(bodies, 'elastic body')} on "
        f"{_some(surfaces, 'surface')}, {count(seeds, 'seed') + ', ' if seeds > 1 else ''}",
        count(max(len(curve.rows) for curve in curves), "pressure"),
        " from ",
        P_STAR,
        f" = {span(_column(rows, 'p_star'))} ({span(_column(rows, 'pressure'), 'Pa')}), ",
        f"{_whole({row['points'] for row in rows})} grid points a side.",
    ]
    return tag("p", *parts, class_="lead")


def _some(names: list[str], what: str) -> str:
    if len(names) == 1:
        return f"the {what} {names[0]}"
    return count(len(names), what) + (f" ({told(names)})" if len(names) <= LISTED else "")


def _whole(sizes: set[int]) -> str:
    return str(*sizes) if len(sizes) == 1 else f"{min(sizes)} to {max(sizes)}"


def verdict(contents: Contents) -> Html:
    """Whether every contact is solved to its tolerance."""
    missing = sum(row["status"] == MISSING for row in contents.rows)
    failed = len(contents.solved) - sum(row["status"] == CONVERGED for row in contents.solved)
    if not (missing or failed):
        return _told("good", f"All {len(contents.rows)} contacts converged.")
    parts = []
    if failed:
        parts.append(f"{failed} of {len(contents.rows)} contacts did not reach their tolerance")
    if missing:
        parts.append(f"{missing} of {len(contents.rows)} are not solved yet")
    return _told("bad", "; ".join(parts) + ".")


def _told(kind: str, text: str) -> Html:
    sign = {"good": "✓", "bad": "!"}[kind]
    return tag("p", tag("span", sign, aria_hidden="true"), " ", text, class_=f"verdict {kind}")


def key_numbers(contents: Contents) -> Html:
    """The numbers to take home, reduced and in SI units."""
    rows = contents.solved
    pairs: list[tuple[object, object, object]] = [
        (
            "Pressure",
            span(_column(rows, "pressure"), "Pa"),
            join(P_STAR, " = ", span(_column(rows, "p_star"))),
        ),
        (
            "Contact area",
            span(_best(rows, "a_r")),
            join(AREA, ", share of the nominal area", _where(rows, "a_r")),
        ),
        (
            "Mean gap",
            span(_best(rows, "u_g", "h_std"), "m"),
            _measured(GAP, rows, "u_g", H_STD),
        ),
        (
            "Stress deviation",
            span(_best(rows, "sigma_p", "delta_sigma"), "Pa"),
            _measured(DEVIATION, rows, "sigma_p", DELTA_SIGMA),
        ),
        (
            "Stress in full contact",
            span(_column(rows, "delta_sigma"), "Pa"),
            join("rms ", DELTA_SIGMA),
        ),
        ("Roughness", span(_column(rows, "h_std"), "m"), _side(rows)),
        (
            "Area / Persson theory",
            _ratios(contents, "a_r", math.inf),
            join(AREA, _where(rows, "a_r")),
        ),
        (
            "Gap / Persson theory",
            _ratios(contents, "u_g", NEARLY_FULL),
            join(GAP, " up to ", P_STAR, f" = {NEARLY_FULL}", _where(rows, "u_g")),
        ),
        ("Largest residual", pretty(max(_column(rows, "residual"))), _asked(rows)),
        ("Time", _time(rows), "solving, summed over contacts"),
    ]
    return tag("dl", *(_card(*pair) for pair in pairs), class_="numbers")


def _card(name: object, value: object, note: object) -> Html:
    return tag(
        "div", tag("dt", name), tag("dd", value, class_="value"), tag("dd", note, class_="note")
    )


def _measured(symbol: Html, rows: list[Row], name: str, unit: Html) -> Html:
    return join(symbol, " / ", unit, " = ", span(_best(rows, name)), _where(rows, name))


def _best(rows: list[Row], name: str, unit: str = "") -> list[float]:
    """A quantity in the continuum where that is known, in its unit or times that column."""
    return [best(row, name)[0] * (row[unit] if unit else 1.0) for row in rows]


def _where(rows: list[Row], name: str) -> str:
    """Whether values are those of the continuum; "" where none is."""
    known = [in_continuum(row, name) for row in rows]
    if not any(known):
        return ""
    return ", in the continuum" + ("" if all(known) else " where known")


def _side(rows: list[Row]) -> Html:
    return join("rms height ", H_STD, ", side ", span(_column(rows, "length"), "m"))


def _asked(rows: list[Row]) -> str:
    return f"natural residual, asked: {span(_column(rows, 'tolerance'))}"


def _time(rows: list[Row]) -> str:
    seconds = sum(value for value in _column(rows, "seconds") if math.isfinite(value))
    if seconds < 120:
        return quantity(seconds, "s")
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


def _ratios(contents: Contents, name: str, most: float) -> str:
    """Simulation over theory at reduced pressures up to `most`."""
    return span(
        simulated / theory
        for curve in contents.comparison.curves
        for p_star, simulated, theory in zip(
            curve.column("p_star"),
            curve.best(name)[0],
            getattr(curve.prediction, name),
            strict=True,
        )
        if theory > 0 and p_star <= most
    )


def _column(rows: list[Row], name: str) -> list[float]:
    return [float(row[name]) for row in rows]


def failures(contents: Contents) -> Section | None:
    """What failed or is missing, and why."""
    failed = [row for row in contents.solved if row["status"] != CONVERGED]
    missing = [row["task"] for row in contents.rows if row["status"] == MISSING]
    if not (failed or missing):
        return None
    parts = []
    if failed:
        parts += [_failed(failed[:SHOWN]), _left_out(len(failed))]
    if missing:
        listed = ", ".join(map(str, missing[:SHOWN])) + (" ..." if len(missing) > SHOWN else "")
        parts += [
            tag(
                "p",
                f"Not solved yet: {count(len(missing), 'contact')}; ",
                code("gfmd run"),
                " with the same spec goes on.",
            ),
            details("Tasks not solved yet", tag("p", listed)),
        ]
    return Section("What failed or is missing", join(*parts))


def _failed(rows: list[Row]) -> Html:
    header = ["Task", "Body", "Surface", P_STAR, "Status", "Residual", "Asked", "Steps"]
    names = ("task", "elastomer", "surface", "p_star", "status", "residual", "tolerance", "steps")
    cells = [[row[name] for name in names] for row in rows]
    caption = (
        "Contacts that ended above the tolerance asked for. Their values are kept; figures show "
        "them as crosses."
    )
    return table(caption, header, [Group("", cells)])


def _left_out(total: int) -> Html | None:
    return tag("p", f"The first {SHOWN} of {total} are listed.") if total > SHOWN else None
