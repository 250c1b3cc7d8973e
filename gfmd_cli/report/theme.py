"""Colours on light and on dark paper, for the page and for the figures in it."""

import colorsys
import re

from gfmd_cli.analysis.curve_styles import rgb

PALETTE = {
    "paper": ("#ffffff", "#15181d"),
    "panel": ("#f4f5f7", "#1e2229"),
    "rule": ("#d5d9df", "#3a414c"),
    "ink": ("#1a1d21", "#e6e8eb"),
    "muted": ("#565d66", "#a5adb8"),
    "link": ("#0b5cad", "#7ab8f5"),
    "good": ("#1b6b2f", "#79cf8c"),
    "bad": ("#a32012", "#ff9c8c"),
}
"""Light and dark by name: text has a contrast of at least 4.5 to paper and panel."""
LIGHT, DARK = PALETTE["paper"]
INK, PAPER = "#000000", "#ffffff"
"""Ink and background of figures."""
LEGIBLE = 3.0
"""Least contrast of graphics by WCAG 2."""
USED = re.compile(r"var\(--c-([0-9a-f]{6})\)")


def variable(colour: str) -> str:
    """A colour of a figure as the page has it."""
    named = {INK: "ink", PAPER: "paper"}.get(colour)
    return f"var(--{named})" if named else f"var(--c-{colour[1:]})"


def variables(body: str) -> str:
    """Style sheet of the palette and of the colours that figures in a body use."""
    pairs = dict(PALETTE)
    for name in sorted(set(USED.findall(body))):
        pairs[f"c-{name}"] = (toned(f"#{name}", LIGHT), toned(f"#{name}", DARK))
    light, dark = (
        ";".join(f"--{name}:{pair[side]}" for name, pair in pairs.items()) for side in (0, 1)
    )
    return (
        f":root{{color-scheme:light dark;{light}}}\n"
        f"@media screen and (prefers-color-scheme:dark){{:root{{{dark}}}}}\n"
    )


def toned(colour: str, paper: str) -> str:
    """The colour of the same hue that is light or dark enough to be seen on the paper."""
    hue, lightness, saturation = colorsys.rgb_to_hls(*rgb(colour))
    away = 1.0 if _luminance(paper) < 0.2 else 0.0
    for step in range(101):
        moved = lightness + (away - lightness) * step / 100
        parts = colorsys.hls_to_rgb(hue, moved, saturation)
        candidate = "#" + bytes(round(255 * part) for part in parts).hex()
        if contrast(candidate, paper) >= LEGIBLE:
            break
    return candidate


def contrast(one: str, other: str) -> float:
    """Contrast ratio of two colours, 1 to 21. WCAG 2, relative luminance."""
    low, high = sorted((_luminance(one), _luminance(other)))
    return (high + 0.05) / (low + 0.05)


def _luminance(colour: str) -> float:
    red, green, blue = (
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in rgb(colour)
    )
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue
