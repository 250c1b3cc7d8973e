"""How curves look: short names for what sets them apart, colours, symbols."""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from gfmd_cli.analysis.compare import Curve

LADDER = ("#332288", "#0077bb", "#009988", "#999933", "#ee7733", "#cc3311")
"""Told apart by the colour-blind too (P. Tol, Colour schemes, 2021), ordered by hue."""
MARKERS = "os^Dv<p>h"
LONGEST = 46  # characters of a label
MANY = 8  # curves; more cannot be told apart one by one
Colour = tuple[float, float, float]
"""Red, green, blue from 0 to 1."""


@dataclass(frozen=True)
class Look:
    """How a curve is drawn."""

    colour: Colour
    marker: str
    label: str


def order(curve: Curve) -> tuple[float, float]:
    """Slabs by rising thickness, then bodies by rising exponent, then the others."""
    thickness, n = (float(np.nan_to_num(curve.rows[0][c], nan=np.inf)) for c in ("thickness", "n"))
    return thickness, n


def looks(curves: list[Curve]) -> list[Look]:
    """Colours along the ordered curves, one a body; symbols tell bodies, or else curves, apart."""
    bodies = list(dict.fromkeys(curve.elastomer for curve in curves))
    names = _names({curve.elastomer: curve for curve in curves})
    variants = _variants(curves) if len(curves) <= MANY else [""] * len(curves)
    singly = len(bodies) == 1 and any(variants)
    chosen = colours(len(curves) if singly else len(bodies))
    told = []
    for i, (curve, variant) in enumerate(zip(curves, variants, strict=True)):
        body = bodies.index(curve.elastomer)
        marker = MARKERS[(i if any(variants) else body) % len(MARKERS)]
        label = ", ".join(filter(None, (names[curve.elastomer], variant)))
        told.append(
            Look(chosen[i if singly else body], marker, label[:LONGEST].replace("$", r"\$"))
        )
    return told


def colours(count: int) -> list[Colour]:
    """Colours evenly along the ladder."""
    steps = np.array([list(bytes.fromhex(colour[1:])) for colour in LADDER]).T / 255
    at = np.linspace(0, len(LADDER) - 1, count)
    red, green, blue = (np.interp(at, range(len(LADDER)), step).tolist() for step in steps)
    return list(zip(red, green, blue, strict=True))


def _names(bodies: dict[str, Curve]) -> dict[str, str]:
    """A short name for each elastomer; its full text where short ones would coincide."""
    short = {}
    for text, curve in bodies.items():
        thickness = curve.rows[0]["thickness"]
        short[text] = f"t/L = {thickness:g}" if np.isfinite(thickness) else text
        if np.isfinite(curve.n):
            exact = Fraction(curve.n).limit_denominator(4)
            short[text] = f"n = {exact}" if exact == curve.n else f"n = {curve.n:g}"
    return short if len(set(short.values())) == len(short) else {text: text for text in short}


def _variants(curves: list[Curve]) -> list[str]:
    """What sets curves of one elastomer apart: surface, seed, grid, solver; empty if nothing."""
    told = []
    for curve in curves:
        row = curve.rows[0]
        words = [word for word in curve.surface.split() if not word.startswith("seed=")]
        words += [f"seed={row['seed']}", f"{row['points']} points"]
        told.append([*words, row["solver"], f"tolerance={row['tolerance']:g}"])
    variants = []
    for curve, words in zip(curves, told, strict=True):
        peers = [w for c, w in zip(curves, told, strict=True) if c.elastomer == curve.elastomer]
        common = set(words).intersection(*peers)
        variants.append(" ".join(word for word in words if word not in common))
    return variants
