"""How often the error bars of single indenters hold: shapes, exponents, pressures on small grids.

Each contact is solved at pressures in Pa on grids whose halves give the change, and on a reference
grid that is at least four times finer. A bar holds if it contains the continuum value of the
reference grid, after it was widened by the error of that value, at most by a fifth of the bar.
"""

import argparse
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli import rows, run
from gfmd_cli.physics.observables import QUANTITIES

Row = dict[str, Any]
LINES = (
    {"kind": "ridge"},
    {"kind": "ridge", "width": 0.3},
    {"kind": "line-parabola"},
    {"kind": "wave"},
)
ROUND = (
    {"kind": "cone"},
    *({"kind": "power-law", "exponent": m} for m in (0.5, 1.5, 4)),
    {"kind": "power-law", "exponent": 12, "radius": 0.3},
    {"kind": "parabola"},
)
EXPONENTS = (0.0, 0.25, 0.5, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0)
LIGHTEST, HEAVIEST = 0.003, 2.5  # pressures at n = 1; they rise by 3^(n - 1)
WIDENING = 0.2  # largest part of the error of the reference that widens a bar, over the bar


def measured(surface: Row, n: float, pressures: list[float], points: list[int]) -> list[Row]:
    """The contacts of one indenter, with their error bars."""
    spec = {
        "surface": surface,
        "elastomer": {"kind": "power", "n": n},
        "grid": {"points": points},
        "load": {"pressure": pressures},
        "solver": {"tolerance": 1e-7},
        "accuracy": {"mean_gap": 0.5},
        "output": {"histogram": False},
    }
    with tempfile.TemporaryDirectory() as folder:
        return rows(run(spec, Path(folder) / "study.h5"))


def scores(coarse: list[Row], fine: list[Row]) -> Iterator[tuple[str, bool]]:
    """Each quantity of each coarse contact, and whether its bar holds."""
    references = {row["load_value"]: row for row in fine}
    for row in coarse:
        reference = references[row["load_value"]]
        if row["a_r"] == 1 or reference["a_r"] == 1:
            continue
        for name, quantity in QUANTITIES.items():
            unit, unit_of_reference = (
                each[quantity.scale] if quantity.scale else 1.0 for each in (row, reference)
            )
            value, bar = (unit * row[f"{name}_continuum{end}"] for end in ("", "_error"))
            true, error = (
                unit_of_reference * reference[f"{name}_continuum{end}"] for end in ("", "_error")
            )
            if np.isfinite(bar) and np.isfinite(true):
                yield name, abs(value - true) <= bar + min(error, WIDENING * bar)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, nargs="+", default=[64, 96, 128])
    parser.add_argument("--line-reference", type=int, default=8192)
    parser.add_argument("--round-reference", type=int, default=1024)
    parser.add_argument("--exponents", type=float, nargs="+", default=EXPONENTS)
    parser.add_argument("--pressures", type=int, default=8, help="number of pressures")
    parser.add_argument("--shift", type=float, default=1.0, help="factor of the pressures")
    chosen = parser.parse_args()
    print("shape | " + " | ".join(QUANTITIES))
    for surfaces, finest in ((LINES, chosen.line_reference), (ROUND, chosen.round_reference)):
        for surface in surfaces:
            held = defaultdict(list)
            for n in chosen.exponents:
                factor = chosen.shift * 3.0 ** (n - 1)
                pressures = list(factor * np.geomspace(LIGHTEST, HEAVIEST, chosen.pressures))
                coarse = measured(surface, n, pressures, chosen.points)
                for name, holds in scores(coarse, measured(surface, n, pressures, [finest])):
                    held[name].append(holds)
            label = ", ".join(map(str, surface.values()))
            shares = [
                f"{100 * np.mean(held[name]):.1f} % ({len(held[name])})" if held[name] else "-"
                for name in QUANTITIES
            ]
            print(f"{label} | {' | '.join(shares)}", flush=True)


if __name__ == "__main__":
    main()
