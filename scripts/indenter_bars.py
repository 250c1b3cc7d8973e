"""How often the error bars of single indenters hold: shapes, exponents, pressures on small grids.

    python scripts/indenter_bars.py --pressures 6 --shift 1.37     # a table of docs/calibration.md

Each contact is solved at pressures in Pa on grids whose halves give the change, and on a reference
grid that is at least four times finer. A bar holds if it contains the continuum value of the
reference grid, after it was widened by the error of that value, at most by a fifth of the bar.

With --units: how much Delta_sigma changes from a grid to the next, beside the share of its square
at the shortest waves (`MAX_FINEST_SHARE`).
"""

import argparse
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from gfmd_cli import rows, run
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.observables import MAIN_OBSERVABLES
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.surfaces import Surface
from gfmd_cli.study.plausibility import MAX_FINEST_SHARE, finest_share

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
        for name, observable in MAIN_OBSERVABLES.items():
            unit, unit_of_reference = (
                each[observable.unit_column] if observable.unit_column else 1.0
                for each in (row, reference)
            )
            value, bar = (unit * row[f"{name}_continuum{end}"] for end in ("", "_error"))
            true, error = (
                unit_of_reference * reference[f"{name}_continuum{end}"] for end in ("", "_error")
            )
            if np.isfinite(bar) and np.isfinite(true):
                yield name, abs(value - true) <= bar + min(error, WIDENING * bar)


def changes_of_unit(points: list[int], exponents: list[float]) -> Iterator[tuple[float, float]]:
    """Share at the shortest waves, and relative change of Delta_sigma on the next grid."""
    adapter = TypeAdapter(Surface)
    for surface in (*LINES, *ROUND, {"kind": "punch"}):
        for n in exponents:
            scenes = [
                build_scene(adapter.validate_python(surface), Power(n=n), each) for each in points
            ]
            for coarse, fine in pairwise(scenes):
                yield finest_share(coarse), abs(fine.delta_sigma / coarse.delta_sigma - 1)


def print_units(changes: list[tuple[float, float]]) -> None:
    """The changes of Delta_sigma on both sides of the limit."""
    share, change = np.array(changes).T
    above = share > MAX_FINEST_SHARE
    for name, side in (("above", change[above]), ("below", change[~above])):
        small = ", ".join(f"{(side < limit).sum()} below {limit:.1%}" for limit in (0.03, 0.011))
        print(
            f"share {name} {MAX_FINEST_SHARE:g}: {side.size} pairs of grids, change "
            f"{min(side, default=0):.1%} to {max(side, default=0):.1%}, {small}"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, nargs="+", default=[64, 96, 128])
    parser.add_argument("--line-reference", type=int, default=8192)
    parser.add_argument("--round-reference", type=int, default=1024)
    parser.add_argument("--exponents", type=float, nargs="+", default=EXPONENTS)
    parser.add_argument("--pressures", type=int, default=8, help="number of pressures")
    parser.add_argument("--shift", type=float, default=1.0, help="factor of the pressures")
    parser.add_argument("--units", action="store_true")
    options = parser.parse_args()
    if options.units:
        print_units(list(changes_of_unit(options.points, options.exponents)))
        return
    print("shape | " + " | ".join(MAIN_OBSERVABLES))
    for surfaces, finest in ((LINES, options.line_reference), (ROUND, options.round_reference)):
        for surface in surfaces:
            held = defaultdict(list)
            for n in options.exponents:
                factor = options.shift * 3.0 ** (n - 1)
                pressures = list(factor * np.geomspace(LIGHTEST, HEAVIEST, options.pressures))
                coarse = measured(surface, n, pressures, options.points)
                for name, holds in scores(coarse, measured(surface, n, pressures, [finest])):
                    held[name].append(holds)
            label = ", ".join(map(str, surface.values()))
            shares = [
                f"{100 * np.mean(held[name]):.1f} % ({len(held[name])})" if held[name] else "-"
                for name in MAIN_OBSERVABLES
            ]
            print(f"{label} | {' | '.join(shares)}", flush=True)


if __name__ == "__main__":
    main()
