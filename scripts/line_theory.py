"""Contact area of random line profiles over that of Persson theory, by exponent and pressure.

Self-affine profiles of H = 0.8, in the continuum; the error is the standard error over the seeds.

python scripts/line_theory.py --seeds 20     # the table of docs/theory.md
"""

import argparse
import warnings

import numpy as np
from markdown_tables import print_head, print_row
from scipy.special import erf

from gfmd_cli import solve

PROFILES = [(64, 256), (8, 32), (8, 256)]  # waves per cell: roll-off, shortest wave
EXPONENTS, PRESSURES = [0.5, 1.0, 1.5, 2.0], [0.01, 0.1, 1.0]


def profile(seed: int, rolloff: int, highest: int) -> np.ndarray:
    """A profile with the spectrum C(q) ~ [1 + (q / q_r)^2]^(-1/2 - H), four points per wave."""
    m = np.arange(2 * highest + 1)
    amplitude = (1 + (m / rolloff) ** 2) ** -0.65 * ((m > 0) & (m <= highest))
    phases = np.random.default_rng(seed).random(m.size)
    return np.fft.irfft(amplitude * np.exp(2j * np.pi * phases), 4 * highest)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--points", type=int, default=32, help="per shortest wave")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    print_head("λr/λs, L/λr", "n", *(f"p* = {p:g}" for p in PRESSURES))
    for rolloff, highest in PROFILES:
        heights = [profile(seed, rolloff, highest) for seed in range(arguments.seeds)]
        for n in EXPONENTS:
            cells = []
            for p_star in PRESSURES:
                spec = {
                    "surface": {"interpolation": "fourier", "periodic": True},
                    "elastomer": {"kind": "power", "n": n},
                    "grid": {"points": arguments.points * highest},
                    "load": {"p_star": p_star},
                    "accuracy": {"contact_area": 0.1},
                }
                areas = [solve(spec, heights=each).columns["a_r_continuum"] for each in heights]
                ratios = np.array(areas) / erf(p_star / np.sqrt(2))
                error = ratios.std(ddof=1) / np.sqrt(len(ratios))
                cells.append(f"{ratios.mean():.2f} ± {error:.2f}")
            print_row(f"{highest / rolloff:g}, {rolloff}", f"{n:g}", *cells)


if __name__ == "__main__":
    main()
