"""Contact areas of plates (n > 3.5) on nested grids, and whether the bars of the program hold.

    python scripts/plate_areas.py results/plates.jsonl      # a quarter of an hour on one core

Each case is one contact with 2 to 96 points per lambda_s. The constants of
`physics/discretisation_error.py` were fitted to one half; the table shows both.
"""

import argparse
import json
from collections.abc import Iterator
from math import isfinite
from pathlib import Path
from typing import NamedTuple

import numpy as np
from calibration import KEYS, Case, measure

from gfmd_cli.physics.discretisation_error import RoughnessScales, estimate
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.error_estimates import GridValues
from gfmd_cli.physics.self_affine import SelfAffine

COUNT = 48
FITTED = 7  # seed of the set that gave the constants
DOUBLINGS = 5
ORDER = 1.5  # between the two finest grids, for the reference value
PRESSURES = np.geomspace(0.02, 2.0, 12)


class Score(NamedTuple):
    """One estimate from two grids beside the reference value."""

    fit: bool
    error: float
    bar: float


def cases(seed: int) -> Iterator[Case]:
    """Surfaces of both spectra and all Hurst exponents; of `FITTED` every second was fitted to."""
    draw = np.random.default_rng(seed)
    for k in range(COUNT):
        n = (4.0, 4.0, 3.6, 4.0, 3.75, 4.0)[k % 6]
        modes = int(draw.choice([5, 6, 7]))
        hurst = float(draw.choice([0.3, 0.5, 0.8, 1.0]))
        rolloff = float(draw.choice([0.25, 0.5, 1.0]))
        spectrum = str(draw.choice(["rolloff", "cutoff"]))
        surface = SelfAffine(
            hurst=hurst,
            rolloff=rolloff,
            cutoff=1 / modes,
            spectrum=spectrum,
            seed=int(draw.integers(1, 10**6)),
        )
        base = 2 * round(modes * float(draw.choice([1.0, 1.25, 1.5])))
        p_star = float(PRESSURES[(5 * k + k // 12) % 12])
        name = f"n={n:g} H={surface.hurst:g} {surface.spectrum} 1/{modes}"
        fitted = seed == FITTED and k % 2 == 0
        yield Case(k, name, surface, Power(n=n), p_star, base, DOUBLINGS, fitted)


def scores(record: dict) -> Iterator[Score]:
    """Estimates from grids that are at least four times coarser than the reference."""
    levels = [GridValues(*(level[key] for key in KEYS)) for level in record["levels"]]
    last = levels[-1].a_r
    exact = max(0.0, last - (levels[-2].a_r - last) / (2**ORDER - 1))
    for k in range(1, len(levels) - 2):
        at_grid = record["levels"][k]
        if levels[k].a_r < 1:
            rough = RoughnessScales(**at_grid["texture"])
            area = estimate(levels[k - 1 : k + 1], at_grid["exponent"], rough)["a_r"]
            if isfinite(area.continuum_error):  # else "unknown": no promise that could fail
                yield Score(record["fit"], abs(area.continuum - exact), area.continuum_error)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cache", type=Path, help="file of the measured cases, one a line")
    parser.add_argument("--no-run", action="store_true", help="use the cases that are there")
    parser.add_argument(
        "--seed",
        type=int,
        default=FITTED,
        help=f"{FITTED}: the constants were fitted to every second case of this set",
    )
    arguments = parser.parse_args()
    arguments.cache.parent.mkdir(parents=True, exist_ok=True)
    done = arguments.cache.read_text().splitlines() if arguments.cache.exists() else []
    for case in [] if arguments.no_run else list(cases(arguments.seed))[len(done) :]:
        done.append(json.dumps(measure(case, tolerance=1e-5), default=str))
        arguments.cache.write_text("\n".join(done) + "\n")
    scored = [score for line in done for score in scores(json.loads(line))]
    for half in (True, False):
        chosen = [score for score in scored if score.fit == half]
        if not chosen:
            continue
        share = np.mean([score.error <= score.bar for score in chosen])
        ratio = np.median([score.bar / max(score.error, 1e-12) for score in chosen])
        print(f"{'fit' if half else 'verify'}: {len(chosen)} estimates, {100 * share:.1f} % held, "
              f"median of bar over error {ratio:.1f}")  # fmt: skip


if __name__ == "__main__":
    main()
