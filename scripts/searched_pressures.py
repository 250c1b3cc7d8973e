"""How often the error bars at a load that was searched hold, on random loads and surfaces.

Each case has a contact area or a mean gap as the load. It is solved with [accuracy] on 64 and 128
points per side, and on `--finer` times 64 points, whose results are the reference. A line for each
kind of case and quantity says how many error bars hold of those that are given, how many are
"unknown", and the median of bar over error: docs/calibration.md.

    python scripts/searched_pressures.py --count 240 --seed 1
"""

import argparse
import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from calibration import IRREGULAR, irregular_map
from markdown_tables import print_head, print_row

from gfmd_cli.api import solve
from gfmd_cli.errors import InputError
from gfmd_cli.physics.observables import MAIN_OBSERVABLES

AREAS = (0.003, 0.95)
GAPS = (0.01, 2.0)
EXPONENTS = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
BASE = 64
SEARCHED = {"contact_area": "a_r", "mean_gap": "u_g"}


@dataclass(frozen=True)
class Case:
    """One load, and the tables of its spec without the grid."""

    kind: str
    quantity: str
    n: str
    tables: dict[str, Any]


def cases(folder: Path, count: int, seed: int) -> Iterator[Case]:
    """Half of the cases are random surfaces, a third irregular maps, the rest single indenters."""
    draw = np.random.default_rng(seed)
    for number in range(count):
        quantity = str(draw.choice(["contact_area", "mean_gap"]))
        load = float(np.exp(draw.uniform(*np.log(AREAS if quantity == "contact_area" else GAPS))))
        n = float(draw.choice(EXPONENTS))
        elastomer: dict[str, Any] = {"kind": "power", "n": n}
        if number % 12 == 0:
            thickness = float(np.exp(draw.uniform(np.log(0.01), np.log(0.1))))
            elastomer = {"kind": "slab", "thickness": thickness}
        if number % 6 < 3:
            kind, surface = "random", random_surface(draw)
        elif number % 6 < 5:
            kind = str(draw.choice(IRREGULAR))
            path = folder / f"{number}.npy"
            np.save(path, irregular_map(kind, draw, 64))
            surface = {"kind": "file", "path": str(path)}
        else:
            kind = str(draw.choice(["wave", "parabola"]))
            surface = {"kind": kind}
        tables = {"surface": surface, "elastomer": elastomer, "load": {quantity: load}}
        group = "random" if kind == "random" else "maps" if kind in IRREGULAR else "single"
        yield Case(group, quantity, str(elastomer.get("n", "slab")), tables)


def random_surface(draw: np.random.Generator) -> dict[str, Any]:
    """A self-affine surface that 64 points per side resolve."""
    return {
        "kind": "self-affine",
        "hurst": float(draw.choice([0.1, 0.3, 0.5, 0.8, 1.0])),
        "rolloff": float(draw.choice([0.25, 0.5, 1.0])),
        "cutoff": 1 / int(draw.choice([10, 12, 16, 20, 24])),
        "seed": int(draw.integers(1, 10**6)),
    }


def columns(case: Case, points: int, tolerance: float) -> dict[str, Any] | None:
    """The row of a case; None where its load cannot be had or its value is not known."""
    spec = case.tables | {
        "grid": {"points": points},
        "accuracy": {"mean_gap": 0.5},
        "load": case.tables["load"] | {"tolerance": tolerance},
    }
    try:
        row = solve(spec).columns
    except InputError:
        return None
    return row if row["status"].is_converged else None


def values(row: dict[str, Any], name: str) -> tuple[float, float]:
    """The best value of a quantity in SI units, and its error bar."""
    if name == "pressure":
        return row["pressure"], row["p_star_error"] * row["delta_sigma"]
    unit = {"a_r": 1.0, "sigma_p": row["delta_sigma"], "u_g": row["h_std"]}[name]
    return row[f"{name}_continuum"] * unit, row[f"{name}_continuum_error"] * unit


def results(arguments: argparse.Namespace) -> Iterator[tuple[str, str, int, float, float]]:
    """Kind of case, load and quantity, number of grids, error and bar, relative to the value."""
    with tempfile.TemporaryDirectory() as folder:
        for case in cases(Path(folder), arguments.count, arguments.seed):
            reference = columns(case, arguments.finer * BASE, 1e-5)
            if reference is None:
                continue
            for grids, points in ((1, BASE), (2, 2 * BASE)):
                row = columns(case, points, 1e-3)
                if row is None:
                    continue
                for name in ("pressure", *MAIN_OBSERVABLES):
                    exact = values(reference, name)[0]
                    value, bar = values(row, name)
                    if name != SEARCHED[case.quantity] and np.isfinite(exact):
                        title = f"{case.quantity}: {name}"
                        error, bar = abs(value / exact - 1), bar / exact
                        if arguments.verbose:
                            load = case.tables["load"][case.quantity]
                            words = f"{case.kind} n={case.n} {title} {load:.3g} {points}:"
                            print(words, f"{error:.2g} {bar:.2g}", flush=True)
                        yield case.kind, title, grids, error, bar


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=240)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--finer", type=int, default=16, help="finest grid over the coarsest")
    parser.add_argument("--verbose", action="store_true", help="print each case")
    entries = list(results(parser.parse_args()))
    print_head("kind", "load: quantity", "grids", "held", "unknown", "bar/error")
    for group in sorted({entry[:3] for entry in entries}):
        bars = [(error, bar) for *key, error, bar in entries if tuple(key) == group]
        given = [(error, bar) for error, bar in bars if np.isfinite(bar)]
        held = sum(error <= bar for error, bar in given)
        ratio = np.median([bar / max(error, 1e-12) for error, bar in given] or [np.nan])
        counts = f"{held}/{len(given)}", len(bars) - len(given), f"{ratio:.1f}"
        print_row(*group, *counts)


if __name__ == "__main__":
    main()
