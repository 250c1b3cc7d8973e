"""Styles of curves: a label that tells the curves apart, colour, marker."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np

from gfmd_cli.analysis.compare import Comparison, Curve, Prediction
from gfmd_cli.analysis.ensemble import without_seed
from gfmd_cli.analysis.selection import grouped
from gfmd_cli.analysis.wording import points_text
from gfmd_cli.grid.arrays import Field
from gfmd_cli.spec_table import as_text
from gfmd_cli.study.column import Row
from gfmd_cli.study.columns import PARAMETERS
from gfmd_cli.study.reading import FILE_MARK

PALETTE = ("#332288", "#0077bb", "#009988", "#999933", "#ee7733", "#cc3311")
"""Safe for colour-blind readers (P. Tol, Colour schemes, 2021), ordered by hue."""
MARKERS = "os^Dv<p>h"
MAX_LABEL = 46  # characters
TAILS = (20, 30, 8)  # characters after the part that is left out of a long label, tried in turn
OF_ELASTOMER = tuple(each for each in PARAMETERS if each.table == "elastomer")
MAX_STYLES = 8  # more markers of one colour cannot be told apart
MAX_NAMED = 20  # a legend names up to so many curves; if there are more, some of them; a choice
Colour = tuple[float, float, float]
"""Red, green, blue from 0 to 1."""


@dataclass(frozen=True)
class CurveStyle:
    """Style of a curve."""

    colour: Colour
    marker: str
    label: str
    heading: str = ""
    """What the curves of a figure share and their labels leave out; the heading of its legend."""


@dataclass(frozen=True)
class StyledCurve:
    """A curve with its style, and its theory over pressures close enough for a line."""

    curve: Curve
    style: CurveStyle
    p_star: Field
    theory: Prediction


def distinct_styles(labels: list[str]) -> list[CurveStyle]:
    """A style for each label, which may have dollar signs, colours along the palette."""
    return [
        CurveStyle(colour, MARKERS[place % len(MARKERS)], literal(label))
        for place, (colour, label) in enumerate(zip(colours(len(labels)), labels, strict=True))
    ]


def literal(text: str) -> str:
    """A text as a label of a figure, its dollar signs escaped: they would delimit formulas.

    Characters that no font has, such as those of control, are replaced.
    """
    shown = "".join(each if each.isprintable() else "\N{REPLACEMENT CHARACTER}" for each in text)
    return shown.replace("$", r"\$")


def without_escapes(label: str) -> str:
    """The text of a label: the inverse of `literal`."""
    return label.replace(r"\$", "$")


def order(curve: Curve) -> tuple[float, ...]:
    """Key for sorting: slabs by thickness, then power laws by exponent, then the others.

    Among curves that are equal in this, the numbers in the spec decide: colours go along a sweep.
    """
    row = curve.rows[0]
    numbers = [row[each.column.name] for each in PARAMETERS if each.column.kind is not str]
    slab = row["thickness"] if np.isnan(curve.n) else np.nan
    return tuple(np.nan_to_num([slab, curve.n, *numbers], nan=np.inf).tolist())


def with_styles(comparison: Comparison) -> list[StyledCurve]:
    """The curves of a study in the order and style of its figures."""
    curves = sorted(comparison.curves, key=order)
    pressures = np.concatenate([curve.column("p_star") for curve in curves])
    low, high = pressures.min() / 3, pressures.max() * 3
    low = min(low, high / 1000)  # near the left end of a linear axis
    p_star = np.union1d(np.geomspace(low, high, 100), np.linspace(low, high, 50))
    return [
        StyledCurve(curve, style, p_star, curve.predict(p_star))
        for curve, style in zip(curves, curve_styles(curves), strict=True)
    ]


def seed_groups(items: list[StyledCurve]) -> list[list[StyledCurve]]:
    """The curves that differ in their seed only, together."""
    groups = grouped(items, lambda item: (item.curve.study, without_seed(item.curve.rows[0])))
    return list(groups.values())


def curve_styles(curves: list[Curve]) -> list[CurveStyle]:
    """Colours along the ordered curves, one per elastomer; markers tell variants apart.

    Curves of one elastomer have a colour each. Curves that differ in their seed only have the same
    style. So have the curves of each elastomer, if there are several elastomers and more than
    MAX_STYLES curves of one of them, or more than MAX_NAMED in all. If there is no other elastomer,
    each curve has a colour instead, in their order.
    """
    names = _elastomer_names(curves)
    alike = grouped(curves, lambda curve: curve.elastomer)
    keys = {elastomer: _differing(group) for elastomer, group in alike.items()}
    pairs = [(c.elastomer, _joined(map(_words(c).get, keys[c.elastomer]), " ")) for c in curves]
    count = len(set(pairs))
    heading = ""
    if len(alike) == 1 and count > MAX_STYLES:
        (heading,) = distinct_labels([*names.values()])
        names = dict.fromkeys(names, "")  # labels of the parameters alone fit into several columns
    elif count > MAX_NAMED or max(Counter(name for name, _ in set(pairs)).values()) > MAX_STYLES:
        pairs = [(curve.elastomer, _merged(curve, alike[curve.elastomer])) for curve in curves]
    distinct = sorted(dict.fromkeys(pairs), key=lambda pair: [*names].index(pair[0]))
    labels = distinct_labels([_joined((names[elastomer], words)) for elastomer, words in distinct])
    styles = dict(zip(distinct, distinct_styles(labels), strict=True))
    if len(names) > 1:
        palette = dict(zip(names, colours(len(names)), strict=True))
        styles = {pair: replace(s, colour=palette[pair[0]]) for pair, s in styles.items()}
    return [replace(styles[pair], heading=literal(heading)) for pair in pairs]


def _elastomer_names(curves: list[Curve]) -> dict[str, str]:
    """Short names of elastomers; those of one kind, by the parameters in which they differ."""
    rows = {curve.elastomer: curve.rows[0] for curve in curves}
    short = {name: str(row["elastomer_short"]) for name, row in rows.items()}

    def kind(name: str) -> str:
        return short[name] if short[name] != name else str(rows[name]["elastomer_kind"])

    names = dict(short)
    for base, alike in grouped(rows, kind).items():
        words = [_elastomer_words(rows[name]) for name in alike]
        differing = [len(set(column)) > 1 for column in zip(*words, strict=True)]
        if any(differing) or 1 == len(alike) < len(rows):
            labels = (_joined((base, *compress(each, differing)), " ") for each in words)
            names |= dict(zip(alike, labels, strict=True))
    if len(set(names.values())) < len(names):  # names that coincide
        return {elastomer: elastomer for elastomer in names}
    return names


def _elastomer_words(row: Row) -> list[str]:
    """The parameters of an elastomer; the thickness is a length, except of a slab."""
    words = {each.key: each.word(row) for each in OF_ELASTOMER}
    if words["thickness"] and row["elastomer_kind"] != "slab":
        words["thickness"] = f"thickness={as_text(row['thickness'], 'm')}"
    return list(words.values())


def distinct_labels(labels: list[str]) -> list[str]:
    """Labels of at most MAX_LABEL characters, different ones if the given ones are different.

    The middle is left out, or the label is numbered where the rest is the same.
    """
    for tail in TAILS:
        cut = [_shortened(label, tail) for label in labels]
        if len(set(cut)) == len(set(labels)):
            return cut
    numbers = {label: i for i, label in enumerate(dict.fromkeys(labels), 1)}
    return [_shortened(f"{numbers[label]}: {label}", 0) for label in labels]


def _shortened(label: str, tail: int) -> str:
    """A label of at most MAX_LABEL characters, of a long one its first and its last `tail` ones."""
    if len(label) <= MAX_LABEL:
        return label
    end = label[len(label) - tail :]
    return f"{label[: MAX_LABEL - tail - 1]}\N{HORIZONTAL ELLIPSIS}{end}"


def colours(count: int) -> list[Colour]:
    """Colours at equal distances along the palette."""
    at = np.linspace(0, len(PALETTE) - 1, count)
    channels = zip(*map(rgb, PALETTE), strict=True)
    red, green, blue = (np.interp(at, range(len(PALETTE)), part).tolist() for part in channels)
    return list(zip(red, green, blue, strict=True))


def rgb(colour: str) -> Colour:
    """The colour #rrggbb."""
    red, green, blue = bytes.fromhex(colour[1:])
    return red / 255, green / 255, blue / 255


def _merged(curve: Curve, alike: list[Curve]) -> str:
    """The study, and the parameters in which its curves of one elastomer differ."""
    keys = ", ".join(_differing([each for each in alike if each.study == curve.study]))
    return _joined((curve.study, keys and f"several {keys}"))


def _differing(curves: list[Curve]) -> list[str]:
    """The parameters in which curves differ, the seed left out.

    A key that only some curves have is left out where the others tell the curves apart.
    """
    words = list(map(_words, curves))
    values = {key: {each[key] for each in words} for key in words[0]}
    every = [key for key in values if len(values[key]) > 1]
    few = [key for key in every if len(values[key] - {""}) > 1]

    def variants(keys: list[str]) -> int:
        return len({tuple(map(each.get, keys)) for each in words})

    return few if variants(few) == variants(every) else every


def _joined(words: Iterable[str | None], separator: str = ", ") -> str:
    return separator.join(filter(None, words))


def _words(curve: Curve) -> dict[str, str]:
    """Parameters of surface, grid and solver by column, as words; no points of an "auto" grid."""
    row = curve.rows[0]
    words = {
        each.column.name: each.word(row)
        for each in PARAMETERS
        if each.table != "elastomer" and each.key != "seed"
    }
    size = points_text(int(row["points"]), int(row["points_y"]))
    points = "" if row["grid"] == "auto" else f"{size} points"
    checksum = "".join(curve.surface.partition(FILE_MARK)[1:]).strip()
    others = {"checksum": checksum, "points": points, "points_y": ""}
    return {"study": curve.study} | words | others
