"""How curves look: short names for what sets them apart, colours, symbols."""

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from gfmd_cli.analysis.compare import Curve
from gfmd_cli.physics.surface import default_of

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
    """Colours along the ordered curves, one a body; symbols tell bodies, or else curves, apart.

    Curves that differ by their seed alone look the same.
    """
    bodies = list(dict.fromkeys(curve.elastomer for curve in curves))
    names = _names({curve.elastomer: curve for curve in curves})
    variants = _variants(curves)
    pairs = [(curve.elastomer, variant) for curve, variant in zip(curves, variants, strict=True)]
    if len(set(pairs)) > MANY:
        variants = [""] * len(curves)
        pairs = [(curve.elastomer, "") for curve in curves]
    apart = list(dict.fromkeys(pairs))
    singly = len(bodies) == 1
    chosen = colours(len(apart) if singly else len(bodies))
    told = []
    for body, variant in pairs:
        place = apart.index((body, variant))
        tone = chosen[place if singly else bodies.index(body)]
        label = ", ".join(filter(None, (names[body], variant)))[:LONGEST]
        told.append(Look(tone, MARKERS[place % len(MARKERS)], label.replace("$", r"\$")))
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
    """What sets curves of one body apart but the seed: surface, grid, solver; empty if nothing."""
    told = [_words(curve) for curve in curves]
    variants = []
    for curve, words in zip(curves, told, strict=True):
        peers = [w for c, w in zip(curves, told, strict=True) if c.elastomer == curve.elastomer]
        keys = dict.fromkeys(key for peer in peers for key in peer)
        pieces = [
            words.get(key) or _default(words["kind"], key)
            for key in keys
            if len({peer.get(key) for peer in peers}) > 1
        ]
        variants.append(" ".join(filter(None, pieces)))
    return variants


def _words(curve: Curve) -> dict[str, str]:
    """What a curve is besides its body, by key; a grid that was chosen by accuracy is none."""
    row = curve.rows[0]
    kind, _, words = curve.surface.partition(" ")
    told = {"kind": kind} | {word.partition("=")[0]: word for word in words.split()}
    told.pop("seed", None)
    if row.get("grid") != "auto":
        told["points"] = f"{row['points']} points"
    return told | {"solver": row["solver"], "tolerance": f"tolerance={row['tolerance']:g}"}


def _default(kind: str, key: str) -> str:
    """A key that a surface leaves out because it has its default; empty where it has none."""
    value = default_of(kind, key)
    if value is None:
        return ""
    return f"{key}={value:g}" if isinstance(value, float) else f"{key}={value}"
