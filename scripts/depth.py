"""Errors of Persson theory over lambda_r / lambda_s: what a longer spectrum changes.

Reads the study `depth` of scripts/theory_studies.py and prints the table of docs/theory.md.

python scripts/depth.py --folder results/theory
"""

import argparse
from pathlib import Path

import numpy as np
from theory_studies import LIGHT

from gfmd_cli.analysis.compare import Curve, compare


def over_theory(curve: Curve, name: str) -> np.ndarray:
    """Simulation over theory, at the pressures of LIGHT."""
    return curve.column(name) / getattr(curve.predict(curve.column("p_star")), name)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--folder", type=Path, default=Path("results/theory"))
    given = parser.parse_args()
    groups: dict[tuple[float, float], list[Curve]] = {}
    for curve in compare(given.folder / "depth.h5").curves:
        row = curve.rows[0]
        groups.setdefault((row["n"], row["rolloff"] / row["cutoff"]), []).append(curve)
    depths = sorted({depth for _, depth in groups})
    heads = " | ".join(f"{depth:g}" for depth in depths)
    for title, name, show in (
        (
            "ln u_g of the theory less that of the simulation, in per cent",
            "u_g",
            lambda x: -100 * np.log(x),
        ),
        ("a_r over that of the theory", "a_r", lambda x: x),
    ):
        print(f"\n{title}\n| $n$ | $p^\\ast$ | {heads} |\n| --- | --- |" + " --- |" * len(depths))
        for n in sorted({n for n, _ in groups}):
            for place, p in enumerate(LIGHT):
                cells = []
                for depth in depths:
                    x = np.array([show(over_theory(c, name))[place] for c in groups[n, depth]])
                    error = x.std(ddof=1) / np.sqrt(x.size)
                    digits = 1 if name == "u_g" else 3
                    cells.append(f"{x.mean():.{digits}f} ± {error:.{digits}f}")
                print(f"| {n:g} | {p:g} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
