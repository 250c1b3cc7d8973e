"""How often the error bars of random line profiles hold, and the excess of their contact area.

Self-affine profiles of 64 points, periodic, with a roll-off at a quarter of the cell and the Hurst
exponents 0.3 and 0.8; 7, 14 or 25 waves in the cell; p* from 0.01 to 1. Contacts on 128 and 256
points, each with its error bars from two grids, are compared with 4096 points. With --free the
profiles are halves of such profiles of 128 points, with a free boundary. The commands print the
numbers of docs/calibration.md.

python scripts/line_bars.py --seeds 30
python scripts/line_bars.py --free --seeds 20 --exponents 0.5 0.75 1 --finest 1024
"""

import argparse
import tempfile
import warnings
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from gfmd_cli import rows, run
from gfmd_cli.physics.discretisation_error import LINE_EXCESS
from gfmd_cli.physics.observables import MAIN_OBSERVABLES

POINTS, ROLLOFF = 64, 4
PRESSURES = [0.01, 0.03, 0.1, 0.3, 1.0]
Row = dict[str, Any]


def profile(draw: np.random.Generator, hurst: float, highest: int, points: int) -> np.ndarray:
    """A self-affine profile with the spectrum C(q) ~ [1 + (q / q_r)^2]^(-1/2 - H)."""
    m = np.arange(points // 2 + 1)
    amplitude = (1 + (m / ROLLOFF) ** 2) ** (-(1 + 2 * hurst) / 4) * ((m > 0) & (m <= highest))
    h = np.fft.irfft(amplitude * np.exp(2j * np.pi * draw.random(m.size)), points)
    return h / h.std()


def contacts(
    path: Path, exponents: list[float], finest: int, *, is_free: bool
) -> tuple[list[Row], list[Row]]:
    """The contacts of a profile on coarse grids, with error bars, and on the finest one."""
    surface = {"kind": "file", "path": str(path), "interpolation": "fourier"}
    base = {
        "surface": surface | ({"periodic": False} if is_free else {}),
        "elastomer": {"kind": "power", "n": exponents},
        "load": {"p_star": PRESSURES},
    }
    boundary = {"boundary": "free"} if is_free else {}
    coarse_grids = boundary | {"points": [2 * POINTS, 4 * POINTS]}
    coarse = {"grid": coarse_grids, "accuracy": {"mean_gap": 0.5}}
    fine = {"grid": boundary | {"points": finest}, "solver": {"tolerance": 1e-5}}
    coarse_rows, fine_rows = (
        rows(run(base | each, path.with_name(f"{name}.h5")))
        for name, each in (("coarse", coarse), ("fine", fine))
    )
    return coarse_rows, fine_rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--exponents", type=float, nargs="+", default=[0.5, 1, 1.5, 2, 2.5, 3])
    parser.add_argument("--finest", type=int, default=4096)
    parser.add_argument("--free", action="store_true", help="free boundary")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    held, excess = defaultdict(list), defaultdict(list)
    for seed in range(arguments.first, arguments.first + arguments.seeds):
        for hurst in (0.3, 0.8):
            draw = np.random.default_rng([seed, round(10 * hurst)])
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder) / "profile.npy"
                highest, halves = int(draw.choice([7, 14, 25])), 2 if arguments.free else 1
                heights = profile(draw, hurst, halves * highest, halves * POINTS)
                np.save(path, heights[:POINTS])
                coarse, fine = contacts(
                    path, arguments.exponents, arguments.finest, is_free=arguments.free
                )
            exact = {(row["n"], row["p_star"]): row for row in fine}
            for row in coarse:
                true = exact[row["n"], row["p_star"]]
                xi, finest_xi = (r["perimeter"] / r["points"] for r in (row, true))
                if not 0 < row["a_r"] < 1:
                    continue
                excess[row["n"]].append((row["a_r"] - true["a_r"]) / (xi - finest_xi))
                references = {name: true[name] for name in MAIN_OBSERVABLES}
                references["a_r"] -= LINE_EXCESS * row["n"] * finest_xi
                for name, reference in references.items():
                    if row[f"{name}_verdict"] == "regular":
                        value, error = (row[f"{name}_continuum{e}"] for e in ("", "_error"))
                        ratios = (
                            abs(value - reference) / error,
                            abs(row[name] - reference) / row[f"{name}_error"],
                        )
                        held[name, row["n"]].append(ratios)
                        held[name, f"p* = {row['p_star']:g}"].append(ratios)
    print("quantity  case       held of continuum value, value   bars  error/bar: median largest")
    for (name, case), pairs in held.items():
        ratios = np.array(pairs)
        shares = 100 * np.mean(ratios <= 1, axis=0)
        median, largest = np.median(ratios[:, 0]), ratios[:, 0].max()
        print(
            f"{name:9} {case!s:10} {shares[0]:6.1f} % {shares[1]:6.1f} % {len(ratios):6d} "
            f"{median:6.2f} {largest:6.2f}"
        )
    for n, values in sorted(excess.items()):
        print(f"n = {n:g}: excess of a_r = ({np.mean(values):.3f} +- {np.std(values):.3f}) xi")


if __name__ == "__main__":
    main()
