"""How often the error bars of searched pressures hold, on random loads and surfaces.

Each case has a contact area or a mean gap as the load. It is solved with [accuracy] on N and 2 N
points per side, and on `--finer` N points, whose pressure is the reference. A line for each kind of
case says how many error bars hold of those that are given, how many are "unknown", and the median
of bar over error: docs/accuracy.md.

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

from gfmd_cli.api import solve
from gfmd_cli.errors import InputError

AREAS = (0.003, 0.95)
GAPS = (0.01, 2.0)
EXPONENTS = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
BASE = 64


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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=240)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--finer", type=int, default=16, help="finest grid over the coarsest")
    parser.add_argument("--verbose", action="store_true", help="print each case")
    arguments = parser.parse_args()
    results: list[tuple[Case, int, float, float]] = []
    with tempfile.TemporaryDirectory() as folder:
        for case in cases(Path(folder), arguments.count, arguments.seed):
            reference = columns(case, arguments.finer * BASE, 1e-5)
            if reference is None:
                continue
            for grids, points in ((1, BASE), (2, 2 * BASE)):
                row = columns(case, points, 1e-3)
                if row is None:
                    continue
                error = abs(row["pressure"] / reference["pressure"] - 1)
                bar = row["p_star_error"] / row["p_star"]
                results.append((case, grids, error, bar))
                if arguments.verbose:
                    load = case.tables["load"]
                    words = f"{case.kind} n={case.n} {load} {points}: {error:.2g} {bar:.2g}"
                    print(words, "" if bar >= error else "<", flush=True)
    print("| kind | load | grids | held | unknown | bar/error |")
    print("| --- | --- | --- | --- | --- | --- |")
    for kind in ("random", "maps", "single"):
        for quantity in ("contact_area", "mean_gap"):
            for grids in (1, 2):
                chosen = [
                    (error, bar)
                    for case, used, error, bar in results
                    if (case.kind, case.quantity, used) == (kind, quantity, grids)
                ]
                given = [(error, bar) for error, bar in chosen if np.isfinite(bar)]
                if not chosen:
                    continue
                held = sum(error <= bar for error, bar in given)
                ratio = np.median([bar / max(error, 1e-12) for error, bar in given] or [np.nan])
                cells = [kind, f"`{quantity}`", grids, f"{held}/{len(given)}"]
                cells += [len(chosen) - len(given), f"{ratio:.1f}"]
                print(f"| {' | '.join(map(str, cells))} |")


if __name__ == "__main__":
    main()
