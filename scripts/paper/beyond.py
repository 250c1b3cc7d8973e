"""What the paper calls infeasible: partial contact of plates, n = 4."""

from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli.analysis.figures import GAP, P_STAR
from gfmd_cli.analysis.looks import MARKERS, Look, colours
from gfmd_cli.analysis.sheet import WIDTH, Page, Sheet
from paper.claims import Claim
from paper.drawing import (
    LOOKS,
    column,
    curves,
    dense,
    draw_points,
    finish,
    plus_minus,
    slope,
    value,
    values,
)
from paper.studies import Held, needs


@needs("plate")
def plate(held: Held, folder: Path) -> list[Claim]:
    """Contact area on every grid, and the mean gap with its error, over three decades."""
    rows = held.rows("plate")
    grids = sorted({row["points"] for row in rows})
    area = Sheet(P_STAR, r"relative contact area  $a_r$")
    for points, colour, marker in zip(grids, colours(len(grids)), MARKERS, strict=False):
        chosen = [row for row in rows if row["points"] == points]
        look = Look(colour, marker, f"{points}²")
        draw_points(area, look, column(chosen, "p_star"), column(chosen, "a_r"))
    finish(area, folder, "plate_area", "log", "log", column(rows, "p_star"), column(rows, "a_r"))
    curve = max(curves(held, "plate"), key=lambda curve: curve.points)
    p, (u, error) = curve.column("p_star"), values(curve.rows, "u_g")
    gap = Sheet(P_STAR, GAP)
    draw_points(gap, LOOKS[4.0], p, u, error)
    gap.theory([(LOOKS[4.0], dense(curve), curve.predict(dense(curve)).u_g)])
    finish(gap, folder, "plate_gap", "log", "log", p, u)
    return [_feasible(rows, curve.rows), _dimension(rows, grids)]


def _feasible(rows: list[dict[str, Any]], finest: list[dict[str, Any]]) -> Claim:
    """Partial contact, solved, with the time that it takes."""
    missed = sum(row["status"] != "converged" for row in rows)
    ends = [min(finest, key=lambda row: abs(np.log(row["p_star"] / at))) for at in (1e-3, 0.03, 1)]
    told = ", ".join(
        f"{plus_minus(*value(row, 'u_g'))} at p* = {row['p_star']:.2g} (a_r = {row['a_r']:.2g} there)"
        for row in ends
    )
    seconds = max(row["seconds"] for row in finest)
    return Claim(
        "Sect. 2 and 5",
        "10 % contact of plates (n = 4) is computationally unfeasible, and a_r cannot be determined.",
        f"{len(rows)} contacts from p* = 0.001 to 1 on up to {finest[0]['points']}² points are solved "
        f"({missed} missed the residual of 1e-5), the slowest in {seconds:.0f} s on one core. "
        f"u_g/h_std: {told}.",
        "disagrees",
        "plate_gap",
    )


def _dimension(rows: list[dict[str, Any]], grids: list[int]) -> Claim:
    """How contact area and contact line change from grid to grid."""
    told, exponents = [], []
    for p in sorted({row["p_star"] for row in rows})[::3]:
        chosen = sorted((r for r in rows if r["p_star"] == p), key=lambda row: row["points"])
        ln = np.log(column(chosen, "points"))
        even = np.full(ln.size, 0.02)
        area = slope(ln, np.log(column(chosen, "a_r")), even)
        line = slope(ln, np.log(column(chosen, "perimeter")), even)
        told.append(f"{plus_minus(*area)} and {plus_minus(*line)} at p* = {p:.2g}")
        exponents.append(area[0])
    falls = max(exponents[:-1]) < -0.3
    return Claim(
        "Sect. 5, 5.1",
        "At n = 4 contact has no area: it is made of lines and points.",
        f"From {grids[0]}² to {grids[-1]}² a_r and the length of the contact line change as powers of "
        f"the points per side: {'; '.join(told)}. Lines alone would have −1 and 0, points −2 and −1.",
        "agrees" if falls else "agrees in part",
        "plate_area",
    )


@needs("plate_map")
def plate_map(held: Held, folder: Path) -> list[Claim]:
    """Where bodies touch: contact over the gap, n = 1 to 4."""
    page = Page(WIDTH, WIDTH * 1.06)
    axes = page.figure.subplots(2, 2)
    for ax, row in zip(
        axes.flat, sorted(held.rows("plate_map"), key=lambda r: r["n"]), strict=False
    ):
        fields = held.fields("plate_map", row)
        gap = (fields["u"] - fields["height"]) / row["h_std"]
        touching = (fields["u"] == fields["height"]) & (fields["sigma"] > 0)
        half = len(gap) // 2
        gap, touching = gap[:half, :half], touching[:half, :half]
        ax.imshow(gap, cmap="Blues", vmax=0.5, origin="lower", interpolation="nearest")
        y, x = np.nonzero(touching)
        ax.plot(x, y, ",", color="#cc3311", rasterized=True)
        ax.set(xticks=[], yticks=[])
        ax.set_title(f"n = {row['n']:g}, a_r = {row['a_r']:.3f}", fontsize=8, pad=2)
    folder.mkdir(parents=True, exist_ok=True)
    page.write(folder / "plate_map")
    return []


FIGURES = (plate, plate_map)
