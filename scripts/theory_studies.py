"""The studies of the pages that docs/theory.md names, written as specs and solved one by one.

Each study is one study file, and a second call resumes a stopped run. All together take about an
hour on one core.

python scripts/theory_studies.py --folder results/theory
"""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from gfmd_cli.cli.progress import Reporter
from gfmd_cli.errors import InputError
from gfmd_cli.spec.parse import read_spec
from gfmd_cli.status import counted
from gfmd_cli.study.run import RunOptions, run_study

TRAINING, TEST = range(100, 108), range(200, 208)
"""Disjoint sets of seeds: constants are fitted to the first and tested on the second."""
FURTHER = [*range(300, 316)]
"""Seeds that no form of a theory was chosen with."""
HURST = [0.3, 0.5, 0.8]
SPECTRA = {
    "roll-off, L/8": ("rolloff", 1 / 8),
    "cut-off, L/8": ("cutoff", 1 / 8),
    "roll-off, L/4": ("rolloff", 1 / 4),
}
"""Kind of the spectrum and lambda_r / L; lambda_s = L/128."""
EXPONENTS = [0.5, 1, 2, 3, 4]
LIGHT = [0.01, 0.03, 0.1, 0.3]
LADDER = [0.001, 0.003, 0.01, 0.03, 0.1, 0.2, *(0.01 * x for x in range(25, 65, 5)), 0.7, 0.8, 1.0]
"""Reduced pressures up to the percolation of the contact, where the gap stops percolating."""
SHOWN = [0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0]
"""Those of the tables of the contact stiffness."""
PERCOLATION = [0.01 * x for x in range(34, 68, 2)]
"""Reduced pressures about the percolation of the gap."""


def table(heading: str, **keys: object) -> str:
    lines = [f"{key} = {value!r}" for key, value in keys.items()]
    return "\n".join([f"\n{heading}", *lines, ""])


def surface(spectrum: str, rolloff: float, cutoff: float | list[float], **keys: object) -> str:
    parameters = {"spectrum": spectrum, "rolloff": rolloff, "cutoff": cutoff} | keys
    return table("[[surface]]", kind="self-affine", **parameters)


def power(exponents: list[float]) -> str:
    return table("[elastomer]", kind="power", n=exponents)


def grids(seeds: dict[int, list[int]]) -> tuple[list[int], str]:
    """List of seeds, and the tables that pair it with the points a side, from points: seeds."""
    pairs = [(seed, points) for points, of_grid in seeds.items() for seed in of_grid]
    paired = table("[sweep]", paired=["surface.seed", "grid.points"])
    return [seed for seed, _ in pairs], table("[grid]", points=[p for _, p in pairs]) + paired


def rest(p_star: list[float], **output: bool) -> str:
    load = table("[load]", p_star=[round(p, 3) for p in p_star])
    chosen = "\n".join(f"{key} = true" for key in output)
    return f"{load}{table('[solver]', tolerance=1e-5)}\n[output]\nhistogram = false\n{chosen}\n"


def gamma_specs() -> list[str]:
    """Mean gaps of nine spectra on 512^2, and of the first seeds on coarser and finer grids."""
    seeds, grid = grids({512: [*TRAINING, *TEST], 256: [100], 1024: [100, 101]})
    surfaces = [surface(*which, 1 / 128, hurst=HURST, seed=seeds) for which in SPECTRA.values()]
    one = surface(*SPECTRA["roll-off, L/8"], 1 / 128, hurst=[0.3, 0.8], seed=[100])
    return [
        one + power([2, 3, 4]) + table("[grid]", points=2048) + rest(LIGHT),
        "".join(surfaces) + power(EXPONENTS) + grid + rest(LIGHT),
    ]


def further_specs() -> list[str]:
    """The nine spectra with seeds of their own, for n <= 1, where 512^2 is fine enough."""
    spectra = [surface(*which, 1 / 128, hurst=HURST, seed=FURTHER) for which in SPECTRA.values()]
    return ["".join(spectra) + power([0.5, 1]) + table("[grid]", points=512) + rest(LIGHT)]


def between_specs() -> list[str]:
    """Exponents between those of the fits, eight seeds on 512^2 and one on 1024^2."""
    exponents, specs = power([1.5, 2.5, 3.5]), []
    for held, surfaces in (
        ([*TEST], (("roll-off, L/8", 0.3), ("roll-off, L/4", 0.8))),
        (FURTHER[:8], (("cut-off, L/8", 0.3), ("cut-off, L/8", 0.8))),
    ):
        seeds, grid = grids({512: held, 1024: held[:1]})
        texts = [surface(*SPECTRA[name], 1 / 128, hurst=h, seed=seeds) for name, h in surfaces]
        specs.append("".join(texts) + exponents + grid + rest(LIGHT))
    return specs


def stiffness_specs() -> list[str]:
    """Contact stiffness and percolation of the gap, on three grids."""
    seeds, grid = grids({512: [*TRAINING, *TEST], 256: [*TRAINING], 1024: [*TRAINING][:4]})
    one = surface("rolloff", 1 / 4, 1 / 64, hurst=0.8, seed=seeds)
    every = power([0, *EXPONENTS])
    return [one + every + grid + rest(LADDER, stiffness=True, percolation=True)]


def surfaces_specs() -> list[str]:
    """Contact stiffness of two more surfaces, seeds of their own."""
    ends = 1 / 4, 1 / 64
    small = surface("rolloff", *ends, hurst=0.3, seed=FURTHER[:8])
    cut = surface("cutoff", *ends, hurst=0.8, seed=FURTHER[:8])
    grid = table("[grid]", points=512)
    return [small + cut + power([0, *EXPONENTS]) + grid + rest(SHOWN, stiffness=True)]


def slab_specs() -> list[str]:
    """Slabs from nearly a plate to nearly a half-space; u_g to 1 %."""
    thickness = table("[elastomer]", kind="slab", thickness=[0.005, 0.02, 0.05, 0.2])
    grid = table("[grid]", points="auto") + table("[accuracy]", mean_gap=0.01, max_points=800)
    return [surface("cutoff", 0.2, 0.02, seed=[*range(200, 216)]) + thickness + grid + rest(LIGHT)]


def true_contact_specs() -> list[str]:
    """Delta_sigma over the true contact, with areas in the continuum."""
    grid = table("[grid]", points=400) + table("[accuracy]", mean_gap=0.01)
    exponents = power([0, 0.5, 1, 1.5, 2, 2.5, 3])
    one = surface("rolloff", 0.5, 0.02, seed=[*range(24)])
    return [one + exponents + grid + rest([0.003, 0.03, 0.3], true_contact=True)]


def depth_specs() -> list[str]:
    """Spectra of lambda_r / lambda_s = 8 to 128, eight points per lambda_s."""
    points = [256, 512, 1024, 2048, 4096]
    cutoffs = [8 / side for side in points]
    paired = table("[sweep]", paired=["surface.cutoff", "grid.points"])
    one = surface("rolloff", 1 / 4, cutoffs, hurst=0.8, seed=[*range(8)])
    return [one + power([0.5, 1, 2, 3]) + table("[grid]", points=points) + paired + rest(LIGHT)]


def percolation_specs() -> list[str]:
    """Percolation of the gap for n >= 2 on four grids, with contact areas in the continuum."""
    seeds, grid = grids({points: [*TRAINING][:4] for points in (256, 512, 1024, 2048)})
    one = surface("rolloff", 1 / 4, 1 / 64, hurst=0.8, seed=seeds)
    last = table("[accuracy]", mean_gap=0.01)
    return [
        one + power(exponents) + grid + last + rest(PERCOLATION[:count], percolation=True)
        for exponents, count in (([4], 17), ([2, 3], 11))
    ]


def thresholds_specs() -> list[str]:
    """Percolation of the gap at n = 1 and 2 on three surfaces, seeds of their own."""
    specs = []
    for n, seeds, pressures in ((1, FURTHER, range(30, 64, 2)), (2, FURTHER[:8], range(34, 56, 2))):
        texts = [
            surface(kind, 1 / 4, 1 / 64, hurst=hurst, seed=seeds)
            for kind, hurst in (("rolloff", 0.8), ("rolloff", 0.3), ("cutoff", 0.8))
        ]
        last = table("[grid]", points=512) + rest([0.01 * x for x in pressures], percolation=True)
        specs.append("".join(texts) + power([n]) + last)
    return specs


def resolution_specs() -> list[str]:
    """The shortest spectrum of `depth_specs` on 8, 16 and 32 points per lambda_s."""
    one = surface("rolloff", 1 / 4, 1 / 32, hurst=0.8, seed=[0, 1])
    return [one + power([1, 2, 3]) + table("[grid]", points=[256, 512, 1024]) + rest(LIGHT)]


STUDIES = {
    "between": between_specs,
    "depth": depth_specs,
    "further": further_specs,
    "gamma": gamma_specs,
    "percolation": percolation_specs,
    "resolution": resolution_specs,
    "slab": slab_specs,
    "stiffness": stiffness_specs,
    "surfaces": surfaces_specs,
    "thresholds": thresholds_specs,
    "true-contact": true_contact_specs,
}


def run_with_studies(main: Callable[[], None], maker: str) -> None:
    """Run a script that reads studies; if one is missing, print the command that makes them."""
    try:
        main()
    except InputError as error:
        sys.exit(f"{error}; `{maker}` makes the studies")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--folder", type=Path, default=Path("results/theory"))
    parser.add_argument("names", nargs="*", choices=[[], *STUDIES], default=[])
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    for name in arguments.names or STUDIES:
        for number, text in enumerate(STUDIES[name](), 1):
            path = arguments.folder / f"{name}-{number}.toml"
            path.write_text(text.lstrip())
            spec, source = read_spec(path, ())
            with Reporter(True) as report:
                store = arguments.folder / f"{name}.h5"
                outcome = run_study(spec, source, store, report, RunOptions(jobs=1))
            print(f"{path.stem}: {counted(outcome)}", flush=True)


if __name__ == "__main__":
    main()
