"""Units of length as files write them."""

NAMES = {
    1.0: "m metre metres meter meters",
    1e-3: "mm",
    1e-6: "um \N{MICRO SIGN}m \N{GREEK SMALL LETTER MU}m micron microns micrometer micrometre",
    1e-9: "nm nanometer nanometre",
    1e-10: "\N{ANGSTROM SIGN} \N{LATIN CAPITAL LETTER A WITH RING ABOVE} angstrom Angstrom",
    1e-12: "pm",
}
METRES = {name: metres for metres, names in NAMES.items() for name in names.split()}
"""Metres per unit; Unicode has two letters for micro and two for angstrom."""


def in_metres(unit: str) -> float | None:
    """Metres per unit of a text such as "nm" or "[um]"; None where the unit is not known."""
    return METRES.get(unit.strip().strip("[]()").strip())
