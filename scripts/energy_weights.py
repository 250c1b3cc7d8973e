"""The weight W of the elastic energy, measured by shell.

W(p, q) = |u(q)|^2 / |h(q)|^2 is what Persson theory replaces by [gamma + (1 - gamma) a_r^2] a_r at
the scale q (paper Eqs. (29), (30)). Prints a table of docs/energy_weights.md.

python scripts/energy_weights.py results/energy_weights.jsonl     # ten minutes on one core
"""

import argparse
import json
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from markdown_tables import print_head, print_row
from scipy.special import erf

from gfmd_cli.physics.contact import Scene
from gfmd_cli.physics.elastomers import Power
from gfmd_cli.physics.persson import gamma_n
from gfmd_cli.physics.scenes import build_scene
from gfmd_cli.physics.self_affine import SelfAffine
from gfmd_cli.physics.waves import radial_power
from gfmd_cli.solvers.auto import Auto
from gfmd_cli.solvers.nested_grids import solve_contact

POINTS, ROLLOFF, CUTOFF = 256, 1 / 4, 1 / 64
KINDS = {"roll-off, H = 0.8": (0.8, "rolloff"), "roll-off, H = 0.3": (0.3, "rolloff"),
         "cut-off, H = 0.8": (0.8, "cutoff")}  # fmt: skip
EXPONENTS = (0.5, 1.0, 2.0, 3.0)
PRESSURES = (0.01, 0.03, 0.1, 0.3, 1.0)
SEEDS = 8
GROUPS = 6  # of shells, equally wide in ln q


Record = dict[str, Any]


def scene_of(kind: str, n: float, seed: int, points: int = POINTS) -> Scene:
    hurst, spectrum = KINDS[kind]
    surface = SelfAffine(hurst=hurst, rolloff=ROLLOFF, cutoff=CUTOFF, spectrum=spectrum, seed=seed)
    return build_scene(surface, Power(n=n), points)


def measure(kind: str, n: float, seed: int, points: int) -> Record:
    """Weights and energies of one surface over the pressures."""
    scene = scene_of(kind, n, seed, points)
    record: Record = {"kind": kind, "n": n, "seed": seed, "weight": [], "beyond": []}
    for p in PRESSURES:
        contact = scene.contact(p)
        solution = solve_contact(contact, Auto(tolerance=1e-5))
        weight, beyond = weights(scene, n, solution.u)
        record["weight"].append(weight)
        record["beyond"].append(beyond)
    return record


def groups() -> np.ndarray:
    """Bounds of the groups of shells, in q L / 2 pi."""
    return np.geomspace(0.99, 1.01 / CUTOFF, GROUPS + 1)


def weights(scene: Scene, n: float, u: np.ndarray) -> tuple[list[float], float]:
    """W in every group, weighted with k C, and the energy share of waves that the surface lacks."""
    m, height, _ = radial_power(scene.grid, scene.height)
    own, bounds = m[height > 0], groups()
    q, moved, _ = radial_power(scene.grid, u - u.mean())
    energy = q**n * moved
    group = np.digitize(q, bounds) - 1
    full = np.bincount(np.digitize(own, bounds) - 1, own**n * height[height > 0], GROUPS)
    sums = np.bincount(group[group < GROUPS], energy[group < GROUPS], GROUPS)
    beyond = energy[q > own.max() * (1 + 1e-9)].sum() / energy.sum()
    share = np.divide(sums, full, out=np.full(GROUPS, np.nan), where=full > 0)
    return share.tolist(), float(beyond)


def theory_weights(kind: str, n: float, p: float, gamma: float) -> list[float]:
    """W of Eq. (30) in every group, weighted with k C."""
    scene = scene_of(kind, n, 0)
    shells = scene.shells
    variance = np.cumsum(shells.variance) - 0.5 * shells.variance
    a = erf(p * scene.delta_sigma / np.sqrt(2 * variance))
    w = a * (gamma + (1 - gamma) * a**2)
    group = np.digitize(shells.q / (2 * np.pi), groups()) - 1
    full = np.bincount(group, shells.energy, GROUPS)
    sums = np.bincount(group, w * shells.energy, GROUPS)
    return np.divide(sums, full, out=np.full(GROUPS, np.nan), where=full > 0).tolist()


def print_weights(records: list[Record]) -> None:
    """W by group beside Eq. (30), and the energy beyond the waves of the surface."""
    middles = np.sqrt(groups()[1:] * groups()[:-1])
    heads = (f"qL/2π = {m:.3g}" for m in middles)
    print_head("surface", "n", "p*", *heads, "energy beyond qₛ")
    for kind, n, (i, p) in product(KINDS, EXPONENTS, enumerate(PRESSURES)):
        chosen = [r for r in records if (r["kind"], r["n"]) == (kind, n)]
        if len(chosen) < 2:
            continue
        fractions = np.array([r["weight"][i] for r in chosen])
        theory = theory_weights(kind, n, p, float(gamma_n(n)))
        cells = [f"{w:.3f} ({s:.3f})" for w, s in zip(fractions.mean(axis=0), theory, strict=True)]
        beyond = np.mean([r["beyond"][i] for r in chosen])
        print_row(kind, f"{n:g}", f"{p:g}", *cells, f"{100 * beyond:.1f} %")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cache", type=Path, help="file of the measured surfaces, one a line")
    parser.add_argument("--points", type=int, default=POINTS)
    parser.add_argument("--seeds", type=int, default=SEEDS, help="seeds, from 0 on")
    parser.add_argument("--no-run", action="store_true", help="use what is there")
    arguments = parser.parse_args()
    arguments.cache.parent.mkdir(parents=True, exist_ok=True)
    lines = arguments.cache.read_text().splitlines() if arguments.cache.exists() else []
    cases = list(product(range(arguments.seeds), KINDS, EXPONENTS))
    for seed, kind, n in [] if arguments.no_run else cases[len(lines) :]:
        lines.append(json.dumps(measure(kind, n, seed, arguments.points)))
        arguments.cache.write_text("\n".join(lines) + "\n")
    records = [json.loads(line) for line in lines]
    print_weights(records)


if __name__ == "__main__":
    main()
