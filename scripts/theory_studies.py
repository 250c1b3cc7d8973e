"""The studies that docs/theory.md is made from: written as specs and solved, one after another.

python scripts/theory_studies.py --folder results/theory
"""

import argparse
from pathlib import Path

from gfmd_cli.cli.progress import Reporter
from gfmd_cli.spec.parse import read_spec
from gfmd_cli.study.run import run_study

FINE = [0, 0.5, 1, 1.5, 2, 2.5, 3, 4]
EXPONENTS = [0, 0.5, 1, 2, 3, 4]
BETWEEN = [0.25, 0.75, 1.75, 2.75, 3.5]
LADDER = [0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0]
FOUR = [0, 1, 2, 3]
TRAINING = "training"


def power(exponents: list[float]) -> str:
    return f'kind = "power"\nn = {exponents}'


def spec(
    body: str = "",
    points: int | None = None,
    most: int = 400,
    p_star: list[float] = LADDER,
    **surface: object,
) -> str:
    """A run spec; `surface` tells what differs from the training surface.

    Without `points` the grid is the coarsest that has u_g to 1 %, and `most` points a side at most;
    with them, Delta_sigma over the true contact is kept, too.
    """
    chosen = {
        "kind": "self-affine",
        "hurst": 0.8,
        "rolloff": 0.5,
        "cutoff": 0.02,
        "spectrum": "rolloff",
        "seed": FOUR,
    } | surface
    table = "\n".join(f"{key} = {value!r}" for key, value in chosen.items())
    return f"""[surface]
{table}

[elastomer]
{body or power(EXPONENTS)}

[grid]
points = {points or '"auto"'}

[load]
p_star = {p_star}

[accuracy]
mean_gap = 0.01
max_points = {most}

[output]
histogram = false
{"true_contact = true" if points else ""}
"""


SLABS = 'kind = "slab"\nthickness = [0.005, 0.02, 0.05, 0.2]'
STUDIES = {
    TRAINING: spec(power(FINE), most=800),
    "hurst-0.3": spec(hurst=0.3),
    "cut-off": spec(spectrum="cutoff"),
    "slab": spec(SLABS, spectrum="cutoff", rolloff=0.2, cutoff=0.02, seed=[0, 1]),
    "narrow": spec(cutoff=0.0625),
    "between": spec(power(BETWEEN)),
    "other-seeds": spec(seed=[4, 5, 6, 7]),
    "hurst-0.5": spec(hurst=0.5),
    "large-cell": spec(rolloff=0.125, cutoff=0.01, seed=[0, 1]),
    "broad": spec(power(FINE[:-2]), most=800, cutoff=0.005, seed=[0, 1]),
    "true-contact": spec(power(FINE[:-1]), points=400, p_star=[0.003, 0.03, 0.3], seed=[0, 1, 2]),
}
"""Which surfaces and bodies each study holds; only the first is fitted to."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--folder", type=Path, default=Path("results/theory"))
    parser.add_argument("names", nargs="*", choices=[[], *STUDIES], default=[])
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    for name in given.names or STUDIES:
        path = given.folder / f"{name}.toml"
        path.write_text(STUDIES[name])
        resolved, text = read_spec(path, ())
        with Reporter(True) as report:
            outcome = run_study(resolved, text, path.with_suffix(".h5"), report, jobs=1)
        print(f"{name}: {dict(outcome)}", flush=True)


if __name__ == "__main__":
    main()
