"""Styles of curves: a label that tells the curves apart, colour, marker."""

from dataclasses import dataclass

import numpy as np

from gfmd_cli.analysis.compare import Curve
from gfmd_cli.study.columns import PARAMETERS

PALETTE = ("#332288", "#0077bb", "#009988", "#999933", "#ee7733", "#cc3311")
"""Safe for colour-blind readers (P. Tol, Colour schemes, 2021), ordered by hue."""
MARKERS = "os^Dv<p>h"
MAX_LABEL = 46  # characters
MAX_STYLES = 8  # more styles cannot be told apart
Colour = tuple[float, float, float]
"""Red, green, blue from 0 to 1."""


@dataclass(frozen=True)
class CurveStyle:
    """Style of a curve."""

    colour: Colour
    marker: str
    label: str


def literal(text: str) -> str:
    """A text as a label of a figure, its dollar signs escaped: they would delimit formulas."""
    return text.replace("$", r"\$")


def without_escapes(label: str) -> str:
    """The text of a label: the inverse of `literal`."""
    return label.replace(r"\$", "$")


def order(curve: Curve) -> tuple[float, float]:
    """Key for sorting: slabs by thickness, then power laws by exponent, then the others."""
    thickness = curve.rows[0]["thickness"] if np.isnan(curve.n) else np.nan
    return float(np.nan_to_num(thickness, nan=np.inf)), float(np.nan_to_num(curve.n, nan=np.inf))


def curve_styles(curves: list[Curve]) -> list[CurveStyle]:
    """Colours along the ordered curves, one per elastomer; markers tell variants apart.

    Curves of one elastomer have a colour each. Curves that differ in their seed only have the same
    style.
    """
    elastomers = list(dict.fromkeys(curve.elastomer for curve in curves))
    names = _names({curve.elastomer: curve for curve in curves})
    variants = _variants(curves)
    pairs = [(curve.elastomer, variant) for curve, variant in zip(curves, variants, strict=True)]
    if len(set(pairs)) > MAX_STYLES:
        pairs = [(curve.elastomer, curve.study) for curve in curves]
    distinct = list(dict.fromkeys(pairs))
    by_variant = len(elastomers) == 1
    palette = colours(len(distinct) if by_variant else len(elastomers))
    styles = []
    for elastomer, variant in pairs:
        place = distinct.index((elastomer, variant))
        colour = palette[place if by_variant else elastomers.index(elastomer)]
        label = ", ".join(filter(None, (names[elastomer], variant)))[:MAX_LABEL]
        marker = MARKERS[place % len(MARKERS)]
        styles.append(CurveStyle(colour, marker, literal(label)))
    return styles


def colours(count: int) -> list[Colour]:
    """Colours at equal distances along the palette."""
    steps = np.array([list(bytes.fromhex(colour[1:])) for colour in PALETTE]).T / 255
    at = np.linspace(0, len(PALETTE) - 1, count)
    red, green, blue = (np.interp(at, range(len(PALETTE)), step).tolist() for step in steps)
    return list(zip(red, green, blue, strict=True))


def _names(elastomers: dict[str, Curve]) -> dict[str, str]:
    """A short name for each elastomer; the full labels where short names would coincide."""
    short = {label: str(curve.rows[0]["elastomer_short"]) for label, curve in elastomers.items()}
    return short if len(set(short.values())) == len(short) else {label: label for label in short}


def _variants(curves: list[Curve]) -> list[str]:
    """The parameters in which curves of one elastomer differ, the seed left out; "" if none."""
    words = [_words(curve) for curve in curves]
    variants = []
    for curve, own in zip(curves, words, strict=True):
        peers = [w for c, w in zip(curves, words, strict=True) if c.elastomer == curve.elastomer]
        pieces = [own[key] for key in own if len({peer[key] for peer in peers}) > 1]
        variants.append(" ".join(filter(None, pieces)))
    return variants


def _words(curve: Curve) -> dict[str, str]:
    """Parameters of surface, grid and solver by column, as words; no points of an "auto" grid."""
    row = curve.rows[0]
    words = {
        each.column.name: each.word(row)
        for each in PARAMETERS
        if each.table != "elastomer" and each.key != "seed"
    }
    points = "" if row["grid"] == "auto" else f"{row['points']} points"
    return {"study": curve.study} | words | {"solver_kind": row["solver"], "points": points}
